//! The values that an instance starts with, and the file of an FMU that holds them.

use std::fmt::Write;

use offbd_core::engine::Setup;
use offbd_core::plant::{GRAVITY_M_S2, SimulatedTwin, TwinAxis};
use offbd_core::vocabulary::{Invalid, in_range};

use crate::variables::{
    BALL_RADIUS, COUNT, FRICTION, GRAVITY, INERTIA_FACTOR, LONGEST_STEP, PLATE_THICKNESS,
    VARIABLES, X_SERVO, Y_SERVO,
};

/// A value of each variable, within its range.
#[derive(Clone, Debug, PartialEq)]
pub struct StartValues([f64; COUNT]);

impl StartValues {
    /// The file of an FMU that holds the start values.
    pub const FILE: &str = "start-values.txt";

    /// Returns the values of the twin of `setup`, with its ball at rest in the middle of the
    /// plate.
    ///
    /// # Errors
    /// [`Invalid`] naming a variable, if the rig has a value that the model does not take.
    pub fn of(setup: &Setup) -> Result<Self, Invalid> {
        let (rig, axes) = (&setup.rig, &setup.twin.axes);
        let mut values = [0.0; COUNT];
        values[GRAVITY] = GRAVITY_M_S2;
        values[BALL_RADIUS] = rig.ball.radius_m();
        values[INERTIA_FACTOR] = rig.ball.inertia_factor();
        values[PLATE_THICKNESS] = rig.plate.thickness_m();
        values[FRICTION] = rig.contact.friction();
        values[LONGEST_STEP] = *SimulatedTwin::STEPS_S.start();
        values[X_SERVO..Y_SERVO].copy_from_slice(&servo(&axes.x));
        values[Y_SERVO..].copy_from_slice(&servo(&axes.y));
        Self::checked(values)
    }

    fn checked(values: [f64; COUNT]) -> Result<Self, Invalid> {
        for (variable, value) in VARIABLES.iter().zip(values) {
            in_range(variable.name, value, variable.range.clone())?;
        }
        Ok(Self(values))
    }

    /// The values, in the order of [`VARIABLES`].
    #[must_use]
    pub const fn values(&self) -> &[f64; COUNT] {
        &self.0
    }

    /// Returns the text of [`FILE`](Self::FILE): name and value of each variable.
    #[must_use]
    pub fn to_text(&self) -> String {
        let mut text = String::new();
        for (variable, value) in VARIABLES.iter().zip(self.0) {
            let _ = writeln!(text, "{} {value}", variable.name);
        }
        text
    }

    /// Reads the text of [`FILE`](Self::FILE).
    ///
    /// # Errors
    /// [`Invalid`] naming the variable that is missing, unknown or out of range.
    pub fn parse(text: &str) -> Result<Self, Invalid> {
        let mut found = [None; COUNT];
        for line in text.lines() {
            let (name, value) = line.split_once(' ').unwrap_or((line, ""));
            let index = VARIABLES.iter().position(|variable| variable.name == name);
            let index =
                index.ok_or_else(|| Invalid::new(name, "is not a variable of the model"))?;
            let value = value.parse().map_err(|_| Invalid::new(name, "is not a number"))?;
            found[index] = Some(value);
        }
        let mut values = [0.0; COUNT];
        for (i, variable) in VARIABLES.iter().enumerate() {
            values[i] = found[i].ok_or_else(|| Invalid::new(variable.name, "is missing"))?;
        }
        Self::checked(values)
    }
}

/// Returns the parameters of a servo, in the order of [`VARIABLES`].
fn servo(axis: &TwinAxis) -> [f64; Y_SERVO - X_SERVO] {
    [
        axis.servo.angle_limit_rad(),
        axis.servo.rate_limit_rad_s(),
        axis.dead_time_s,
        axis.command_gain,
        axis.servo.lag_s(),
        axis.gain,
        axis.level_rad,
        axis.resistance_m_s2,
    ]
}

#[cfg(test)]
mod tests {
    use super::*;
    use offbd_core::engine::Rig;

    fn chapter() -> StartValues {
        StartValues::of(&Setup::new(Rig::chapter("chapter"), None).unwrap()).unwrap()
    }

    #[test]
    fn a_file_has_the_same_values_to_the_bit() {
        assert_eq!(StartValues::parse(&chapter().to_text()).unwrap(), chapter());
    }

    #[test]
    fn an_error_names_the_variable() {
        let text = chapter().to_text();
        let error = |text: &str| StartValues::parse(text).unwrap_err().to_string();
        assert_eq!(error(&text.replace("friction 0.6\n", "")), "friction: is missing");
        assert_eq!(
            error(&text.replace("friction", "grip")),
            "grip: is not a variable of the model"
        );
        assert_eq!(error(&text.replace("friction 0.6", "friction ?")), "friction: is not a number");
        let refused = error(&text.replace("friction 0.6", "friction NaN"));
        assert_eq!(refused, "friction: NaN is outside 0.000001 to 100");
    }
}
