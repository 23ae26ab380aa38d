//! Runs the sliding model with event location: slip begins or ends, the body leaves the
//! plate, lands, or passes the edge.

use super::drive::Drive;
use super::driven_models::{DrivenModel, DrivenSliding};
use super::samples::StepInterpolant;
use super::stepping::{ErrorBudget, Failure, Integration, MOST_CHANGES, StepObserver, next_step};
use crate::methods::StepControl;
use offbd_core::maths::{System, dopri5};
use offbd_core::plant::{Ground, Motion, Phase};

/// A change of phase in a run, and its time.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Event {
    pub at_s: f64,
    /// The phase from then on: rolls, slips, flies, falls.
    pub what: &'static str,
}

/// Maximum number of events recorded of one run; later ones are not listed. Chosen to
/// bound the memory.
pub const MOST_EVENTS: usize = 1000;

/// Resolution of an event's time, s. Chosen: at 1 m/s it is 1e-12 m.
const EVENT_TIME_S: f64 = 1e-12;

/// Minimum duration of a phase, s. Chosen so that a body on the verge of two phases
/// still advances.
const LEAST_PHASE_S: f64 = 1e-8;

/// The phase of the sliding model during an integration, and its events so far.
pub(super) struct PhaseTracker {
    pub phase: Option<Phase>,
    pub events: Vec<Event>,
    since_s: f64,
    changes: u32,
    /// Time for which a damper holds a body that leaves the plate, s.
    hold_s: f64,
}

impl PhaseTracker {
    /// `hold_s`: time for which a damper holds a body that leaves the plate, s; 0 for a
    /// rigid plate.
    pub(super) const fn new(hold_s: f64) -> Self {
        let since_s = f64::NEG_INFINITY;
        Self { phase: None, events: Vec::new(), since_s, changes: 0, hold_s }
    }

    /// Integrates one piece of the drive, up to `until`.
    pub(super) fn piece<'p, D: Drive, W: StepObserver<DrivenSliding<'p, D>, 9>>(
        &mut self,
        system: &mut DrivenSliding<'p, D>,
        integration: &mut Integration<'_, '_, 9>,
        until: f64,
        (control, budget): (&mut StepControl, &ErrorBudget),
        observer: &mut W,
    ) -> Result<(), Failure> {
        self.enter(system, integration);
        let mut first = system.rate(integration.t, &integration.y);
        // On a plate that stands still, accelerations are constant within a phase.
        let whole = system.plate.is_still() && system.model.ground == Ground::Endless;
        while integration.t < until {
            let longest = if whole { f64::INFINITY } else { control.h };
            let (h, end) = next_step(integration.t, until, longest);
            let mut last = first;
            let tried = dopri5(system, integration.t, &integration.y, h, &mut last);
            let error = budget.at_the_end(&tried.error, 3, integration.t, h);
            if !control.accepts(h, error / budget.tolerance / (h / budget.duration)) {
                integration.statistics.rejected += 1;
                continue;
            }
            let interpolant = StepInterpolant {
                t: [integration.t, end],
                y: [&integration.y, &tried.y],
                rate: [first, last],
            };
            match self.event_within(system, &interpolant) {
                None => {
                    integration.statistics.method_error_m += error;
                    integration.take(system, end, tried.y, observer)?;
                    first = last;
                }
                Some(at) => {
                    let y = dopri5(
                        system,
                        integration.t,
                        &integration.y,
                        at - integration.t,
                        &mut first,
                    )
                    .y;
                    integration.take(system, at, y, observer)?;
                    self.hold(system, integration, until, observer)?;
                    self.enter(system, integration);
                    self.changes += 1;
                    if self.changes > MOST_CHANGES {
                        return Err(Failure::TooManyChanges { at_s: integration.t });
                    }
                    first = system.rate(integration.t, &integration.y);
                }
            }
        }
        Ok(())
    }

    /// Holds a body that is about to leave the plate.
    fn hold<'p, D: Drive, W: StepObserver<DrivenSliding<'p, D>, 9>>(
        &self,
        system: &DrivenSliding<'p, D>,
        integration: &mut Integration<'_, '_, 9>,
        until: f64,
        observer: &mut W,
    ) -> Result<(), Failure> {
        let (t, h) = (integration.t, self.hold_s.min(until - integration.t));
        if h <= 0.0 || !matches!(system.phase, Phase::Contact(_)) {
            return Ok(());
        }
        let at = Motion::from_row(&integration.y);
        if system.model.enter(&at, &system.plate.at(t)).0 != Phase::Flight {
            return Ok(());
        }
        let mut first = system.rate(t, &integration.y);
        let y = dopri5(system, t, &integration.y, h, &mut first).y;
        integration.take(system, t + h, y, observer)
    }

    /// Switches to the phase that the current motion implies.
    fn enter<D: Drive>(
        &mut self,
        system: &mut DrivenSliding<'_, D>,
        integration: &mut Integration<'_, '_, 9>,
    ) {
        let fallen = self.phase == Some(Phase::Fallen);
        let (phase, motion) =
            system.model.enter(&Motion::from_row(&integration.y), &system.plate.at(integration.t));
        let phase = if fallen { Phase::Fallen } else { phase };
        integration.y = motion.to_row();
        let before = self.phase.map(|phase| phase.name());
        if before != Some(phase.name()) && self.events.len() < MOST_EVENTS {
            self.events.push(Event { at_s: integration.t, what: phase.name() });
        }
        self.phase = Some(phase);
        self.since_s = integration.t;
        system.phase = phase;
    }

    /// Returns the first time within the step at which the phase ends, s.
    fn event_within<D: Drive>(
        &self,
        system: &DrivenSliding<'_, D>,
        interpolant: &StepInterpolant<'_, 9>,
    ) -> Option<f64> {
        let margin = |t: f64| {
            let y = interpolant.at(t, 3, DrivenSliding::<'_, D>::SMOOTH);
            system.model.margin(&system.phase, &y, &system.plate.at(t))
        };
        let [start, end] = interpolant.t;
        let middle = (start + end) / 2.0;
        let over = [middle, end].into_iter().find(|&t| margin(t) < 0.0)?;
        let from = if over == end { middle } else { start };
        let at = crossing(margin, from.max(start), over);
        Some(at.max(self.since_s + LEAST_PHASE_S).min(end))
    }
}

/// Returns a time just after `f` turns negative between `before` and `after`, by the
/// Illinois method with a bisection in every fourth iteration.
fn crossing(f: impl Fn(f64) -> f64, mut before: f64, mut after: f64) -> f64 {
    let (mut above, mut below) = (f(before).max(0.0), f(after));
    for i in 0..100 {
        let width = after - before;
        if width <= EVENT_TIME_S {
            break;
        }
        let share = if i % 4 == 3 || above == 0.0 { 0.5 } else { above / (above - below) };
        // Stay off both ends, so that both of them move.
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
