//! Searches the dead time and the lag of one axis.
//!
//! A coarse grid and a first refinement follow the planar model over the windows with
//! most motion. The twin then settles both over all windows. A refinement takes the paths
//! as linear in small changes of dead time and lag (Gauss–Newton), since the cost itself,
//! with its trimming, costs next to nothing once the paths are known.

#[cfg(not(feature = "std"))]
use crate::no_std::*;
use core::ops::Range;

use nalgebra::Vector3;

use super::commanded::{CommandedPath, PathPoint};
use super::fit::{AxisFit, Fitter, Window, WindowSums, explain};
use super::recording::Recording;
use crate::diagnosis::Profile;
use crate::plant::ServoModel;

/// Dead times of the grid, s.
const DEAD_TIMES_S: [f64; 7] = [0.0, 0.03, 0.06, 0.1, 0.15, 0.2, 0.3];
/// Lags of the grid, s.
const LAGS_S: [f64; 6] = [0.01, 0.03, 0.06, 0.1, 0.15, 0.22];
/// Motion that the grid and the first refinement look at, s. Chosen: with a minute,
/// and with a quarter of one, it ends within reach of the twin's refinement as well.
const LOOKED_AT_S: f64 = 30.0;
/// Length of the pieces of which that is made up, s: several times what a servo must be
/// followed for before.
const PIECE_S: f64 = 10.0;
/// Dead time and lag, s, by which the motion of the pieces is compared: of the middle of the
/// grid. Chosen.
const TYPICAL_S: (f64, f64) = (0.1, 0.06);
/// Difference of lags from which the effect of a change is taken, s.
const LAG_STEP_S: f64 = 1e-3;
/// Largest change of dead time or lag for which the paths are taken as linear, s. Chosen:
/// in a motion of 5 rad/s the quadratic part is 2 % of the path.
const REACH_S: f64 = 0.04;
/// Change of dead time or lag below which the linear paths are the paths, s: in a motion
/// of 10 rad/s the quadratic part is 0.02 % of the path.
const NEAR_S: f64 = 0.002;
/// Most rounds of one refinement, of which two or three are common.
const MOST_ROUNDS: usize = 12;
/// First step of dead time and lag within a round, s. Chosen.
const FIRST_STEP_S: f64 = 0.02;
/// Step of dead time and lag at which the search ends, s. Chosen.
const FINEST_STEP_S: f64 = 0.001;
/// Directions of the search. Dead time and lag trade off along a narrow valley, so it is
/// also searched diagonally.
const DIRECTIONS: [(f64, f64); 10] = [
    (1.0, 0.0),
    (-1.0, 0.0),
    (0.0, 1.0),
    (0.0, -1.0),
    (1.0, -1.0),
    (-1.0, 1.0),
    (2.0, -1.0),
    (-2.0, 1.0),
    (1.0, -2.0),
    (-1.0, 2.0),
];

/// The dead time and the lag with the least cost, and the fit of the twin there.
pub(super) struct Found {
    pub(super) dead_time_s: f64,
    pub(super) lag_s: f64,
    pub(super) fit: AxisFit,
}

/// Searches the dead time and the lag with the least cost; `None` if the ball's motion
/// does not tell them.
pub(super) fn search(fitter: &Fitter<'_>) -> Option<Found> {
    let searched = Searched::new(fitter);
    let looked_at = searched.with_most_motion();
    let coarse = searched.coarse(&looked_at)?;
    let near = searched.refine(coarse, &DIRECTIONS, |at| searched.twin_changes(&looked_at, at))?;
    let all = searched.all();
    searched
        .refine((near.dead_time_s, near.lag_s), &DIRECTIONS, |at| searched.twin_changes(&all, at))
}

/// One recording of the axis.
struct SearchedRecording<'a> {
    recording: &'a Recording,
    commanded: CommandedPath,
    windows: Vec<Window>,
}

/// Windows of a track, by their indices.
type WindowRange = (usize, Range<usize>);

/// Sums of a window for the path, its change with the dead time and that with the lag.
type Changes = WindowSums<3>;

struct Searched<'a> {
    fitter: &'a Fitter<'a>,
    tracks: Vec<SearchedRecording<'a>>,
}

impl<'a> Searched<'a> {
    fn new(fitter: &'a Fitter<'a>) -> Self {
        let (axis, ladder) = (fitter.axis, fitter.rig.ladder(Profile::Default));
        let track = |(session, (recording, stretches)): (usize, (&'a Recording, &Vec<_>))| {
            SearchedRecording {
                recording,
                commanded: CommandedPath::new(recording, axis, *ladder.planar()),
                windows: stretches
                    .iter()
                    .map(|s| Window::new(session, recording, s, axis))
                    .collect(),
            }
        };
        let recordings = fitter.recordings.iter().zip(&fitter.stretches);
        Self { fitter, tracks: recordings.enumerate().map(track).collect() }
    }

    fn servo(&self, lag_s: f64) -> Option<ServoModel> {
        let spec = &self.fitter.rig.servo;
        ServoModel::new(spec.angle_limit_rad, lag_s, spec.rate_limit_rad_s).ok()
    }

    fn all(&self) -> Vec<WindowRange> {
        self.tracks.iter().enumerate().map(|(i, track)| (i, 0..track.windows.len())).collect()
    }

    /// Returns pieces of [`LOOKED_AT_S`] in all, or all of the windows if they last no
    /// longer: those with most motion that was commanded, so that pushes do not count.
    fn with_most_motion(&self) -> Vec<WindowRange> {
        let pieces: Vec<WindowRange> = self
            .tracks
            .iter()
            .enumerate()
            .flat_map(|(i, t)| t.pieces().map(move |p| (i, p)))
            .collect();
        let span_s = |(i, piece): &WindowRange| self.tracks[*i].span_s(piece);
        let total_s: f64 = pieces.iter().map(span_s).sum();
        let Some(servo) = self.servo(TYPICAL_S.1).filter(|_| total_s > LOOKED_AT_S) else {
            return self.all();
        };
        let motion = |piece: &WindowRange| {
            let windows = self.planar(core::slice::from_ref(piece), &servo, TYPICAL_S.0);
            windows.iter().map(|w| w.of(&[1.0].into()).excitation_m2()).sum::<f64>()
        };
        let mut ranked: Vec<(f64, usize)> = pieces.iter().map(motion).zip(0..).collect();
        ranked.sort_by(|a, b| b.0.total_cmp(&a.0));
        let mut looked_at_s = 0.0;
        let mut taken: Vec<usize> = ranked
            .into_iter()
            .map(|(_, piece)| piece)
            .take_while(|&piece| {
                let before_s = looked_at_s;
                looked_at_s += span_s(&pieces[piece]);
                before_s < LOOKED_AT_S
            })
            .collect();
        taken.sort_unstable();
        taken.into_iter().map(|piece| pieces[piece].clone()).collect()
    }

    /// Returns the dead time and lag from which to refine: of each lag of the grid the
    /// dead time by the planar model, of these the one with the least cost of the twin.
    fn coarse(&self, pieces: &[WindowRange]) -> Option<(f64, f64)> {
        let with_lag = |&lag_s: &f64| {
            let servo = self.servo(lag_s)?;
            let cost = |dead_s: f64| {
                let windows = self.planar(pieces, &servo, dead_s);
                self.fit(&windows, &[1.0].into()).map_or(f64::NAN, |fit| fit.cost())
            };
            let costs = DEAD_TIMES_S.map(cost);
            let least = (0..costs.len())
                .filter(|&i| !costs[i].is_nan())
                .min_by(|&a, &b| costs[a].total_cmp(&costs[b]))?;
            let found = self.refine((DEAD_TIMES_S[least], lag_s), &DIRECTIONS[..2], |at| {
                self.planar_changes(pieces, at)
            })?;
            let at = (found.dead_time_s, lag_s);
            let fit = self.fit(&self.twin_changes(pieces, at)?, &changed(0.0, 0.0))?;
            Some((fit.cost(), at))
        };
        let candidates = LAGS_S.iter().filter_map(with_lag).filter(|(cost, _)| !cost.is_nan());
        candidates.min_by(|a, b| a.0.total_cmp(&b.0)).map(|(_, at)| at)
    }

    fn fit<const N: usize>(
        &self,
        windows: &[WindowSums<N>],
        weights: &nalgebra::SVector<f64, N>,
    ) -> Option<AxisFit> {
        let windows: Vec<_> = windows.iter().map(|w| w.of(weights)).collect();
        explain(&windows, self.tracks.len())
    }

    /// Returns the windows of `pieces` with the planar path of a servo.
    fn planar(
        &self,
        pieces: &[WindowRange],
        servo: &ServoModel,
        dead_s: f64,
    ) -> Vec<WindowSums<1>> {
        let mut found = Vec::new();
        let mut points: Vec<PathPoint> = Vec::new();
        for (track, piece) in pieces {
            let track = &self.tracks[*track];
            let mut walk = track.commanded.walk(servo, dead_s);
            found.extend(track.windows[piece.clone()].iter().map(|window| {
                walk.along(&window.stretch, &mut points);
                window.sums(|i| [points[i].position_m])
            }));
        }
        found
    }

    /// Returns the windows of `pieces` with the planar path and its changes.
    fn planar_changes(&self, pieces: &[WindowRange], at: (f64, f64)) -> Option<Vec<Changes>> {
        let mut found = Vec::new();
        for (track, piece) in pieces {
            let track = &self.tracks[*track];
            self.follow(track, piece, at, |window, points, more| {
                let change = |i: usize| (more[i].position_m - points[i].position_m) / LAG_STEP_S;
                let sums = |i: usize| [points[i].position_m, -points[i].velocity_m_s, change(i)];
                found.push(window.sums(sums));
            })?;
        }
        Some(found)
    }

    /// Returns the windows of `pieces` with the path of the twin, and the changes of the
    /// planar one.
    fn twin_changes(&self, pieces: &[WindowRange], at: (f64, f64)) -> Option<Vec<Changes>> {
        let model = self.fitter.model(at.0, at.1, 1.0, 0.0, 0.0)?;
        let mut found = Vec::new();
        for (track, piece) in pieces {
            let track = &self.tracks[*track];
            let windows = &track.windows[piece.clone()];
            let (Some(first), Some(last)) = (windows.first(), windows.last()) else { continue };
            let from = track.commanded.warm(first.stretch.start, at.0);
            let path = track.recording.twin_path_within(
                &(from..last.stretch.end),
                &model,
                self.fitter.axis,
            );
            self.follow(track, piece, at, |window, points, more| {
                let path = &path[window.stretch.start - from..];
                let change = |i: usize| (more[i].position_m - points[i].position_m) / LAG_STEP_S;
                found.push(window.sums(|i| [path[i], -points[i].velocity_m_s, change(i)]));
            })?;
        }
        Some(found)
    }

    /// Passes each window of `piece` with the planar path at `at`, and that of a servo
    /// with a lag longer by [`LAG_STEP_S`].
    fn follow(
        &self,
        track: &SearchedRecording<'_>,
        piece: &Range<usize>,
        (dead_s, lag_s): (f64, f64),
        mut take: impl FnMut(&Window, &[PathPoint], &[PathPoint]),
    ) -> Option<()> {
        let (servo, slower) = (self.servo(lag_s)?, self.servo(lag_s + LAG_STEP_S)?);
        let mut walk = track.commanded.walk(&servo, dead_s);
        let mut slower_walk = track.commanded.walk(&slower, dead_s);
        let (mut points, mut more) = (Vec::new(), Vec::new());
        for window in &track.windows[piece.clone()] {
            walk.along(&window.stretch, &mut points);
            slower_walk.along(&window.stretch, &mut more);
            take(window, &points, &more);
        }
        Some(())
    }

    /// Refines `at` until the paths, as given by `changes`, ask for no further change.
    fn refine(
        &self,
        mut at: (f64, f64),
        directions: &[(f64, f64)],
        changes: impl Fn((f64, f64)) -> Option<Vec<Changes>>,
    ) -> Option<Found> {
        let mut windows = changes(at)?;
        let mut fit = self.fit(&windows, &changed(0.0, 0.0))?;
        let mut reach_s = REACH_S;
        for _ in 0..MOST_ROUNDS {
            let (by, better) = self.least_cost(&windows, &fit, at, directions, reach_s);
            let (to, moved_s) = ((at.0 + by.0, at.1 + by.1), by.0.abs().max(by.1.abs()));
            if moved_s <= NEAR_S {
                (at, fit) = (to, better);
                break;
            }
            let there = changes(to);
            let found = there.as_ref().and_then(|w| self.fit(w, &changed(0.0, 0.0)));
            match (there, found) {
                (Some(there), Some(found)) if found.cost() < fit.cost() => {
                    (at, windows, fit) = (to, there, found);
                }
                _ => reach_s = moved_s / 2.0,
            }
        }
        Some(Found { dead_time_s: at.0, lag_s: at.1, fit })
    }

    /// Searches the change of dead time and lag, each of at most `reach_s`, with the
    /// least cost. Returns it with its fit, from `fit` without a change on.
    fn least_cost(
        &self,
        windows: &[Changes],
        fit: &AxisFit,
        at: (f64, f64),
        directions: &[(f64, f64)],
        reach_s: f64,
    ) -> ((f64, f64), AxisFit) {
        let (mut best, mut fit) = ((0.0, 0.0), fit.clone());
        let mut step_s = FIRST_STEP_S.min(reach_s);
        while step_s >= FINEST_STEP_S {
            let (from, before) = (best, fit.cost());
            for &(dead, lag) in directions {
                let to = (from.0 + dead * step_s, from.1 + lag * step_s);
                let within = to.0.abs().max(to.1.abs()) <= reach_s;
                if !within || at.0 + to.0 < 0.0 || at.1 + to.1 < 0.0 {
                    continue;
                }
                let Some(found) = self.fit(windows, &changed(to.0, to.1)) else { continue };
                if found.cost() < fit.cost() {
                    (best, fit) = (to, found);
                }
            }
            // Also ends if the cost is NaN.
            let better = fit.cost() < before;
            if !better {
                step_s /= 2.0;
            }
        }
        (best, fit)
    }
}

/// The weights of the path and its changes.
fn changed(dead_s: f64, lag_s: f64) -> Vector3<f64> {
    Vector3::new(1.0, dead_s, lag_s)
}

impl SearchedRecording<'_> {
    /// Returns the windows in pieces of [`PIECE_S`].
    fn pieces(&self) -> impl Iterator<Item = Range<usize>> {
        let mut from = 0;
        core::iter::from_fn(move || {
            let first = self.windows.get(from)?;
            let start = &self.recording.moments[first.stretch.start].at;
            let within =
                |w: &&Window| self.recording.moments[w.stretch.end - 1].at - *start <= PIECE_S;
            let n = self.windows[from..].iter().take_while(within).count().max(1);
            from += n;
            Some(from - n..from)
        })
    }

    /// Time that the windows of `piece` last, s.
    fn span_s(&self, piece: &Range<usize>) -> f64 {
        let moments = &self.recording.moments;
        let span = |w: &Window| moments[w.stretch.end - 1].at - moments[w.stretch.start].at;
        self.windows[piece.clone()].iter().map(span).sum()
    }
}
