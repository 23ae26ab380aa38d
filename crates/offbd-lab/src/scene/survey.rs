//! A cheap look at a scene before it is run: what the contact will have to
//! bear, and what the smaller models leave out.
//!
//! The plate is looked at a few times per shortest time of its law, with the
//! ball where it starts. That costs less than the cheapest run.

use nalgebra::Vector2;

use super::drive::{Drive, Seen};
use super::{Scene, Subject};
use crate::models::Creeping;
use offbd_core::plant::{Ball, Grip, Motion, Planar, Rolling, RollingState, Tilt};

/// Looks per shortest time of the plate's law.
const LOOKS_PER_TIME: f64 = 4.0;

/// Most looks at one scene; a longer one is looked at more sparsely.
const MOST_LOOKS: f64 = 64.0;

/// A body that starts within this of the plate starts on it, m.
const ON_THE_PLATE_M: f64 = 1e-3;

/// What the survey found; errors are estimates of the worst error of position
/// over the scene against the compliant model, m.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Survey {
    /// Largest part of the friction limit in use; above 1 the ball slips.
    pub demand: f64,
    /// Whether the body starts on the plate, not slipping more than it creeps.
    pub starts_rolling: bool,
    /// Error of small angles, m.
    pub planar_error_m: f64,
    /// Step that keeps a held angle within a metre of the moving one, s: the
    /// error goes with the square of the step.
    pub planar_step_s: f64,
    /// Error of a model without creep and sag, m.
    pub rolling_error_m: f64,
    /// Error of the creeping model, m.
    pub creeping_error_m: f64,
}

impl Survey {
    /// Looks at `scene` under `drive`.
    pub fn of<D: Drive>(scene: &Scene, drive: &mut D) -> Self {
        let mut worst = Worst::default();
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

/// The worst seen so far.
#[derive(Clone, Copy, Debug, Default)]
struct Worst {
    demand: f64,
    /// v − U of the creeping ball by creep, m/s, and by sag.
    creep: f64,
    sink: f64,
    sag: f64,
    /// How long sag and creep take to settle, s.
    settling: [f64; 2],
    angle: f64,
    rate: f64,
    acceleration: f64,
}

impl Worst {
    fn piece<D: Drive>(&mut self, scene: &Scene, drive: &D, from: f64, until: f64, look: f64) {
        let plate = Seen::new(drive, scene.body().mass_kg(), from);
        let n = ((until - from) / look).ceil().max(1.0) as u32;
        for i in 0..=n {
            let t = from + (until - from) * f64::from(i) / f64::from(n);
            self.turn(&drive.tilt(t), drive.push().norm() / scene.body().mass_kg());
            self.look(scene, &plate.at(t));
        }
    }

    /// Notes how far and how fast the plate turns; a push counts as an angle of
    /// any size, for the planar model has none.
    fn turn(&mut self, tilt: &Tilt, push: f64) {
        let angle = if push > 0.0 { f64::INFINITY } else { tilt.angle.norm() };
        self.angle = self.angle.max(angle);
        self.rate = self.rate.max(tilt.rate.norm());
        self.acceleration = self.acceleration.max(tilt.acceleration.norm());
    }

    /// Error of small angles, m, and the step that holding them takes: at worst
    /// the plate is always where it is worst, and the ball as far and as fast
    /// as that drives it.
    fn planar(&self, scene: &Scene) -> (f64, f64) {
        let (Subject::Ball(ball), t) = (&scene.subject, scene.duration_s) else {
            return (f64::INFINITY, 0.0);
        };
        let (at, gain) = (&scene.initial, ball.rolling_gravity());
        let speed = at.velocity.norm() + gain * self.angle * t;
        let state = RollingState {
            position: Vector2::new(at.position.xy().norm() + speed * t, 0.0),
            velocity: Vector2::new(speed, 0.0),
            spin: at.spin.z,
        };
        let worst = |size: f64| Vector2::new(size, 0.0);
        let tilt = Tilt {
            angle: worst(self.angle),
            rate: worst(self.rate),
            acceleration: worst(self.acceleration),
        };
        let left_out = Planar::new(ball, &scene.plate).left_out(&state, &tilt);
        // The midpoint rule loses h²/24 of the change of the rate, twice the
        // largest at most, and the ball carries the velocity to the end.
        let step = (12.0 / (gain * self.rate * t)).sqrt();
        (left_out * t * t / 2.0, step)
    }

    fn look(&mut self, scene: &Scene, plate: &offbd_core::plant::PlateMotion) {
        let at = &scene.initial;
        match &scene.subject {
            Subject::Ball(ball) => {
                let creeping = Creeping::new(ball, &scene.plate, &scene.contact);
                let y = creeping.enter(at, plate);
                let grip = Rolling::new(ball, &scene.plate).grip(&y, plate);
                let give = creeping.give(&grip, plate);
                let sink = 2.0 * give.sag * plate.omega.xy().norm() / (1.0 + ball.inertia_factor());
                let creep = give.slip[0].hypot(give.slip[1]) * creeping_share(ball);
                self.note(scene, &grip, [creep, sink], give.sag);
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
        // The trade adds up over the scene at worst, and half again as much
        // because the ball is looked at where it starts only; what each part
        // lags behind by its settling time is the creeping model's error.
        let parts = [self.sink, self.creep];
        let rolling = 1.5 * (parts[0] + parts[1]) * scene.duration_s + self.sag * self.demand;
        let (planar_error_m, planar_step_s) = self.planar(scene);
        let part = |i: usize| {
            let lag = (std::f64::consts::TAU * self.settling[i] / shortest_time).min(1.0);
            parts[i] * (2.0 * scene.duration_s * lag + 4.0 * self.settling[i])
        };
        let creeping = 1.5 * (part(0) + part(1));
        Survey {
            demand: self.demand,
            starts_rolling: starts_rolling(scene),
            planar_error_m: planar_error_m + rolling,
            planar_step_s,
            rolling_error_m: rolling,
            creeping_error_m: creeping,
        }
    }
}

/// κ/(1 + κ): the part of creep that shows in the velocity.
fn creeping_share(ball: &Ball) -> f64 {
    ball.inertia_factor() / (1.0 + ball.inertia_factor())
}

fn starts_rolling(scene: &Scene) -> bool {
    let (body, at): (_, &Motion) = (scene.body(), &scene.initial);
    let depth = body.rest_height_m() - at.position.z;
    let [x, y] = body.slip(&at.velocity, &at.spin);
    (0.0..ON_THE_PLATE_M).contains(&depth)
        && at.velocity.z == 0.0
        && x.hypot(y) <= scene.contact.slip_threshold_m_s()
}
