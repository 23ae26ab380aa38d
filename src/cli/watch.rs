//! `offbd watch`: shows an asset live in the terminal. An ordinary client of the
//! interface: it receives states and fault lines over the WebSocket.

mod connect;

use std::io::{IsTerminal, Write};

use anyhow::bail;
use clap::Args;
use futures_util::StreamExt;
use serde_json::Value;
use tokio_tungstenite::tungstenite::Message;

use self::connect::{ConnectArgs, connect};
use offbd_terminal::output::{self, OutputFormat};
use offbd_terminal::table;
use offbd_wire::learning::LearningView;
use offbd_wire::service::{MonitorView, StateView};
use offbd_wire::verdict::{AxisEvidenceView, FaultView};

/// Shows an asset live: residuals and their limits, monitors, faults.
///
/// In a terminal the state is updated in place; otherwise each state that differs
/// from the one before is printed as a line, below a heading for each session. Changes of faults are printed
/// when they happen. With --format json each state and each change is one JSON
/// object, as the service sends it. Ends with Ctrl-C
/// or when the service stops.
#[derive(Clone, Debug, Args)]
#[command(after_help = "Examples:\n  \
    offbd watch demo-rig\n  \
    offbd watch bench-1 --url 192.168.1.5:8087 --hz 1\n  \
    offbd watch bench-1 --url https://rigs.example --token-file token\n  \
    offbd watch bench-1 --states 1 --format json | jq .evidence")]
pub(super) struct WatchArgs {
    /// Name of the asset
    asset: String,
    #[command(flatten)]
    connect: ConnectArgs,
    /// States per second, 0.1 to 50
    #[arg(long, default_value_t = 4.0, value_name = "HZ", value_parser = rate)]
    hz: f64,
    /// End after this number of states [default: no limit]
    #[arg(long, value_name = "N")]
    states: Option<u64>,
    /// Text for people, or one JSON object per line
    #[arg(long, value_enum, default_value_t = OutputFormat::Table)]
    format: OutputFormat,
}

fn rate(word: &str) -> Result<f64, String> {
    let value: Option<f64> = word.parse().ok();
    value.filter(|v| (0.1..=50.0).contains(v)).ok_or_else(|| "must be from 0.1 to 50".to_owned())
}

/// Width of a bar, characters.
const BAR: usize = 24;

pub(super) fn run(args: &WatchArgs) -> anyhow::Result<()> {
    offbd_terminal::block_on(watch(args))
}

async fn watch(args: &WatchArgs) -> anyhow::Result<()> {
    let mut socket = connect(&args.connect, &args.asset, args.hz).await?;
    let redraws = std::io::stdout().is_terminal();
    let mut screen = Screen { asset: args.asset.clone(), redraws, ..Screen::default() };
    let mut left = args.states.unwrap_or(u64::MAX);
    while left > 0 {
        let Some(message) = socket.next().await else { bail!("the service closed the stream") };
        let Message::Text(text) = message? else { continue };
        let frame: Value = serde_json::from_str(&text)?;
        let kind = frame["type"].as_str();
        let is_state = kind == Some("state");
        match kind {
            Some("state" | "fault") if args.format == OutputFormat::Json => {
                left -= u64::from(is_state);
                output::print_line(&text)?;
            }
            Some("state") => {
                left -= u64::from(screen.state(&serde_json::from_value(frame)?)?);
            }
            Some("fault") => screen.fault(&serde_json::from_value(frame)?)?,
            Some("error") => bail!("{}", frame["problem"]["detail"]),
            _ => {}
        }
    }
    Ok(())
}

/// The output, in a terminal or as plain lines.
#[derive(Default)]
struct Screen {
    /// Name of the asset.
    asset: String,
    /// Whether each state replaces the previous one.
    redraws: bool,
    /// Number of lines of the previous state.
    drawn: usize,
    /// The session, and the progress of learning, that plain lines are about.
    session: Option<String>,
    learning: Option<String>,
    /// The plain line of the latest state.
    last: String,
}

impl Screen {
    /// Shows a state; returns whether it differs from the one before.
    fn state(&mut self, state: &StateView) -> std::io::Result<bool> {
        let lines = if self.redraws { block(state) } else { self.plain(state) };
        if lines.is_empty() {
            return Ok(false);
        }
        let mut out = output::stdout();
        self.erase(&mut out)?;
        self.drawn = lines.len();
        lines.iter().try_for_each(|line| writeln!(out, "{line}"))?;
        out.flush()?;
        Ok(true)
    }

    /// A state as one line, after a heading if the session is another one, and after the
    /// progress of learning if it has changed; nothing if it is that of the state before.
    fn plain(&mut self, state: &StateView) -> Vec<String> {
        let mut lines = self.heading(state.session.as_deref().unwrap_or("no session"));
        let learning = state.learning.as_ref().map(|learning| learning.summary.clone());
        if self.learning != learning {
            let summary = learning.iter().map(|summary| table::wrapped("  calibration: ", summary));
            lines.extend(summary);
            self.learning = learning;
        }
        let line = line(state);
        if line != self.last {
            lines.push(line.clone());
            self.last = line;
        }
        lines
    }

    /// The heading of plain lines, if they are about another session than those before.
    fn heading(&mut self, session: &str) -> Vec<String> {
        if self.session.as_deref() == Some(session) {
            return Vec::new();
        }
        self.session = Some(session.to_owned());
        vec![format!("{}, {session}", self.asset), HEADING.to_owned()]
    }

    fn fault(&mut self, fault: &FaultView) -> std::io::Result<()> {
        let lines = self.transition(fault);
        let mut out = output::stdout();
        self.erase(&mut out)?;
        self.drawn = 0;
        lines.iter().try_for_each(|line| writeln!(out, "{line}"))?;
        out.flush()
    }

    /// A transition, after a heading if plain lines were about another session.
    fn transition(&mut self, fault: &FaultView) -> Vec<String> {
        let mut lines = match self.redraws {
            true => Vec::new(),
            false => self.heading(&fault.session),
        };
        lines.push(table::wrapped(&format!("{:>8.2} s  ", fault.t_s), &fault.summary));
        lines
    }

    /// Erases the lines of the previous state (ECMA-48 CUU, ED).
    fn erase(&self, out: &mut impl Write) -> std::io::Result<()> {
        if self.redraws && self.drawn > 0 {
            write!(out, "\x1b[{}A\x1b[J", self.drawn)
        } else {
            Ok(())
        }
    }
}

fn head(state: &StateView) -> String {
    let (session, t_s) = (state.session.as_deref(), state.t_s.unwrap_or(0.0));
    let session = session.unwrap_or("no session");
    format!("{t_s:>8.2} s  {}  {session}  {} samples", state.asset, state.samples)
}

/// Heading of the plain lines: the columns of [`line`].
const HEADING: &str =
    "       time    samples     x residual     y residual   judged % x y ball sensor";

/// A state as one line, for logs.
fn line(state: &StateView) -> String {
    let axis = |axis: &AxisEvidenceView| match axis.residual_m_s2 {
        Some(residual) => format!("{residual:+.2}/{:.2}", axis.limit_m_s2),
        None => "-".to_owned(),
    };
    let percent = |m: &MonitorView| format!("{:.0}", 100.0 * m.judged_share);
    let judged: Vec<String> = state.monitors.iter().map(percent).collect();
    let (x, y) = (axis(&state.evidence.x), axis(&state.evidence.y));
    let (t_s, samples) = (state.t_s.unwrap_or(0.0), state.samples);
    format!("{t_s:>9.2} s {samples:>10} {x:>14} {y:>14}   {}", judged.join(" "))
}

/// A state as a block of lines: a bar for each residual, and the monitors.
fn block(state: &StateView) -> Vec<String> {
    let evidence = &state.evidence;
    let monitor = |m: &MonitorView| {
        let off = if m.enabled { "" } else { " (not tested now)" };
        let judged = table::judged(m.judged_share, m.judged_s);
        format!("           {:<11} {:>4}  judged {judged}{off}", m.code, m.counter)
    };
    let mut lines = vec![head(state), bar("x", &evidence.x), bar("y", &evidence.y)];
    lines.extend(state.monitors.iter().map(monitor));
    lines.push(format!("           twin: {}", state.fidelity));
    lines.extend(state.learning.iter().flat_map(learning));
    lines
}

/// The progress of learning, as separate lines of the screen, because lines to erase are
/// counted.
fn learning(learning: &LearningView) -> Vec<String> {
    let words = table::wrapped("           calibration: ", &learning.summary);
    words.lines().map(str::to_owned).collect()
}

/// A bar for a residual; `|` marks the limit, at two thirds of the width.
fn bar(name: &str, axis: &AxisEvidenceView) -> String {
    let Some(residual) = axis.residual_m_s2 else {
        return format!("         {name} [{:BAR$}] no residual", "");
    };
    let at_limit = BAR * 2 / 3;
    let share = residual.abs() / axis.limit_m_s2.max(f64::MIN_POSITIVE);
    let filled = ((share * at_limit as f64).round() as usize).min(BAR);
    let cell = |i: usize| {
        if i == at_limit {
            '|'
        } else if i < filled {
            '#'
        } else {
            ' '
        }
    };
    let cells: String = (0..BAR).map(cell).collect();
    let gate = if axis.enabled { "judged" } else { "not tested" };
    format!("         {name} [{cells}] {residual:+.2} of {:.2} m/s², {gate}", axis.limit_m_s2)
}

#[cfg(test)]
mod tests {
    use super::*;
    use offbd_core::diagnosis::{Evidence, StatusByte, Suspicion, Transition};
    use offbd_core::engine::State;
    use offbd_core::vocabulary::{FaultCode, FaultStatus, SimTime};
    use offbd_wire::basis::Basis;
    use offbd_wire::learning::LearningState;
    use offbd_wire::service::state_view;
    use offbd_wire::verdict::fault_view;

    fn axis(residual: Option<f64>) -> AxisEvidenceView {
        AxisEvidenceView {
            residual_m_s2: residual,
            limit_m_s2: 0.5,
            enabled: true,
            ..AxisEvidenceView::default()
        }
    }

    fn gathering(summary: &str) -> StateView {
        let mut state = state_view("new", None, &State::default());
        state.learning = Some(LearningView {
            asset: "new".to_owned(),
            state: LearningState::Gathering,
            summary: summary.to_owned(),
            wanted_s: 60.0,
            x_s: Some(23.0),
            y_s: None,
            t_s: None,
            sessions: Vec::new(),
            n_sessions: 0,
            calibration: None,
            refused: None,
            by_itself: false,
            refines: false,
        });
        state
    }

    #[test]
    fn the_progress_of_learning_is_shown() {
        let words = "Gathering motion: x 23 of 60 s.";
        let state = gathering(words);
        let mut screen = Screen::default();
        let plain = screen.plain(&state);
        assert!(plain.contains(&format!("  calibration: {words}")), "{plain:?}");
        assert!(screen.plain(&state).is_empty(), "nothing has changed");
        assert_eq!(block(&state).last().unwrap().trim(), format!("calibration: {words}"));
        let long = block(&gathering(&"record steps or circles, ".repeat(9)));
        assert!(long.iter().all(|line| !line.contains('\n')), "each line is counted");
        let learnt = StateView { learning: None, ..state };
        assert!(block(&learnt).len() < long.len());
        assert!(screen.plain(&learnt).is_empty(), "the evidence has not changed");
    }

    #[test]
    fn plain_lines_fit_and_say_once_what_they_are_about() {
        let mut screen = Screen { asset: "rig".to_owned(), ..Screen::default() };
        let mut state = state_view("rig", None, &State::default());
        state.session = Some("monday".to_owned());
        state.t_s = Some(123_456.78);
        state.samples = 1_234_567_890;
        state.evidence.x = axis(Some(-12.34));
        let first = screen.plain(&state);
        assert_eq!((first.len(), &*first[0]), (3, "rig, monday"));
        assert!(first.iter().all(|line| line.chars().count() <= 80), "{first:?}");
        assert!(first[2].contains("-12.34/0.50"), "{first:?}");
        assert!(screen.plain(&state).is_empty(), "nothing has changed");
        state.samples += 1;
        assert_eq!(screen.plain(&state).len(), 1);
        state.session = None;
        assert_eq!(screen.plain(&state)[0], "rig, no session");
    }

    #[test]
    fn a_transition_comes_after_the_heading_of_its_session() {
        let transition = Transition {
            at: SimTime::new(2.5).unwrap(),
            code: FaultCode::XServo,
            status: FaultStatus::Confirmed,
            byte: StatusByte::default(),
            suspicion: Suspicion::default(),
            evidence: Evidence::default(),
        };
        let fault = fault_view("monday", &Basis::default(), &transition);
        let mut screen = Screen { asset: "rig".to_owned(), ..Screen::default() };
        let first = screen.transition(&fault);
        assert_eq!(first[..2], ["rig, monday", HEADING]);
        assert!(first[2].starts_with("    2.50 s  X servo "), "{first:?}");
        assert_eq!(screen.transition(&fault), first[2..]);
        let mut terminal = Screen { redraws: true, ..Screen::default() };
        assert_eq!(terminal.transition(&fault), first[2..], "the session is in the state's lines");
    }

    #[test]
    fn a_bar_reaches_its_mark_at_the_limit() {
        let n = |residual: f64| bar("x", &axis(Some(residual))).matches('#').count();
        assert_eq!((n(0.0), n(-0.25), n(0.5)), (0, 8, 16));
        assert_eq!(n(50.0), BAR - 1, "full, but for the mark");
        assert!(bar("x", &axis(None)).contains("no residual"));
    }
}
