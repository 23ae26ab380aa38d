//! Determines model, method and pace from the options.

use clap::Args;
use clap::builder::{PossibleValuesParser, TypedValueParser};

use offbd_core::plant::GRAVITY_M_S2;
use offbd_core::vocabulary::Invalid;
use offbd_lab::scene::{
    Choice, Configuration, Declined, Drive, Method, Model, OutOfReach, Pace, Scene, TriedCandidate,
    choose, suits,
};
use offbd_lab::timing::cpu_once;
use offbd_terminal::errors::BadArgument;

/// How to run a scene.
#[derive(Clone, Debug, Args)]
pub(super) struct ConfigurationArgs {
    /// Model of the ball and its contact
    #[arg(long, default_value = "auto", value_parser = or_auto::<Model>(Model::ALL.map(Model::name)))]
    pub model: OrAuto<Model>,
    /// Numerical method that steps the model
    #[arg(long, default_value = "auto", value_parser = or_auto::<Method>(Method::ALL.map(Method::name)))]
    pub method: OrAuto<Method>,
    /// Fixed steps of this length, s [default for methods with fixed steps: 0.001,
    /// or the stable step]
    #[arg(long, value_name = "S", conflicts_with = "tolerance", allow_negative_numbers = true,
          value_parser = positive_number)]
    pub step: Option<f64>,
    /// Wanted accuracy of the position, m; with a model named, that of its method
    /// [default: 1e-4]
    #[arg(long, value_name = "M", allow_negative_numbers = true, value_parser = positive_number)]
    pub tolerance: Option<f64>,
    /// Search for the cheapest model and method by trial runs, for a scene that
    /// is to run many times [default: one pass that changes models as it goes]
    #[arg(long, conflicts_with_all = ["model", "method", "step"])]
    pub search: bool,
}

/// A named choice, or `None` for `auto`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct OrAuto<T>(pub Option<T>);

fn or_auto<T>(
    words: impl IntoIterator<Item = &'static str>,
) -> impl TypedValueParser<Value = OrAuto<T>>
where
    T: std::str::FromStr<Err = Invalid> + Clone + Send + Sync + 'static,
{
    PossibleValuesParser::new(std::iter::once("auto").chain(words))
        .map(|word| OrAuto(word.parse::<T>().ok()))
}

/// Parses a finite number above zero.
pub(super) fn positive_number(word: &str) -> Result<f64, String> {
    let value: Option<f64> = word.parse().ok();
    value.filter(|v| v.is_finite() && *v > 0.0).ok_or_else(|| "not a number above 0".to_owned())
}

/// Default accuracy, m; chosen.
pub(super) const TOLERANCE_M: f64 = 1e-4;

/// Default fixed step, s: the chapter's longest.
const STEP_S: f64 = 1e-3;

/// The configuration to be run, and its origin.
#[derive(Clone, Debug)]
pub(super) struct Decision {
    /// `None` for a run in one pass.
    pub configuration: Option<Configuration>,
    /// The requested accuracy, m.
    pub wanted_m: Option<f64>,
    /// The choice of `auto`, if it was requested.
    pub choice: Option<Choice>,
    /// CPU time of choosing, s.
    pub choosing_s: f64,
}

/// No model keeps the tolerance.
#[derive(Debug, thiserror::Error)]
#[error("{why}")]
pub(super) struct NoModelMeets {
    why: String,
    pub tried: Vec<TriedCandidate>,
}

impl From<OutOfReach> for NoModelMeets {
    fn from(none: OutOfReach) -> Self {
        Self { why: none.to_string(), tried: none.tried }
    }
}

impl From<Declined> for NoModelMeets {
    fn from(declined: Declined) -> Self {
        Self { why: declined.to_string(), tried: Vec::new() }
    }
}

impl ConfigurationArgs {
    /// Returns whether all options have their defaults.
    pub(super) fn is_plain(&self) -> bool {
        let Self { model, method, step, tolerance, search } = self;
        let asked = step.is_some() || tolerance.is_some() || *search;
        model.0.is_none() && method.0.is_none() && !asked
    }

    /// Returns whether model and method are left to the program.
    pub(super) fn chooses(&self) -> bool {
        self.model.0.is_none() && self.method.0.is_none()
    }

    pub(super) fn decide<D: Drive + Clone>(
        &self,
        scene: &Scene,
        drive: &D,
    ) -> anyhow::Result<Decision> {
        if let Some(model) = self.model.0 {
            let configuration = Some(self.configured(scene, model)?);
            let paced = configuration.map(|by| by.pace());
            let by_tolerance = matches!(paced, Some(Pace::Tolerance(_)));
            let wanted_m = by_tolerance.then_some(self.tolerance.unwrap_or(TOLERANCE_M));
            let choice = None;
            return Ok(Decision { configuration, wanted_m, choice, choosing_s: 0.0 });
        }
        let wanted_m = self.tolerance.unwrap_or(TOLERANCE_M);
        if !(1e-12..=1.0).contains(&wanted_m) {
            let text = format!("--tolerance: {wanted_m} is outside 1e-12 to 1");
            return Err(BadArgument(text).into());
        }
        let wanted = Some(wanted_m);
        if self.method.0.is_none() && self.step.is_none() && !self.search {
            let (configuration, choice) = (None, None);
            return Ok(Decision { configuration, wanted_m: wanted, choice, choosing_s: 0.0 });
        }
        let (choice, choosing_s) = cpu_once(|| choose(scene, drive, wanted_m));
        let choice = choice.map_err(NoModelMeets::from)?;
        let chosen = choice.configuration;
        let fits = self.method.0.is_none_or(|method| method == chosen.method());
        let configuration = if fits && self.step.is_none() {
            chosen
        } else {
            self.configured(scene, self.able(chosen.model()))?
        };
        let configuration = Some(configuration);
        Ok(Decision { configuration, wanted_m: wanted, choice: Some(choice), choosing_s })
    }

    /// Returns the chosen model if the requested method and step can run it; else the most
    /// accurate model that they can run.
    fn able(&self, chosen: Model) -> Model {
        let can = |model: Model| {
            let stepped = self.step.is_none() || model != Model::Sliding;
            stepped && self.method.0.is_none_or(|method| model.methods().contains(&method))
        };
        if can(chosen) {
            return chosen;
        }
        Model::ALL.into_iter().rev().find(|model| can(*model)).unwrap_or(chosen)
    }

    fn configured(&self, scene: &Scene, model: Model) -> anyhow::Result<Configuration> {
        suits(scene, model).map_err(bad)?;
        let fixed = self.step.is_some();
        let usual = if fixed { fixed_method(model) } else { model.usual_method() };
        let method = self.method.0.unwrap_or(usual);
        let step = match (self.step, self.tolerance) {
            (None, None) if !method.adapts() => Some(usual_step(scene, model, method)),
            (step, _) => step,
        };
        let configuration = match step {
            Some(step) => Configuration::new(model, method, Pace::Step(step)),
            None => Configuration::within(model, method, self.tolerance.unwrap_or(TOLERANCE_M)),
        };
        Ok(configuration.map_err(bad)?)
    }
}

/// Maps an invalid option to an error with its name.
fn bad(error: Invalid) -> BadArgument {
    BadArgument(format!("--{}: {}", error.element.trim_start_matches('/'), error.reason))
}

/// Returns the default method for a fixed step.
const fn fixed_method(model: Model) -> Method {
    match model {
        Model::Planar => Method::ZeroOrderHold,
        Model::Rolling | Model::Creeping => Method::Rk4,
        Model::Sliding => Method::Dopri5,
        Model::Compliant => Method::ContactStep,
    }
}

/// Returns the default step, s: 1 ms, or for an explicit method of the compliant model one
/// time constant of its fastest mode, slip or normal
/// (`crates/offbd-core/src/plant/contact.rs`).
fn usual_step(scene: &Scene, model: Model, method: Method) -> f64 {
    if model != Model::Compliant || method == Method::ContactStep {
        return STEP_S;
    }
    let (body, contact) = (scene.body(), &scene.contact);
    let weight = body.mass_kg() * GRAVITY_M_S2;
    let slip = body.slip_ease() * contact.friction() * weight / contact.slip_threshold_m_s();
    let normal = contact.damping_n_s_per_m() / body.mass_kg();
    STEP_S.min(1.0 / slip.max(normal))
}
