//! The show: streams sessions in real time, injects faults, and prints detected ones.
//!
//! At every tick, all rows due by the rig's clock are sent, so that the show catches up
//! after a stall and no row is lost.

use std::collections::VecDeque;
use std::io::Write;
use std::time::Duration;

use tokio::sync::mpsc;
use tokio::time::{Instant, Interval, MissedTickBehavior, interval, timeout};

use super::client::{self, Client, Uplink};
use super::comparison::FaultComparison;
use super::controls::{VisitorCommand, VisitorControls};
use super::events;
use super::plan::{self, Episode};
use offbd_core::vocabulary::{FaultCode, Sample};
use offbd_lab::simulation::{Fault, FaultEffect, SimulatedRig};
use offbd_terminal::{output, table};
use offbd_wire::verdict::FaultView;

/// Interval between two batches; chosen: ten rows at 100 Hz.
const TICK: Duration = Duration::from_millis(100);
/// Maximum number of rows of a batch; chosen. After a stall several batches are sent.
const MAX_ROWS: usize = 1000;
/// Maximum wait for the events of a session after its verdict; chosen.
const LAST_EVENTS: Duration = Duration::from_secs(5);

/// A show in progress.
pub(super) struct Show {
    client: Client,
    rig: SimulatedRig,
    next: Sample,
    speed: f64,
    started: Instant,
    ticks: Interval,
    events: mpsc::Receiver<FaultView>,
    comparison: FaultComparison,
    controls: VisitorControls,
    /// Whether the script injects and repairs faults.
    script: bool,
    /// Whether the script clears codes, so that it can show each fault again.
    clears: bool,
    /// Prefix of the names of this show's sessions.
    name: String,
    n_sessions: u32,
}

/// Why a session's stream ends.
enum StreamEnd {
    /// The episode has ended.
    End,
    /// Ctrl-C.
    Interrupted,
    /// A visitor has given a command.
    Command(VisitorCommand),
}

/// One session in progress.
struct StreamedSession {
    name: String,
    /// The service's id, once a batch has been acknowledged.
    id: Option<String>,
    uplink: Uplink,
    end_s: f64,
    /// Messages still to be printed, with their times, s.
    to_announce: Vec<(f64, String)>,
}

impl StreamedSession {
    /// Prints the messages due by `due_s`.
    fn announce(&mut self, due_s: f64) {
        self.to_announce.retain(|(at_s, text)| {
            if *at_s <= due_s {
                say(*at_s, text);
            }
            *at_s > due_s
        });
    }
}

/// Returns the messages about the faults of an episode, in order.
fn announcements(episode: &Episode) -> Vec<(f64, String)> {
    let of_fault = |fault: &Fault| {
        let what = format!("{}:{}", fault.effect.code(), fault.effect.kind());
        let injected = (fault.onset_s, format!(">> {what} injected"));
        let repaired = fault.end_s.map(|end_s| (end_s, format!(">> {what} repaired")));
        std::iter::once(injected).chain(repaired)
    };
    let mut all: Vec<_> = episode.faults.iter().flat_map(of_fault).collect();
    all.sort_by(|a, b| a.0.total_cmp(&b.0));
    all
}

impl Show {
    #[expect(clippy::disallowed_methods, reason = "the show runs in real time")]
    /// Begins a show. If it `clears`, nothing of earlier faults is on record.
    pub(super) async fn new(
        client: Client,
        mut rig: SimulatedRig,
        speed: f64,
        controls: VisitorControls,
        clears: bool,
    ) -> anyhow::Result<Self> {
        let cleared = FaultCode::ALL.iter().filter(|_| clears);
        for &code in cleared {
            client.clear(code).await?;
        }
        let events = events::listen(client.events().await?);
        let mut ticks = interval(TICK);
        ticks.set_missed_tick_behavior(MissedTickBehavior::Skip);
        // To the millisecond: the next demo with the same store may start within the same
        // second, and sessions of the same name would be merged.
        let name = jiff::Timestamp::now().strftime("demo-%Y%m%dT%H%M%S%.3f").to_string();
        let (next, started) = (rig.next_sample(), Instant::now());
        let comparison = FaultComparison::default();
        Ok(Self {
            client,
            rig,
            next,
            speed,
            started,
            ticks,
            events,
            comparison,
            controls,
            script: true,
            clears,
            name,
            n_sessions: 0,
        })
    }

    /// Streams all `episodes`, and the sessions that visitors control in between; returns
    /// whether Ctrl-C interrupted them.
    pub(super) async fn run(&mut self, episodes: Vec<Episode>) -> anyhow::Result<bool> {
        let end_s = episodes.last().map_or(0.0, |last| last.end_s);
        let mut rest = VecDeque::from(episodes);
        while let Some(mut episode) = rest.pop_front() {
            let mut end = self.scripted(&mut episode).await?;
            if let StreamEnd::Command(command) = end {
                end = self.by_hand(command, end_s).await?;
                plan::go_on(&mut rest, self.next.t_s, end_s);
            }
            if matches!(end, StreamEnd::Interrupted) {
                return Ok(true);
            }
        }
        Ok(false)
    }

    /// Streams an episode as planned, until its end or a visitor's command.
    async fn scripted(&mut self, episode: &mut Episode) -> anyhow::Result<StreamEnd> {
        let mut session = self.begin(episode).await?;
        let end = self.stream(&mut session).await?;
        self.end(session, episode).await?;
        Ok(end)
    }

    /// Streams a session in which visitors inject and repair faults, until they resume the
    /// script.
    async fn by_hand(&mut self, first: VisitorCommand, end_s: f64) -> anyhow::Result<StreamEnd> {
        self.script = false;
        self.repair();
        let start_s = self.next.t_s;
        let mut episode = Episode { start_s, end_s, faults: Vec::new() };
        let mut session = self.begin(&episode).await?;
        let mut end = StreamEnd::Command(first);
        while let StreamEnd::Command(command) = end {
            match command {
                VisitorCommand::Script => break,
                VisitorCommand::Repair => self.repair(),
                VisitorCommand::Break(effect) => self.break_now(effect, &mut episode).await?,
            }
            end = self.stream(&mut session).await?;
        }
        self.repair();
        self.end(session, &episode).await?;
        self.script = true;
        Ok(end)
    }

    fn repair(&mut self) {
        FaultCode::ALL.iter().for_each(|&code| self.rig.repair(code));
        say(self.rig.truth().t_s, ">> all repaired");
    }

    async fn break_now(
        &mut self,
        effect: FaultEffect,
        episode: &mut Episode,
    ) -> anyhow::Result<()> {
        self.clear_if_found_before(effect.code()).await?;
        self.rig.repair(effect.code());
        let onset_s = self.rig.truth().t_s;
        let fault = Fault { effect, onset_s, end_s: None };
        self.rig.inject(fault);
        episode.faults.push(fault);
        say(onset_s, &format!(">> {}:{} injected", effect.code(), effect.kind()));
        Ok(())
    }

    /// Updates the state that visitors see.
    fn show(&self) {
        let now_s = self.rig.truth().t_s;
        let broken = self.rig.faults().map(|t| t.fault).filter(|fault| fault.active(now_s));
        let words = |fault: Fault| format!("{}:{}", fault.effect.code(), fault.effect.kind());
        self.controls.show(self.script, broken.map(words).collect());
    }

    /// Writes the comparison; returns whether injected and confirmed faults agree.
    pub(super) fn conclude(&self) -> anyhow::Result<bool> {
        let mut out = output::stdout();
        writeln!(out)?;
        self.comparison.write(&mut out)?;
        out.flush()?;
        Ok(self.comparison.agrees())
    }

    /// Begins a session; sessions alternate between WebSocket and HTTP.
    async fn begin(&mut self, episode: &Episode) -> anyhow::Result<StreamedSession> {
        self.n_sessions += 1;
        let name = format!("{}-{}", self.name, self.n_sessions);
        let by_socket = self.n_sessions % 2 == 1;
        let uplink = if by_socket {
            self.client.connect().await?
        } else {
            Uplink::Http(self.client.clone())
        };
        for fault in &episode.faults {
            if self.clears {
                self.clear_if_found_before(fault.effect.code()).await?;
            }
            self.rig.inject(*fault);
        }
        say(episode.start_s, &format!(">> session {name} begins, over {}", uplink.name()));
        let to_announce = announcements(episode);
        Ok(StreamedSession { name, id: None, uplink, end_s: episode.end_s, to_announce })
    }

    /// Clears a code that was confirmed in an earlier session, as a workshop does after a
    /// repair, before its fault is injected again.
    async fn clear_if_found_before(&self, code: FaultCode) -> anyhow::Result<()> {
        if self.comparison.has_found(code) { self.client.clear(code).await } else { Ok(()) }
    }

    async fn stream(&mut self, session: &mut StreamedSession) -> anyhow::Result<StreamEnd> {
        loop {
            tokio::select! {
                _ = self.ticks.tick() => {}
                Some(fault) = self.events.recv() => {
                    self.heard(&fault);
                    continue;
                }
                command = self.controls.next() => return Ok(StreamEnd::Command(command)),
                interrupted = tokio::signal::ctrl_c() => {
                    interrupted?;
                    return Ok(StreamEnd::Interrupted);
                }
            }
            let due_s = (self.started.elapsed().as_secs_f64() * self.speed).min(session.end_s);
            self.send_due(session, due_s).await?;
            self.show();
            if due_s >= session.end_s {
                return Ok(StreamEnd::End);
            }
        }
    }

    async fn send_due(&mut self, session: &mut StreamedSession, due_s: f64) -> anyhow::Result<()> {
        self.rig.tune(self.controls.gains())?;
        let mut rows = Vec::new();
        while self.next.t_s < due_s {
            rows.push(std::mem::replace(&mut self.next, self.rig.next_sample()));
        }
        for batch in rows.chunks(MAX_ROWS) {
            let ack = match session.uplink.send(&session.name, batch).await {
                Err(error) if client::is_ended(&error) => {
                    self.continue_in_new_session(session);
                    session.uplink.send(&session.name, batch).await?
                }
                ack => ack?,
            };
            session.id = ack.session_id.or(session.id.take());
        }
        session.announce(due_s);
        Ok(())
    }

    /// Continues in a new session, as a device does, after a visitor has ended this one.
    fn continue_in_new_session(&mut self, session: &mut StreamedSession) {
        self.n_sessions += 1;
        (session.name, session.id) = (format!("{}-{}", self.name, self.n_sessions), None);
        say(self.rig.truth().t_s, &format!(">> ended by a visitor; session {}", session.name));
    }

    /// Ends a session, and waits for the events of its verdict.
    async fn end(&mut self, session: StreamedSession, episode: &Episode) -> anyhow::Result<()> {
        let StreamedSession { name, id, uplink, .. } = session;
        uplink.close().await;
        let mut confirmed = Vec::new();
        let mut hash = "-".to_owned();
        if let Some(id) = id
            && let Some(verdict) = self.client.end_session(&id).await?.verdict
        {
            (confirmed, hash) = (verdict.faults, verdict.verdict_hash);
        }
        let hear_all = async {
            while !self.comparison.has_heard(&name, &confirmed) {
                let Some(fault) = self.events.recv().await else { return };
                self.heard(&fault);
            }
        };
        if timeout(LAST_EVENTS, hear_all).await.is_err() {
            tracing::warn!(session = name, "a confirmed fault did not come over the events");
        }
        let now_s = self.rig.truth().t_s.min(episode.end_s);
        let short = hash.get(..12).unwrap_or(&hash);
        say(now_s, &format!(">> session {name} ends, verdict hash {short}"));
        let of_episode = |truth: &&offbd_lab::simulation::FaultTruth| {
            // The end is not compared: a visitor's repair may differ from the plan.
            let is_it =
                |f: &Fault| (f.effect, f.onset_s) == (truth.fault.effect, truth.fault.onset_s);
            episode.faults.iter().any(is_it) && truth.fault.onset_s <= now_s
        };
        self.comparison.injected(&name, self.rig.faults().filter(of_episode).copied());
        Ok(())
    }

    fn heard(&mut self, fault: &FaultView) {
        say(fault.t_s, &fault.summary);
        self.comparison.heard(fault);
    }
}

/// Prints a message with the time on the rig's clock.
fn say(t_s: f64, text: &str) {
    anstream::println!("{}", table::wrapped(&format!("{t_s:>8.2} s  "), text));
}
