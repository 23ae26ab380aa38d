//! The plate's motion, and the accelerations that it causes in its own frame.

use nalgebra::{Vector2, Vector3};

use super::GRAVITY_M_S2;
use crate::maths::sine::sin_cos;

/// Plate angles about x and y, within ±1000 rad, with their first and second derivatives.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Tilt {
    /// (qx, qy), rad.
    pub angle: Vector2<f64>,
    /// (q̇x, q̇y), rad/s.
    pub rate: Vector2<f64>,
    /// (q̈x, q̈y), rad/s².
    pub acceleration: Vector2<f64>,
}

impl Tilt {
    /// A plate at rest at (qx, qy).
    #[must_use]
    pub fn constant(qx_rad: f64, qy_rad: f64) -> Self {
        Self { angle: Vector2::new(qx_rad, qy_rad), ..Self::default() }
    }

    /// Builds the motion from the angle, rate and acceleration of each of qx and qy.
    #[must_use]
    #[inline]
    pub fn of(x: [f64; 3], y: [f64; 3]) -> Self {
        let [angle, rate, acceleration] = [0, 1, 2].map(|i| Vector2::new(x[i], y[i]));
        Self { angle, rate, acceleration }
    }

    /// Returns the same motion expressed in the plate frame.
    #[must_use]
    #[inline]
    pub fn motion(&self) -> PlateMotion {
        let (sin_x, cos_x) = sin_cos(self.angle.x);
        let (sin_y, cos_y) = sin_cos(self.angle.y);
        let coupling = self.rate.x * self.rate.y;
        PlateMotion {
            omega: Vector3::new(self.rate.x * cos_y, self.rate.y, self.rate.x * sin_y),
            alpha: Vector3::new(
                self.acceleration.x * cos_y - coupling * sin_y,
                self.acceleration.y,
                self.acceleration.x * sin_y + coupling * cos_y,
            ),
            gravity: Vector3::new(cos_x * sin_y, -sin_x, -cos_x * cos_y) * GRAVITY_M_S2,
        }
    }
}

/// The plate's motion in its own frame, and the external acceleration of a ball.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct PlateMotion {
    /// Ω = (q̇x cos qy, q̇y, q̇x sin qy), rad/s.
    pub omega: Vector3<f64>,
    /// α = Ω̇, rad/s².
    pub alpha: Vector3<f64>,
    /// Gravity g·(cos qx sin qy, −sin qx, −cos qx cos qy) plus any other force
    /// on the ball's centre over its mass, m/s².
    pub gravity: Vector3<f64>,
}

impl PlateMotion {
    /// Adds an external force on the ball's centre along x and y, given per mass, m/s².
    #[must_use]
    pub fn pushed(mut self, acceleration: Vector2<f64>) -> Self {
        self.gravity += Vector3::new(acceleration.x, acceleration.y, 0.0);
        self
    }

    /// Acceleration of a free body at `p` with velocity `v`, both relative to the plate:
    /// `g_P − 2Ω×v − Ω×(Ω×p) − α×p`, m/s².
    #[must_use]
    #[inline]
    pub fn free(&self, p: &Vector3<f64>, v: &Vector3<f64>) -> Vector3<f64> {
        let inner = 2.0 * v + self.omega.cross(p);
        self.gravity - self.omega.cross(&inner) - self.alpha.cross(p)
    }

    /// Rate of change of the spin `w` of a free body relative to the plate: `−α − Ω×w`,
    /// rad/s².
    #[must_use]
    #[inline]
    pub fn free_turn(&self, w: &Vector3<f64>) -> Vector3<f64> {
        -self.alpha - self.omega.cross(w)
    }
}
