//! One window of a ball that stays on the plate: Gauss–Legendre collocation, solved by
//! Picard sweeps.
//!
//! For a given motion of the plate, the rolling ball's equation is linear in position,
//! velocity and spin. The plate is evaluated once at each node; a sweep integrates the
//! rates at the nodes, and evaluates the rates again on the path found.
//!
//! The models differ in what a sweep adds: the rolling ball nothing, the creeping ball
//! the creep and the sag that carry the contact forces (`models/creeping.rs`), the sagging
//! ball a sag that lags behind its load:
//!
//! ```text
//! m·δ̈ + D·δ̇ + K·δ = m·n         δ ≈ δ₁ − (λ₁/λ₂)·(m·n/K − δ₁),  δ̇₁ = λ₁·(m·n/K − δ₁)
//! ```
//!
//! with λ₁ < λ₂ the decay rates of the contact, and n the normal force per mass.

#![expect(
    clippy::needless_range_loop,
    reason = "loops over the nodes by index are those that the compiler vectorises"
)]

use std::f64::consts::SQRT_2;

use super::nodes::Nodes;
use crate::scene::drive::PlateNodes;
use crate::scene::survey::SURE_TO_ROLL;
use offbd_core::plant::{Ball, Contact, Plate};

/// A model of a ball on the plate, from the cheapest to the most accurate.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(super) enum Rung {
    Rolling,
    Creeping,
    Sagging,
}

/// A ball and its contact.
#[derive(Clone, Copy)]
pub(super) struct BallContact {
    /// 1/(1 + κ), and κ.
    pub share: f64,
    kappa: f64,
    pub radius: f64,
    /// Height of the ball's centre above the joint, m.
    height: f64,
    pub friction: f64,
    threshold: f64,
    /// Sag per normal force per mass: m/K, s².
    sag_per_normal: f64,
    /// Settling time of the sag: D/K, s.
    sag_lag: f64,
    /// The decay rates λ₁ < λ₂ of the sag, 1/s.
    pub decay: [f64; 2],
}

/// Minimum of 1 − 4·m·K/D² at which the two decays of the sag count as separate. Chosen:
/// from there on λ₂/λ₁ is above 3.
const SEPARATE: f64 = 0.25;

/// Returns the decay rates λ₁ < λ₂ of the sag of a body of `mass` kg, 1/s, or `None` if the
/// contact oscillates, or nearly does.
pub(super) fn decays(mass: f64, contact: &Contact) -> Option<[f64; 2]> {
    let (k, d) = (contact.stiffness_n_per_m(), contact.damping_n_s_per_m());
    let apart = 1.0 - 4.0 * mass * k / (d * d);
    // The smaller rate without cancellation: λ₁·λ₂ = K/m.
    let fast = d / (2.0 * mass) * (1.0 + apart.max(0.0).sqrt());
    (apart >= SEPARATE).then(|| [k / mass / fast, fast])
}

impl BallContact {
    /// Returns `None` if the contact oscillates, or nearly does.
    pub(super) fn new(ball: &Ball, plate: &Plate, contact: &Contact) -> Option<Self> {
        let (kappa, mass) = (ball.inertia_factor(), ball.mass_kg());
        let (k, d) = (contact.stiffness_n_per_m(), contact.damping_n_s_per_m());
        Some(Self {
            share: 1.0 / (1.0 + kappa),
            kappa,
            radius: ball.radius_m(),
            height: plate.centre_gap_m(ball),
            friction: contact.friction(),
            threshold: contact.slip_threshold_m_s(),
            sag_per_normal: mass / k,
            sag_lag: d / k,
            decay: decays(mass, contact)?,
        })
    }

    /// Returns the settling time of the creep under the normal force per mass `normal`,
    /// s.
    pub(super) fn creep_lag(&self, normal: f64) -> f64 {
        self.share * self.kappa * self.threshold / (self.friction * normal)
    }
}

/// Longest window whose sag is integrated, in decays of its slow sag; chosen: over longer
/// ones the growing exponential in the integral outweighs everything.
const MOST_DECAYS: f64 = 8.0;

/// The state of the ball: (x, y, Ux, Uy, wz, δ₁). U is the velocity without creep and sag
/// (`models/creeping.rs`).
pub(super) type State = [f64; 6];

/// The decay of the slow sag at the nodes of a window of length 2·`half`.
pub(super) struct SagDecay<const M: usize> {
    half: f64,
    rate: f64,
    ratio: f64,
    decay: [f64; M],
    growth: [f64; M],
    whole: f64,
}

impl<const M: usize> SagDecay<M> {
    pub(super) fn new(nodes: &Nodes<M>, [slow, fast]: [f64; 2], half: f64) -> Self {
        let growth = nodes.at.map(|s| (slow * half * (1.0 + s)).exp());
        let whole = (-2.0 * slow * half).exp();
        let decay = growth.map(f64::recip);
        Self { half, rate: slow, ratio: slow / fast, decay, growth, whole }
    }

    /// Returns δ₁ at the nodes and at the end, for the settled sag `settled`.
    fn slow(&self, nodes: &Nodes<M>, settled: &[f64; M], start: f64) -> ([f64; M], f64) {
        let mut load = *settled;
        for i in 0..M {
            load[i] *= self.rate * self.growth[i];
        }
        let mut slow = nodes.integrals(&load, self.half);
        for i in 0..M {
            slow[i] = self.decay[i] * (start + slow[i]);
        }
        (slow, self.whole * (start + nodes.whole(&load, self.half)))
    }
}

/// The path of the ball through a window, at the nodes.
pub(super) struct Path<const M: usize> {
    /// Rates of (Ux, Uy, wz).
    pub rate: [[f64; M]; 3],
    /// (Ux, Uy, wz).
    pub free: [[f64; M]; 3],
    pub position: [[f64; M]; 2],
    /// v − U, m/s.
    pub offset: [[f64; M]; 2],
    /// Creep, m/s.
    pub slip: [[f64; M]; 2],
    pub sag: [f64; M],
    pub normal: [f64; M],
    pub end: State,
    /// Change of the acceleration expected of further sweeps, m/s².
    pub unsettled: f64,
    pub worst: Worst,
}

/// Largest values at the nodes of a window, and some at single nodes.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Worst {
    /// Fraction of the friction limit in use.
    pub demand: f64,
    /// The same at the first node, and the normal force per mass there and at the last
    /// node, m/s².
    pub first_demand: f64,
    pub first_normal: f64,
    pub last_normal: f64,
    /// Number of nodes before the first at which the ball is not sure to roll.
    pub sure: usize,
    /// Normal force per mass, m/s², and its smallest value.
    pub normal: f64,
    pub least_normal: f64,
    /// Rates of the plate: |Ω|, 1/s, |Ω_z| and |α|, 1/s².
    pub turn: f64,
    pub twist: f64,
    pub alpha: f64,
    /// Mean over the window of the square of the rate at which errors grow, 1/s².
    pub growth: f64,
}

impl Worst {
    /// Returns |Ω|² + |α|, 1/s²: the acceleration per lever arm.
    fn shake(&self) -> f64 {
        self.turn * self.turn + self.alpha
    }
}

/// Maximum number of sweeps of a window; chosen: each gains a factor of 30 to 100, and a
/// window that needs more is too long.
const MOST_SWEEPS: u32 = 12;

/// Largest assumed ratio of the changes in two sweeps in turn; chosen.
const SLOWEST: f64 = 0.5;

/// One window: where it starts, how long it is and how the plate moves.
pub(super) struct Window<'a, const M: usize> {
    pub nodes: &'a Nodes<M>,
    pub plate: PlateNodes<M>,
    pub start: State,
    pub half: f64,
}

impl BallContact {
    /// Sweeps until a further sweep would change the acceleration by less than `settled`,
    /// m/s². The rates in `path` are the first guess.
    #[inline(always)]
    pub(super) fn sweep<const M: usize>(
        &self,
        window: &Window<'_, M>,
        rung: Rung,
        decay: Option<&SagDecay<M>>,
        settled: f64,
        path: &mut Path<M>,
    ) {
        let mut change = f64::INFINITY;
        for sweeps in 1.. {
            integrate(window, path);
            let mut rate = [[0.0; M]; 3];
            let mut friction = [[0.0; M]; 2];
            self.roll(&window.plate, path, &mut rate, &mut friction);
            let mut moved = 0.0;
            if rung > Rung::Rolling {
                self.sink(window, decay, path);
                moved = self.creep(&window.plate, &friction, path, &mut rate);
            }
            let before = change;
            change = 0.0;
            // The spin counts too: it feeds back into the velocity one sweep later.
            for (a, arm) in [1.0, 1.0, self.radius].into_iter().enumerate() {
                for i in 0..M {
                    change = f64::max(change, arm * (rate[a][i] - path.rate[a][i]).abs());
                }
            }
            path.rate = rate;
            // The first sweeps change more than the later ones repeat.
            let gain = if sweeps > 2 { (change / before).min(SLOWEST) } else { SLOWEST };
            path.unsettled = (change * gain).max(moved / window.half);
            if path.unsettled <= settled || sweeps >= MOST_SWEEPS {
                self.finish(window, rung, &friction, path);
                return;
            }
        }
    }

    /// Returns a path whose rates are those of a ball at rest at the joint.
    #[inline(always)]
    pub(super) fn guess<const M: usize>(&self, plate: &PlateNodes<M>) -> Path<M> {
        let lever = self.kappa * self.radius;
        let mut rate = [[0.0; M]; 3];
        for i in 0..M {
            rate[0][i] = (plate.gravity[0][i] - lever * plate.alpha[1][i]) * self.share;
            rate[1][i] = (plate.gravity[1][i] + lever * plate.alpha[0][i]) * self.share;
            rate[2][i] = -plate.alpha[2][i];
        }
        Path {
            rate,
            free: [[0.0; M]; 3],
            position: [[0.0; M]; 2],
            offset: [[0.0; M]; 2],
            slip: [[0.0; M]; 2],
            sag: [0.0; M],
            normal: [0.0; M],
            end: [0.0; 6],
            unsettled: f64::INFINITY,
            worst: Worst::default(),
        }
    }

    /// Evaluates the rolling ball's rates, friction and normal force at the nodes of the
    /// path.
    #[inline(always)]
    fn roll<const M: usize>(
        &self,
        plate: &PlateNodes<M>,
        path: &mut Path<M>,
        rate: &mut [[f64; M]; 3],
        friction: &mut [[f64; M]; 2],
    ) {
        let (c, lever, per_radius) = (self.height, self.kappa * self.radius, 1.0 / self.radius);
        let [ox, oy, oz] = &plate.omega;
        let [ax, ay, az] = &plate.alpha;
        for i in 0..M {
            let (x, y) = (path.position[0][i], path.position[1][i]);
            let (vx, vy, wz) = (path.free[0][i], path.free[1][i], path.free[2][i]);
            let (wx, wy) = (-vy * per_radius, vx * per_radius);
            let inner_x = 2.0 * vx + (oy[i] * c - oz[i] * y);
            let inner_y = 2.0 * vy + (oz[i] * x - ox[i] * c);
            let inner_z = ox[i] * y - oy[i] * x;
            let fx =
                plate.gravity[0][i] - (oy[i] * inner_z - oz[i] * inner_y) - (ay[i] * c - az[i] * y);
            let fy =
                plate.gravity[1][i] - (oz[i] * inner_x - ox[i] * inner_z) - (az[i] * x - ax[i] * c);
            path.normal[i] =
                (ox[i] * inner_y - oy[i] * inner_x) + (ax[i] * y - ay[i] * x) - plate.gravity[2][i];
            let turn_x = -ax[i] - (oy[i] * wz - oz[i] * wy);
            let turn_y = -ay[i] - (oz[i] * wx - ox[i] * wz);
            rate[0][i] = (fx + lever * turn_y) * self.share;
            rate[1][i] = (fy - lever * turn_x) * self.share;
            rate[2][i] = -az[i] - (ox[i] * wy - oy[i] * wx);
            friction[0][i] = rate[0][i] - fx;
            friction[1][i] = rate[1][i] - fy;
        }
    }

    /// Evaluates the sag: settled, or lagging behind its load.
    #[inline(always)]
    fn sink<const M: usize>(
        &self,
        window: &Window<'_, M>,
        decay: Option<&SagDecay<M>>,
        path: &mut Path<M>,
    ) {
        let [ox, oy, _] = &window.plate.omega;
        for i in 0..M {
            // A ball that lies deeper, and moves with v instead of U, is pressed differently.
            path.normal[i] += path.sag[i] * (ox[i] * ox[i] + oy[i] * oy[i])
                + 2.0 * (ox[i] * path.offset[1][i] - oy[i] * path.offset[0][i]);
            path.sag[i] = self.sag_per_normal * path.normal[i];
        }
        if let Some(decay) = decay {
            let settled = path.sag;
            let (slow, end) = decay.slow(window.nodes, &settled, window.start[5]);
            for i in 0..M {
                path.sag[i] = slow[i] - decay.ratio * (settled[i] - slow[i]);
            }
            path.end[5] = end;
        }
    }

    /// Adds creep and sag to the path and the rates; returns the largest change of v − U
    /// since the last sweep, m/s.
    #[inline(always)]
    fn creep<const M: usize>(
        &self,
        plate: &PlateNodes<M>,
        friction: &[[f64; M]; 2],
        path: &mut Path<M>,
        rate: &mut [[f64; M]; 3],
    ) -> f64 {
        let [ox, oy, oz] = &plate.omega;
        let [ax, ay, _] = &plate.alpha;
        let (kappa, share) = (self.kappa, self.share);
        let mut moved = 0.0_f64;
        for i in 0..M {
            let per = self.threshold / (self.friction * path.normal[i]);
            let (sx, sy, sag) = (friction[0][i] * per, friction[1][i] * per, path.sag[i]);
            let x = share * (2.0 * sag * oy[i] - kappa * sx);
            let y = share * (-2.0 * sag * ox[i] - kappa * sy);
            moved = moved.max((x - path.offset[0][i]).abs()).max((y - path.offset[1][i]).abs());
            (path.offset[0][i], path.offset[1][i]) = (x, y);
            (path.slip[0][i], path.slip[1][i]) = (sx, sy);
            let (turn_x, turn_y) = (x + sx, y + sy);
            rate[0][i] +=
                share * (sag * (ox[i] * oz[i] - ay[i]) + oz[i] * (2.0 * y + kappa * turn_y));
            rate[1][i] +=
                share * (sag * (oy[i] * oz[i] + ax[i]) - oz[i] * (2.0 * x + kappa * turn_x));
            rate[2][i] -= (ox[i] * turn_x + oy[i] * turn_y) / self.radius;
        }
        moved
    }

    /// Computes the state at the end, and the largest values.
    #[inline(always)]
    fn finish<const M: usize>(
        &self,
        window: &Window<'_, M>,
        rung: Rung,
        friction: &[[f64; M]; 2],
        path: &mut Path<M>,
    ) {
        let Window { nodes, plate, start, half } = window;
        for a in 0..2 {
            path.end[a] = start[a] + nodes.whole(&path.velocity(a), *half);
        }
        for a in 0..3 {
            path.end[2 + a] = start[2 + a] + nodes.whole(&path.rate[a], *half);
        }
        if rung < Rung::Sagging {
            path.end[5] = self.slow_sag(window, path);
        }
        let worst = &mut path.worst;
        let mut least_normal = f64::INFINITY;
        let (mut demand, mut normal, mut turn, mut twist, mut alpha) =
            ([0.0; M], 0.0, 0.0, 0.0, 0.0);
        let mut growth = [0.0; M];
        for i in 0..M {
            let needed = friction[0][i].abs().max(friction[1][i].abs());
            let n = path.normal[i];
            demand[i] = if n > 0.0 { needed / (self.friction * n) } else { f64::INFINITY };
            normal = f64::max(normal, n);
            least_normal = f64::min(least_normal, n);
            let [ox, oy, oz] = [0, 1, 2].map(|a| plate.omega[a][i]);
            let [ax, ay, az] = [0, 1, 2].map(|a| plate.alpha[a][i]);
            let square = ox * ox + oy * oy + oz * oz;
            turn = f64::max(turn, square);
            twist = f64::max(twist, oz.abs());
            alpha = f64::max(alpha, ax * ax + ay * ay + az * az);
            growth[i] = square + self.share * az.abs();
        }
        worst.demand = demand.into_iter().fold(0.0, |a, b| if b > a || b.is_nan() { b } else { a });
        worst.sure = demand.iter().take_while(|&&demand| demand < SURE_TO_ROLL).count();
        worst.first_demand = demand[0];
        (worst.first_normal, worst.last_normal) = (path.normal[0], path.normal[M - 1]);
        worst.least_normal = least_normal;
        (worst.normal, worst.turn, worst.twist, worst.alpha) =
            (normal, turn.sqrt(), twist, alpha.sqrt());
        worst.growth = nodes.whole(&growth, 0.5);
    }

    /// Returns the slow sag at the end of a window in which it has no effect yet. In a window
    /// of four nodes its load hardly changes.
    #[inline(always)]
    fn slow_sag<const M: usize>(&self, window: &Window<'_, M>, path: &Path<M>) -> f64 {
        let settled = path.normal.map(|n| self.sag_per_normal * n);
        let (start, length) = (window.start[5], 2.0 * window.half);
        let [slow, _] = self.decay;
        if M > 4 && slow * length < MOST_DECAYS {
            let decay = SagDecay::new(window.nodes, self.decay, window.half);
            return decay.slow(window.nodes, &settled, start).1;
        }
        // The start is forgotten: the settled sag at the end, and how far behind it the slow
        // sag is.
        let at = &window.nodes.at;
        let rise = (settled[M - 1] - settled[M - 2]) / (at[M - 1] - at[M - 2]);
        let behind = rise / (slow * window.half);
        let forgotten = 1.0 - (-slow * length).exp();
        let end = settled[M - 1] + rise * (1.0 - at[M - 1]) - behind * forgotten;
        end + (start - settled[0]) * (1.0 - forgotten)
    }

    /// Returns bounds of what creep and sag, left out, change in a window: v − U, m/s, and
    /// the acceleration, m/s².
    pub(super) fn left_out(&self, worst: &Worst) -> [f64; 2] {
        let (slip, sag) =
            (SQRT_2 * self.threshold * worst.demand, self.sag_per_normal * worst.normal);
        let offset = self.share * (self.kappa * slip + 2.0 * sag * worst.turn);
        let turned = offset + slip;
        let acceleration =
            self.share * (sag * worst.shake() + worst.twist * (2.0 * offset + self.kappa * turned));
        [offset, acceleration]
    }
}

impl BallContact {
    /// Returns bounds of the errors of the creeping ball, of position, m, which does not
    /// add up, and of velocity, m/s. Its offsets lag behind by their settling times, so
    /// that the position falls behind by the product. A sag that is not there yet changes
    /// the lever of the plate's acceleration.
    pub(super) fn creeping_lag(&self, worst: &Worst, slow: f64) -> [f64; 2] {
        let sag = 2.0 * self.share * self.sag_per_normal * worst.normal * worst.turn;
        let lever = self.share * self.unsettled(worst, slow) * worst.shake();
        [sag * self.sag_lag + self.creeping_part(worst), lever * self.sag_lag]
    }

    /// Returns the largest difference of the sag from the settled one, m, in a window that
    /// starts with the slow sag `slow`.
    fn unsettled(&self, worst: &Worst, slow: f64) -> f64 {
        let [most, least] = [worst.normal, worst.least_normal].map(|n| self.sag_per_normal * n);
        (most - slow).max(slow - least).max(most - least)
    }

    fn creeping_part(&self, worst: &Worst) -> f64 {
        let creep = self.share * self.kappa * SQRT_2 * self.threshold * worst.demand;
        creep * self.creep_lag(worst.least_normal)
    }

    /// Returns bounds as [`Self::creeping_lag`] of the sagging ball: its sag has the right
    /// delay, but not the right second moment, 1/λ₂², and creep follows m·n instead of
    /// F_z.
    pub(super) fn sagging_lag(&self, worst: &Worst, slow_sag: f64) -> [f64; 2] {
        let [slow, fast] = self.decay;
        let sag = self.sag_per_normal * worst.normal;
        let (late, unsettled) = (slow / (fast * fast), self.unsettled(worst, slow_sag));
        let sunk =
            2.0 * self.share * (sag * worst.alpha / (fast * fast) + unsettled * worst.turn * late);
        let creep = self.share * self.kappa * SQRT_2 * self.threshold * worst.demand;
        let pressed = creep * slow * unsettled / worst.least_normal;
        let lever = self.share * unsettled * worst.shake();
        [sunk + pressed + self.creeping_part(worst), lever * late]
    }

    /// Returns a bound of the error of position, m, of a window at whose start the contact
    /// carries the normal force per mass `carried`, m/s². The force tends to what is needed
    /// by exp(−λ₂·t); until it suffices, the ball slips; then friction stops the slip with
    /// what it has in excess.
    pub(super) fn settling(&self, worst: &Worst, carried: f64) -> f64 {
        let (demand, normal) = (worst.first_demand, worst.first_normal);
        if demand * normal <= carried {
            return 0.0;
        }
        let until = ((normal - carried) / (normal * (1.0 - demand))).ln() / self.decay[1];
        let needed = SQRT_2 * self.friction * demand * normal;
        needed * until * until / (4.0 * (1.0 - demand))
    }

    /// Returns a bound of the error of position, m, while a slip of `slip` m/s at the start
    /// settles.
    pub(super) fn stopping(&self, worst: &Worst, slip: f64) -> f64 {
        self.share * self.kappa * slip * self.creep_lag(worst.first_normal)
    }

    /// Returns the normal force per mass that the contact carries at the depth `sag` at rest,
    /// m/s².
    pub(super) fn carried(&self, sag: f64) -> f64 {
        sag / self.sag_per_normal
    }
}

impl<const M: usize> Path<M> {
    /// Returns the velocity along x or y at the nodes, m/s.
    #[inline(always)]
    pub(super) fn velocity(&self, axis: usize) -> [f64; M] {
        let mut v = self.free[axis];
        for i in 0..M {
            v[i] += self.offset[axis][i];
        }
        v
    }
}

/// Integrates the rates to velocities, spin and positions at the nodes.
#[inline(always)]
fn integrate<const M: usize>(window: &Window<'_, M>, path: &mut Path<M>) {
    let Window { nodes, start, half, .. } = window;
    for a in 0..3 {
        path.free[a] = nodes.integrals(&path.rate[a], *half);
        for i in 0..M {
            path.free[a][i] += start[2 + a];
        }
    }
    for a in 0..2 {
        path.position[a] = nodes.integrals(&path.velocity(a), *half);
        for i in 0..M {
            path.position[a][i] += start[a];
        }
    }
}
