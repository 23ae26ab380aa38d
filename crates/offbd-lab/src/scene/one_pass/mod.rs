//! Runs a scene in one pass within a wanted accuracy, without a reference and without a
//! search.
//!
//! The run starts on the cheapest model. While it goes, a bound of its error is carried
//! along: what the model leaves out, what the method leaves out, and how the linearised
//! motion lets both grow until the end. Where the bound would be exceeded, the next
//! better model takes over, from the same state:
//!
//! 1. The ball rolls, creeps or sags (`window.rs`): Gauss–Legendre windows of up to one
//!    period of the plate, or a whole piece in which it stands still, of 4 to 24 nodes.
//! 2. From where it slips or flies, the rigid model to the end, if the contact is stiff and
//!    the bound allows it (`slide.rs`).
//! 3. Otherwise from there the compliant model by RODAS, to the end.

mod bound;
mod nodes;
mod slide;
mod window;

use std::f64::consts::PI;

use nalgebra::Vector3;

use super::configuration::{Configuration, Method, Model, Pace};
use super::drive::{Drive, DrivenPlate, PlateNodes};
use super::run::{RunOutcome, SceneRunner};
use super::samples::Samples;
use super::stepping::{MOST_STEPS, RunStatistics};
use super::survey::{SURE_TO_ROLL, starts_rolling};
use super::{Scene, Subject};
use crate::models::Creeping;
use bound::ErrorBound;
use nodes::{EIGHT, FOUR, Legendre, Nodes, SIXTEEN, TWELVE, TWENTY_FOUR};
use offbd_core::plant::{Ball, GRAVITY_M_S2, Motion, PlateMotion};
use slide::Slide;
use window::{BallContact, Path, Rung, SagDecay, State, Window};

/// A stretch of a run with one model and one method.
#[derive(Clone, Debug, PartialEq)]
pub struct Stage {
    pub from_s: f64,
    pub model: &'static str,
    pub method: &'static str,
    /// Why this model begins here.
    pub why: &'static str,
}

/// The result of a run in one pass.
#[derive(Clone, Debug, PartialEq)]
pub struct OnePass {
    pub end: Motion,
    /// Estimate of the largest error of the position (x, y), m. On the plate it is a bound
    /// for a plate that does not follow the ball, and the sliding model adds one of what a
    /// hard contact changes; the contact model adds its method's own estimate, which may
    /// exceed what was wanted although the error does not.
    pub error_m: f64,
    pub stages: Vec<Stage>,
    pub statistics: RunStatistics,
}

impl OnePass {
    /// Returns the names of the model and the method of the last, most accurate stage.
    #[must_use]
    pub fn most_accurate(&self) -> (&'static str, &'static str) {
        self.stages.last().map_or(("", ""), |stage| (stage.model, stage.method))
    }
}

/// No way to keep the tolerance.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[error("no model stays within {tolerance_m:e} m here: {why}")]
pub struct Declined {
    pub tolerance_m: f64,
    pub why: String,
}

/// Share of the wanted accuracy for the windows before the ball leaves the plate; chosen.
const WINDOWS_SHARE: f64 = 0.5;

/// Largest force at the start of a ball on the plate, in weights; chosen: a deeper one is
/// thrown up.
pub(super) const DEEPEST: f64 = 2.0;

/// Maximum number of windows of a run, tried ones included; chosen to bound the time at
/// some tenths of a second.
const MOST_WINDOWS: u64 = 100_000;

/// Attempts at ever finer windows; chosen.
const ATTEMPTS: u32 = 3;

/// Share of the tolerance that a repetition takes of the one that would have sufficed, which
/// counts as at least the second number; chosen.
const REFINED: f64 = 0.5;
const LEAST_REFINED: f64 = 1e-3;

/// Runs `scene` under `drive` so that the position (x, y) stays within `tolerance_m`, in
/// [1e-12, 1], of the compliant model's, and passes samples to `samples`.
///
/// # Errors
/// [`Declined`] if no model keeps the tolerance; samples taken until then remain valid.
pub fn one_pass<D: Drive + Clone>(
    scene: &Scene,
    drive: &mut D,
    tolerance_m: f64,
    mut samples: Option<&mut Samples<'_>>,
) -> Result<OnePass, Declined> {
    let left = match on_the_plate(scene, drive, tolerance_m, samples.as_deref_mut()) {
        Ran::Whole(run) => return Ok(run),
        Ran::Until(left) => left,
    };
    let slide = Slide { scene, tolerance_m, from: &left };
    if let Some(slid) = slide.run(drive, samples.as_deref_mut()) {
        return Ok(left.then(Model::Sliding, Method::Dopri5, slid));
    }
    let Left { at_s, motion, why } = &left.left;
    let declined = |why: String| Declined { tolerance_m, why };
    let pace = Pace::Tolerance(Method::Rodas4.tolerance_to_keep(tolerance_m));
    let by = Configuration::new(Model::Compliant, Method::Rodas4, pace).map_err(|_| {
        declined(format!("{why}, and the contact model would need a tolerance below 1e-12 m"))
    })?;
    let run = SceneRunner::new(MOST_STEPS, scene, &by)
        .compliant_from(*at_s, motion, drive, samples)
        .map_err(|failure| declined(failure.to_string()))?;
    Ok(left.then(Model::Compliant, by.method(), run))
}

/// Begins a stage. It replaces the last stage if both begin at the same time.
fn enter(stages: &mut Vec<Stage>, stage: Stage) {
    stages.pop_if(|last| last.from_s == stage.from_s);
    stages.push(stage);
}

/// Returns whether the ball stays on the plate, so that the run costs little.
pub(super) fn rolls<D: Drive + Clone>(scene: &Scene, drive: &D, tolerance_m: f64) -> bool {
    matches!(on_the_plate(scene, &mut drive.clone(), tolerance_m, None), Ran::Whole(_))
}

/// The motion at which the ball leaves the models on the plate.
struct Left {
    at_s: f64,
    motion: Motion,
    why: &'static str,
}

/// A run on the plate until the ball leaves it.
struct HandOver {
    left: Left,
    /// Bound of the error that it has until the end of the scene, m.
    error_m: f64,
    stages: Vec<Stage>,
    statistics: RunStatistics,
}

impl HandOver {
    /// Returns the whole run, which `run` has ended.
    fn then(self, model: Model, method: Method, run: RunOutcome) -> OnePass {
        let Self { left, error_m, mut stages, statistics: before } = self;
        let (model, method) = (model.name(), method.name());
        enter(&mut stages, Stage { from_s: left.at_s, model, method, why: left.why });
        let error_m = error_m + run.statistics.method_error_m;
        let statistics = RunStatistics {
            steps: before.steps + run.statistics.steps,
            rejected: before.rejected + run.statistics.rejected,
            divided: 0,
            method_error_m: error_m,
        };
        OnePass { end: run.end, error_m, stages, statistics }
    }
}

/// What came of a run on the plate.
enum Ran {
    Whole(OnePass),
    Until(HandOver),
}

impl Ran {
    /// Leaves the whole scene to the contact model.
    fn not_at_all(scene: &Scene, why: &'static str) -> Self {
        let left = Left { at_s: 0.0, motion: scene.initial, why };
        let (stages, statistics) = (Vec::new(), RunStatistics::default());
        Self::Until(HandOver { left, error_m: 0.0, stages, statistics })
    }
}

/// Runs the models on the plate, with windows fine enough for the bound at the end.
fn on_the_plate<D: Drive + Clone>(
    scene: &Scene,
    drive: &mut D,
    tolerance_m: f64,
    samples: Option<&mut Samples<'_>>,
) -> Ran {
    let Subject::Ball(ball) = &scene.subject else {
        return Ran::not_at_all(scene, "a block slides");
    };
    if !starts_rolling(scene) {
        let why = "the ball does not start rolling on the plate";
        return Ran::not_at_all(scene, why);
    }
    let Some(contact) = BallContact::new(ball, &scene.plate, &scene.contact) else {
        return Ran::not_at_all(scene, "the contact oscillates");
    };
    let depth = scene.body().rest_height_m() - scene.initial.position.z;
    if contact.carried(depth) > DEEPEST * GRAVITY_M_S2 {
        return Ran::not_at_all(scene, "the ball starts too deep in the plate");
    }
    let (start, mut target_m) = (drive.clone(), tolerance_m);
    for _ in 0..ATTEMPTS {
        // What may have to be repeated takes no samples.
        let mut pass = Pass::new(scene, (ball, contact), drive, target_m);
        let tried = pass.roll(None);
        let (error_m, share) = (pass.bound_m(), if tried.is_ok() { 1.0 } else { WINDOWS_SHARE });
        let within = share * tolerance_m / error_m;
        if within >= 1.0 {
            let mut tried = tried;
            if let Some(samples) = samples {
                *drive = start;
                pass = Pass::new(scene, (ball, contact), drive, target_m);
                tried = pass.roll(Some(samples));
            }
            return match tried {
                Ok(end) => Ran::Whole(pass.run(end)),
                Err(left) => Ran::Until(pass.until(left)),
            };
        }
        *drive = start.clone();
        target_m *= REFINED * within.max(LEAST_REFINED);
    }
    Ran::not_at_all(scene, "errors grow too fast on the plate")
}

/// Number of sizes of a window: 4, 8, 12, 16 and 24 nodes.
const SIZES: usize = 5;

/// Index of the smallest size that resolves a sag which lags, and its nodes; chosen.
const SAGGING: usize = 3;
const FEWEST_FOR_SAG: usize = 16;

/// Index of the size of the first windows, of one period of the plate, by the wanted
/// accuracy, m; measured on the scene *sine*.
fn first_size(tolerance_m: f64) -> usize {
    if tolerance_m >= 1e-3 {
        1
    } else if tolerance_m >= 1e-5 {
        2
    } else {
        3
    }
}

/// Longest window of the sagging ball, in decays of its slow sag; chosen.
const DECAYS: f64 = 4.0;

/// Shares of the wanted accuracy for what a model leaves out, for lags, for the method and
/// for sweeps; chosen.
const MODEL_SHARE: f64 = 0.4;
const LAG_SHARE: f64 = 0.2;
const METHOD_SHARE: f64 = 0.3;
const SWEEP_SHARE: f64 = 0.03;

/// Shortest window, as a share of the plate's shortest time, before the contact model
/// takes over; chosen.
const SHORTEST_PART: f64 = 1.0 / 16.0;

/// A run on the plate in progress.
struct Pass<'a, D> {
    scene: &'a Scene,
    drive: &'a mut D,
    ball: BallContact,
    creeping: Creeping,
    /// The windows' tolerance, m.
    target: f64,
    t: f64,
    state: State,
    /// Start of the current piece, s, with the motion there: creep and sag are still those
    /// of the piece before.
    entered: (f64, Motion),
    /// Normal force per mass that the contact carries, m/s².
    carried: f64,
    rung: Rung,
    size: usize,
    bound: ErrorBound,
    stages: Vec<Stage>,
    statistics: RunStatistics,
}

/// What came of a window.
enum Tried {
    Taken,
    /// The window is too long for its nodes.
    TooCoarse,
    /// A better model has been entered, which needs other windows.
    Again,
    /// The ball does not stay on the plate, or does not roll, within this window. A window of
    /// this share of it may do.
    Leaves(&'static str, f64),
    /// No shorter window would help.
    Ends(&'static str),
}

impl<'a, D: Drive> Pass<'a, D> {
    fn new(
        scene: &'a Scene,
        (ball, contact): (&Ball, BallContact),
        drive: &'a mut D,
        target: f64,
    ) -> Self {
        Self {
            scene,
            drive,
            ball: contact,
            creeping: scene.creeping(ball),
            target,
            t: 0.0,
            state: [0.0; 6],
            entered: (0.0, scene.initial),
            carried: 0.0,
            rung: Rung::Rolling,
            size: first_size(target),
            bound: ErrorBound::default(),
            stages: Vec::new(),
            statistics: RunStatistics::default(),
        }
    }

    /// Returns the bound of the error, until the end of the scene, m.
    fn bound_m(&self) -> f64 {
        self.bound.after(self.scene.duration_s - self.t)
    }

    fn run(self, end: Motion) -> OnePass {
        let error_m = self.bound_m();
        let statistics = RunStatistics { method_error_m: error_m, ..self.statistics };
        OnePass { end, error_m, stages: self.stages, statistics }
    }

    fn until(self, left: Left) -> HandOver {
        let error_m = self.bound_m();
        HandOver { left, error_m, stages: self.stages, statistics: self.statistics }
    }

    /// Runs until the end, or until the ball does not stay on the plate.
    fn roll(&mut self, mut samples: Option<&mut Samples<'_>>) -> Result<Motion, Left> {
        let end = self.scene.duration_s;
        let initial = self.scene.initial;
        let mut until = self.drive.begin(0.0, &initial).min(end);
        let plate = DrivenPlate::new(&*self.drive, self.scene.body().mass_kg(), 0.0).at(0.0);
        let [x, y, u, v, w] = self.creeping.enter(&initial, &plate);
        self.state = [x, y, u, v, w, self.scene.body().rest_height_m() - initial.position.z];
        if let Some(samples) = samples.as_deref_mut() {
            samples.take(0.0, |_| initial);
        }
        self.carried = self.ball.carried(self.state[5]);
        self.enter(Rung::Rolling);
        loop {
            self.piece(until, samples.as_deref_mut())?;
            if self.t >= end {
                return Ok(self.motion());
            }
            self.entered = (self.t, self.motion());
            until = self.drive.begin(self.t, &self.entered.1).min(end);
        }
    }

    fn enter(&mut self, rung: Rung) {
        self.rung = rung;
        let (from_s, method) = (self.t, "collocation");
        let (model, why) = match rung {
            Rung::Rolling => ("rolling", "the cheapest model"),
            Rung::Creeping => ("creeping", "creep and sag of the contact count"),
            Rung::Sagging => ("sagging", "the sag lags behind its load"),
        };
        enter(&mut self.stages, Stage { from_s, model, method, why });
    }

    /// Returns the ball's motion now.
    fn motion(&self) -> Motion {
        let plate = DrivenPlate::new(&*self.drive, self.scene.body().mass_kg(), self.t).at(self.t);
        let y: [f64; 5] = std::array::from_fn(|i| self.state[i]);
        let mut at = self.creeping.leave(&y, &plate);
        let [slow, fast] = self.ball.decay;
        let lag = self.scene.body().rest_height_m() - at.position.z - self.state[5];
        self.sink(&mut at, self.state[5] - slow / fast * lag, &plate);
        at.velocity.z = -slow * lag;
        at
    }

    /// Moves a ball with a settled sag to the depth `sag`, m.
    fn sink(&self, at: &mut Motion, sag: f64, plate: &PlateMotion) {
        let height = self.scene.body().rest_height_m();
        let turn = 2.0 * self.ball.share * (sag - (height - at.position.z));
        at.position.z = height - sag;
        at.velocity += Vector3::new(turn * plate.omega.y, -turn * plate.omega.x, 0.0);
        at.spin += Vector3::new(turn * plate.omega.x, turn * plate.omega.y, 0.0) / self.ball.radius;
    }

    /// Runs one piece of the drive, up to `until`.
    fn piece(&mut self, until: f64, mut samples: Option<&mut Samples<'_>>) -> Result<(), Left> {
        let time = self.drive.shortest_time_s();
        let still = self.drive.is_still();
        let whole = if still { f64::INFINITY } else { time };
        let mut longest = whole;
        let mut size = if still { 0 } else { self.size };
        while self.t < until {
            if self.rung == Rung::Sagging && !still {
                longest = longest.min(DECAYS / self.ball.decay[0]);
                size = size.max(SAGGING);
            }
            let left = until - self.t;
            let n = (left / longest - 1e-9).ceil().max(1.0);
            let half = left / n / 2.0;
            let last = n == 1.0;
            let end = if last { until } else { self.t + 2.0 * half };
            let samples = samples.as_deref_mut();
            let tried = match size {
                0 => self.window(&FOUR, half, end, still, last, samples),
                1 => self.window(&EIGHT, half, end, still, last, samples),
                2 => self.window(&TWELVE, half, end, still, last, samples),
                3 => self.window(&SIXTEEN, half, end, still, last, samples),
                _ => self.window(&TWENTY_FOUR, half, end, still, last, samples),
            };
            let tries = self.statistics.steps + self.statistics.rejected;
            if tries >= MOST_WINDOWS || self.t + half <= self.t {
                return Err(self.leave("the motion needs too many windows"));
            }
            let shortest = SHORTEST_PART * time.min(until - self.entered.0);
            match tried {
                Tried::Taken => {
                    self.statistics.steps += 1;
                    longest = (2.0 * longest).min(whole);
                    continue;
                }
                Tried::Again => {}
                Tried::TooCoarse if size + 1 < SIZES => {
                    size += 1;
                    self.size = size.max(self.size);
                }
                Tried::TooCoarse if half * 2.0 > shortest => longest = half,
                Tried::Leaves(_, share) if half * 4.0 * share > shortest => {
                    longest = half * 2.0 * share;
                }
                Tried::Leaves(why, _) | Tried::Ends(why) => return Err(self.leave(why)),
                Tried::TooCoarse => return Err(self.leave("the motion is too fast for windows")),
            }
            self.statistics.rejected += 1;
        }
        Ok(())
    }

    fn leave(&self, why: &'static str) -> Left {
        let (entered_s, entered) = self.entered;
        let motion = if self.t == entered_s { entered } else { self.motion() };
        Left { at_s: self.t, motion, why }
    }

    /// Tries the window up to `end` with these nodes.
    #[inline(always)]
    fn window<const M: usize>(
        &mut self,
        nodes: &Nodes<M>,
        half: f64,
        end: f64,
        still: bool,
        last: bool,
        samples: Option<&mut Samples<'_>>,
    ) -> Tried {
        let (length, left) = (2.0 * half, self.scene.duration_s - self.t);
        let push = self.drive.push() / self.scene.body().mass_kg();
        let plate = if still {
            PlateNodes::still(&self.drive.tilt(self.t).motion())
        } else {
            self.drive.nodes(&nodes.at.map(|s| self.t + half * (1.0 + s)))
        };
        let window = Window { nodes, plate: plate.pushed(push), start: self.state, half };
        // Allowed error per second of the scene, m/s.
        let allowed = self.target / self.scene.duration_s;
        // As errors have grown so far; the bound at the end has the last word.
        let [same, over] = bound::growth(self.bound.mean_square(), left);
        let settled = SWEEP_SHARE * allowed / (left * over);
        let mut path = self.ball.guess(&window.plate);
        let mut rung = if still { self.rung.min(Rung::Creeping) } else { self.rung };
        let mut added;
        loop {
            let decay =
                (rung == Rung::Sagging).then(|| SagDecay::new(nodes, self.ball.decay, half));
            self.ball.sweep(&window, rung, decay.as_ref(), settled, &mut path);
            if path.worst.demand.is_nan() || path.worst.demand >= SURE_TO_ROLL {
                let flies = path.worst.demand == f64::INFINITY;
                let why = if flies { "the ball flies" } else { "the ball slips" };
                let sure = path.worst.sure.checked_sub(1).map_or(0.0, |i| 1.0 + nodes.at[i]);
                return Tried::Leaves(why, sure / 2.0);
            }
            if path.unsettled > settled || path.unsettled.is_nan() {
                return Tried::TooCoarse;
            }
            if let Some(why) = self.ends(&path, still, [self.t, end], last) {
                return Tried::Leaves(why, 0.5);
            }
            added = bound::WindowError::default();
            let model = match rung {
                Rung::Rolling => {
                    let [offset, acceleration] = self.ball.left_out(&path.worst);
                    added.position = offset * length;
                    added.velocity = acceleration * length;
                    let rate = offset * same + acceleration * left * over;
                    rate <= MODEL_SHARE * allowed
                }
                Rung::Creeping | Rung::Sagging => {
                    let sags = rung == Rung::Sagging;
                    let [passing, velocity] = if sags {
                        self.ball.sagging_lag(&path.worst, self.state[5])
                    } else {
                        self.ball.creeping_lag(&path.worst, self.state[5])
                    };
                    // A lag is a displacement, which then grows as others do.
                    added.velocity = velocity + path.worst.growth * length * passing;
                    added.passing = passing;
                    let most = if sags { MODEL_SHARE } else { LAG_SHARE } * self.target;
                    passing * same + velocity * left * over <= most
                }
            };
            if model {
                break;
            }
            rung = match rung {
                Rung::Rolling => Rung::Creeping,
                Rung::Creeping if !still => Rung::Sagging,
                _ => return Tried::Ends("the contact settles too slowly"),
            };
            if rung == Rung::Sagging && !self.resolves_the_sag::<M>(length) {
                self.enter(rung);
                return Tried::Again;
            }
        }
        let (tail, inside) = tails(nodes, &path, half);
        let local = (tail[1] * left * over + tail[0]) * same.max(1.0);
        if !(local <= METHOD_SHARE * allowed * length && inside <= METHOD_SHARE * self.target) {
            return Tried::TooCoarse;
        }
        added.position += tail[0];
        added.velocity += tail[1] + path.unsettled * length;
        added.passing += inside;
        if self.t == self.entered.0 {
            // The plate's acceleration jumps here, the force of the contact does not.
            let mut settling = self.ball.settling(&path.worst, self.carried);
            if self.t == 0.0 {
                let Motion { velocity, spin, .. } = &self.scene.initial;
                let [x, y] = self.scene.body().slip(velocity, spin);
                settling += self.ball.stopping(&path.worst, x.hypot(y));
            }
            if settling * same > LAG_SHARE * self.target {
                return Tried::Ends("the ball slips while the contact settles");
            }
            added.position += settling;
        }
        self.take(&window, &path, rung, end, added, samples);
        Tried::Taken
    }

    /// Returns whether windows of this length and `M` nodes resolve a sag that lags.
    fn resolves_the_sag<const M: usize>(&self, length: f64) -> bool {
        M >= FEWEST_FOR_SAG && length <= DECAYS / self.ball.decay[0] * (1.0 + 1e-9)
    }

    /// Returns why the ball leaves the plate, or slips, where the nodes do not show it: at
    /// an edge of the plate, or where a piece of the drive begins or ends, at which its
    /// acceleration is often largest.
    #[inline]
    fn ends<const M: usize>(
        &self,
        path: &Path<M>,
        still: bool,
        [from, end]: [f64; 2],
        last: bool,
    ) -> Option<&'static str> {
        if self.scene.edges {
            let ground = self.scene.ground();
            let [x, y] = &path.position;
            // Between two nodes the path is bent by at most this.
            let fastest =
                (0..M).map(|i| path.rate[0][i].hypot(path.rate[1][i])).fold(0.0, f64::max);
            let gap = PI * (end - from) / 2.0 / M as f64;
            let least = self.target + fastest * gap * gap / 8.0;
            let within = (0..M).all(|i| ground.margin_m(x[i], y[i]) > least)
                && ground.margin_m(path.end[0], path.end[1]) > least;
            if !within {
                return Some("the ball passes the edge");
            }
        }
        let slips = |first: bool, t, state| first && self.slips_at(t, state);
        let begins = from == self.entered.0;
        (!still && (slips(begins, from, &self.state) || slips(last, end, &path.end)))
            .then_some("the ball slips")
    }

    /// Returns whether a ball in this state would slip or fly.
    fn slips_at(&self, t: f64, state: &State) -> bool {
        let plate = DrivenPlate::new(&*self.drive, self.scene.body().mass_kg(), t).at(t);
        let y: [f64; 5] = std::array::from_fn(|i| state[i]);
        let demand = self.creeping.rolling().grip(&y, &plate).demand(self.ball.friction);
        demand.is_nan() || demand >= SURE_TO_ROLL
    }

    /// Takes the window that ends at `end`.
    #[inline(always)]
    fn take<const M: usize>(
        &mut self,
        window: &Window<'_, M>,
        path: &Path<M>,
        rung: Rung,
        end: f64,
        added: bound::WindowError,
        samples: Option<&mut Samples<'_>>,
    ) {
        if rung > self.rung {
            self.enter(rung);
        }
        self.carried = path.worst.last_normal;
        self.bound.carry(path.worst.growth, 2.0 * window.half, &added);
        if let Some(samples) = samples {
            let (start, half) = (self.t, window.half);
            let mut series = None;
            let whole = samples.whole_motions();
            samples.take(end, |within| {
                let series = series.get_or_insert_with(|| WindowSeries::of(window, path));
                let s = within.map_or(1.0, |t| (t - start) / half - 1.0);
                let legendre = Legendre::at(s);
                if whole {
                    let at = start + half * (1.0 + s);
                    self.sample(at, series, &legendre, rung)
                } else {
                    let [x, y] = series.position(&legendre);
                    Motion { position: Vector3::new(x, y, 0.0), ..Motion::default() }
                }
            });
        }
        (self.t, self.state) = (end, path.end);
    }

    /// Returns the motion at the time `t` within a window, at which `legendre` is.
    fn sample<const M: usize>(
        &self,
        t: f64,
        series: &WindowSeries<M>,
        legendre: &Legendre<M>,
        rung: Rung,
    ) -> Motion {
        let [x, y] = series.position(legendre);
        let [u, v, w] = [0, 1, 2].map(|a| legendre.value(&series.free[a]));
        let plate = DrivenPlate::new(&*self.drive, self.scene.body().mass_kg(), t).at(t);
        let mut at = self.creeping.leave(&[x, y, u, v, w], &plate);
        if rung == Rung::Sagging {
            self.sink(&mut at, legendre.value(&series.sag), &plate);
        }
        at
    }
}

/// The motion in a window as Legendre series.
struct WindowSeries<const M: usize> {
    start: [f64; 2],
    half: f64,
    velocity: [[f64; M]; 2],
    free: [[f64; M]; 3],
    sag: [f64; M],
}

impl<const M: usize> WindowSeries<M> {
    fn of(window: &Window<'_, M>, path: &Path<M>) -> Self {
        let Window { nodes, start, half, .. } = window;
        Self {
            start: [start[0], start[1]],
            half: *half,
            velocity: [0, 1].map(|a| nodes.coefficients(&path.velocity(a))),
            free: [0, 1, 2].map(|a| nodes.coefficients(&path.free[a])),
            sag: nodes.coefficients(&path.sag),
        }
    }

    fn position(&self, legendre: &Legendre<M>) -> [f64; 2] {
        [0, 1].map(|a| self.start[a] + self.half * legendre.integral(&self.velocity[a]))
    }
}

/// Returns estimates of what the series of a window leaves out: of position, m, and of
/// velocity, m/s, at its end, and of positions within it, m.
///
/// At the end, Gauss's quadrature is exact up to degree 2M − 1: its error is that of a
/// series of twice the length.
#[inline(always)]
fn tails<const M: usize>(nodes: &Nodes<M>, path: &Path<M>, half: f64) -> ([f64; 2], f64) {
    let (mut end, mut inside) = ([0.0; 2], 0.0_f64);
    for a in 0..2 {
        let [rate, at_end] = tail(nodes, &path.rate[a]);
        end[1] += at_end * 2.0 * half;
        inside = inside.max(4.0 * rate * half * half / (M * M) as f64);
        let [offset, at_end] = tail(nodes, &path.offset[a]);
        end[0] += at_end * 2.0 * half;
        inside = inside.max(2.0 * offset * half / M as f64);
    }
    end[0] += end[1] * half;
    (end, inside)
}

/// Returns the size of the last Legendre coefficients of `f`, and of those that would
/// follow after as many again.
#[inline(always)]
fn tail<const M: usize>(nodes: &Nodes<M>, f: &[f64; M]) -> [f64; 2] {
    let [last, before, middle] = [M - 1, M - 2, M / 2 - 1].map(|n| nodes.coefficient(n, f).abs());
    let top = last.max(before);
    let fall = (top / middle.max(f64::MIN_POSITIVE)).min(1.0);
    [top, top * fall * fall]
}
