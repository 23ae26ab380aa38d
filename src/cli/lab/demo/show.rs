//! The show: sessions streamed in real time, faults injected, findings printed.
//!
//! The rig's clock is a deadline: at every tick all rows that are due by then
//! are sent, so that a stall is caught up with and nothing is lost.

use std::collections::VecDeque;
use std::io::Write;
use std::time::Duration;

use tokio::sync::mpsc;
use tokio::time::{Instant, Interval, MissedTickBehavior, interval, timeout};

use super::client::{self, Client, Uplink};
use super::events;
use super::hands::{Act, Hands};
use super::plan::{self, Episode};
use super::tally::Tally;
use crate::cli::{output, table};
use crate::wire::verdict::FaultView;
use offbd_core::vocabulary::{FaultCode, Sample};
use offbd_lab::simulation::{Fault, FaultEffect, SimulatedRig};

/// Time between two batches: ten rows at 100 Hz.
const TICK: Duration = Duration::from_millis(100);
/// Most rows of a batch; after a stall several follow each other.
const MAX_ROWS: usize = 1000;
/// How long the events may lag behind the verdict of a session that has ended.
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
    tally: Tally,
    hands: Hands,
    /// Whether faults come and go by themselves.
    script: bool,
    /// What the names of this show's sessions begin with.
    name: String,
    n_sessions: u32,
}

/// Why a session's stream ends.
enum Cut {
    /// It has come to its end.
    End,
    Interrupted,
    /// A visitor does something.
    Act(Act),
}

/// One session in progress.
struct Session {
    name: String,
    /// The service's id, once a batch has been acknowledged.
    id: Option<String>,
    uplink: Uplink,
    end_s: f64,
    /// What the person has not been told yet.
    to_announce: Vec<(f64, String)>,
}

impl Session {
    /// Says what was done to the rig by `due_s`.
    fn announce(&mut self, due_s: f64) {
        self.to_announce.retain(|(at_s, text)| {
            if *at_s <= due_s {
                say(*at_s, text);
            }
            *at_s > due_s
        });
    }
}

/// What is done to the rig in an episode, in order.
fn acts(episode: &Episode) -> Vec<(f64, String)> {
    let act = |fault: &Fault| {
        let what = format!("{}:{}", fault.effect.code(), fault.effect.kind());
        let injected = (fault.onset_s, format!(">> {what} injected"));
        let repaired = fault.end_s.map(|end_s| (end_s, format!(">> {what} repaired")));
        std::iter::once(injected).chain(repaired)
    };
    let mut acts: Vec<_> = episode.faults.iter().flat_map(act).collect();
    acts.sort_by(|a, b| a.0.total_cmp(&b.0));
    acts
}

impl Show {
    #[expect(clippy::disallowed_methods, reason = "the show runs in real time")]
    pub(super) async fn new(
        client: Client,
        mut rig: SimulatedRig,
        speed: f64,
        hands: Hands,
    ) -> anyhow::Result<Self> {
        for &code in FaultCode::ALL {
            client.clear(code).await?;
        }
        let events = events::listen(client.events().await?);
        let mut ticks = interval(TICK);
        ticks.set_missed_tick_behavior(MissedTickBehavior::Skip);
        // To the millisecond: the next demo on a store that is kept may begin within
        // the second, and a session of the same name would be taken for this one.
        let name = jiff::Timestamp::now().strftime("demo-%Y%m%dT%H%M%S%.3f").to_string();
        let (next, started) = (rig.next_sample(), Instant::now());
        let tally = Tally::default();
        Ok(Self {
            client,
            rig,
            next,
            speed,
            started,
            ticks,
            events,
            tally,
            hands,
            script: true,
            name,
            n_sessions: 0,
        })
    }

    /// Streams all `episodes`, and what visitors do in between; returns whether
    /// Ctrl-C cut them short.
    pub(super) async fn run(&mut self, episodes: Vec<Episode>) -> anyhow::Result<bool> {
        let end_s = episodes.last().map_or(0.0, |last| last.end_s);
        let mut rest = VecDeque::from(episodes);
        while let Some(mut episode) = rest.pop_front() {
            let mut cut = self.scripted(&mut episode).await?;
            if let Cut::Act(act) = cut {
                cut = self.by_hand(act, end_s).await?;
                plan::go_on(&mut rest, self.next.t_s, end_s);
            }
            if matches!(cut, Cut::Interrupted) {
                return Ok(true);
            }
        }
        Ok(false)
    }

    /// An episode as it was planned, or until a visitor lays hands on the rig.
    async fn scripted(&mut self, episode: &mut Episode) -> anyhow::Result<Cut> {
        let mut session = self.begin(episode).await?;
        let cut = self.stream(&mut session).await?;
        self.end(session, episode).await?;
        Ok(cut)
    }

    /// One session in which visitors break and repair, until they hand the rig
    /// back to the script.
    async fn by_hand(&mut self, first: Act, end_s: f64) -> anyhow::Result<Cut> {
        self.script = false;
        self.repair();
        let start_s = self.next.t_s;
        let mut episode = Episode { start_s, end_s, faults: Vec::new() };
        let mut session = self.begin(&episode).await?;
        let mut cut = Cut::Act(first);
        while let Cut::Act(act) = cut {
            match act {
                Act::Script => break,
                Act::Repair => self.repair(),
                Act::Break(effect) => self.break_now(effect, &mut episode).await?,
            }
            cut = self.stream(&mut session).await?;
        }
        self.repair();
        self.end(session, &episode).await?;
        self.script = true;
        Ok(cut)
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

    /// Tells visitors how the rig is.
    fn show(&self) {
        let now_s = self.rig.truth().t_s;
        let broken = self.rig.faults().map(|t| t.fault).filter(|fault| fault.active(now_s));
        let words = |fault: Fault| format!("{}:{}", fault.effect.code(), fault.effect.kind());
        self.hands.show(self.script, broken.map(words).collect());
    }

    /// Writes the comparison; returns whether injected and found agree.
    pub(super) fn conclude(&self) -> anyhow::Result<bool> {
        let mut out = output::stdout();
        writeln!(out)?;
        self.tally.write(&mut out)?;
        out.flush()?;
        Ok(self.tally.agrees())
    }

    /// The sessions take turns: WebSocket, then HTTP.
    async fn begin(&mut self, episode: &Episode) -> anyhow::Result<Session> {
        self.n_sessions += 1;
        let name = format!("{}-{}", self.name, self.n_sessions);
        let by_socket = self.n_sessions % 2 == 1;
        let uplink = if by_socket {
            self.client.connect().await?
        } else {
            Uplink::Http(self.client.clone())
        };
        for fault in &episode.faults {
            self.clear_if_found_before(fault.effect.code()).await?;
            self.rig.inject(*fault);
        }
        say(episode.start_s, &format!(">> session {name} begins, over {}", uplink.name()));
        let to_announce = acts(episode);
        Ok(Session { name, id: None, uplink, end_s: episode.end_s, to_announce })
    }

    /// A code that was found in an earlier session and repaired is cleared
    /// before it is injected again, as a workshop does.
    async fn clear_if_found_before(&self, code: FaultCode) -> anyhow::Result<()> {
        if self.tally.has_found(code) { self.client.clear(code).await } else { Ok(()) }
    }

    async fn stream(&mut self, session: &mut Session) -> anyhow::Result<Cut> {
        loop {
            tokio::select! {
                _ = self.ticks.tick() => {}
                Some(fault) = self.events.recv() => {
                    self.heard(&fault);
                    continue;
                }
                act = self.hands.next() => return Ok(Cut::Act(act)),
                interrupted = tokio::signal::ctrl_c() => {
                    interrupted?;
                    return Ok(Cut::Interrupted);
                }
            }
            let due_s = (self.started.elapsed().as_secs_f64() * self.speed).min(session.end_s);
            self.send_due(session, due_s).await?;
            self.show();
            if due_s >= session.end_s {
                return Ok(Cut::End);
            }
        }
    }

    async fn send_due(&mut self, session: &mut Session, due_s: f64) -> anyhow::Result<()> {
        let mut rows = Vec::new();
        while self.next.t_s < due_s {
            rows.push(std::mem::replace(&mut self.next, self.rig.next_sample()));
        }
        for batch in rows.chunks(MAX_ROWS) {
            let ack = match session.uplink.send(&session.name, batch).await {
                Err(error) if client::is_ended(&error) => {
                    self.go_on_in_another(session);
                    session.uplink.send(&session.name, batch).await?
                }
                ack => ack?,
            };
            session.id = ack.session_id.or(session.id.take());
        }
        session.announce(due_s);
        Ok(())
    }

    /// A visitor has ended the session; a device would begin another.
    fn go_on_in_another(&mut self, session: &mut Session) {
        self.n_sessions += 1;
        (session.name, session.id) = (format!("{}-{}", self.name, self.n_sessions), None);
        say(self.rig.truth().t_s, &format!(">> ended by a visitor; session {}", session.name));
    }

    /// Ends a session: its verdict is settled, and all of it has been heard.
    async fn end(&mut self, session: Session, episode: &Episode) -> anyhow::Result<()> {
        let Session { name, id, uplink, .. } = session;
        uplink.close().await;
        let mut confirmed = Vec::new();
        let mut hash = "-".to_owned();
        if let Some(id) = id
            && let Some(verdict) = self.client.end_session(&id).await?.verdict
        {
            (confirmed, hash) = (verdict.faults, verdict.verdict_hash);
        }
        let hear_all = async {
            while !self.tally.has_heard(&name, &confirmed) {
                let Some(fault) = self.events.recv().await else { return };
                self.heard(&fault);
            }
        };
        if timeout(LAST_EVENTS, hear_all).await.is_err() {
            tracing::warn!(session = name, "a confirmed fault did not come over the events");
        }
        let now_s = self.rig.truth().t_s.min(episode.end_s);
        let short = hash.get(..12).unwrap_or(&hash);
        say(now_s, &format!(">> session {name} ends, verdict {short}"));
        let of_episode = |truth: &&offbd_lab::simulation::FaultTruth| {
            // A repair by hand gives a fault another end than was planned.
            let is_it =
                |f: &Fault| (f.effect, f.onset_s) == (truth.fault.effect, truth.fault.onset_s);
            episode.faults.iter().any(is_it) && truth.fault.onset_s <= now_s
        };
        self.tally.injected(&name, self.rig.faults().filter(of_episode).copied());
        Ok(())
    }

    fn heard(&mut self, fault: &FaultView) {
        say(fault.t_s, &fault.summary);
        self.tally.heard(fault);
    }
}

/// A line of the show with the time on the rig's clock.
fn say(t_s: f64, text: &str) {
    anstream::println!("{}", table::wrapped(&format!("{t_s:>8.2} s  "), text));
}
