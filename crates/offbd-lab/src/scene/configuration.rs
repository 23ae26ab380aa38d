//! The models and methods, with their names, and the configurations made of them.

use std::fmt;
use std::str::FromStr;

use offbd_core::vocabulary::Invalid;

/// A model of the body and its contact, ordered from the cheapest to the most accurate.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Model {
    Planar,
    Rolling,
    Creeping,
    Sliding,
    Compliant,
}

/// Tolerance of an implicit method as a share of the accuracy that it is to keep, and at
/// most, m. Chosen: RODAS errs by up to 13 times its tolerance on random scenes, and above
/// 1e-4 m it misses that a ball just leaves the plate.
const KEEPING_SHARE: f64 = 0.05;
const COARSEST_KEEPING_M: f64 = 5e-5;

/// A numerical method that steps a model.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Method {
    /// Exact while the angle is constant.
    ZeroOrderHold,
    Euler,
    SemiImplicitEuler,
    Midpoint,
    Rk4,
    Dopri5,
    Rodas3,
    Rodas4,
    /// Backward Euler for the contact, in closed form.
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

    /// Returns the methods that can step this model.
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

    /// Returns the default method.
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

    /// Returns the tolerance at which the error of the position stays within `wanted_m`, m:
    /// a smaller one for an implicit method, whose error a landing or a take-off can make
    /// larger than its estimates.
    #[must_use]
    pub const fn tolerance_to_keep(self, wanted_m: f64) -> f64 {
        match self {
            Self::Rodas3 | Self::Rodas4 => (wanted_m * KEEPING_SHARE).min(COARSEST_KEEPING_M),
            _ => wanted_m,
        }
    }

    /// Returns whether the method adapts its step size to a tolerance.
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
            Invalid::new("/model", format!("unknown model {name}; expected one of {known}"))
        })
    }
}

impl FromStr for Method {
    type Err = Invalid;

    fn from_str(name: &str) -> Result<Self, Invalid> {
        Self::ALL.into_iter().find(|method| method.name() == name).ok_or_else(|| {
            let known = Self::ALL.map(Self::name).join(", ");
            Invalid::new("/method", format!("unknown method {name}; expected one of {known}"))
        })
    }
}

/// How the step size is set.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Pace {
    /// Fixed steps of at most this length, s: each smooth piece of the plate's motion is
    /// divided into equal ones.
    Step(f64),
    /// Adaptive steps that keep the error of the position at the end of the scene, as the
    /// method estimates it, within this tolerance, m.
    Tolerance(f64),
}

/// The shortest step, s. Chosen so that time still advances in double precision after
/// hours of a scene.
pub const SHORTEST_STEP_S: f64 = 1e-9;

/// The longest step, s; chosen.
pub const LONGEST_STEP_S: f64 = 10.0;

/// The finest tolerance, m; chosen: below it, rounding errors outweigh the gain.
pub(super) const FINEST_M: f64 = 1e-12;

/// A model, a method that can step it, and a pace that the method accepts.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Configuration {
    model: Model,
    method: Method,
    pace: Pace,
}

impl Configuration {
    /// Checks the combination. A step lies in [1e-9, 10] s, a tolerance in [1e-12, 1] m.
    /// Every method accepts a fixed step, only adaptive methods accept a tolerance; the
    /// sliding model needs a tolerance.
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
                offbd_core::vocabulary::in_range("/tolerance", tolerance, FINEST_M..=1.0)?;
                if !method.adapts() {
                    let reason = format!("{method} takes fixed steps: give a step");
                    return Err(Invalid::new("/tolerance", reason));
                }
            }
        }
        Ok(Self { model, method, pace })
    }

    /// Returns the configuration that is to keep the error of the position within
    /// `accuracy_m`, in [1e-12, 1] m, by its method's own tolerance; see
    /// [`Method::tolerance_to_keep`].
    ///
    /// # Errors
    /// As [`Self::new`], also where the method's own tolerance would be below 1e-12 m.
    pub fn within(model: Model, method: Method, accuracy_m: f64) -> Result<Self, Invalid> {
        let asked = Self::new(model, method, Pace::Tolerance(accuracy_m))?;
        let tolerance_m = method.tolerance_to_keep(accuracy_m);
        if tolerance_m < FINEST_M {
            let least_m = FINEST_M / KEEPING_SHARE;
            let reason = format!("must be at least {least_m:.0e} m to be kept by {method}");
            return Err(Invalid::new("/tolerance", reason));
        }
        Ok(Self { pace: Pace::Tolerance(tolerance_m), ..asked })
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
