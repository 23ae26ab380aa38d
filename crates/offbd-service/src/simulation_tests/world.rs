//! A service whose threads a simulation moves step by step, with its devices and the network
//! between them. Its database is a real one, in a file.

use std::future::Future;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::PathBuf;
use std::pin::{Pin, pin};
use std::sync::atomic::{AtomicI64, Ordering};
use std::sync::{Arc, LazyLock, Mutex, PoisonError};
use std::time::Duration;

use futures_util::FutureExt;
use tempfile::TempDir;
use tokio::runtime::Runtime;

use super::check;
use super::device::{Device, SAMPLES_PER_PART, SentBatch, content};
use super::disk::{self, PowerCut};
use super::scenario::{DeviceKind, Scenario, Step};
use crate::asset::{AssetCommand, Loader, Shard};
use crate::start::Inner;
use crate::writing::Committer;
use crate::{Clock, Limits, RequestLimits, Service, ServiceError, WorkerLimits, views};
use offbd_core::engine::Rig;
use offbd_core::vocabulary::FaultCode;
use offbd_store::{CommitFault, CommitPoint, FaultPlan, Location, Store};
use offbd_wire::asset;

/// Most rounds until everything must be done once nothing fails any more.
const MAX_ROUNDS: usize = 300;

/// Limits that are reached in a short scenario.
fn limits() -> Limits {
    Limits {
        requests: RequestLimits {
            in_flight_samples: 100,
            batch_samples: 50,
            journal_bytes: 3000,
            session_samples: SAMPLES_PER_PART,
            ..RequestLimits::default()
        },
        workers: WorkerLimits { shards: 2, queue: 64, ..WorkerLimits::default() },
        snapshot_interval: 40,
        ..Limits::default()
    }
}

/// For the connections of the store. It does nothing by itself.
pub(super) static RUNTIME: LazyLock<Runtime> = LazyLock::new(|| {
    tokio::runtime::Builder::new_multi_thread().worker_threads(1).enable_all().build().unwrap()
});

/// An empty database, which is copied for each scenario.
static EMPTY: LazyLock<Vec<u8>> = LazyLock::new(|| {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("empty.sqlite");
    RUNTIME.block_on(async {
        let (store, writer) = Store::open(&Location::File(file.clone())).await.unwrap();
        store.close().await;
        writer.close().await.unwrap();
    });
    std::fs::read(file).unwrap()
});

/// Returns a folder, in memory where there is one.
fn folder() -> TempDir {
    tempfile::tempdir_in("/dev/shm").or_else(|_| tempfile::tempdir()).unwrap()
}

type Act = Pin<Box<dyn Future<Output = Result<(), ServiceError>>>>;

/// The parts of a running service.
struct Process {
    service: Service,
    shards: Vec<Shard>,
    loader: Loader,
    committer: Arc<Mutex<Committer>>,
    faults: FaultPlan,
}

impl Process {
    fn start(file: PathBuf, clock: Clock) -> Self {
        let _runtime = RUNTIME.enter();
        let opened = RUNTIME.block_on(Store::open(&Location::File(file)));
        let (store, writer) = opened.unwrap();
        let faults = writer.faults.clone();
        let (service, mut parts) = Service::assemble(store, writer, limits(), None, None, clock);
        parts.committer.first_retry = Duration::ZERO;
        let committer = Arc::new(Mutex::new(parts.committer));
        let for_barrier = committer.clone();
        let commit_queued = Box::new(move || while commit(&for_barrier, usize::MAX) {});
        assert!(service.inner.handles.commit_queued.set(commit_queued).is_ok());
        Self { service, shards: parts.shards, loader: parts.loader, committer, faults }
    }
}

/// Commits the next write sets; returns whether there were any.
fn commit(committer: &Mutex<Committer>, most: usize) -> bool {
    let mut committer = committer.lock().unwrap_or_else(PoisonError::into_inner);
    RUNTIME.block_on(committer.step(most))
}

/// A batch on its way to the service.
struct Request {
    device: usize,
    batch: SentBatch,
}

/// Everything that a scenario moves.
pub(super) struct World {
    folder: TempDir,
    now: Arc<AtomicI64>,
    process: Option<Process>,
    pub(super) devices: Vec<Device>,
    network: Vec<Request>,
    /// Acts of persons whose answers are pending, each with the name of the person.
    acts: Vec<(String, Act)>,
    n_acts: usize,
    /// The persons whose acts were confirmed.
    pub(super) confirmed: Vec<String>,
    /// What happens to the log at the next commit.
    power_cut: Option<PowerCut>,
}

impl World {
    pub(super) fn new(kinds: &[DeviceKind]) -> Self {
        let folder = folder();
        std::fs::write(folder.path().join("offbd.sqlite"), &*EMPTY).unwrap();
        let devices = kinds.iter().enumerate().map(|(i, kind)| Device::new(i, *kind)).collect();
        let mut this = Self {
            folder,
            now: Arc::new(AtomicI64::new(1_767_225_600_000_000)),
            process: None,
            devices,
            network: Vec::new(),
            acts: Vec::new(),
            n_acts: 0,
            confirmed: Vec::new(),
            power_cut: None,
        };
        this.start();
        for i in 0..this.devices.len() {
            let name = this.devices[i].asset.clone();
            let document = views::to_json(&asset::view(&Rig::chapter(&name))).unwrap();
            let create = |reply| AssetCommand::Create { document, reply };
            this.call(&name, create).unwrap();
        }
        this
    }

    /// Executes all steps of `scenario`.
    ///
    /// # Errors
    /// What the service has done wrong.
    pub(super) fn run(&mut self, scenario: &Scenario) -> Result<(), String> {
        scenario.steps.iter().try_for_each(|step| self.step(step))
    }

    fn file(&self) -> PathBuf {
        self.folder.path().join("offbd.sqlite")
    }

    fn start(&mut self) {
        self.process = Some(Process::start(self.file(), Clock::Simulated(self.now.clone())));
    }

    /// Cuts the power before a commit was synced: of what it wrote to the log, which was
    /// `before`, any part is on the disk. Starts another process on what is left.
    fn cut_power(&mut self, before: &[u8], cut: PowerCut) {
        let left = cut.apply(before, &disk::log_of(&self.file()));
        let database = std::fs::read(self.file()).unwrap();
        // Elsewhere, because connections that are closing still write to the old files.
        self.folder = folder();
        std::fs::write(self.file(), database).unwrap();
        std::fs::write(disk::log(&self.file()), left).unwrap();
        self.kill();
    }

    /// Ends the process without any notice, and starts another one.
    pub(super) fn kill(&mut self) {
        self.process = None;
        self.acts.clear();
        self.devices.iter_mut().for_each(Device::disconnect);
        self.start();
    }

    /// Lets the shards store their engines, and starts another process. What they have not executed
    /// is lost, which is more than what a stop loses.
    fn stop(&mut self) {
        self.work(|process| {
            process.shards.iter_mut().for_each(Shard::stop);
            true
        });
        while self.work(|process| commit(&process.committer, usize::MAX)) {}
        self.kill();
    }

    fn process(&mut self) -> &mut Process {
        self.process.as_mut().unwrap()
    }

    pub(super) fn inner(&self) -> &Inner {
        &self.process.as_ref().unwrap().service.inner
    }

    fn step(&mut self, step: &Step) -> Result<(), String> {
        self.now.fetch_add(1000, Ordering::SeqCst);
        let n = self.devices.len();
        match *step {
            Step::Measure { device, n: rows, spoilt } => {
                let device = device % n;
                if let Some(batch) = self.devices[device].measure(rows, spoilt) {
                    self.network.push(Request { device, batch });
                }
            }
            Step::Resend { device } => self.resend(device % n),
            Step::Reboot { device } => self.reboot(device % n),
            Step::DeviceClock { device, by_s } => self.devices[device % n].set_clock(by_s),
            Step::Read { device } => self.read(device % n)?,
            Step::Disconnect { device } => self.disconnect(device % n),
            Step::Deliver { which, copied } if !self.network.is_empty() => {
                let which = self.next_request(which % self.network.len());
                if self.can_arrive(which) {
                    self.deliver(which, copied);
                }
            }
            Step::Lose { which } if !self.network.is_empty() => {
                self.network.remove(which % self.network.len());
            }
            Step::Deliver { .. } | Step::Lose { .. } => {}
            Step::Shard { which } => drop(self.work(|process| process.shards[which % 2].step())),
            Step::Load => drop(self.work(|process| process.loader.step())),
            Step::Commit { most } => drop(self.work(|process| commit(&process.committer, most))),
            Step::Fail { at, fault } => {
                self.power_cut = None;
                self.process().faults.set(Some((at, fault)));
            }
            Step::CutPower(cut) => {
                self.power_cut = Some(cut);
                let fault = (CommitPoint::AfterCommit, CommitFault::Kill);
                self.process().faults.set(Some(fault));
            }
            Step::FailReads { n } => {
                self.inner().handles.failing_reads.store(n, Ordering::SeqCst);
            }
            Step::Delete { device } => self.delete(device % n)?,
            Step::Sweep => self.sweep(),
            Step::Kill => self.kill(),
            Step::Stop => self.stop(),
            Step::WallClock { by_s } => {
                self.now.fetch_add(by_s * 1_000_000, Ordering::SeqCst);
            }
            Step::Act { device, clears } => self.act(device % n, clears),
            Step::End { device } => self.end(device % n)?,
            Step::Run { rounds } => {
                for _ in 0..rounds {
                    self.round()?;
                }
            }
        }
        Ok(())
    }

    /// Lets a part of the service work; starts the service again if it is killed thereby.
    /// Returns whether there was something to do.
    fn work(&mut self, work: impl FnOnce(&mut Process) -> bool) -> bool {
        let log = self.power_cut.map(|_| disk::log_of(&self.file()));
        let process = self.process();
        let worked = catch_unwind(AssertUnwindSafe(|| work(process)));
        let is_killed = process.faults.is_killed();
        match (log, self.power_cut.take_if(|_| is_killed)) {
            (Some(log), Some(cut)) => self.cut_power(&log, cut),
            _ if is_killed => self.kill(),
            _ => {}
        }
        match worked {
            Ok(worked) => worked || is_killed,
            Err(panic) if !is_killed => std::panic::resume_unwind(panic),
            Err(_) => true,
        }
    }

    /// Lets everything go on a little.
    pub(super) fn round(&mut self) -> Result<bool, String> {
        self.now.fetch_add(10_000, Ordering::SeqCst);
        let mut worked = false;
        let mut which = 0;
        while which < self.network.len() {
            match self.can_arrive(which) {
                true => self.deliver(which, false),
                false => which += 1,
            }
        }
        worked |= self.work(|process| process.shards[0].step());
        worked |= self.work(|process| process.shards[1].step());
        worked |= self.work(|process| process.loader.step());
        worked |= self.work(|process| commit(&process.committer, 3));
        for device in 0..self.devices.len() {
            self.read(device)?;
        }
        self.poll_acts();
        Ok(worked)
    }

    fn resend(&mut self, device: usize) {
        let Device { unacknowledged, submission, answers, .. } = &self.devices[device];
        let is_answered = |id| {
            submission.as_ref().is_some_and(|(batch, _)| batch.id == id)
                || answers.iter().any(|(batch, _)| batch.id == id)
        };
        let requests = unacknowledged
            .iter()
            .filter(|batch| !is_answered(batch.id))
            .cloned()
            .collect::<Vec<_>>();
        self.network.extend(requests.into_iter().map(|batch| Request { device, batch }));
    }

    fn disconnect(&mut self, device: usize) {
        self.devices[device].disconnect();
        if self.devices[device].kind.stream {
            self.network.retain(|request| request.device != device);
        }
    }

    fn reboot(&mut self, device: usize) {
        self.devices[device].reboot();
        let DeviceKind { named, stream, .. } = self.devices[device].kind;
        if stream || !named {
            // Lost with the connection; or nobody could tell to which run they belong.
            self.network.retain(|request| request.device != device);
        }
    }

    /// Whether no other batch waits for room on the connection.
    fn can_arrive(&self, which: usize) -> bool {
        self.devices[self.network[which].device].submission.is_none()
    }

    /// Returns which request arrives if `which` is chosen: those on one connection, and those
    /// of a device that does not name its sessions, arrive in order.
    fn next_request(&self, which: usize) -> usize {
        let device = self.network[which].device;
        let is_first = |request: &Request| request.device == device;
        let DeviceKind { named, stream, .. } = self.devices[device].kind;
        match named && !stream {
            true => which,
            false => self.network.iter().position(is_first).unwrap_or(which),
        }
    }

    fn deliver(&mut self, which: usize, copied: bool) {
        let request = self.network.remove(which);
        let service = &self.process.as_ref().unwrap().service;
        let device = &mut self.devices[request.device];
        let batch = device.arriving(&request.batch);
        if device.kind.stream {
            let submission = service.submit_when_ready(&device.asset, batch, false);
            device.submission = Some((request.batch, Box::pin(submission)));
            return;
        }
        // Otherwise the device is told at once, and tries again.
        if let Ok(pending) = service.submit(&device.asset, batch) {
            device.answers.push_back((request.batch.clone(), pending));
        }
        if copied {
            self.network.push(request);
        }
    }

    /// Reads the answers of a device, in order, as far as they are there.
    fn read(&mut self, device: usize) -> Result<(), String> {
        let device = &mut self.devices[device];
        if let Some((batch, mut submission)) = device.submission.take() {
            match submission.as_mut().now_or_never() {
                Some(Ok(pending)) => device.answers.push_back((batch, pending)),
                Some(Err(_)) => {}
                None => {
                    device.submission = Some((batch, submission));
                    return Ok(());
                }
            }
        }
        while let Some((batch, pending)) = device.answers.pop_front() {
            match pending.now() {
                Ok(answer) => device.note(&batch, answer)?,
                Err(pending) => {
                    device.answers.push_front((batch, pending));
                    break;
                }
            }
        }
        Ok(())
    }

    fn act(&mut self, device: usize, clears: bool) {
        let actor = format!("person {}", self.n_acts);
        self.n_acts += 1;
        let asset = self.devices[device].asset.clone();
        let shards = self.inner().shards.clone();
        let (code, by) = (FaultCode::XServo, actor.clone());
        let act: Act = Box::pin(async move {
            let command = |reply| match clears {
                true => AssetCommand::Clear { code, actor: by, reply },
                false => AssetCommand::Acknowledge { code, actor: by, reply },
            };
            shards.call(&asset, command).await
        });
        self.acts.push((actor, act));
        self.poll_acts();
    }

    fn poll_acts(&mut self) {
        let mut pending = Vec::new();
        for (actor, mut act) in self.acts.drain(..) {
            match act.as_mut().now_or_never() {
                None => pending.push((actor, act)),
                Some(Ok(())) => self.confirmed.push(actor),
                Some(Err(_)) => {}
            }
        }
        self.acts = pending;
    }

    fn end(&mut self, device: usize) -> Result<(), String> {
        let asset = self.devices[device].asset.clone();
        let open = self.inner().handles.store.open_session(&asset);
        let open = RUNTIME.block_on(open).map_err(|error| error.to_string())?;
        if let Some(session) = open.map(|row| row.id) {
            // A kill may interrupt it.
            let _ = self.call(&asset, |reply| AssetCommand::EndSession { session, reply });
        }
        Ok(())
    }

    /// Deletes the oldest ended session of a device.
    fn delete(&mut self, device: usize) -> Result<(), String> {
        let asset = self.devices[device].asset.clone();
        let sessions = check::sessions(self, &asset)?;
        let Some(row) = sessions.into_iter().rev().find(|row| !row.is_open()) else {
            return Ok(());
        };
        let recorded = check::recorded(self, &row)?;
        self.devices[device].deleted.extend(recorded.iter().map(content));
        // A kill may interrupt it.
        let _ = self.call(&asset, |reply| AssetCommand::DeleteSession { session: row.id, reply });
        Ok(())
    }

    /// Goes on with all deletions, with the commits that they need.
    fn sweep(&mut self) {
        self.work(|process| {
            let deleter = process.service.inner.deleter.clone();
            let mut committer = process.committer.lock().unwrap_or_else(PoisonError::into_inner);
            RUNTIME.block_on(async {
                let mut deletion = pin!(deleter.all());
                // A commit is never given up half-way.
                while futures_util::poll!(&mut deletion).is_pending() {
                    committer.step(usize::MAX).await;
                    tokio::task::yield_now().await;
                }
            });
            true
        });
    }

    /// Executes a command and lets everything go on until it is answered.
    fn call<T: Send + 'static>(
        &mut self,
        asset: &str,
        make: impl FnOnce(crate::asset::Reply<T>) -> AssetCommand,
    ) -> Result<T, ServiceError> {
        let shards = self.inner().shards.clone();
        let mut call = Box::pin(shards.call(asset, make));
        for _ in 0..MAX_ROUNDS {
            if let Some(answer) = call.as_mut().now_or_never() {
                return answer;
            }
            let told = self.round();
            told.map_err(ServiceError::corrupt)?;
        }
        Err(ServiceError::Unavailable { what: "a command is not answered" })
    }

    /// Lets everything go on without faults until all is acknowledged, and ends all sessions.
    ///
    /// # Errors
    /// If that does not come to an end, or the service has done something wrong.
    pub(super) fn finish(&mut self) -> Result<(), String> {
        self.power_cut = None;
        self.process().faults.set(None);
        self.inner().handles.failing_reads.store(0, Ordering::SeqCst);
        for round in 0..MAX_ROUNDS {
            if round % 10 == 0 {
                (0..self.devices.len()).for_each(|device| self.resend(device));
            }
            let worked = self.round()?;
            let is_done =
                |device: &Device| device.unacknowledged.is_empty() && device.submission.is_none();
            let is_quiet = !worked && self.network.is_empty() && self.acts.is_empty();
            if is_quiet && self.devices.iter().all(is_done) {
                return (0..self.devices.len()).try_for_each(|device| self.end(device));
            }
        }
        let waiting: Vec<_> = self.devices.iter().map(|d| d.unacknowledged.len()).collect();
        let load = self.process.as_ref().unwrap().service.load();
        Err(format!("not done after {MAX_ROUNDS} rounds: {waiting:?} batches, {load:?}"))
    }
}
