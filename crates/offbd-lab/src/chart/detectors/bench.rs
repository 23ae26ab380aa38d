//! The rigs: each is learnt once and then runs session after session.

use super::trace::{Trace, follow};
use crate::chart::ChartError;
use crate::simulation::{Disturbances, Fault, Preset, Reference, SimulatedRig};
use offbd_core::diagnosis::Profile;
use offbd_core::engine::{Rig, Setup, calibrate};
use offbd_core::maths::robust_deviation;
use offbd_core::vocabulary::{Axis, PerAxis, Sample};

/// Length of the healthy session that a rig is learnt from, s.
const LEARNING_S: f64 = 120.0;
/// Hands and gusts per minute in healthy sessions.
const HANDS: Disturbances = Disturbances { pushes_per_minute: 2.0, gusts_per_minute: 1.0 };
/// Onset of a fault, s: from the first on, spread over the second.
const ONSET_S: [f64; 2] = [15.0, 10.0];
/// Length of a session with a fault, s: most are without a chance for some
/// seconds, and half a minute after it nobody waits any more.
const FAULTY_S: f64 = 60.0;
/// Fractions of the golden ratio spread onsets evenly.
const GOLDEN: f64 = 0.618_033_988_749_894_9;

/// A session to be simulated.
pub(super) struct Session {
    pub(super) preset: Preset,
    reference: Reference,
    disturbances: Disturbances,
    /// As on the command line, without onset.
    pub(super) fault: Option<&'static str>,
    seconds: f64,
    seed: u64,
}

impl Session {
    pub(super) fn healthy(preset: Preset, reference: Reference, seconds: f64, seed: u64) -> Self {
        Self { preset, reference, disturbances: HANDS, fault: None, seconds, seed }
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

    /// The fault with its onset.
    fn injected(&self) -> Option<Fault> {
        let share = (self.seed as f64 * GOLDEN).fract();
        let onset_s = ONSET_S[0] + ONSET_S[1] * share;
        self.fault.and_then(|words| format!("{words}@{onset_s:.3}").parse().ok())
    }

    fn record(&self) -> Result<Recording, ChartError> {
        let model = self.preset.model()?;
        let mut rig = SimulatedRig::new(model, self.reference, self.disturbances, self.seed)?;
        self.injected().into_iter().for_each(|fault| rig.inject(fault));
        let rows = std::iter::from_fn(|| Some(rig.next_sample()));
        let samples = rows.take_while(|s| s.t_s <= self.seconds).collect();
        let truth = rig.faults().next();
        let onset_s = truth.map(|t| t.fault.onset_s);
        Ok(Recording { samples, onset_s, chance_s: truth.and_then(|t| t.chance_s) })
    }
}

/// A session as it was, and what is true of its fault.
struct Recording {
    samples: Vec<Sample>,
    onset_s: Option<f64>,
    chance_s: Option<f64>,
}

/// One learnt rig.
pub(super) struct Bench {
    setups: [Setup; 2],
    /// Standard deviation of the residual in the session it was learnt from,
    /// without hands, m/s².
    pub(super) healthy_m_s2: PerAxis<f64>,
}

impl Bench {
    /// Learns the rig of `preset`.
    pub(super) fn new(preset: Preset) -> Result<Self, ChartError> {
        let mut rig: Rig = preset.model()?.rig;
        let session = Session {
            disturbances: Disturbances::default(),
            // Apart from those of all sessions.
            ..Session::healthy(preset, Reference::Lissajous, LEARNING_S, u64::MAX)
        };
        let samples = session.record()?.samples;
        rig.calibration = Some(calibrate(&rig, std::slice::from_ref(&samples), "", "")?);
        let setup = |profile| Setup::new(rig.clone(), Some(profile));
        let setups = [setup(Profile::Default)?, setup(Profile::Textbook)?];
        let trace = follow(&setups, &samples);
        let healthy = |axis: Axis| {
            let enabled = trace.judged.iter().filter_map(|m| m.axes[axis].residual_m_s2);
            robust_deviation(&mut enabled.collect::<Vec<_>>()).unwrap_or(f64::INFINITY)
        };
        Ok(Self { healthy_m_s2: PerAxis::from_fn(healthy), setups })
    }

    /// What the rig is judged by, by profile.
    pub(super) const fn setup(&self, profile: Profile) -> &Setup {
        &self.setups[profile as usize]
    }

    /// Simulates and follows one session.
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

    /// A session to measure costs on: a minute of steps, with hands.
    pub(super) fn minute(preset: Preset) -> Result<Vec<Sample>, ChartError> {
        Ok(Session::healthy(preset, Reference::Steps, 60.0, 0).record()?.samples)
    }
}
