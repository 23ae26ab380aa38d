//! What the columns of a table probably are, from their names, units and the size of their values.
//! A guess is proposed, never taken.

use super::CsvError;
use super::cell;
use super::dialect::Dialect;
use super::expression::{ColumnMapping, ColumnName, Dimension, Expression, Term, own_name};
use super::own_names::with_own_names;
use super::unit::{TIME_WORDS, is_unit, unit_of};
use crate::session_csv::COLUMNS;
use offbd_core::vocabulary::Brief;

/// Columns that an error lists.
const LISTED: usize = 20;

/// Longest name that an error lists whole, characters.
const LONGEST_NAME: usize = 40;

/// The step of a time in seconds that is more likely one of milliseconds or microseconds. Chosen:
/// a rig that is sampled every two seconds cannot be judged.
const LONGEST_STEP: [(f64, &str); 3] = [(2e6, "ns"), (2e3, "us"), (2.0, "ms")];

/// Largest length in metres and angle in radians that is taken for one. Chosen: a plate is smaller
/// than two metres and turns by less than a right angle.
const LARGEST_M: f64 = 2.0;
const LARGEST_RAD: f64 = 1.6;

/// Returns a column's name as an error shows it.
fn shown(dialect: &Dialect, column: usize) -> String {
    match dialect.names.get(column) {
        Some(name) if name.chars().count() > LONGEST_NAME => {
            format!("`{}…`", name.chars().take(LONGEST_NAME).collect::<String>())
        }
        Some(name) if !name.is_empty() => format!("`{name}`"),
        _ => format!("#{}", column + 1),
    }
}

/// Lists the columns of a table.
pub(super) fn listed(dialect: &Dialect) -> String {
    let n = dialect.n_columns();
    if dialect.names.is_empty() {
        return format!("{n} columns without names, #1 to #{n}");
    }
    let mut list: Vec<String> = (0..n.min(LISTED)).map(|i| shown(dialect, i)).collect();
    if n > LISTED {
        list.push(format!("and {} more", n - LISTED));
    }
    list.join(", ")
}

/// Returns the column whose name is most like `wanted`, if one is.
pub(super) fn nearest<'a>(dialect: &'a Dialect, wanted: &ColumnName) -> Option<&'a str> {
    let ColumnName::Name(wanted) = wanted else { return None };
    nearest_of(wanted, dialect.names.iter().map(String::as_str))
}

/// Returns the word that is most like `wanted`, if one is.
pub(crate) fn nearest_of<'a>(
    wanted: &str,
    words: impl Iterator<Item = &'a str>,
) -> Option<&'a str> {
    let likeness = |word: &&str| {
        (1000.0 * strsim::jaro_winkler(&wanted.to_lowercase(), &word.to_lowercase())) as u64
    };
    // Chosen: `x` and `t_s` are less alike, `cmd_qx` and `cmd_qx_rad` more.
    words.max_by_key(likeness).filter(|word| likeness(word) >= 800)
}

/// Times from which on they are not seconds since 1970, which are 1.8e9 today: of the year 5000 in
/// each unit.
const LATEST_TIME: [(f64, &str); 3] = [(1e17, "ns"), (1e14, "us"), (1e11, "ms")];

/// Returns the error of a time that is not in seconds.
pub(super) fn wrong_time_unit(dialect: &Dialect) -> Option<CsvError> {
    let found = values(dialect, time_column(dialect)?).next()?;
    let (_, unit) = LATEST_TIME.iter().find(|(latest, _)| found > *latest)?;
    Some(CsvError::TimeUnit { found, unit })
}

/// The column with the name of the time.
fn time_column(dialect: &Dialect) -> Option<usize> {
    dialect.names.iter().position(|name| name.eq_ignore_ascii_case(COLUMNS[0]))
}

fn by_step(step: f64) -> String {
    format!("a step of {} from row to row", Brief(step))
}

/// Returns `value` with three significant digits.
fn rounded(value: f64) -> f64 {
    format!("{value:.2e}").parse().unwrap_or(value)
}

fn values(dialect: &Dialect, column: usize) -> impl Iterator<Item = f64> {
    let rows = dialect.first_rows.iter().filter_map(move |row| row.get(column));
    rows.filter_map(|cell| cell::parse(cell.as_bytes(), dialect.decimal).ok().flatten())
}

fn median_step(dialect: &Dialect, column: usize) -> Option<f64> {
    let values: Vec<f64> = values(dialect, column).collect();
    let mut steps: Vec<f64> = values.windows(2).map(|pair| pair[1] - pair[0]).collect();
    steps.sort_by(f64::total_cmp);
    steps.get(steps.len() / 2).copied().map(rounded)
}

/// What a column's name says.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Meaning {
    Time,
    /// A command that turns the plate about x (0) or y (1); without an axis of a beam.
    Turn(Option<usize>),
    /// A command whose axis is more likely that of the motion.
    Push(Option<usize>),
    /// The ball's position along x (0) or y (1).
    Position(usize),
}

/// Words of names; a name is split at signs and at changes from small to capital letters.
const TURNS: [(&str, usize); 8] = [
    ("qx", 0),
    ("roll", 0),
    ("alpha", 0),
    ("rotx", 0),
    ("qy", 1),
    ("pitch", 1),
    ("beta", 1),
    ("roty", 1),
];
const COMMANDS: [&str; 21] = [
    "cmd", "command", "u", "mv", "tilt", "angle", "servo", "motor", "mot", "theta", "winkel", "q",
    "neigung", "control", "output", "out", "plate", "servox", "servoy", "motx", "moty",
];
const POSITIONS: [(&str, usize); 14] = [
    ("x", 0),
    ("bx", 0),
    ("px", 0),
    ("posx", 0),
    ("ballx", 0),
    ("xpos", 0),
    ("xball", 0),
    ("y", 1),
    ("by", 1),
    ("py", 1),
    ("posy", 1),
    ("bally", 1),
    ("ypos", 1),
    ("yball", 1),
];
/// Positions of a beam, unless another word says the axis.
const DISTANCES: [(&str, usize); 5] =
    [("position", 0), ("distance", 0), ("pos", 0), ("dist", 0), ("abstand", 0)];
/// Such positions if the name has no other word: `ball seen` is not a position.
const BALLS: [&str; 2] = ["ball", "kugel"];
/// Words of quantities that are none of a sample.
const OTHERS: [&str; 20] = [
    "dot", "xdot", "ydot", "v", "vx", "vy", "vel", "velocity", "acc", "ax", "ay", "err", "error",
    "ex", "ey", "ref", "sp", "setpoint", "target", "dt",
];

/// Words of values that are neither lengths nor angles: they need a factor and an offset. The first
/// one is a position by itself.
const COUNTS: [&str; 11] =
    ["px", "pix", "pixel", "pixels", "adc", "raw", "count", "counts", "tick", "ticks", "pwm"];

/// Splits a name into words in small letters.
fn words(name: &str) -> Vec<String> {
    let mut words = vec![String::new()];
    let mut was_small = false;
    for c in name.chars() {
        if !(c.is_alphanumeric() || c == '°') || c.is_uppercase() && was_small {
            words.push(String::new());
        }
        if (c.is_alphanumeric() || c == '°')
            && let Some(word) = words.last_mut()
        {
            word.extend(c.to_lowercase());
        }
        was_small = c.is_lowercase();
    }
    words.retain(|word| !word.is_empty());
    words
}

fn meaning(name: &str) -> Option<Meaning> {
    let mut words = words(name);
    // The unit at the end is not a part of the name, unless it is the whole name.
    if words.len() > 1 && words.last().is_some_and(|word| is_unit(word)) {
        words.pop();
    }
    let has = |known: &[&str]| words.iter().any(|word| known.contains(&word.as_str()));
    let axis = |known: &[(&str, usize)]| {
        words.iter().find_map(|word| known.iter().find(|(w, _)| w == word)).map(|(_, axis)| *axis)
    };
    if has(&OTHERS) {
        return None;
    }
    if let Some(axis) = axis(&TURNS) {
        return Some(Meaning::Turn(Some(axis)));
    }
    if has(&COMMANDS) {
        let ends = |end: char| words.iter().any(|word| word.ends_with(end));
        let axis = if ends('x') {
            Some(0)
        } else if ends('y') {
            Some(1)
        } else {
            None
        };
        return Some(Meaning::Push(axis));
    }
    if let Some(axis) = axis(&POSITIONS).or_else(|| axis(&DISTANCES)) {
        return Some(Meaning::Position(axis));
    }
    if words.len() == 1 && has(&BALLS) {
        return Some(Meaning::Position(0));
    }
    has(&TIME_WORDS).then_some(Meaning::Time)
}

/// Whether a column's name says that it holds pixels or counts.
fn are_counts(name: &str) -> bool {
    let words = words(name);
    let known = if words.len() > 1 { &COUNTS[..] } else { &COUNTS[1..] };
    words.iter().any(|word| known.contains(&word.as_str()))
}

/// What a column's name says that it holds in a unit.
fn meaning_in_unit(name: &str) -> Option<Meaning> {
    meaning(name).filter(|meaning| *meaning == Meaning::Time || !are_counts(name))
}

/// Returns the columns of commands and positions in pixels or counts that `mapping` does not use.
pub(crate) fn counts(dialect: &Dialect, mapping: &ColumnMapping) -> Vec<ColumnName> {
    let terms = || mapping.expressions.iter().flatten().flat_map(|e| &e.terms);
    let names = dialect.names.iter().enumerate();
    let counts = names.filter(|(_, name)| meaning(name) != meaning_in_unit(name));
    let columns = counts.map(|(i, _)| name(dialect, i));
    columns.filter(|name| terms().all(|term| term.column.as_ref() != Some(name))).collect()
}

/// A guess, with its reason.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Guess {
    pub(crate) quantity: usize,
    pub(super) column: usize,
    /// The column of the time of day that is added to a date.
    clock: Option<usize>,
    pub(crate) unit: &'static str,
    pub(crate) reason: String,
}

impl Guess {
    fn expression(&self, dialect: &Dialect) -> Expression {
        let units = Dimension::of(self.quantity).units();
        let factor = units.iter().find(|(word, _)| *word == self.unit).map_or(1.0, |(_, si)| *si);
        let columns = [Some(self.column), self.clock].into_iter().flatten();
        let term = |column| Term { column: Some(name(dialect, column)), factor };
        Expression { terms: columns.map(term).collect() }
    }
}

/// Returns the name of a column; its number if it has no name, or another column has the same.
pub(crate) fn name(dialect: &Dialect, column: usize) -> ColumnName {
    own_name(&dialect.names, column)
        .map_or(ColumnName::Number(column + 1), |name| ColumnName::Name(name.to_owned()))
}

/// Guesses the columns of the quantities that `known` does not map.
pub(super) fn guesses(dialect: &Dialect, known: &ColumnMapping) -> Vec<Guess> {
    let meanings: Vec<Option<Meaning>> =
        dialect.names.iter().map(|name| meaning_in_unit(name)).collect();
    let mut taken: Vec<usize> = Vec::new();
    let mut guesses = Vec::new();
    // The order in which columns are taken: what a name says most surely first.
    let wanted: [(usize, &[Meaning]); 5] = [
        (0, &[Meaning::Time]),
        (1, &[Meaning::Turn(Some(0)), Meaning::Push(Some(1))]),
        (
            2,
            &[
                Meaning::Turn(Some(1)),
                Meaning::Push(Some(0)),
                Meaning::Push(None),
                Meaning::Turn(None),
            ],
        ),
        (3, &[Meaning::Position(0)]),
        (4, &[Meaning::Position(1)]),
    ];
    for (quantity, meanings_wanted) in wanted {
        if known.expressions[quantity].is_some() {
            continue;
        }
        let has = |meaning: &Meaning| {
            (0..meanings.len()).find(|i| !taken.contains(i) && meanings[*i] == Some(*meaning))
        };
        let time_by_unit = || {
            let is_time = |i: &usize| {
                let unit = dialect.units.get(*i)?;
                unit_of(unit, Dimension::Time).filter(|_| !taken.contains(i))
            };
            (0..dialect.names.len()).find(|i| is_time(i).is_some())
        };
        // Of two commands whose names say no axis, such as `servo_1` and `servo_2`.
        let second_of_two = || {
            let mut all = (0..meanings.len()).filter(|i| meanings[*i] == Some(Meaning::Push(None)));
            let (first, second) = (all.next()?, all.next()?);
            let without_number = |i: usize| dialect.names[i].trim_end_matches(char::is_numeric);
            let alike = without_number(first) == without_number(second);
            (alike && all.next().is_none()).then_some(second)
        };
        let of_moments = || {
            let is_moment = |i: &usize| first_value(dialect, *i).is_some_and(cell::is_moment);
            let is_duration = |i: &usize| first_value(dialect, *i).is_some_and(cell::is_duration);
            let mut moments = (0..dialect.n_columns()).filter(is_moment).collect::<Vec<_>>();
            // A duration may be another quantity, such as a latency.
            moments.sort_by_key(is_duration);
            moments.first().copied().filter(|_| quantity == 0)
        };
        let found = if quantity == 0 { time_by_unit() } else { None };
        let found = found.or_else(|| meanings_wanted.iter().find_map(has)).or_else(of_moments);
        if let Some(column) = found.or_else(|| second_of_two().filter(|_| quantity == 1)) {
            let (column, clock) = with_clock(dialect, column);
            taken.push(column);
            taken.extend(clock);
            guesses.push(Guess { quantity, column, clock, unit: "", reason: String::new() });
        }
    }
    let columns = |dimension: Dimension| {
        let same = guesses.iter().filter(|guess| Dimension::of(guess.quantity) == dimension);
        same.map(|guess| guess.column).collect::<Vec<usize>>()
    };
    let alike = [columns(Dimension::Time), columns(Dimension::Angle), columns(Dimension::Length)];
    for guess in &mut guesses {
        let dimension = Dimension::of(guess.quantity);
        (guess.unit, guess.reason) =
            unit(dialect, dimension, guess.column, &alike[dimension as usize]);
    }
    guesses
}

/// The first value of a column that is not missing.
pub(super) fn first_value(dialect: &Dialect, column: usize) -> Option<&str> {
    let cells = dialect.first_rows.iter().filter_map(|row| row.get(column));
    cells.map(String::as_str).find(|cell| !cell::is_missing(cell))
}

/// Returns the column of the date and that of the time of day, if `column` is one of them and there is
/// the other.
fn with_clock(dialect: &Dialect, column: usize) -> (usize, Option<usize>) {
    let first = |is_it: fn(&str) -> bool| {
        (0..dialect.n_columns()).find(|i| first_value(dialect, *i).is_some_and(is_it))
    };
    match first_value(dialect, column) {
        Some(value) if cell::is_day(value) => (column, first(cell::is_time_of_day)),
        Some(value) if cell::is_time_of_day(value) => match first(cell::is_day) {
            Some(day) => (day, Some(column)),
            None => (column, None),
        },
        _ => (column, None),
    }
}

/// The reasons of units that the file itself states.
pub(super) const BY_NAME: &str = "its name says the unit";
const BY_UNIT_LINE: &str = "the line below the names says the unit";

impl Guess {
    /// Whether the file states the unit.
    pub(crate) fn is_stated(&self) -> bool {
        [BY_NAME, BY_UNIT_LINE].contains(&self.reason.as_str())
    }

    /// Whether only the size of the values speaks for the unit.
    fn is_by_size(&self) -> bool {
        self.quantity != 0 && !self.is_stated()
    }
}

/// Returns the unit of a column, and how it is known. The columns `alike` have the same dimension
/// and probably the same unit.
fn unit(
    dialect: &Dialect,
    dimension: Dimension,
    column: usize,
    alike: &[usize],
) -> (&'static str, String) {
    let last_word = dialect.names.get(column).and_then(|name| words(name).pop());
    if let Some(unit) = last_word.and_then(|word| unit_of(&word, dimension)) {
        return (unit, BY_NAME.to_owned());
    }
    if let Some(unit) = dialect.units.get(column).and_then(|word| unit_of(word, dimension)) {
        return (unit, BY_UNIT_LINE.to_owned());
    }
    let all = alike.iter().flat_map(|column| values(dialect, *column));
    let largest = all.fold(0.0, |most: f64, value| most.max(value.abs()));
    let by_size = |unit| (unit, format!("values up to {}", Brief(rounded(largest))));
    match dimension {
        Dimension::Time => {
            if first_value(dialect, column).is_some_and(cell::is_moment) {
                return ("s", "its values are dates, times of day or durations".to_owned());
            }
            let step = median_step(dialect, column).unwrap_or_default();
            let unit = LONGEST_STEP.iter().find(|(longest, _)| step > *longest);
            let unit = unit.map_or("s", |(_, unit)| unit);
            (unit, by_step(step))
        }
        Dimension::Angle => by_size(if largest > LARGEST_RAD { "deg" } else { "rad" }),
        Dimension::Length => by_size(if largest > LARGEST_M { "mm" } else { "m" }),
    }
}

/// Returns `known` with the guesses for all else.
pub(crate) fn mapping(dialect: &Dialect, known: &ColumnMapping) -> (ColumnMapping, Vec<Guess>) {
    let mut mapping = with_own_names(known, dialect).unwrap_or_else(|_| known.clone());
    let mut guesses = guesses(dialect, &mapping);
    if known.expressions[0].is_none()
        && let Some(column) = time_column(dialect)
        && let Some(step) = median_step(dialect, column)
        && let Some((_, unit)) = LONGEST_STEP.iter().find(|(longest, _)| step > *longest)
    {
        guesses.insert(0, Guess { quantity: 0, column, clock: None, unit, reason: by_step(step) });
    }
    for guess in &guesses {
        mapping.expressions[guess.quantity] = Some(guess.expression(dialect));
    }
    (mapping, guesses)
}

/// Returns a sentence that proposes a mapping, with a blank before it; nothing if too little can be
/// guessed.
pub(super) fn proposal(dialect: &Dialect, known: &ColumnMapping) -> String {
    let (mapping, guesses) = mapping(dialect, known);
    if guesses.is_empty() {
        return format!(
            " A mapping says which column is what, such as `t_s=NAME/ms, x_m=NAME/mm`; the \
             quantities are {}. A file without a time needs its rate",
            COLUMNS.join(", ")
        );
    }
    let mut has_unit = true;
    let parts = COLUMNS.iter().enumerate().filter_map(|(i, quantity)| {
        let expression = match guesses.iter().find(|guess| guess.quantity == i) {
            // The motion may decide otherwise, which an error has no time to look at.
            Some(guess) if guess.is_by_size() => {
                has_unit = false;
                format!("{}/UNIT", name(dialect, guess.column))
            }
            Some(_) => mapping.expressions[i].as_ref()?.text(i),
            None => known.expressions[i].as_ref()?.text(i),
        };
        Some(format!("{quantity}={expression}"))
    });
    let parts = parts.collect::<Vec<_>>().join(", ");
    // Names such as `MV_x` leave open which of two commands moves the ball along which axis.
    let has_two = [1, 2].iter().all(|i| guesses.iter().any(|guess| guess.quantity == *i));
    let units = match (has_unit, has_two) {
        (true, _) => "",
        (false, false) => "; `offbd inspect` proposes each UNIT by the motion",
        (false, true) => {
            "; `offbd inspect` proposes each UNIT, and which command is which, by the motion"
        }
    };
    format!(" This mapping is likely: `{parts}`{units}")
}

#[cfg(test)]
mod tests {
    use super::super::dialect::detect;
    use super::*;

    fn guessed(text: &str) -> String {
        let dialect = detect(text.as_bytes(), true).unwrap();
        mapping(&dialect, &ColumnMapping::default()).0.to_string()
    }

    #[test]
    fn names_units_and_sizes_say_what_a_column_is() {
        for (text, mapping) in [
            (
                ",time,x,y,MV_x,MV_y\n0,895.71,2.09,0.51,0.43,-1.23\n1,895.73,2.1,0.5,4,-3\n",
                "t_s=time/s, cmd_qx_rad=MV_y/deg, cmd_qy_rad=MV_x/deg, x_m=x/mm, y_m=y/mm",
            ),
            (
                "time,time_rel,dt,x,xdot,theta,theta_deg\n1.5,0,0.02,0.1,0,0.01,0.5\n1.52,0,0.02,0.1,0,0,0\n",
                "t_s=time/s, cmd_qy_rad=theta/rad, x_m=x/m",
            ),
            (
                "ts_us;roll_deg;pitch_deg;bx [mm];by [mm]\n0;1;2;3;4\n10000;1;2;3;4\n",
                "t_s=ts_us/us, cmd_qx_rad=roll_deg/deg, cmd_qy_rad=pitch_deg/deg, x_m='bx [mm]'/mm, y_m='by [mm]'/mm",
            ),
            (
                "Zeit [ms]\tWinkel X [°]\tWinkel Y [°]\tBall X [cm]\tBall Y [cm]\n0\t1\t2\t3\t4\n",
                "t_s='Zeit [ms]'/ms, cmd_qx_rad='Winkel Y [°]'/deg, cmd_qy_rad='Winkel X [°]'/deg, x_m='Ball X [cm]'/cm, y_m='Ball Y [cm]'/cm",
            ),
            ("x-axis,1,2\nsecond,Volt,Volt\n-1.97,0.4,-0.8\n-1.96,0.4,-0.5\n", "t_s='x-axis'/s"),
            (
                "cmdX,cmdY,ballX,ballY\n0.1,0.1,0.01,0.01\n",
                "cmd_qx_rad=cmdY/rad, cmd_qy_rad=cmdX/rad, x_m=ballX/m, y_m=ballY/m",
            ),
            (
                "t_s,qx,qy,ball/position/x,ball/position/y\n0,0.1,0.1,0.01,0.01\n",
                "t_s=#1/s, cmd_qx_rad=qx/rad, cmd_qy_rad=qy/rad, x_m='ball/position/x'/m, y_m='ball/position/y'/m",
            ),
            ("0,1,2\n1,2,3\n", ""),
            (
                "time,angle_deg,ball_mm\n0,1,3\n0.01,1,3\n",
                "t_s=time/s, cmd_qy_rad=angle_deg/deg, x_m=ball_mm/mm",
            ),
            (
                "time,qy,ball seen,pos\n0,0.1,1,0.1\n0.01,0.1,1,0.1\n",
                "t_s=time/s, cmd_qy_rad=qy/rad, x_m=pos/m",
            ),
            ("t_ms,px,py\n0,0.1,0.2\n10,0.1,0.2\n", "t_s=t_ms/ms, x_m=px/m, y_m=py/m"),
            ("t_ms,ball_x_px,adc_y,servo_raw\n0,320,200,512\n10,320,200,512\n", "t_s=t_ms/ms"),
        ] {
            assert_eq!(guessed(text), mapping, "{text}");
        }
    }

    #[test]
    fn an_error_proposes_no_unit_that_only_the_size_speaks_for() {
        let text = "time,x,y [mm],roll\n895.71,2.09,51,0.1\n895.73,2.1,50,0.1\n";
        let dialect = detect(text.as_bytes(), true).unwrap();
        let proposed = proposal(&dialect, &ColumnMapping::default());
        let mapping = "t_s=time/s, cmd_qx_rad=roll/UNIT, x_m=x/UNIT, y_m='y [mm]'/mm";
        assert!(proposed.contains(mapping), "{proposed}");
    }
}
