//! Which model and which method, by the names that people use.

use std::fmt;
use std::str::FromStr;

use offbd_core::vocabulary::Invalid;

/// A rung of the ladder of models, from the cheapest to the truest.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Model {
    Planar,
    Rolling,
    Creeping,
    Sliding,
    Compliant,
}

/// A way to step a model.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Method {
    /// Exact for a held angle.
    ZeroOrderHold,
    Euler,
    SemiImplicitEuler,
    Midpoint,
    Rk4,
    Dopri5,
    Rodas3,
    Rodas4,
    /// Backward Euler of the contact in closed form.
    ContactStep,
}

impl Model {
    pub const ALL: [Self; 5] =
        [Self::Planar, Self::Rolling, Self::Creeping, Self::Sliding, Self::Compliant];

    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Planar => "planar",
            Self::Rolling => "rolling",
            Self::Creeping => "creeping",
            Self::Sliding => "sliding",
            Self::Compliant => "compliant",
        }
    }

    /// The methods that can step it.
    #[must_use]
    pub const fn methods(self) -> &'static [Method] {
        match self {
            Self::Planar => &[Method::ZeroOrderHold],
            Self::Rolling => &[
                Method::Euler,
                Method::SemiImplicitEuler,
                Method::Midpoint,
                Method::Rk4,
                Method::Dopri5,
            ],
            Self::Creeping => &[Method::Midpoint, Method::Rk4, Method::Dopri5],
            Self::Sliding => &[Method::Dopri5],
            Self::Compliant => &[
                Method::Euler,
                Method::SemiImplicitEuler,
                Method::Midpoint,
                Method::Rk4,
                Method::Dopri5,
                Method::Rodas3,
                Method::Rodas4,
                Method::ContactStep,
            ],
        }
    }

    /// The method that is taken when none is named.
    #[must_use]
    pub const fn usual_method(self) -> Method {
        match self {
            Self::Planar => Method::ZeroOrderHold,
            Self::Rolling | Self::Creeping | Self::Sliding => Method::Dopri5,
            Self::Compliant => Method::Rodas4,
        }
    }
}

impl Method {
    pub const ALL: [Self; 9] = [
        Self::ZeroOrderHold,
        Self::Euler,
        Self::SemiImplicitEuler,
        Self::Midpoint,
        Self::Rk4,
        Self::Dopri5,
        Self::Rodas3,
        Self::Rodas4,
        Self::ContactStep,
    ];

    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::ZeroOrderHold => "zoh",
            Self::Euler => "euler",
            Self::SemiImplicitEuler => "semi-implicit-euler",
            Self::Midpoint => "midpoint",
            Self::Rk4 => "rk4",
            Self::Dopri5 => "dopri5",
            Self::Rodas3 => "rodas3",
            Self::Rodas4 => "rodas4",
            Self::ContactStep => "contact-step",
        }
    }

    /// Whether it chooses its steps by itself, from a tolerance.
    #[must_use]
    pub const fn adapts(self) -> bool {
        matches!(self, Self::Dopri5 | Self::Rodas3 | Self::Rodas4)
    }
}

impl fmt::Display for Model {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

impl fmt::Display for Method {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

impl FromStr for Model {
    type Err = Invalid;

    fn from_str(name: &str) -> Result<Self, Invalid> {
        Self::ALL.into_iter().find(|model| model.name() == name).ok_or_else(|| {
            let known = Self::ALL.map(Self::name).join(", ");
            Invalid::new("/model", format!("{name} is none of {known}"))
        })
    }
}

impl FromStr for Method {
    type Err = Invalid;

    fn from_str(name: &str) -> Result<Self, Invalid> {
        Self::ALL.into_iter().find(|method| method.name() == name).ok_or_else(|| {
            let known = Self::ALL.map(Self::name).join(", ");
            Invalid::new("/method", format!("{name} is none of {known}"))
        })
    }
}

/// How long the steps are.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Pace {
    /// Fixed steps of so many seconds; the last one of a piece is shorter.
    Step(f64),
    /// Steps such that the position at the end is off by this much at most, m,
    /// as far as the method can tell.
    Tolerance(f64),
}

/// The shortest step, s: below it, time stands still in double precision after
/// a few hours.
pub const SHORTEST_STEP_S: f64 = 1e-9;

/// The longest step, s.
pub const LONGEST_STEP_S: f64 = 10.0;

/// A model with a method and its pace, which fit together.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Configuration {
    model: Model,
    method: Method,
    pace: Pace,
}

impl Configuration {
    /// A step lies in [1e-9, 10] s, a tolerance in [1e-12, 1] m. A fixed step
    /// goes with every method, a tolerance with those that adapt.
    ///
    /// # Errors
    /// [`Invalid`] naming `/method`, `/step` or `/tolerance`.
    pub fn new(model: Model, method: Method, pace: Pace) -> Result<Self, Invalid> {
        if !model.methods().contains(&method) {
            let able: Vec<&str> = model.methods().iter().map(|m| m.name()).collect();
            let reason =
                format!("the {model} model is stepped by {}, not {method}", able.join(", "));
            return Err(Invalid::new("/method", reason));
        }
        match pace {
            Pace::Step(h) => {
                offbd_core::vocabulary::in_range("/step", h, SHORTEST_STEP_S..=LONGEST_STEP_S)?;
                if model == Model::Sliding {
                    let reason = "the sliding model steps from event to event: give a tolerance";
                    return Err(Invalid::new("/step", reason));
                }
            }
            Pace::Tolerance(tolerance) => {
                offbd_core::vocabulary::in_range("/tolerance", tolerance, 1e-12..=1.0)?;
                if !method.adapts() {
                    let reason = format!("{method} takes fixed steps: give a step");
                    return Err(Invalid::new("/tolerance", reason));
                }
            }
        }
        Ok(Self { model, method, pace })
    }

    #[must_use]
    pub const fn model(&self) -> Model {
        self.model
    }

    #[must_use]
    pub const fn method(&self) -> Method {
        self.method
    }

    #[must_use]
    pub const fn pace(&self) -> Pace {
        self.pace
    }
}
