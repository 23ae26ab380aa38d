//! First stage: validates samples and recognises retransmissions.
//!
//! A sample is identified by its `seq`, or by `t_s` if it has none: sent twice, it counts
//! once. New samples that cannot be judged are recorded all the same.

use super::ledger::{Ledger, Recognition};
use super::{Admission, AxisMapping, Rejection, Rig};
use crate::vocabulary::Sample;
use serde::{Deserialize, Serialize};

/// Largest plausible time, s. Chosen: over 30 000 years.
const MAX_TIME_S: f64 = 1e12;
/// Largest plausible position, m: ten times half of the largest plate (10 m).
const MAX_POSITION_M: f64 = 50.0;
/// Largest believable command, rad: a full turn.
const MAX_COMMAND_RAD: f64 = core::f64::consts::TAU;

/// The stage: validation and retransmissions.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub(super) struct Admit {
    max_command: f64,
    max_position: f64,
    ledger: Ledger,
}

/// Returns why the engine of `rig` would reject `sample`, whatever came before it; `None`
/// if it would not.
#[must_use]
pub fn rejection(rig: &Rig, sample: &Sample) -> Option<Rejection> {
    Admit::new(&rig.mapping).check(sample).err()
}

impl Admit {
    pub(super) fn new(mapping: &AxisMapping) -> Self {
        Self {
            max_command: MAX_COMMAND_RAD / mapping.command_unit_rad,
            max_position: MAX_POSITION_M / mapping.position_unit_m,
            ledger: Ledger::default(),
        }
    }

    /// Decides on a sample that is new if `is_new`, and may be a retransmission otherwise.
    /// Returns `None` if it is new and its clock is to be judged.
    pub(super) fn take(&mut self, sample: &Sample, is_new: bool) -> Option<Admission> {
        if let Err(rejection) = self.check(sample) {
            return Some(Admission::Rejected(rejection));
        }
        if is_new {
            return None;
        }
        match self.ledger.recognise(sample) {
            Recognition::New => None,
            Recognition::Same => Some(Admission::Duplicate),
            Recognition::Conflict => Some(Admission::Rejected(Rejection::conflict(sample))),
            Recognition::Taken | Recognition::Unknown => Some(Admission::Unknown),
        }
    }

    /// Returns what is known of a sample.
    pub(super) fn recognise(&self, sample: &Sample) -> Recognition {
        self.ledger.recognise(sample)
    }

    /// Notes a new sample in the ledger; `gap_s` is the interval that makes a gap.
    pub(super) fn note(&mut self, sample: &Sample, gap_s: f64) {
        self.ledger.note(sample, gap_s);
    }

    /// Whether a new sample can be one that was lost and is sent late.
    pub(super) fn fits_gap(&self, sample: &Sample) -> bool {
        self.ledger.fits_gap(sample)
    }

    /// Whether a sample is before the first one.
    pub(super) fn precedes(&self, sample: &Sample) -> bool {
        self.ledger.precedes(sample)
    }

    /// Whether samples without `seq` have been taken around `t_s`.
    pub(super) fn has_stretch_at(&self, t_s: f64) -> bool {
        self.ledger.has_stretch_at(t_s)
    }

    /// Checks the numbers of a sample, whatever came before it.
    fn check(&self, sample: &Sample) -> Result<(), Rejection> {
        let fields = [
            ("t_s", Some(sample.t_s), MAX_TIME_S),
            ("cmd_qx_rad", sample.cmd_qx_rad, self.max_command),
            ("cmd_qy_rad", sample.cmd_qy_rad, self.max_command),
            ("x_m", sample.x_m, self.max_position),
            ("y_m", sample.y_m, self.max_position),
        ];
        for (field, value, limit) in fields {
            let Some(value) = value else { continue };
            if !value.is_finite() {
                return Err(Rejection::NotFinite { field });
            }
            if value.abs() > limit {
                return Err(Rejection::Absurd { field, value, limit });
            }
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn at(t_s: f64) -> Sample {
        Sample { t_s, x_m: Some(0.0), ..Sample::default() }
    }

    fn admit() -> Admit {
        Admit::new(&AxisMapping::default())
    }

    #[test]
    fn what_is_no_sample_is_named() {
        let nan = Sample { y_m: Some(f64::NAN), ..at(1.0) };
        let reason = Rejection::NotFinite { field: "y_m" };
        assert_eq!(admit().take(&nan, false), Some(Admission::Rejected(reason)));
        let far = Sample { x_m: Some(-1e9), ..at(1.0) };
        let Some(Admission::Rejected(reason)) = admit().take(&far, true) else { panic!("taken") };
        assert_eq!(reason.to_string(), "x_m is -1000000000, beyond ±50");
    }
}
