//! The chapter's contact: a spring and damper under the body, and friction
//! that grows with slip up to a threshold (equations 4.1 to 4.9).
//!
//! ```text
//! m·(v̇ + 2Ω×v + Ω×(Ω×p) + α×p) = m·g_P + F        I·(ẇ + α + Ω×w) = τ
//! F_z = −K(pz − cgap) − D·vz   while pz < cgap over the plate, else 0
//! s   = (−vx + r·wy, −vy − r·wx)
//! F_x = μ·clamp(s_x/v_thr, ±1)·F_z, F_y alike       τ = (r·F_y, −r·F_x, 0)
//! ```
//!
//! By default it is the S-function `ballplateforces.c`: friction saturates on each axis
//! separately, and the damper pulls a body back that leaves the plate (F_z < 0).
//! [`Compliant::with_cone`] and [`Compliant::with_push_only`] correct that. A block has
//! r = 0 and no spin (application problem 2).
//!
//! Valid for any motion; the simpler models are compared with it. Stiff: with the
//! chapter's numbers the normal mode decays at 836 and 18 772 1/s, slip at 206 000 1/s.

use nalgebra::{Matrix3, Vector3};

use offbd_core::plant::{Body, Contact, Ground, Motion, PlateMotion};

/// The compliant model of one body on one plate.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Compliant {
    pub body: Body,
    pub contact: Contact,
    pub ground: Ground,
    cone: bool,
    push_only: bool,
}

/// The derivatives of the contact forces on the body.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct ContactDerivatives {
    /// ∂F_z/∂pz and ∂F_z/∂vz.
    normal_by: [f64; 2],
    /// ∂F_x/∂F_z, ∂F_y/∂F_z: the mobilised friction coefficients.
    by_normal: [f64; 2],
    /// ∂(F_x, F_y)/∂(s_x, s_y).
    by_slip: [[f64; 2]; 2],
}

/// A slip below this share of the threshold is none: how it grows depends on rounding;
/// chosen.
const NO_SLIP: f64 = 1e-6;

impl Compliant {
    /// Creates the model as in the S-function, without its start-up delay of 1 ms.
    #[must_use]
    pub fn new(body: Body, contact: Contact, ground: Ground) -> Self {
        Self { body, contact, ground, cone: false, push_only: false }
    }

    /// Limits the resultant friction, |F_xy| ≤ μF_z, instead of each axis.
    #[must_use]
    pub const fn with_cone(mut self) -> Self {
        self.cone = true;
        self
    }

    /// Limits the normal force to F_z ≥ 0: the plate never pulls.
    #[must_use]
    pub const fn with_push_only(mut self) -> Self {
        self.push_only = true;
        self
    }

    pub(super) const fn pushes_only(&self) -> bool {
        self.push_only
    }

    pub(super) const fn limits_as_a_cone(&self) -> bool {
        self.cone
    }

    #[inline]
    pub(crate) fn touches(&self, p: &Vector3<f64>) -> bool {
        p.z < self.body.rest_height_m() && self.ground.margin_m(p.x, p.y) > 0.0
    }

    /// Returns whether the Jacobian contains the contact. A body that just touches counts as
    /// in contact: otherwise an implicit step from there would be an explicit one.
    #[inline]
    pub(crate) fn has_contact_derivatives(&self, p: &Vector3<f64>) -> bool {
        p.z <= self.body.rest_height_m() && self.ground.margin_m(p.x, p.y) > 0.0
    }

    /// Returns the derivatives of (p, v, w) under the plate's motion.
    #[must_use]
    #[inline]
    pub fn rate(&self, y: &[f64; 9], plate: &PlateMotion) -> [f64; 9] {
        let at = Motion::from_row(y);
        let force = self.force(&at);
        let a = plate.free(&at.position, &at.velocity) + force / self.body.mass_kg();
        let turn = self.turn(&at.spin, &force, plate);
        let v = at.velocity;
        [v.x, v.y, v.z, a.x, a.y, a.z, turn.x, turn.y, turn.z]
    }

    #[inline]
    fn turn(&self, w: &Vector3<f64>, force: &Vector3<f64>, plate: &PlateMotion) -> Vector3<f64> {
        if !self.body.turns() {
            return Vector3::zeros();
        }
        let lever = self.body.arm_m() * self.body.inverse_inertia();
        plate.free_turn(w) + Vector3::new(lever * force.y, -lever * force.x, 0.0)
    }

    /// Returns the contact force on the body, N.
    #[must_use]
    #[inline]
    pub fn force(&self, at: &Motion) -> Vector3<f64> {
        if !self.touches(&at.position) {
            return Vector3::zeros();
        }
        let depth = at.position.z - self.body.rest_height_m();
        let normal = -self.contact.stiffness_n_per_m() * depth
            - self.contact.damping_n_s_per_m() * at.velocity.z;
        let normal = if self.push_only { normal.max(0.0) } else { normal };
        let [x, y] = self.mobilised_friction(self.body.slip(&at.velocity, &at.spin));
        Vector3::new(x * normal, y * normal, normal)
    }

    /// Returns the time in which a slip grows by a factor of e, s: while the damper pulls
    /// the body back, friction has the sign of the slip and drives it. Infinite where no
    /// slip grows.
    #[inline]
    pub(crate) fn slip_growth_s(&self, at: &Motion) -> f64 {
        let pull = -self.force(at).z;
        let threshold = self.contact.slip_threshold_m_s();
        let slip = self.body.slip(&at.velocity, &at.spin);
        let grows = |s: &f64| (NO_SLIP * threshold..threshold).contains(&s.abs());
        if pull <= 0.0 || !slip.iter().any(grows) {
            return f64::INFINITY;
        }
        threshold / (self.body.slip_ease() * self.contact.friction() * pull)
    }

    /// Returns the friction force per unit of normal force.
    #[inline]
    fn mobilised_friction(&self, slip: [f64; 2]) -> [f64; 2] {
        let (mu, threshold) = (self.contact.friction(), self.contact.slip_threshold_m_s());
        if self.cone {
            let scale = mu / slip[0].hypot(slip[1]).max(threshold);
            return [scale * slip[0], scale * slip[1]];
        }
        slip.map(|s| mu * (s / threshold).clamp(-1.0, 1.0))
    }

    /// Returns the derivatives of the contact force.
    fn contact_derivatives(&self, at: &Motion) -> ContactDerivatives {
        if !self.has_contact_derivatives(&at.position) {
            return ContactDerivatives::default();
        }
        let force = self.force(at);
        let slip = self.body.slip(&at.velocity, &at.spin);
        let held = self.push_only && force.z == 0.0;
        let normal_by = if held {
            [0.0; 2]
        } else {
            [-self.contact.stiffness_n_per_m(), -self.contact.damping_n_s_per_m()]
        };
        ContactDerivatives {
            normal_by,
            by_normal: self.mobilised_friction(slip),
            by_slip: self.friction_by_slip(slip).map(|row| row.map(|f| f * force.z)),
        }
    }

    fn friction_by_slip(&self, slip: [f64; 2]) -> [[f64; 2]; 2] {
        let (mu, threshold) = (self.contact.friction(), self.contact.slip_threshold_m_s());
        let sticks = mu / threshold;
        if !self.cone {
            let [x, y] = slip.map(|s| if s.abs() < threshold { sticks } else { 0.0 });
            return [[x, 0.0], [0.0, y]];
        }
        let speed = slip[0].hypot(slip[1]);
        if speed < threshold {
            return [[sticks, 0.0], [0.0, sticks]];
        }
        let [x, y] = slip.map(|s| s / speed);
        let scale = mu / speed;
        [[scale * y * y, -scale * x * y], [-scale * x * y, scale * x * x]]
    }

    /// Returns `∂rate[i]/∂y[j]` as `[i][j]`.
    #[must_use]
    pub fn jacobian(&self, y: &[f64; 9], plate: &PlateMotion) -> [[f64; 9]; 9] {
        let mut j = [[0.0; 9]; 9];
        self.free_jacobian(&mut j, plate);
        self.add_contact(&mut j, &self.contact_derivatives(&Motion::from_row(y)));
        j
    }

    fn free_jacobian(&self, j: &mut [[f64; 9]; 9], plate: &PlateMotion) {
        let (omega, alpha) = (cross_matrix(&plate.omega), cross_matrix(&plate.alpha));
        let by_position = -omega * omega - alpha;
        for row in 0..3 {
            j[row][row + 3] = 1.0;
            for column in 0..3 {
                j[row + 3][column] = by_position[(row, column)];
                j[row + 3][column + 3] = -2.0 * omega[(row, column)];
                if self.body.turns() {
                    j[row + 6][column + 6] = -omega[(row, column)];
                }
            }
        }
    }

    fn add_contact(&self, j: &mut [[f64; 9]; 9], contact: &ContactDerivatives) {
        let r = self.body.arm_m();
        let (light, lever) = (1.0 / self.body.mass_kg(), r * self.body.inverse_inertia());
        for (k, column) in [2, 5].into_iter().enumerate() {
            let normal = contact.normal_by[k];
            let [x, y] = contact.by_normal.map(|f| f * normal);
            j[3][column] += light * x;
            j[4][column] += light * y;
            j[5][column] += light * normal;
            j[6][column] += lever * y;
            j[7][column] -= lever * x;
        }
        // s_x decreases with vx and increases with r·wy; s_y decreases with vy and r·wx.
        for (column, slip, factor) in [(3, 0, -1.0), (7, 0, r), (4, 1, -1.0), (6, 1, -r)] {
            let [x, y] = [contact.by_slip[0][slip] * factor, contact.by_slip[1][slip] * factor];
            j[3][column] += light * x;
            j[4][column] += light * y;
            j[6][column] += lever * y;
            j[7][column] -= lever * x;
        }
    }
}

/// Returns the skew-symmetric matrix [a]× with [a]×·b = a×b.
fn cross_matrix(a: &Vector3<f64>) -> Matrix3<f64> {
    Matrix3::new(0.0, -a.z, a.y, a.z, 0.0, -a.x, -a.y, a.x, 0.0)
}
