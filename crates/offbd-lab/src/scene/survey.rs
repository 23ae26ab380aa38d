//! A cheap survey of a scene before it is run: it estimates the load of the contact and
//! the errors of the simpler models.
//!
//! The plate's motion is evaluated a few times per shortest time scale, with the ball at
//! its start. That costs less than the cheapest run.

use super::drive::{Drive, DrivenPlate};
use super::{Scene, Subject};
use crate::models::Creeping;
use offbd_core::plant::{Ball, Grip, Motion, PlateMotion, Rolling};

/// Evaluations per shortest time scale of the plate's motion; chosen.
const LOOKS_PER_TIME: f64 = 4.0;

/// Maximum number of evaluations of one scene, chosen to bound the cost; a longer scene
/// is evaluated at longer intervals.
const MOST_LOOKS: f64 = 64.0;

/// Maximum friction demand at which the ball counts as rolling, as a fraction of the
/// limit. Chosen below 1 as a margin for the estimates.
pub(super) const SURE_TO_ROLL: f64 = 0.9;

/// Maximum initial depth of a body that starts on the plate, m; chosen: more than the
/// sag of a soft contact.
const ON_THE_PLATE_M: f64 = 1e-3;

/// The result of a survey. Errors are estimates of the largest error of the position over
/// the scene, against the compliant model.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Survey {
    /// Largest fraction of the friction limit in use; above 1 the ball slips.
    pub demand: f64,
    /// Whether the body starts on the plate with no more slip than its creep.
    pub starts_rolling: bool,
    /// Error of the rolling model, which has neither creep nor sag, m.
    pub rolling_error_m: f64,
    /// Error of the creeping model, m.
    pub creeping_error_m: f64,
}

impl Survey {
    /// Surveys `scene` under `drive`.
    pub fn of<D: Drive>(scene: &Scene, drive: &mut D) -> Self {
        let mut worst = WorstCase::default();
        let mut t = 0.0;
        let time = drive.shortest_time_s();
        let look = (time / LOOKS_PER_TIME).max(scene.duration_s / MOST_LOOKS).min(scene.duration_s);
        while t < scene.duration_s {
            let until = drive.begin(t, &scene.initial).min(scene.duration_s);
            worst.piece(scene, drive, t, until, look);
            t = until;
        }
        worst.survey(scene, time)
    }
}

/// The largest values found so far.
#[derive(Clone, Copy, Debug, Default)]
struct WorstCase {
    demand: f64,
    /// v − U of the creeping ball due to creep, m/s.
    creep: f64,
    /// v − U of the creeping ball due to sag, m/s.
    sink: f64,
    /// Depth of the body in the plate, m.
    sag: f64,
    /// Settling times of sag and creep, s.
    settling: [f64; 2],
}

impl WorstCase {
    fn piece<D: Drive>(&mut self, scene: &Scene, drive: &D, from: f64, until: f64, look: f64) {
        let plate = DrivenPlate::new(drive, scene.body().mass_kg(), from);
        let n = ((until - from) / look).ceil().max(1.0) as u32;
        for i in 0..=n {
            let t = from + (until - from) * f64::from(i) / f64::from(n);
            self.look(scene, &plate.at(t));
        }
    }

    fn look(&mut self, scene: &Scene, plate: &PlateMotion) {
        let at = &scene.initial;
        match &scene.subject {
            Subject::Ball(ball) => {
                let creeping = Creeping::new(ball, &scene.plate, &scene.contact);
                let y = creeping.enter(at, plate);
                let grip = Rolling::new(ball, &scene.plate).grip(&y, plate);
                let creep_and_sag = creeping.creep_and_sag(&grip, plate);
                let sink = 2.0 * creep_and_sag.sag * plate.omega.xy().norm()
                    / (1.0 + ball.inertia_factor());
                let creep =
                    creep_and_sag.slip[0].hypot(creep_and_sag.slip[1]) * creeping_share(ball);
                self.note(scene, &grip, [creep, sink], creep_and_sag.sag);
                let settling = creeping.settling_s(grip.normal.max(f64::MIN_POSITIVE));
                self.settling = [0, 1].map(|i| self.settling[i].max(settling[i]));
            }
            Subject::Block(_) => {
                let free = plate.free(&at.position, &at.velocity);
                let grip = Grip { friction: [-free.x, -free.y], normal: -free.z };
                let sag = scene.body().mass_kg() * grip.normal / scene.contact.stiffness_n_per_m();
                let creep = grip.demand(scene.contact.friction()).min(1.0)
                    * scene.contact.slip_threshold_m_s();
                self.note(scene, &grip, [creep * std::f64::consts::SQRT_2, 0.0], sag);
            }
        }
    }

    fn note(&mut self, scene: &Scene, grip: &Grip, [creep, sink]: [f64; 2], sag: f64) {
        self.demand = self.demand.max(grip.demand(scene.contact.friction()));
        (self.creep, self.sink) = (self.creep.max(creep.abs()), self.sink.max(sink));
        self.sag = self.sag.max(sag);
    }

    fn survey(&self, scene: &Scene, shortest_time: f64) -> Survey {
        // At worst, v − U adds up over the scene; the factor 1.5 is a margin, because the
        // ball is evaluated at its start only. The creeping model's error is the lag of
        // each part by its settling time.
        let parts = [self.sink, self.creep];
        let rolling = 1.5 * (parts[0] + parts[1]) * scene.duration_s + self.sag * self.demand;
        let part = |i: usize| {
            let lag = (std::f64::consts::TAU * self.settling[i] / shortest_time).min(1.0);
            parts[i] * (2.0 * scene.duration_s * lag + 4.0 * self.settling[i])
        };
        let creeping = 1.5 * (part(0) + part(1));
        Survey {
            demand: self.demand,
            starts_rolling: starts_rolling(scene),
            rolling_error_m: rolling,
            creeping_error_m: creeping,
        }
    }
}

/// Returns κ/(1 + κ), the share of the creep that appears in the velocity.
fn creeping_share(ball: &Ball) -> f64 {
    ball.inertia_factor() / (1.0 + ball.inertia_factor())
}

pub(super) fn starts_rolling(scene: &Scene) -> bool {
    let (body, at): (_, &Motion) = (scene.body(), &scene.initial);
    let depth = body.rest_height_m() - at.position.z;
    let [x, y] = body.slip(&at.velocity, &at.spin);
    (0.0..ON_THE_PLATE_M).contains(&depth)
        && at.velocity.z == 0.0
        && x.hypot(y) <= scene.contact.slip_threshold_m_s()
}
