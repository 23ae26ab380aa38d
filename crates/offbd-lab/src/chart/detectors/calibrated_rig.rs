//! The rigs: each is calibrated once and then simulated for many sessions.

use super::trace::{Trace, follow};
use crate::chart::ChartError;
use crate::simulation::{Disturbances, Fault, Preset, Reference, SimulatedRig};
use offbd_core::diagnosis::Profile;
use offbd_core::engine::{Rig, Setup, calibrate};
use offbd_core::maths::robust_deviation;
use offbd_core::vocabulary::{Axis, PerAxis, Sample};

/// Duration of the calibration session, s; chosen.
const CALIBRATION_S: f64 = 120.0;
/// Disturbances in healthy sessions; chosen.
const DISTURBANCES: Disturbances = Disturbances { pushes_per_minute: 2.0, gusts_per_minute: 1.0 };
/// Earliest onset of a fault and the interval over which onsets are spread, s; chosen.
const ONSET_S: [f64; 2] = [15.0, 10.0];
/// Duration of a session with a fault, s. Chosen: most faults become detectable within
/// seconds, and a detection half a minute later is of no use.
const FAULTY_S: f64 = 60.0;
/// Fractional part of the golden ratio: the fractional parts of its multiples spread
/// onsets evenly.
const GOLDEN: f64 = 0.618_033_988_749_894_9;

/// A session to be simulated.
pub(super) struct Session {
    pub(super) preset: Preset,
    reference: Reference,
    disturbances: Disturbances,
    /// The fault as on the command line, without onset; `None`: healthy.
    pub(super) fault: Option<&'static str>,
    seconds: f64,
    seed: u64,
}

impl Session {
    pub(super) fn healthy(preset: Preset, reference: Reference, seconds: f64, seed: u64) -> Self {
        Self { preset, reference, disturbances: DISTURBANCES, fault: None, seconds, seed }
    }

    pub(super) fn faulty(
        preset: Preset,
        reference: Reference,
        fault: &'static str,
        seed: u64,
    ) -> Self {
        let disturbances = Disturbances::default();
        Self { preset, reference, disturbances, fault: Some(fault), seconds: FAULTY_S, seed }
    }

    /// Returns the fault with its onset.
    fn injected(&self) -> Option<Fault> {
        let share = (self.seed as f64 * GOLDEN).fract();
        let onset_s = ONSET_S[0] + ONSET_S[1] * share;
        self.fault.and_then(|words| format!("{words}@{onset_s:.3}").parse().ok())
    }

    fn record(&self) -> Result<SimulatedSession, ChartError> {
        let model = self.preset.model()?;
        let mut rig = SimulatedRig::new(model, self.reference, self.disturbances, self.seed)?;
        self.injected().into_iter().for_each(|fault| rig.inject(fault));
        let rows = std::iter::from_fn(|| Some(rig.next_sample()));
        let samples = rows.take_while(|s| s.t_s <= self.seconds).collect();
        let truth = rig.faults().next();
        let onset_s = truth.map(|t| t.fault.onset_s);
        Ok(SimulatedSession { samples, onset_s, chance_s: truth.and_then(|t| t.chance_s) })
    }
}

/// The samples of a session, with the onset and first chance of its fault.
struct SimulatedSession {
    samples: Vec<Sample>,
    onset_s: Option<f64>,
    chance_s: Option<f64>,
}

/// A calibrated rig.
pub(super) struct CalibratedRig {
    setups: [Setup; 2],
    /// Standard deviation of the residual in the calibration session, which has no
    /// disturbances, m/s².
    pub(super) healthy_m_s2: PerAxis<f64>,
}

impl CalibratedRig {
    /// Calibrates the rig of `preset`.
    pub(super) fn new(preset: Preset) -> Result<Self, ChartError> {
        let mut rig: Rig = preset.model()?.rig;
        let session = Session {
            disturbances: Disturbances::default(),
            // A seed that no other session has.
            ..Session::healthy(preset, Reference::Lissajous, CALIBRATION_S, u64::MAX)
        };
        let samples = session.record()?.samples;
        rig.calibration = Some(Box::new(calibrate(&rig, std::slice::from_ref(&samples))?));
        let setup = |profile| Setup::new(rig.clone(), Some(profile));
        let setups = [setup(Profile::Default)?, setup(Profile::Textbook)?];
        let trace = follow(&setups, &samples);
        let healthy = |axis: Axis| {
            let enabled = trace.judged.iter().filter_map(|m| m.axes[axis].residual_m_s2);
            robust_deviation(&mut enabled.collect::<Vec<_>>()).unwrap_or(f64::INFINITY)
        };
        Ok(Self { healthy_m_s2: PerAxis::from_fn(healthy), setups })
    }

    /// Returns the engine's setup for a profile.
    pub(super) const fn setup(&self, profile: Profile) -> &Setup {
        &self.setups[profile as usize]
    }

    /// Simulates one session and runs both engines over it.
    pub(super) fn run(&self, session: &Session) -> Result<Trace, ChartError> {
        let recording = session.record()?;
        let trace = follow(&self.setups, &recording.samples);
        Ok(Trace {
            fault: session.fault,
            onset_s: recording.onset_s,
            chance_s: recording.chance_s,
            seconds: session.seconds,
            ..trace
        })
    }

    /// Returns a session for measuring costs: a minute of steps, with disturbances.
    pub(super) fn minute(preset: Preset) -> Result<Vec<Sample>, ChartError> {
        Ok(Session::healthy(preset, Reference::Steps, 60.0, 0).record()?.samples)
    }
}
