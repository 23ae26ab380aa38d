//! The body on the plate and its contact: spring, damper, friction.

use nalgebra::Vector3;
use serde::{Deserialize, Serialize};

use super::{Ball, Plate};
use crate::vocabulary::{Invalid, in_range, positive};

/// The parameters of the contact; immutable.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Contact {
    stiffness_n_per_m: f64,
    damping_n_s_per_m: f64,
    friction: f64,
    slip_threshold_m_s: f64,
}

impl Contact {
    /// The chapter's contact with K and D of its S-function (equation 4.6): 800 000 N/m,
    /// 1000 N·s/m, μ = 0.6, v_thr = 1e-4 m/s.
    pub const CHAPTER: Self = Self {
        stiffness_n_per_m: 800_000.0,
        damping_n_s_per_m: 1000.0,
        friction: 0.6,
        slip_threshold_m_s: 1e-4,
    };

    /// The chapter's contact with K and D of its section 4.8: 1000 N/m, 100 N·s/m.
    pub const SOFT: Self =
        Self { stiffness_n_per_m: 1000.0, damping_n_s_per_m: 100.0, ..Self::CHAPTER };

    /// The differing parameters that the chapter gives, by name.
    pub const PRESETS: [(&'static str, Self); 2] =
        [("chapter", Self::CHAPTER), ("soft", Self::SOFT)];

    /// Stiffness K in (0, 1e12] N/m, damping D in (0, 1e9] N·s/m, friction μ
    /// in (0, 100], and the slip speed at which friction saturates, v_thr in
    /// (0, 10] m/s.
    ///
    /// # Errors
    /// [`Invalid`] naming the element under `/contact`.
    pub fn new(
        stiffness_n_per_m: f64,
        damping_n_s_per_m: f64,
        friction: f64,
        slip_threshold_m_s: f64,
    ) -> Result<Self, Invalid> {
        Ok(Self {
            stiffness_n_per_m: positive("/contact/stiffness_n_per_m", stiffness_n_per_m, 1e12)?,
            damping_n_s_per_m: positive("/contact/damping_n_s_per_m", damping_n_s_per_m, 1e9)?,
            friction: positive("/contact/friction", friction, 100.0)?,
            slip_threshold_m_s: positive("/contact/slip_threshold_m_s", slip_threshold_m_s, 10.0)?,
        })
    }

    #[must_use]
    pub const fn stiffness_n_per_m(&self) -> f64 {
        self.stiffness_n_per_m
    }

    #[must_use]
    pub const fn damping_n_s_per_m(&self) -> f64 {
        self.damping_n_s_per_m
    }

    #[must_use]
    pub const fn friction(&self) -> f64 {
        self.friction
    }

    #[must_use]
    pub const fn slip_threshold_m_s(&self) -> f64 {
        self.slip_threshold_m_s
    }
}

impl Default for Contact {
    fn default() -> Self {
        Self::CHAPTER
    }
}

/// The body on the plate: a ball, or a block that slides without turning.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Body {
    mass: f64,
    /// Lever arm of friction about the centre, m: the radius of a ball; 0 for a block,
    /// whose slip is −v.
    arm: f64,
    /// 1/I, 1/(kg m²); 0 for a block, which does not turn.
    ease: f64,
    rest_height: f64,
}

impl Body {
    #[must_use]
    pub fn ball(ball: &Ball, plate: &Plate) -> Self {
        let (r, m) = (ball.radius_m(), ball.mass_kg());
        Self {
            mass: m,
            arm: r,
            ease: 1.0 / (ball.inertia_factor() * m * r * r),
            rest_height: plate.centre_gap_m(ball),
        }
    }

    /// A cube with an edge in (0, 1] m and a mass in [1e-6, 100] kg that slides without
    /// turning: application problem 2 of the chapter.
    ///
    /// # Errors
    /// [`Invalid`] naming the element under `/block`.
    pub fn block(edge_m: f64, mass_kg: f64, plate: &Plate) -> Result<Self, Invalid> {
        Ok(Self {
            mass: in_range("/block/mass_kg", mass_kg, 1e-6..=100.0)?,
            arm: 0.0,
            ease: 0.0,
            rest_height: (plate.thickness_m() + positive("/block/edge_m", edge_m, 1.0)?) / 2.0,
        })
    }

    #[must_use]
    pub const fn mass_kg(&self) -> f64 {
        self.mass
    }

    #[must_use]
    pub const fn arm_m(&self) -> f64 {
        self.arm
    }

    /// 1/I, 1/(kg m²); 0 for a block.
    #[must_use]
    pub const fn inverse_inertia(&self) -> f64 {
        self.ease
    }

    /// Whether the body can turn.
    #[must_use]
    pub fn turns(&self) -> bool {
        self.arm > 0.0
    }

    /// Height of the body's centre above the joint when it just touches the plate, m.
    #[must_use]
    pub const fn rest_height_m(&self) -> f64 {
        self.rest_height
    }

    /// Change of the slip per unit of friction impulse: 1/m + r²/I, 1/kg.
    #[must_use]
    pub fn slip_ease(&self) -> f64 {
        1.0 / self.mass + self.arm * self.arm * self.ease
    }

    /// Slip of the contact point, with the sign of the friction force on the
    /// body: (−vx + r wy, −vy − r wx), m/s (equations 4.6 and 4.7, signs of the
    /// S-function).
    #[must_use]
    #[inline]
    pub fn slip(&self, v: &Vector3<f64>, w: &Vector3<f64>) -> [f64; 2] {
        [-v.x + self.arm * w.y, -v.y - self.arm * w.x]
    }
}

/// Position (m), velocity (m/s) and spin (rad/s) of a body relative to the plate, in the
/// plate frame.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Motion {
    pub position: Vector3<f64>,
    pub velocity: Vector3<f64>,
    pub spin: Vector3<f64>,
}

impl Motion {
    /// A body at rest that just touches the plate's centre.
    #[must_use]
    pub fn at_rest(body: &Body) -> Self {
        Self { position: Vector3::new(0.0, 0.0, body.rest_height_m()), ..Self::default() }
    }

    /// (p, v, w) as one array.
    #[must_use]
    #[inline]
    pub fn to_row(&self) -> [f64; 9] {
        let (p, v, w) = (&self.position, &self.velocity, &self.spin);
        [p.x, p.y, p.z, v.x, v.y, v.z, w.x, w.y, w.z]
    }

    #[must_use]
    #[inline]
    pub fn from_row(y: &[f64; 9]) -> Self {
        Self {
            position: Vector3::new(y[0], y[1], y[2]),
            velocity: Vector3::new(y[3], y[4], y[5]),
            spin: Vector3::new(y[6], y[7], y[8]),
        }
    }
}

/// Where the plate supports a body.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub enum Ground {
    /// A plate of infinite extent.
    Endless,
    /// Only within the plate's outline.
    Plate(Plate),
}

impl Ground {
    /// Distance of (x, y) from the edge, m; negative beyond it.
    #[must_use]
    #[inline]
    pub fn margin_m(&self, x_m: f64, y_m: f64) -> f64 {
        match self {
            Self::Endless => f64::INFINITY,
            Self::Plate(plate) => plate.edge_distance_m(x_m, y_m),
        }
    }
}
