//! First stage: checks the numbers of a sample, whatever came before it.

use super::{AxisMapping, Rejection, Rig};
use crate::vocabulary::Sample;

/// Largest plausible time, s. Chosen: over 30 000 years.
const MAX_TIME_S: f64 = 1e12;
/// Largest plausible position, m: ten times half of the largest plate (10 m).
const MAX_POSITION_M: f64 = 50.0;
/// Largest believable command, rad: a full turn.
const MAX_COMMAND_RAD: f64 = core::f64::consts::TAU;

/// Returns why the engine of `rig` would reject `sample`, whatever came before it; `None`
/// if it would not.
#[must_use]
pub fn rejection(rig: &Rig, sample: &Sample) -> Option<Rejection> {
    check(&rig.mapping, sample).err()
}

/// Checks that the numbers of `sample` are finite and plausible.
pub(super) fn check(mapping: &AxisMapping, sample: &Sample) -> Result<(), Rejection> {
    let max_command = MAX_COMMAND_RAD / mapping.command_unit_rad;
    let max_position = MAX_POSITION_M / mapping.position_unit_m;
    let fields = [
        ("t_s", Some(sample.t_s), MAX_TIME_S),
        ("cmd_qx_rad", sample.cmd_qx_rad, max_command),
        ("cmd_qy_rad", sample.cmd_qy_rad, max_command),
        ("x_m", sample.x_m, max_position),
        ("y_m", sample.y_m, max_position),
    ];
    for (field, value, limit) in fields {
        let Some(value) = value else { continue };
        // False for NaN.
        if value.abs() <= limit {
            continue;
        }
        return Err(match value.is_finite() {
            true => Rejection::Absurd { field, value, limit },
            false => Rejection::NotFinite { field },
        });
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn at(t_s: f64) -> Sample {
        Sample { t_s, x_m: Some(0.0), ..Sample::default() }
    }

    #[test]
    fn what_is_not_a_sample_is_named() {
        let mapping = AxisMapping::default();
        assert_eq!(check(&mapping, &at(1.0)), Ok(()));
        let nan = Sample { y_m: Some(f64::NAN), ..at(1.0) };
        assert_eq!(check(&mapping, &nan), Err(Rejection::NotFinite { field: "y_m" }));
        let far = Sample { x_m: Some(-1e9), ..at(1.0) };
        let reason = check(&mapping, &far).unwrap_err();
        assert_eq!(reason.to_string(), "x_m is -1000000000, beyond ±50");
        let reason = check(&mapping, &at(1_771_570_260_336.0)).unwrap_err();
        let told = "t_s is 1771570260336, beyond ±1000000000000; its unit is s";
        assert_eq!(reason.to_string(), told);
        let turn = Sample { cmd_qx_rad: Some(400.0), ..Sample::default() };
        let degrees = AxisMapping { command_unit_rad: 0.017_453_292_5, ..AxisMapping::default() };
        let reason = check(&degrees, &turn).unwrap_err();
        assert_eq!(reason.to_string(), "cmd_qx_rad is 400, beyond ±360");
        let reason = check(&AxisMapping::default(), &turn).unwrap_err();
        assert_eq!(reason.to_string(), "cmd_qx_rad is 400, beyond ±6.28");
    }

    #[test]
    fn infinite_numbers_are_not_samples() {
        let rig = Rig::chapter("rig");
        let infinite = Sample { x_m: Some(f64::INFINITY), ..at(1.0) };
        assert_eq!(rejection(&rig, &infinite), Some(Rejection::NotFinite { field: "x_m" }));
        assert_eq!(rejection(&rig, &at(1.0)), None);
    }

    #[test]
    fn limits_are_in_the_units_of_the_rig() {
        let mapping =
            AxisMapping { position_unit_m: 0.001, command_unit_rad: 0.1, ..AxisMapping::default() };
        let x = |x_m| Sample { x_m: Some(x_m), ..at(1.0) };
        assert_eq!(check(&mapping, &x(50_000.0)), Ok(()));
        assert!(check(&mapping, &x(-50_001.0)).is_err());
        let command = |cmd| Sample { cmd_qy_rad: Some(cmd), ..at(1.0) };
        assert_eq!(check(&mapping, &command(-62.0)), Ok(()));
        assert!(check(&mapping, &command(63.0)).is_err());
        assert_eq!(check(&mapping, &at(1e12)), Ok(()));
        assert!(check(&mapping, &at(-1.1e12)).is_err());
    }
}
