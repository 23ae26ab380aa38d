//! The sizes of injected faults, as words on the command line.

use std::ops::RangeInclusive;

use nalgebra::Vector2;

use offbd_core::vocabulary::Axis;

/// What the size of a fault may be.
pub(super) trait Size {
    type Value: Copy;

    /// Parses the word after `=`, or returns the default size if there is none. The error says
    /// what is expected.
    fn parse(&self, word: Option<&str>) -> Result<Self::Value, &'static str>;

    /// The word after the name in help texts, as `=FACTOR`.
    fn usage(&self) -> &'static str;

    /// The size as numbers; `None` if it is not told.
    fn numbers(&self, _: Self::Value) -> Option<Vec<f64>> {
        None
    }

    fn axis(&self, _: Self::Value) -> Option<Axis> {
        None
    }
}

/// A number in a range.
pub(super) struct Number {
    pub typical: f64,
    pub range: RangeInclusive<f64>,
    pub expected: &'static str,
    pub usage: &'static str,
    /// Whether labels and names tell it.
    pub is_told: bool,
}

/// A factor by which something is larger.
pub(super) const fn factor(typical: f64) -> Number {
    number(typical, 1.0..=1000.0, "a factor, 1 to 1000", "=FACTOR")
}

/// A share of the readings.
pub(super) const fn share(typical: f64) -> Number {
    number(typical, 0.0..=1.0, "a share of the readings, 0 to 1", "=SHARE")
}

pub(super) const fn number(
    typical: f64,
    range: RangeInclusive<f64>,
    expected: &'static str,
    usage: &'static str,
) -> Number {
    Number { typical, range, expected, usage, is_told: true }
}

impl Size for Number {
    type Value = f64;

    fn parse(&self, word: Option<&str>) -> Result<f64, &'static str> {
        let Some(word) = word else { return Ok(self.typical) };
        let value: Option<f64> = word.parse().ok();
        value.filter(|v| self.range.contains(v)).ok_or(self.expected)
    }

    fn usage(&self) -> &'static str {
        self.usage
    }

    fn numbers(&self, size: f64) -> Option<Vec<f64>> {
        self.is_told.then(|| vec![size])
    }
}

/// An axis; by default x.
pub(super) struct OneAxis;

impl Size for OneAxis {
    type Value = Axis;

    fn parse(&self, word: Option<&str>) -> Result<Axis, &'static str> {
        match word {
            Some("x") | None => Ok(Axis::X),
            Some("y") => Ok(Axis::Y),
            Some(_) => Err("x or y"),
        }
    }

    fn usage(&self) -> &'static str {
        "=x|y"
    }

    fn axis(&self, axis: Axis) -> Option<Axis> {
        Some(axis)
    }
}

/// A shift along x and y, m, with its default.
pub(super) struct Shift(pub [f64; 2]);

impl Size for Shift {
    type Value = Vector2<f64>;

    fn parse(&self, word: Option<&str>) -> Result<Vector2<f64>, &'static str> {
        let Some(word) = word else { return Ok(self.0.into()) };
        let (x, y) = word.split_once(',').unwrap_or((word, "0"));
        let metres = |word: &str| {
            let value: Option<f64> = word.parse().ok();
            let expected = "a shift in m along x, or along x and y as in 0.04,-0.02";
            value.filter(|v| v.abs() <= 10.0).ok_or(expected)
        };
        Ok(Vector2::new(metres(x)?, metres(y)?))
    }

    fn usage(&self) -> &'static str {
        "=X_M[,Y_M]"
    }

    fn numbers(&self, shift: Vector2<f64>) -> Option<Vec<f64>> {
        Some(vec![shift.x, shift.y])
    }
}
