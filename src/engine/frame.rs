//! From the device's numbers to the plate frame.

use super::AxisMapping;
use crate::vocabulary::{Axis, PerAxis, Sample, SimTime};

/// A sample in the plate frame: commands in rad, positions in m, per ball axis.
#[derive(Clone, Copy, Debug)]
pub struct Moment {
    pub at: SimTime,
    pub command: PerAxis<Option<f64>>,
    pub position: PerAxis<Option<f64>>,
}

/// The sample as `mapping` has it; none where its time is not finite.
pub fn moment(mapping: &AxisMapping, sample: &Sample) -> Option<Moment> {
    let read = |axis: Axis| if mapping.swap { axis.other() } else { axis };
    Some(Moment {
        at: SimTime::new(sample.t_s)?,
        command: PerAxis::from_fn(|a| sample.command(a).map(|c| c * mapping.command_unit_rad)),
        position: PerAxis::from_fn(|a| {
            sample.position(read(a)).map(|p| p * mapping.position_unit_m * mapping.sign[a])
        }),
    })
}
