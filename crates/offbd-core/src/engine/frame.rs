//! Conversion from the device's numbers to the plate frame.

use super::AxisMapping;
use crate::vocabulary::{Axis, PerAxis, Sample, SimTime};
use serde::{Deserialize, Serialize};

/// A sample in the plate frame: commands in rad, positions in m, per ball axis.
#[derive(Clone, Copy, Debug)]
pub(super) struct Moment {
    pub at: SimTime,
    pub command: PerAxis<Option<f64>>,
    pub position: PerAxis<Option<f64>>,
}

/// Detects readings that only repeat the previous one, of a sensor that is slower than
/// its log: they tell where the ball was, not where it is.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub(super) struct Repeats {
    /// Time between two readings of the sensor, s; zero if it keeps up with the log.
    refresh_s: f64,
    last: Option<(SimTime, PerAxis<Option<f64>>)>,
}

/// Time for which the same reading counts as a repeat, in refreshes. Chosen; a ball at
/// rest reads the same for longer.
const REPEAT_REFRESHES: f64 = 1.5;

impl Repeats {
    pub(super) fn new(refresh_s: f64) -> Self {
        Self { refresh_s, last: None }
    }

    /// Whether the sensor is slower than its log.
    pub(super) fn are_expected(&self) -> bool {
        self.refresh_s > 0.0
    }

    /// Takes the next reading; returns whether it repeats the previous one.
    pub(super) fn is_repeat(&mut self, at: SimTime, position: &PerAxis<Option<f64>>) -> bool {
        if self.refresh_s == 0.0 {
            return false;
        }
        let since_s = self.last.filter(|(_, p)| p == position).map(|(since, _)| at - since);
        let repeats = since_s.is_some_and(|s| s < REPEAT_REFRESHES * self.refresh_s);
        if !repeats {
            self.last = Some((at, *position));
        }
        repeats
    }
}

/// Converts the sample by `mapping`; `None` if its time is not finite.
pub(super) fn moment(mapping: &AxisMapping, sample: &Sample) -> Option<Moment> {
    let read = |axis: Axis| if mapping.swap { axis.other() } else { axis };
    Some(Moment {
        at: SimTime::new(sample.t_s)?,
        command: PerAxis::from_fn(|a| sample.command(a).map(|c| c * mapping.command_unit_rad)),
        position: PerAxis::from_fn(|a| {
            let factor = mapping.position_unit_m * mapping.sign[a];
            sample.position(read(a)).map(|p| p * factor - mapping.origin_m[a])
        }),
    })
}
