//! Other limits and debounce times than those of the rig, tried on a recording.

use alloc::borrow::Cow;

use crate::diagnosis::Settings;
use crate::vocabulary::{Axis, FaultCode, Invalid, PerAxis, in_range};

/// Smallest factor on the limits of a servo. Chosen: below it everything is a failure.
const MIN_FACTOR: f64 = 0.01;
/// Largest factor on the limits of a servo: that of the textbook's limit of 0.01 m/s² to
/// more than any residual.
const MAX_FACTOR: f64 = 1000.0;

/// What is tried for each monitor; the default tries nothing else than the rig's settings.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Trial {
    limit_factor: PerAxis<f64>,
    debounce_s: [Option<f64>; FaultCode::COUNT],
}

impl Default for Trial {
    fn default() -> Self {
        Self { limit_factor: PerAxis { x: 1.0, y: 1.0 }, debounce_s: [None; FaultCode::COUNT] }
    }
}

impl Trial {
    /// Multiplies everything with which the servo of `axis` is compared by `factor`, in
    /// [0.01, 1000]: the limits of the residual and of the path, and the evidence that counts.
    ///
    /// # Errors
    /// [`Invalid`] naming `element`.
    pub fn with_limit(mut self, element: &str, axis: Axis, factor: f64) -> Result<Self, Invalid> {
        self.limit_factor[axis] = in_range(element, factor, MIN_FACTOR..=MAX_FACTOR)?;
        Ok(self)
    }

    /// Sets the debounce of the monitor of `code` as [`Settings::with_debounce`] does that of
    /// all monitors.
    ///
    /// # Errors
    /// [`Invalid`] naming `element`.
    pub fn with_debounce(
        mut self,
        element: &str,
        code: FaultCode,
        fail_s: f64,
    ) -> Result<Self, Invalid> {
        Settings::default()
            .with_debounce(fail_s)
            .map_err(|error| Invalid::new(element, error.reason))?;
        self.debounce_s[code as usize] = Some(fail_s);
        Ok(self)
    }

    /// The factors on the limits of the servos.
    pub(super) const fn limit_factor(&self) -> &PerAxis<f64> {
        &self.limit_factor
    }

    /// Returns `settings` with the debounce of `code`. They have the rig's window, which
    /// extends the debounce as in [`Settings::with_window`].
    pub(super) fn settings<'a>(
        &self,
        code: FaultCode,
        settings: &'a Settings,
    ) -> Cow<'a, Settings> {
        let Some(fail_s) = self.debounce_s[code as usize] else { return Cow::Borrowed(settings) };
        let extension_s = settings.window_s - Settings::of(settings.profile).window_s;
        Cow::Owned(Settings {
            fail_s: (fail_s + extension_s).max(0.0),
            readings_fail_s: fail_s,
            noise_fail_s: fail_s,
            gather_s: fail_s,
            ..*settings
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_debounce_concerns_its_code_and_goes_with_the_window() {
        let learnt = Settings::default().with_window(|_| 0.7);
        let trial = Trial::default().with_debounce("?d", FaultCode::XServo, 1.0).unwrap();
        let tried = trial.settings(FaultCode::XServo, &learnt);
        let owners = Settings::default().with_debounce(1.0).unwrap().with_window(|_| 0.7);
        assert!((tried.fail_s - owners.fail_s).abs() < 1e-12);
        assert_eq!(Settings { fail_s: owners.fail_s, ..*tried }, owners);
        assert_eq!(*trial.settings(FaultCode::YServo, &learnt), learnt);
    }

    #[test]
    fn what_is_out_of_range_is_refused_with_its_element() {
        let trial = Trial::default();
        for factor in [0.0, -1.0, 1001.0, f64::NAN] {
            let error = trial.with_limit("?x_servo_limit", Axis::X, factor).unwrap_err();
            assert_eq!(error.element, "?x_servo_limit");
        }
        for fail_s in [-0.1, 60.1, f64::NAN] {
            let error = trial.with_debounce("?s", FaultCode::Sensor, fail_s).unwrap_err();
            assert_eq!(error.element, "?s");
        }
    }
}
