//! The two directions in which the ball moves on the plate.

use core::ops::{Index, IndexMut};
use serde::{Deserialize, Serialize};

/// A direction of ball motion in the plate frame.
///
/// The *x servo* is the one that moves the ball along x; it turns the plate
/// about y by `qy`. The *y servo* turns it about x by `qx`, and +qx moves the
/// ball toward −y.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord, Serialize, Deserialize)]
pub enum Axis {
    X,
    Y,
}

impl Axis {
    /// Both axes, x first.
    pub const ALL: [Self; 2] = [Self::X, Self::Y];

    /// `"x"` or `"y"`.
    #[must_use]
    pub const fn as_str(self) -> &'static str {
        match self {
            Self::X => "x",
            Self::Y => "y",
        }
    }

    /// The plate angle whose command drives this axis: `"qy"` for x, `"qx"` for y.
    #[must_use]
    pub const fn command(self) -> &'static str {
        match self {
            Self::X => "qy",
            Self::Y => "qx",
        }
    }

    /// The other axis.
    #[must_use]
    pub const fn other(self) -> Self {
        match self {
            Self::X => Self::Y,
            Self::Y => Self::X,
        }
    }

    /// Sign of the ball's acceleration for a positive angle of the driving
    /// servo: +1 for x (driven by qy), −1 for y (driven by qx).
    #[must_use]
    pub const fn drive_sign(self) -> f64 {
        match self {
            Self::X => 1.0,
            Self::Y => -1.0,
        }
    }
}

/// One value for each axis.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct PerAxis<T> {
    pub x: T,
    pub y: T,
}

impl<T> PerAxis<T> {
    /// Builds the pair from a function of the axis.
    pub fn from_fn(mut f: impl FnMut(Axis) -> T) -> Self {
        Self { x: f(Axis::X), y: f(Axis::Y) }
    }

    /// Applies `f` to both values.
    pub fn map<U>(self, mut f: impl FnMut(T) -> U) -> PerAxis<U> {
        PerAxis { x: f(self.x), y: f(self.y) }
    }
}

impl<T> Index<Axis> for PerAxis<T> {
    type Output = T;
    fn index(&self, axis: Axis) -> &T {
        match axis {
            Axis::X => &self.x,
            Axis::Y => &self.y,
        }
    }
}

impl<T> IndexMut<Axis> for PerAxis<T> {
    fn index_mut(&mut self, axis: Axis) -> &mut T {
        match axis {
            Axis::X => &mut self.x,
            Axis::Y => &mut self.y,
        }
    }
}
