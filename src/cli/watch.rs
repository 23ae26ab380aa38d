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
use super::{output, table};
use crate::wire::learning::LearningView;
use crate::wire::service::{MonitorView, StateView};
use crate::wire::verdict::{AxisEvidenceView, FaultView};

/// Shows an asset live: residuals and their limits, monitors, faults.
///
/// In a terminal the state is updated in place; otherwise each state is printed
/// as a line. Changes of faults are printed when they happen. Ends with Ctrl-C
/// or when the service stops.
#[derive(Clone, Debug, Args)]
#[command(after_help = "Examples:\n  \
    offbd watch demo-rig\n  \
    offbd watch bench-1 --address 192.168.1.5:8087 --hz 1\n  \
    offbd watch bench-1 --address https://rigs.example --token-file token\n  \
    offbd watch bench-1 --states 1")]
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
}

fn rate(word: &str) -> Result<f64, String> {
    let value: Option<f64> = word.parse().ok();
    value.filter(|v| (0.1..=50.0).contains(v)).ok_or_else(|| "must be from 0.1 to 50".to_owned())
}

/// Width of a bar, characters.
const BAR: usize = 24;

pub(super) fn run(args: &WatchArgs) -> anyhow::Result<()> {
    super::block_on(watch(args))
}

async fn watch(args: &WatchArgs) -> anyhow::Result<()> {
    let mut socket = connect(&args.connect, &args.asset, args.hz).await?;
    let mut screen = Screen { redraws: std::io::stdout().is_terminal(), drawn: 0 };
    let mut left = args.states.unwrap_or(u64::MAX);
    while left > 0 {
        let Some(message) = socket.next().await else { bail!("the service closed the stream") };
        let Message::Text(text) = message? else { continue };
        let frame: Value = serde_json::from_str(&text)?;
        match frame["type"].as_str() {
            Some("state") => {
                left -= 1;
                screen.state(&serde_json::from_value(frame)?)?;
            }
            Some("fault") => screen.fault(&serde_json::from_value(frame)?)?,
            Some("error") => bail!("{}", frame["problem"]["detail"]),
            _ => {}
        }
    }
    Ok(())
}

/// The output, in a terminal or as plain lines.
struct Screen {
    /// Whether each state replaces the previous one.
    redraws: bool,
    /// Number of lines of the previous state.
    drawn: usize,
}

impl Screen {
    fn state(&mut self, state: &StateView) -> std::io::Result<()> {
        let lines = if self.redraws { block(state) } else { vec![line(state)] };
        let mut out = output::stdout();
        self.erase(&mut out)?;
        self.drawn = lines.len();
        lines.iter().try_for_each(|line| writeln!(out, "{line}"))?;
        out.flush()
    }

    fn fault(&mut self, fault: &FaultView) -> std::io::Result<()> {
        let mut out = output::stdout();
        self.erase(&mut out)?;
        self.drawn = 0;
        let when = format!("{:>8.2} s  ", fault.t_s);
        writeln!(out, "{}", table::wrapped(&when, &fault.summary))?;
        out.flush()
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

/// A state as one line, for logs.
fn line(state: &StateView) -> String {
    let axis = |name: &str, axis: &AxisEvidenceView| match axis.residual_m_s2 {
        Some(residual) => format!("{name} {residual:+.2}/{:.2}", axis.limit_m_s2),
        None => format!("{name} -"),
    };
    let evidence = &state.evidence;
    let share = |m: &MonitorView| format!("{} {:.0} %", m.code, 100.0 * m.judged_share);
    let judged: Vec<String> = state.monitors.iter().map(share).collect();
    let (x, y) = (axis("x", &evidence.x), axis("y", &evidence.y));
    let learning =
        state.learning.as_ref().map(|l| format!("  {}: {}", l.state.as_str(), l.summary));
    let learning = learning.unwrap_or_default();
    format!("{}  {x}  {y}  judged {}{learning}", head(state), judged.join(", "))
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
    let words = table::wrapped("           learning: ", &learning.summary);
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
    let gate = if axis.enabled { "judged" } else { "gate closed" };
    format!("         {name} [{cells}] {residual:+.2} of {:.2} m/s², {gate}", axis.limit_m_s2)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::wire::learning::LearningState;
    use crate::wire::service::state_view;
    use offbd_core::engine::State;

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
        assert!(line(&state).ends_with(&format!("gathering: {words}")), "{}", line(&state));
        assert_eq!(block(&state).last().unwrap().trim(), format!("learning: {words}"));
        let long = block(&gathering(&"record steps or circles, ".repeat(9)));
        assert!(long.iter().all(|line| !line.contains('\n')), "each line is counted");
        let learnt = StateView { learning: None, ..state };
        assert!(!line(&learnt).contains("Gathering") && block(&learnt).len() < long.len());
    }

    #[test]
    fn a_bar_reaches_its_mark_at_the_limit() {
        let n = |residual: f64| bar("x", &axis(Some(residual))).matches('#').count();
        assert_eq!((n(0.0), n(-0.25), n(0.5)), (0, 8, 16));
        assert_eq!(n(50.0), BAR - 1, "full, but for the mark");
        assert!(bar("x", &axis(None)).contains("no residual"));
    }
}
