//! `offbd watch`: an asset in the terminal, live. A client of the interface as
//! any other: states and fault lines over the WebSocket.

use std::io::{IsTerminal, Write};
use std::path::PathBuf;

use anyhow::{Context, bail};
use clap::Args;
use futures_util::StreamExt;
use serde_json::Value;
use tokio_tungstenite::connect_async;
use tokio_tungstenite::tungstenite::Message;
use tokio_tungstenite::tungstenite::client::IntoClientRequest;
use tokio_tungstenite::tungstenite::handshake::client::Request;
use tokio_tungstenite::tungstenite::http::HeaderValue;
use tokio_tungstenite::tungstenite::http::header::AUTHORIZATION;

use super::unusable::{self, Unusable};
use super::{output, table};
use crate::wire::learning::LearningView;
use crate::wire::service::{MonitorView, StateView};
use crate::wire::verdict::{AxisEvidenceView, FaultView};

/// Follows an asset live: residuals against their limits, monitors, faults.
///
/// In a terminal the last lines are drawn anew; elsewhere a line is printed for
/// each state. Changes of faults are printed as they happen. Ends with Ctrl-C or
/// when the service stops.
#[derive(Clone, Debug, Args)]
#[command(after_help = "Examples:\n  \
    offbd watch demo-rig\n  \
    offbd watch bench-1 --address 192.168.1.5:8087 --hz 1\n  \
    offbd watch bench-1 --states 1")]
pub(super) struct WatchArgs {
    /// Name of the asset
    asset: String,
    /// Where the service listens
    #[arg(long, default_value = "127.0.0.1:8087", value_name = "HOST:PORT")]
    address: String,
    /// States a second, 0.1 to 50
    #[arg(long, default_value_t = 4.0, value_name = "HZ", value_parser = rate)]
    hz: f64,
    /// File with a token, where the service asks for one
    #[arg(long, value_name = "FILE")]
    token_file: Option<PathBuf>,
    /// End after so many states [default: none]
    #[arg(long, value_name = "N")]
    states: Option<u64>,
}

fn rate(word: &str) -> Result<f64, String> {
    let value: Option<f64> = word.parse().ok();
    value.filter(|v| (0.1..=50.0).contains(v)).ok_or_else(|| "not from 0.1 to 50".to_owned())
}

/// Characters of a bar.
const BAR: usize = 24;

pub(super) fn run(args: &WatchArgs) -> anyhow::Result<()> {
    super::runtime()?.block_on(watch(args))
}

async fn watch(args: &WatchArgs) -> anyhow::Result<()> {
    let WatchArgs { asset, address, .. } = args;
    let connected = connect_async(request(args)?).await;
    let (mut socket, _) =
        connected.with_context(|| format!("no stream of {asset} at {address}"))?;
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

/// The request for the stream, with the token if there is one.
fn request(args: &WatchArgs) -> anyhow::Result<Request> {
    let WatchArgs { asset, address, hz, token_file, .. } = args;
    let url = format!("ws://{address}/api/v1/assets/{asset}/stream?state={hz}");
    let mut request = url.into_client_request()?;
    if let Some(file) = token_file {
        let token = String::from_utf8(unusable::read(file)?);
        let token = token.map_err(|error| Unusable::file(file, error))?;
        let value = HeaderValue::from_str(&format!("Bearer {}", token.trim()));
        let mut value = value.map_err(|error| Unusable::file(file, error))?;
        value.set_sensitive(true);
        request.headers_mut().insert(AUTHORIZATION, value);
    }
    Ok(request)
}

struct Screen {
    /// Whether what was drawn last is drawn over.
    redraws: bool,
    /// Lines drawn last.
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

    /// Goes up over what was drawn last and clears it (ECMA-48 CUU, ED).
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

/// One line for logs.
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

/// A block that is drawn anew: a bar for each residual, the monitors.
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

/// How far a rig is on its way to being learnt, a line for each line of the screen:
/// what is drawn over must be counted.
fn learning(learning: &LearningView) -> Vec<String> {
    let words = table::wrapped("           learning: ", &learning.summary);
    words.lines().map(str::to_owned).collect()
}

/// The residual on a scale on which `|` is the limit, two thirds to the right.
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
    fn a_rig_that_is_not_learnt_says_how_far_it_is() {
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
