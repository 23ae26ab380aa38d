//! Whether the columns and units of a mapping agree with the motion.

use super::motion::{self, ASKED_M_S2, Motion};
use super::{InspectionRemarkView, InspectionView, MappingChangeView};
use crate::session_csv::COLUMNS;
use crate::table::guess::Guess;
use crate::table::{AXES, Axis, ColumnMapping, Dimension, Expression};
use offbd_core::vocabulary::Sample;

/// Smallest correlation by which the motion decides a sign, an axis or a unit. Chosen: below it
/// more than three quarters of the motion has another cause.
const MIN_CORRELATION: f64 = 0.5;

/// The motion contradicts the units beyond this factor. Chosen: a servo's lever or a hollow ball
/// stays within it, a unit does not.
const UNIT_FACTOR: f64 = 2.2;

/// Lengths and angles that a rig has, m and rad: the largest value of a recording lies between
/// them. Chosen.
const USUAL_M: (f64, f64) = (0.003, 1.5);
const USUAL_RAD: (f64, f64) = (0.003, 1.6);

/// Compares the mapping of a table with the columns `names` with the motion of `samples`. Changes
/// what was guessed; what was stated is doubted in a remark.
pub(super) fn by_motion(
    view: &mut InspectionView,
    names: &[String],
    mapping: &mut ColumnMapping,
    guesses: &mut [Guess],
    samples: &[Sample],
) {
    let largest = |value: fn(&Sample) -> Option<f64>| {
        samples.iter().filter_map(value).fold(0.0, |most: f64, value| most.max(value.abs()))
    };
    let largest = [
        0.0,
        largest(|s| s.cmd_qx_rad),
        largest(|s| s.cmd_qy_rad),
        largest(|s| s.x_m),
        largest(|s| s.y_m),
    ];
    let motion = motion::compare(samples);
    Check { view, names, mapping, guesses, motion, largest, decided: Vec::new() }.run();
}

/// A table whose mapping is compared with the motion.
struct Check<'a> {
    view: &'a mut InspectionView,
    names: &'a [String],
    mapping: &'a mut ColumnMapping,
    guesses: &'a mut [Guess],
    motion: Motion,
    /// The units that the motion has decided.
    decided: Vec<(usize, &'static str)>,
    /// Largest value of each quantity, in the order of [`COLUMNS`].
    largest: [f64; COLUMNS.len()],
}

/// A unit, and the factor by which the values change if they are in it.
type UnitChange = (&'static str, f64);

const REASON: &str = "the motion decides";

impl Check<'_> {
    fn run(&mut self) {
        let correlation = |axis: usize, command: usize| {
            self.motion[axis][command].map_or(0.0, |fit| fit.correlation.abs())
        };
        let own = correlation(0, 1).max(correlation(1, 0));
        let other = correlation(0, 0).max(correlation(1, 1));
        if other > MIN_CORRELATION && other > 2.0 * own {
            self.exchange();
        }
        for (i, axis) in AXES.iter().enumerate() {
            match self.motion[i][axis.command - 1] {
                Some(fit) if fit.correlation.abs() >= MIN_CORRELATION => {
                    if fit.slope * axis.sign < 0.0 {
                        self.negate(axis);
                    }
                    self.units(axis, fit.slope.abs() / ASKED_M_S2);
                }
                Some(_) => self.view.remark(format!(
                    "the motion along {} hardly follows a command: its unit and sign are not checked",
                    axis.word
                )),
                None => {}
            }
        }
        self.share_units();
    }

    /// Gives both axes the unit that the motion along one decides, if that of the other is a guess by
    /// size.
    fn share_units(&mut self) {
        let pairs = AXES.each_ref().map(|axis| [axis.command, axis.position]);
        for (mine, others) in [(0, 1), (1, 0)] {
            for (quantity, other) in pairs[mine].into_iter().zip(pairs[others]) {
                let Some(decided) = self.decided.iter().find(|(of, _)| *of == other) else {
                    continue;
                };
                let unit = decided.1;
                let is_free = |guess: &&mut Guess| !guess.is_stated() && guess.reason != REASON;
                let Some(guess) = self.guess(quantity).filter(is_free) else { continue };
                (guess.unit, guess.reason) = (unit, format!("as `{}`", COLUMNS[other]));
                self.set_unit(quantity, unit);
            }
        }
    }

    /// Sets the unit of a quantity, and keeps the signs.
    fn set_unit(&mut self, quantity: usize, unit: &str) {
        if let Some(expression) = &mut self.mapping.expressions[quantity] {
            *expression = in_unit(expression, quantity, unit);
        }
    }

    fn guess(&mut self, quantity: usize) -> Option<&mut Guess> {
        self.guesses.iter_mut().find(|guess| guess.quantity == quantity)
    }

    /// Exchanges the commands, if both were guessed.
    fn exchange(&mut self) {
        if self.guess(1).is_none() || self.guess(2).is_none() {
            let text = "each axis moves as the command of the other one asks: are the commands, \
                or x and y, exchanged?";
            let exchanged = [(1, 2), (2, 1)].map(|(to, from)| {
                let expression = self.mapping.expressions[from].clone();
                expression.map(|expression| self.change(to, &expression))
            });
            let changes = exchanged.into_iter().flatten().collect();
            self.view.remarks.push(InspectionRemarkView { text: text.to_owned(), changes });
            return;
        }
        self.mapping.expressions.swap(1, 2);
        self.largest.swap(1, 2);
        for row in &mut self.motion {
            row.swap(0, 1);
        }
        for guess in &mut *self.guesses {
            guess.quantity = [0, 2, 1, 3, 4][guess.quantity];
            if [1, 2].contains(&guess.quantity) {
                guess.reason = REASON.to_owned();
            }
        }
    }

    /// Changes the sign of a command that was guessed.
    fn negate(&mut self, axis: &Axis) {
        let Some(mut expression) = self.mapping.expressions[axis.command].clone() else { return };
        for term in &mut expression.terms {
            term.factor = -term.factor;
        }
        if let Some(guess) = self.guess(axis.command) {
            guess.reason = REASON.to_owned();
            self.mapping.expressions[axis.command] = Some(expression);
            return;
        }
        let text = format!(
            "the ball moves along {} against `{}`: is a sign wrong?",
            axis.word, COLUMNS[axis.command]
        );
        let changes = vec![self.change(axis.command, &expression)];
        self.view.remarks.push(InspectionRemarkView { text, changes });
    }

    fn change(&self, quantity: usize, expression: &Expression) -> MappingChangeView {
        MappingChangeView {
            quantity: COLUMNS[quantity].to_owned(),
            expression: expression.with_names(self.names).text(quantity),
        }
    }

    /// Compares the size of the motion, `ratio` of what the commands ask, with other units.
    fn units(&mut self, axis: &Axis, ratio: f64) {
        if ratio.ln().abs() < UNIT_FACTOR.ln() {
            return;
        }
        let best = self.candidates(axis, ratio);
        let Some((position, command)) = best else {
            let factor = 10_f64.powf(-ratio.log10().round());
            let likely = if (ratio * factor).ln().abs() < UNIT_FACTOR.ln() / 2.0 {
                format!(
                    ": no unit of the quantities explains that, a factor of {factor} of the \
                     positions does"
                )
            } else {
                ", and no other unit explains that".to_owned()
            };
            self.view.remark(format!(
                "the motion along {} is {:.2} of what the commands ask{likely}",
                axis.word, ratio
            ));
            return;
        };
        let (mut asked, mut changes) = (Vec::new(), Vec::new());
        for (quantity, (word, change)) in [(axis.position, position), (axis.command, command)] {
            if change == 1.0 {
                continue;
            }
            if let Some(guess) = self.guess(quantity) {
                guess.unit = word;
                guess.reason = REASON.to_owned();
                self.decided.push((quantity, word));
                self.set_unit(quantity, word);
            } else if let Some(expression) = &self.mapping.expressions[quantity] {
                asked.push(format!("`{}` in {word}", COLUMNS[quantity]));
                changes.push(self.change(quantity, &in_unit(expression, quantity, word)));
            }
        }
        if !asked.is_empty() {
            let text = format!(
                "the motion along {} is {:.2} of what the commands ask: is {}?",
                axis.word,
                ratio,
                asked.join(" and ")
            );
            self.view.remarks.push(InspectionRemarkView { text, changes });
        }
    }

    /// Returns the units of position and command, each with its change of the values, that explain
    /// the motion best.
    fn candidates(&self, axis: &Axis, ratio: f64) -> Option<(UnitChange, UnitChange)> {
        let changes = |quantity: usize, usual: (f64, f64)| -> Vec<UnitChange> {
            let guess = self.guesses.iter().find(|guess| guess.quantity == quantity);
            let factor =
                self.mapping.expressions[quantity].as_ref().and_then(|e| match &e.terms[..] {
                    [term] => Some(term.factor.abs()),
                    _ => None,
                });
            let is_fixed = guess.is_some_and(Guess::is_stated) || factor.is_none();
            let units = Dimension::of(quantity).units().iter().filter_map(|(word, si)| {
                let change = si / factor?;
                let largest = self.largest[quantity] * change;
                let is_usual = largest >= usual.0 && largest <= usual.1 && *word != "turn";
                (!is_fixed && is_usual || change == 1.0).then_some((*word, change))
            });
            let found: Vec<_> = units.collect();
            if found.is_empty() { vec![("", 1.0)] } else { found }
        };
        let error = |(position, command): &(UnitChange, UnitChange)| {
            let explained = (ratio * position.1 / command.1).ln().abs();
            // Of two equal explanations the one that changes less.
            explained + 0.1 * f64::from(u8::from(position.1 != 1.0) + u8::from(command.1 != 1.0))
        };
        let commands = changes(axis.command, USUAL_RAD);
        let pairs = changes(axis.position, USUAL_M)
            .into_iter()
            .flat_map(|position| commands.iter().map(move |command| (position, *command)));
        let best = pairs.min_by(|a, b| error(a).total_cmp(&error(b)))?;
        (error(&best) < UNIT_FACTOR.ln()).then_some(best)
    }
}

/// Returns the expression of a quantity in another unit, with the same signs.
fn in_unit(expression: &Expression, quantity: usize, unit: &str) -> Expression {
    let mut units = Dimension::of(quantity).units().iter();
    // By the word, so that the mapping shows it.
    let si = units.find(|(word, _)| *word == unit).map_or(1.0, |(_, si)| *si);
    let mut changed = expression.clone();
    for term in &mut changed.terms {
        term.factor = si.copysign(term.factor);
    }
    changed
}
