//! The ball and the plate.

#[cfg(not(feature = "std"))]
use crate::no_std::*;
use crate::vocabulary::{Axis, Invalid, PerAxis, in_range, positive};
use serde::{Deserialize, Serialize};

/// Standard gravity as the chapter rounds it, m/s².
pub const GRAVITY_M_S2: f64 = 9.81;

/// A homogeneous or hollow ball.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Ball {
    radius_m: f64,
    mass_kg: f64,
    inertia_factor: f64,
}

impl Ball {
    /// A ball of `radius_m` in (0, 1], `mass_kg` in [1e-6, 100] and
    /// `inertia_factor` κ in [0, 1], where I = κ m r² (solid 2/5, hollow 2/3).
    ///
    /// # Errors
    /// [`Invalid`] naming the element under `/ball`.
    pub fn new(radius_m: f64, mass_kg: f64, inertia_factor: f64) -> Result<Self, Invalid> {
        Ok(Self {
            radius_m: positive("/ball/radius_m", radius_m, 1.0)?,
            mass_kg: in_range("/ball/mass_kg", mass_kg, 1e-6..=100.0)?,
            inertia_factor: in_range("/ball/inertia_factor", inertia_factor, 0.0..=1.0)?,
        })
    }

    #[must_use]
    pub const fn radius_m(&self) -> f64 {
        self.radius_m
    }

    #[must_use]
    pub const fn mass_kg(&self) -> f64 {
        self.mass_kg
    }

    /// κ of I = κ m r².
    #[must_use]
    pub const fn inertia_factor(&self) -> f64 {
        self.inertia_factor
    }

    /// How easily air moves the ball: its area over its mass, relative to a ping-pong
    /// ball.
    #[must_use]
    pub fn air_drag_ratio(&self) -> f64 {
        const PING_PONG: f64 = 0.02 * 0.02 / 0.0027;
        self.radius_m * self.radius_m / self.mass_kg / PING_PONG
    }

    /// Acceleration per unit of slope while rolling, g/(1 + κ), m/s²:
    /// 5/7 g for a solid ball, 3/5 g for a hollow one.
    #[must_use]
    pub fn rolling_gravity(&self) -> f64 {
        GRAVITY_M_S2 / (1.0 + self.inertia_factor)
    }
}

impl Default for Ball {
    /// The chapter's ball: steel, one inch across, 51 g.
    fn default() -> Self {
        Self { radius_m: 0.0127, mass_kg: 0.051, inertia_factor: 0.4 }
    }
}

/// The outline of the plate.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub enum PlateShape {
    /// `length_m` along x, `width_m` along y.
    Rectangle { length_m: f64, width_m: f64 },
    /// A disc.
    Round { diameter_m: f64 },
}

/// The plate: outline, thickness, and whether a rim keeps the ball on it.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Plate {
    shape: PlateShape,
    thickness_m: f64,
    rim: bool,
}

impl Plate {
    /// The chapter's plate, by its hardware description and its text: 0.38 × 0.24 × 0.02
    /// m.
    pub const CHAPTER: Self = Self::rectangle(0.38, 0.24);

    /// The plate entered in step 12 of the chapter: 0.38 × 0.25 × 0.02 m.
    pub const STEP_12: Self = Self::rectangle(0.38, 0.25);

    /// The plate of section 4.8 of the chapter: 0.35 × 0.24 m. The section states no
    /// thickness; that of the other two is used.
    pub const SECTION_4_8: Self = Self::rectangle(0.35, 0.24);

    /// The differing sizes that the chapter gives, by name.
    pub const PRESETS: [(&'static str, Self); 3] = [
        ("chapter", Self::CHAPTER),
        ("step-12", Self::STEP_12),
        ("section-4.8", Self::SECTION_4_8),
    ];

    const fn rectangle(length_m: f64, width_m: f64) -> Self {
        let shape = PlateShape::Rectangle { length_m, width_m };
        Self { shape, thickness_m: 0.02, rim: true }
    }

    /// A plate with sides or diameter in (0, 10] m and a thickness in [0, 1] m.
    ///
    /// # Errors
    /// [`Invalid`] naming the element under `/plate`.
    pub fn new(shape: PlateShape, thickness_m: f64, rim: bool) -> Result<Self, Invalid> {
        match shape {
            PlateShape::Rectangle { length_m, width_m } => {
                positive("/plate/length_m", length_m, 10.0)?;
                positive("/plate/width_m", width_m, 10.0)?;
            }
            PlateShape::Round { diameter_m } => {
                positive("/plate/diameter_m", diameter_m, 10.0)?;
            }
        }
        in_range("/plate/thickness_m", thickness_m, 0.0..=1.0)?;
        Ok(Self { shape, thickness_m, rim })
    }

    #[must_use]
    pub const fn shape(&self) -> PlateShape {
        self.shape
    }

    #[must_use]
    pub const fn thickness_m(&self) -> f64 {
        self.thickness_m
    }

    /// Whether a rim stops the ball at the edge.
    #[must_use]
    pub const fn rim(&self) -> bool {
        self.rim
    }

    /// Height of the resting ball's centre above the joint in the plate's centre, m.
    #[must_use]
    pub fn centre_gap_m(&self, ball: &Ball) -> f64 {
        self.thickness_m / 2.0 + ball.radius_m()
    }

    /// Distance from the centre to the edge along one axis, m.
    #[must_use]
    pub fn half_extent_m(&self, axis: Axis) -> f64 {
        match (self.shape, axis) {
            (PlateShape::Rectangle { length_m, .. }, Axis::X) => length_m / 2.0,
            (PlateShape::Rectangle { width_m, .. }, Axis::Y) => width_m / 2.0,
            (PlateShape::Round { diameter_m }, _) => diameter_m / 2.0,
        }
    }

    /// Distance of the point (x, y) from the nearest edge, m; negative beyond it.
    #[must_use]
    pub fn edge_distance_m(&self, x_m: f64, y_m: f64) -> f64 {
        match self.shape {
            PlateShape::Rectangle { length_m, width_m } => {
                (length_m / 2.0 - x_m.abs()).min(width_m / 2.0 - y_m.abs())
            }
            PlateShape::Round { diameter_m } => diameter_m / 2.0 - x_m.hypot(y_m),
        }
    }

    /// Returns the axis whose edge alone is within `room_m` of the point (x, y). `None`
    /// in a corner, and on a disc, whose edge crosses both axes.
    #[must_use]
    pub fn edge_axis(&self, x_m: f64, y_m: f64, room_m: f64) -> Option<Axis> {
        let PlateShape::Rectangle { length_m, width_m } = self.shape else { return None };
        let (at_x, at_y) =
            (length_m / 2.0 - x_m.abs() < room_m, width_m / 2.0 - y_m.abs() < room_m);
        match (at_x, at_y) {
            (true, false) => Some(Axis::X),
            (false, true) => Some(Axis::Y),
            _ => None,
        }
    }

    /// Returns the least of the inward components that an acceleration has at the edges within
    /// `room_m` of the point (x, y), in the unit of the acceleration; negative if one of these edges
    /// holds the ball. `None` if no edge is near, and in the middle of a round plate.
    #[must_use]
    pub fn off_edge(
        &self,
        place_m: &PerAxis<f64>,
        room_m: f64,
        pull: &PerAxis<f64>,
    ) -> Option<f64> {
        let PerAxis { x, y } = *place_m;
        match self.shape {
            PlateShape::Rectangle { .. } => {
                let near = |&axis: &Axis| self.half_extent_m(axis) - place_m[axis].abs() < room_m;
                let inward = |axis: Axis| -place_m[axis].signum() * pull[axis];
                Axis::ALL.into_iter().filter(near).map(inward).reduce(f64::min)
            }
            PlateShape::Round { .. } => {
                let from_middle_m = x.hypot(y);
                let is_near = self.edge_distance_m(x, y) < room_m && from_middle_m > 0.0;
                is_near.then(|| -(x * pull.x + y * pull.y) / from_middle_m)
            }
        }
    }
}

impl Default for Plate {
    /// The chapter's plate: 0.38 × 0.24 × 0.02 m, with a rim.
    fn default() -> Self {
        Self::CHAPTER
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_edge_lies_across_one_axis_but_in_a_corner_and_on_a_disc() {
        let plate = Plate::CHAPTER;
        assert_eq!(plate.edge_axis(0.18, 0.0, 0.02), Some(Axis::X));
        assert_eq!(plate.edge_axis(0.0, -0.11, 0.02), Some(Axis::Y));
        assert_eq!(plate.edge_axis(0.18, 0.11, 0.02), None);
        assert_eq!(plate.edge_axis(0.1, 0.0, 0.02), None);
        let disc = Plate::new(PlateShape::Round { diameter_m: 0.3 }, 0.02, true).unwrap();
        assert_eq!(disc.edge_axis(0.14, 0.0, 0.02), None);
    }

    #[test]
    fn a_ball_leaves_an_edge_inward() {
        let off = |plate: &Plate, x: f64, y: f64, pull_x: f64, pull_y: f64| {
            plate.off_edge(&PerAxis { x, y }, 0.02, &PerAxis { x: pull_x, y: pull_y })
        };
        let plate = &Plate::CHAPTER;
        assert_eq!(off(plate, 0.1, 0.0, -1.0, 0.0), None);
        assert_eq!(off(plate, 0.18, 0.0, -1.0, 5.0), Some(1.0), "y is along the edge");
        assert_eq!(off(plate, -0.18, 0.11, 3.0, -2.0), Some(2.0));
        assert_eq!(
            off(plate, -0.18, 0.11, 3.0, 2.0),
            Some(-2.0),
            "one edge of the corner holds it"
        );
        let disc = &Plate::new(PlateShape::Round { diameter_m: 0.3 }, 0.02, true).unwrap();
        assert_eq!(off(disc, 0.0, 0.1, 0.0, -1.0), None);
        let found = off(disc, 0.084, 0.112, -1.0, 0.0).unwrap();
        assert!((found - 0.6).abs() < 1e-12, "{found}");
    }
}
