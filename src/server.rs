//! The server: configuration, store, service and sockets put together, from
//! start to a graceful stop. Also what stands behind `migrate`, `check` and
//! `token`.

mod keys;
mod listen;
mod places;
mod tls;
pub mod tokens;
#[cfg_attr(not(feature = "otel"), path = "server/no_traces.rs")]
mod traces;

use std::fs::{File, TryLockError};
use std::net::SocketAddr;
use std::num::NonZeroU32;
use std::path::Path;
use std::sync::Arc;
use std::time::Duration;

use anyhow::{Context, Result, bail};
use tokio::net::TcpListener;
use tokio::task::JoinHandle;
use tokio_util::sync::CancellationToken;

use self::keys::Keys;
use self::listen::Connections;
use self::tls::Tls;
pub use self::traces::Traces;
use crate::config::Config;
use crate::http::{self, App, Budget, More, Policy, Rate, Rates};
use crate::service::{Clock, Service, Workers};
use crate::store::{self, Place, Store};

/// A running server.
pub struct Server {
    /// Where it listens, the real port included.
    pub address: SocketAddr,
    closing: CancellationToken,
    deadline: Duration,
    serving: JoinHandle<()>,
    store: Store,
    workers: Workers,
    /// Held until the store is closed; none where the database keeps it.
    lock: Option<File>,
}

/// Opens the store, resumes open sessions, and listens.
///
/// # Errors
/// If the configuration cannot be, the store cannot be opened, or the address
/// is taken.
pub async fn start(config: Config) -> Result<Server> {
    start_with(config, None).await
}

/// The same for the demo, with `demo` beside the interface.
///
/// # Errors
/// As for [`start`].
pub async fn start_with(config: Config, demo: Option<More>) -> Result<Server> {
    config.check()?;
    http::gather_metrics();
    let tls = config.tls.as_ref().map(Tls::read).transpose()?;
    let (provider, keys) = match &config.jwt {
        Some(jwt) => Some(Keys::read(jwt).await?).unzip(),
        None => (None, None),
    };
    let place = config.place()?;
    let lock = lock(&place)?;
    let (store, writer) = open(&place).await?;
    let listener = TcpListener::bind(config.listen)
        .await
        .with_context(|| format!("`listen`: cannot listen on {}", config.listen))?;
    let address = listener.local_addr()?;
    let limits = config.service_limits();
    let (service, workers) = Service::start(store.clone(), writer, limits, provider).await?;
    let resumed = service.resume().await?;
    let closing = CancellationToken::new();
    let budget = Budget::new(config.limits.bodies_bytes);
    let policy = Arc::new(policy(&config)?);
    advise(&config, &policy, &store).await?;
    let app = App { service, budget, policy, closing: closing.clone(), demo: demo.is_some() };
    let router = http::router(app, demo.unwrap_or_default());
    let connections = Connections::new(&config.limits, tls.clone(), closing.clone());
    let serving = tokio::spawn(connections.serve(listener, router));
    tls.map(|tls| tokio::spawn(tls.watch(closing.clone())));
    keys.map(|keys| tokio::spawn(keys.watch(closing.clone())));
    tokio::spawn(http::keep_metrics(closing.clone()));
    tracing::info!(%address, resumed, store = %store.place(), "serving");
    let deadline = Duration::from_secs(config.limits.shutdown_s);
    Ok(Server { address, closing, deadline, serving, store, workers, lock })
}

/// Who is let in.
fn policy(config: &Config) -> Result<Policy> {
    let rate = |per_s| Rate(NonZeroU32::new(per_s).unwrap_or(NonZeroU32::MIN));
    Ok(Policy {
        required: config.asks_for_tokens()?,
        origins: config.origins.clone(),
        encrypted: config.tls.is_some(),
        rates: Rates::new(rate(config.rates.token_per_s), rate(config.rates.address_per_s)),
    })
}

/// Says what an operator should know of before somebody finds out.
async fn advise(config: &Config, policy: &Policy, store: &Store) -> Result<()> {
    if policy.required && config.jwt.is_none() && store.n_tokens(Clock.now()).await? == 0 {
        tracing::warn!(
            "no token is in force, so nobody comes in; make one with \
             `offbd token create --name NAME --role admin`, with the same --data and --config"
        );
    }
    if policy.required && !policy.encrypted && !config.listen.ip().is_loopback() {
        tracing::warn!(
            "tokens travel unencrypted; set `tls`, or let nobody in but a proxy that encrypts"
        );
    }
    Ok(())
}

/// Takes the store for this process: two writers would not know of each other.
/// The lock goes with the process, however it ends. A server of PostgreSQL keeps
/// one itself, as long as the writer is connected.
fn lock(place: &Place) -> Result<Option<File>> {
    let Some(file) = place.file() else { return Ok(None) };
    let path = file.with_extension("lock");
    if let Some(directory) = path.parent() {
        std::fs::create_dir_all(directory)
            .with_context(|| format!("`data`: cannot make {}", directory.display()))?;
    }
    let lock = File::create(&path).with_context(|| format!("cannot make {}", path.display()))?;
    match lock.try_lock() {
        Ok(()) => Ok(Some(lock)),
        Err(TryLockError::WouldBlock) => {
            bail!("`data`: another process uses this store ({} is locked)", path.display())
        }
        Err(TryLockError::Error(error)) => {
            Err(error).with_context(|| format!("cannot lock {}", path.display()))
        }
    }
}

async fn open(place: &Place) -> Result<(Store, store::Writer)> {
    Store::open(place).await.with_context(|| format!("cannot open the store {place}"))
}

impl Server {
    /// Stops: takes no new connection, ends long answers, finishes what is in
    /// flight, commits it, and closes the store.
    ///
    /// # Errors
    /// If that takes longer than `limits.shutdown_s`; everything acknowledged
    /// is durable all the same.
    pub async fn shutdown(self) -> Result<()> {
        let Self { closing, deadline, serving, store, workers, lock, .. } = self;
        closing.cancel();
        workers.close();
        let finish = async {
            let served = serving.await;
            workers.finish().await;
            store.close().await;
            drop(lock);
            served
        };
        match tokio::time::timeout(deadline, finish).await {
            Ok(served) => Ok(served?),
            Err(_) => bail!("the stop took longer than {} s", deadline.as_secs()),
        }
    }
}

/// Serves until SIGINT or SIGTERM, then stops gracefully.
///
/// # Errors
/// As for [`start`] and [`Server::shutdown`].
pub async fn serve(config: Config) -> Result<()> {
    let server = start(config).await?;
    stop_signal().await?;
    tracing::info!("stopping");
    server.shutdown().await
}

#[cfg(unix)]
async fn stop_signal() -> Result<()> {
    use tokio::signal::unix::{SignalKind, signal};
    let mut terminate = signal(SignalKind::terminate())?;
    tokio::select! {
        interrupted = tokio::signal::ctrl_c() => interrupted?,
        _ = terminate.recv() => {}
    }
    Ok(())
}

#[cfg(not(unix))]
async fn stop_signal() -> Result<()> {
    Ok(tokio::signal::ctrl_c().await?)
}

/// Brings the store to this version's schema; says which file and how many
/// migrations it has.
///
/// # Errors
/// If the store cannot be opened or is newer than this version.
pub async fn migrate(config: &Config) -> Result<String> {
    config.check()?;
    let place = config.place()?;
    let _lock = lock(&place)?;
    let migrated = Store::migrate(&place).await;
    let n = migrated.with_context(|| format!("cannot migrate the store {place}"))?;
    Ok(format!("{place}: {n} migrations applied"))
}

/// Copies the embedded store to `file`, also while it is served; says what was
/// made.
///
/// # Errors
/// If there is no embedded store, `file` is there already, or cannot be written.
pub async fn back_up(config: &Config, file: &Path) -> Result<String> {
    let place = config.place()?;
    let made = store::back_up(&place, file).await;
    made.with_context(|| format!("cannot back up the store {place}"))?;
    Ok(format!("{}: a copy of {place}", file.display()))
}

/// Makes the embedded store from the copy `file`; says what was made.
///
/// # Errors
/// If the copy cannot be, the store is in use, or is there without `replace`.
pub async fn restore(config: &Config, file: &Path, replace: bool) -> Result<String> {
    let place = config.place()?;
    let _lock = lock(&place)?;
    let made = store::restore(&place, file, replace).await;
    made.with_context(|| format!("cannot restore the store {place}"))?;
    Ok(format!("{place}: as in {}", file.display()))
}

/// Checks the configuration; says in a few lines what it comes to.
///
/// # Errors
/// Names the first key that cannot be.
pub fn check(config: &Config) -> Result<String> {
    config.check()?;
    Ok(format!(
        "listen   {}\naccess   {}, {}\nstore    {}\nlog      {:?}, {}\nworkers  {} shards",
        config.listen,
        match (config.asks_for_tokens()?, &config.jwt) {
            (true, Some(jwt)) => format!("with a token, or one of {}", jwt.issuer),
            (true, None) => "with a token".to_owned(),
            (false, _) => "for everyone on this machine".to_owned(),
        },
        if config.tls.is_some() { "encrypted" } else { "not encrypted" },
        config.place()?,
        config.log.format,
        config.log.level,
        config.workers.shards,
    ))
}
