//! The sliding model from event to event: slip begins or ends, the body leaves
//! the plate, lands, passes the edge.

use super::drive::Drive;
use super::rungs::{OnSliding, Rung};
use super::samples::Span;
use super::stepping::{Budget, Course, Failure, MOST_CHANGES, Watch, next_step};
use crate::methods::StepControl;
use offbd_core::maths::{System, dopri5};
use offbd_core::plant::{Motion, Phase};

/// What happened in a run, and when.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Event {
    pub at_s: f64,
    /// What the body does from then on: rolls, slips, flies, falls.
    pub what: &'static str,
}

/// Events kept of one run; later ones happen but are not listed.
pub const MOST_EVENTS: usize = 1000;

/// An event is located to this time, s: at 1 m/s, 1e-12 m.
const EVENT_TIME_S: f64 = 1e-12;

/// After an event at least this long passes before the next, s, so that a body
/// on the verge of two phases moves on.
const LEAST_PHASE_S: f64 = 1e-8;

/// Where the sliding model stands beside its course.
pub(super) struct Sequence {
    pub phase: Option<Phase>,
    pub events: Vec<Event>,
    since_s: f64,
    changes: u32,
}

impl Sequence {
    pub(super) const fn new() -> Self {
        Self { phase: None, events: Vec::new(), since_s: f64::NEG_INFINITY, changes: 0 }
    }

    /// Runs one piece of the drive.
    pub(super) fn piece<'p, D: Drive, W: Watch<OnSliding<'p, D>, 9>>(
        &mut self,
        rung: &mut OnSliding<'p, D>,
        course: &mut Course<'_, '_, 9>,
        until: f64,
        (control, budget): (&mut StepControl, &Budget),
        watch: &mut W,
    ) -> Result<(), Failure> {
        self.enter(rung, course);
        let mut first = rung.rate(course.t, &course.y);
        while course.t < until {
            let (h, end) = next_step(course.t, until, control.h);
            let mut last = first;
            let tried = dopri5(rung, course.t, &course.y, h, &mut last);
            let error = budget.at_the_end(&tried.error, 3, course.t, h);
            if !control.accepts(h, error / budget.tolerance / (h / budget.duration)) {
                course.tally.rejected += 1;
                continue;
            }
            let span = Span { t: [course.t, end], y: [&course.y, &tried.y], rate: [first, last] };
            match self.event_within(rung, &span) {
                None => {
                    course.tally.method_error_m += error;
                    course.take(rung, end, tried.y, watch)?;
                    first = last;
                }
                Some(at) => {
                    let y = dopri5(rung, course.t, &course.y, at - course.t, &mut first).y;
                    course.take(rung, at, y, watch)?;
                    self.enter(rung, course);
                    self.changes += 1;
                    if self.changes > MOST_CHANGES {
                        return Err(Failure::TooManyChanges { at_s: course.t });
                    }
                    first = rung.rate(course.t, &course.y);
                }
            }
        }
        Ok(())
    }

    /// Goes over to the phase that the motion asks for.
    fn enter<D: Drive>(&mut self, rung: &mut OnSliding<'_, D>, course: &mut Course<'_, '_, 9>) {
        let fallen = self.phase == Some(Phase::Fallen);
        let (phase, motion) =
            rung.model.enter(&Motion::from_row(&course.y), &rung.plate.at(course.t));
        let phase = if fallen { Phase::Fallen } else { phase };
        course.y = motion.to_row();
        let before = self.phase.map(|phase| phase.name());
        if before != Some(phase.name()) && self.events.len() < MOST_EVENTS {
            self.events.push(Event { at_s: course.t, what: phase.name() });
        }
        self.phase = Some(phase);
        self.since_s = course.t;
        rung.phase = phase;
    }

    /// The first moment of the step at which the phase is over.
    fn event_within<D: Drive>(&self, rung: &OnSliding<'_, D>, span: &Span<'_, 9>) -> Option<f64> {
        let margin = |t: f64| {
            let y = span.at(t, 3, OnSliding::<'_, D>::SMOOTH);
            rung.model.margin(&rung.phase, &y, &rung.plate.at(t))
        };
        let [start, end] = span.t;
        let middle = (start + end) / 2.0;
        let over = [middle, end].into_iter().find(|&t| margin(t) < 0.0)?;
        let from = if over == end { middle } else { start };
        let at = crossing(margin, from.max(start), over);
        Some(at.max(self.since_s + LEAST_PHASE_S).min(end))
    }
}

/// A moment just after `f` turns negative between `before` and `after`, by the
/// Illinois method with a bisection every fourth time.
fn crossing(f: impl Fn(f64) -> f64, mut before: f64, mut after: f64) -> f64 {
    let (mut above, mut below) = (f(before).max(0.0), f(after));
    for i in 0..100 {
        let width = after - before;
        if width <= EVENT_TIME_S {
            break;
        }
        let share = if i % 4 == 3 || above == 0.0 { 0.5 } else { above / (above - below) };
        // Stay off the ends, so that both close in.
        let t = before + width * share.clamp(0.01, 0.99);
        let value = f(t);
        if value < 0.0 {
            (after, below) = (t, value);
            above /= 2.0;
        } else {
            (before, above) = (t, value);
            below /= 2.0;
        }
    }
    after
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_crossing_is_found_from_above() {
        for root in [1e-9, 0.3, 0.999_999] {
            let at = crossing(|t| (root - t) * (1.0 + t * t), 0.0, 1.0);
            assert!(at >= root && at - root <= 2.0 * EVENT_TIME_S, "{at} for {root}");
        }
    }
}
