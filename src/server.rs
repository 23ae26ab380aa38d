//! The server: assembles configuration, store, service and sockets, from the start to a
//! graceful stop. Also the functions behind the commands `migrate`, `check`, `backup`,
//! `restore` and `token`.

mod advertised;
mod allocator;
mod buses;
mod connections;
#[cfg(feature = "otel")]
mod conventions;
mod delivery;
mod keys;
mod listen;
mod room;
mod tls;
pub mod tokens;
#[cfg_attr(not(feature = "otel"), path = "server/no_traces.rs")]
mod traces;

use std::fmt;
use std::fs::{File, TryLockError};
use std::net::{IpAddr, Ipv4Addr, Ipv6Addr, SocketAddr};
use std::num::NonZeroU32;
use std::path::{Path, PathBuf};
use std::pin::pin;
use std::sync::Arc;
use std::time::Duration;

use anyhow::{Context, Result, bail};
use axum::Router;
use serde::Serialize;
use tokio::net::TcpListener;
use tokio::task::{JoinHandle, JoinSet};
use tokio_util::sync::CancellationToken;

use self::delivery::Senders;
use self::keys::KeyRefresher;
use self::listen::HttpListener;
use self::tls::Tls;
pub use self::traces::Traces;
use crate::config::{ClusterConfig, Config, LogFormat};
use offbd_http::{AccessPolicy, App, BodyBudget, ExtraRoutes, RateLimit, RateLimits};
use offbd_service::access::Provider;
use offbd_service::{Clock, Limits, Service, Workers};
use offbd_store::{CheckReport, Location, NodeIdentity, Partitions, Store, StoreError};

/// How often a blocking thread is asked for: often enough for a device that waits, and rarely
/// enough to cost nothing.
const THREAD_INTERVAL: Duration = Duration::from_secs(1);

/// How often the lock of a store is tried, and the pause between: 0.5 s in all. A process that
/// has just ended may hold it a little longer, as a child process has its open files until it
/// runs its own program. Chosen.
const LOCK_TRIES: u32 = 11;
const LOCK_INTERVAL: Duration = Duration::from_millis(50);

/// The optional parts of this build, by the names of the features.
pub(crate) const FEATURES: &[&str] = &[
    #[cfg(feature = "email")]
    "email",
    #[cfg(feature = "mcap")]
    "mcap",
    #[cfg(feature = "mqtt")]
    "mqtt",
    #[cfg(feature = "nats")]
    "nats",
    #[cfg(feature = "otel")]
    "otel",
    #[cfg(feature = "parquet")]
    "parquet",
    #[cfg(feature = "xlsx")]
    "xlsx",
];

/// A running server.
pub struct Server {
    /// The address that it listens on, with the actual port.
    pub address: SocketAddr,
    closing: CancellationToken,
    deadline: Duration,
    serving: JoinSet<()>,
    /// What serves devices over NATS and MQTT.
    buses: Vec<JoinHandle<()>>,
    service: Service,
    store: Store,
    workers: Workers,
    /// The lock file of an SQLite database, locked until the store is closed. `None` for
    /// PostgreSQL, which has its own lock.
    lock: Option<File>,
}

/// Opens the store and listens. Engines are loaded when they are asked for; those that need
/// a long recording are rebuilt meanwhile.
///
/// # Errors
/// If the configuration is invalid, the store cannot be opened, or the address is in use.
pub async fn start(config: Config) -> Result<Server> {
    start_with(config, None).await
}

/// Starts like [`start`], with the additional routes of the demo.
///
/// # Errors
/// As for [`start`].
pub async fn start_with(config: Config, demo: Option<ExtraRoutes>) -> Result<Server> {
    config.check()?;
    allocator::keep_large_blocks_apart();
    offbd_http::gather_metrics();
    let tls = config.tls.as_ref().map(Tls::read).transpose()?;
    let (provider, keys) = match &config.jwt {
        Some(jwt) => Some(KeyRefresher::start(jwt).await?).unzip(),
        None => (None, None),
    };
    let location = config.location()?;
    let lock = lock(&location).await?;
    let node = match &config.cluster {
        Some(cluster) => Some(NodeListener::bind(cluster).await?),
        None => None,
    };
    let open = async || open(&location, node.as_ref()).await;
    let (store, writer) = room::opened(lock.as_ref(), open).await?;
    let listener = TcpListener::bind(config.listen).await.with_context(|| {
        format!(
            "`listen`: cannot listen on {} (`--listen` chooses another address, port 0 a free one)",
            config.listen
        )
    })?;
    let address = listener.local_addr()?;
    let limits = config.service_limits();
    let senders = Senders::new(&limits.notifications);
    let policy = Arc::new(policy(&config)?);
    warn_of_access(&config, &policy, &store).await?;
    let me = node.as_ref().map(|node| node.identity.clone());
    let (service, workers) = start_service(&store, writer, limits, provider, me).await?;
    let closing = CancellationToken::new();
    let mut server = Server {
        address,
        closing: closing.clone(),
        deadline: Duration::from_secs(config.limits.shutdown_s),
        serving: JoinSet::new(),
        buses: Vec::new(),
        service: service.clone(),
        store,
        workers,
        lock,
    };
    match buses::start(&config, &service, &closing).await {
        Ok(buses) => server.buses = buses,
        Err(error) => {
            drop(service);
            if let Err(late) = server.shutdown().await {
                tracing::error!(error = %late, "cannot stop what was started");
            }
            return Err(error);
        }
    }
    tokio::spawn(service.notifier(senders).run());
    tokio::spawn(rebuild(service.clone(), closing.clone()));
    let router = router(&config, service, policy, &closing, demo);
    if let Some(NodeListener { listener, .. }) = node {
        server.listen(&config, None, listener, router.clone());
    }
    server.listen(&config, tls.clone(), listener, router);
    tls.map(|tls| tokio::spawn(tls.watch(closing.clone())));
    keys.map(|keys| tokio::spawn(keys.watch(closing.clone())));
    tokio::spawn(offbd_http::keep_metrics(closing.clone()));
    tokio::spawn(keep_threads(closing));
    let page = page_url(address, config.tls.is_some());
    tracing::info!(%address, store = %server.store.location(), %page, "serving");
    Ok(server)
}

/// The address at which this machine reaches a service that listens on `address`: one cannot
/// connect to "all addresses".
pub(crate) fn own_address(mut address: SocketAddr) -> SocketAddr {
    match address.ip() {
        IpAddr::V4(ip) if ip.is_unspecified() => address.set_ip(Ipv4Addr::LOCALHOST.into()),
        IpAddr::V6(ip) if ip.is_unspecified() => address.set_ip(Ipv6Addr::LOCALHOST.into()),
        _ => {}
    }
    address
}

/// Returns the address of the page as a browser on this machine opens it.
fn page_url(address: SocketAddr, is_encrypted: bool) -> String {
    let scheme = if is_encrypted { "https" } else { "http" };
    format!("{scheme}://{}/", own_address(address))
}

/// The interface of the service, with the additional routes of the demo.
fn router(
    config: &Config,
    service: Service,
    policy: Arc<AccessPolicy>,
    closing: &CancellationToken,
    demo: Option<ExtraRoutes>,
) -> Router {
    let app = App {
        service,
        budget: BodyBudget::new(config.limits.bodies_bytes),
        policy,
        closing: closing.clone(),
        demo: demo.is_some(),
        features: FEATURES,
    };
    offbd_http::router(app, demo.unwrap_or_default())
}

/// Starts the service, as the node `me` of a cluster if there is one. If that fails, the store is
/// closed.
async fn start_service(
    store: &Store,
    writer: offbd_store::Writer,
    limits: Limits,
    provider: Option<Provider>,
    me: Option<NodeIdentity>,
) -> Result<(Service, Workers)> {
    let store_of_service = store.clone();
    let started = match me {
        None => Service::start(store_of_service, writer, limits, provider).await,
        Some(me) => Service::start_node(store_of_service, writer, limits, provider, me).await,
    };
    if started.is_err() {
        store.close().await;
    }
    Ok(started?)
}

/// Rebuilds the engines of long recordings while requests are served already.
async fn rebuild(service: Service, closing: CancellationToken) {
    let rebuilt = closing.run_until_cancelled(service.rebuild()).await;
    if let Some(Err(error)) = rebuilt {
        tracing::error!(%error, "cannot rebuild the engines; each is rebuilt when it is asked for");
    }
}

/// Asks for a blocking thread again and again. If the system refuses one, tokio leaves the
/// task in its queue until the next one comes, and an asset would wait as long to be loaded.
async fn keep_threads(closing: CancellationToken) {
    while !closing.is_cancelled() {
        let idle = tokio::task::spawn_blocking(|| ());
        let waited = async { (idle.await, tokio::time::sleep(THREAD_INTERVAL).await) };
        let late = tokio::time::timeout(2 * THREAD_INTERVAL, waited);
        closing.run_until_cancelled(late).await;
    }
}

/// Which requests need a token, which origins are allowed, and the rate limits.
fn policy(config: &Config) -> Result<AccessPolicy> {
    let rate = |per_s| RateLimit(NonZeroU32::new(per_s).unwrap_or(NonZeroU32::MIN));
    Ok(AccessPolicy {
        required: config.requires_token()?,
        origins: config.origins.clone(),
        encrypted: config.tls.is_some(),
        rates: RateLimits::new(rate(config.rates.token_per_s), rate(config.rates.address_per_s)),
    })
}

/// Logs warnings about an insecure or unusable configuration.
async fn warn_of_access(config: &Config, policy: &AccessPolicy, store: &Store) -> Result<()> {
    if policy.required && config.jwt.is_none() && store.n_tokens(Clock::System.now()).await? == 0 {
        tracing::warn!(
            "there is no valid token, so every request is refused; create one with \
             `offbd token create --name NAME --role admin`, with the same --data and --config"
        );
    }
    if policy.required && !policy.encrypted && !config.listen.ip().is_loopback() {
        tracing::warn!(
            "tokens are sent without encryption; set `tls`, or allow connections only from a \
             proxy that encrypts"
        );
    }
    Ok(())
}

/// Locks an SQLite store for this process, because two main writers would not notice each
/// other. The operating system releases the lock when the process ends. In PostgreSQL the
/// writer's connection takes a lock instead.
async fn lock(location: &Location) -> Result<Option<File>> {
    let Some(file) = location.file() else { return Ok(None) };
    // A link to the file must not be another lock.
    let file = std::fs::canonicalize(file).unwrap_or_else(|_| file.to_owned());
    let mut path = file.into_os_string();
    path.push(".lock");
    let path = PathBuf::from(path);
    if let Some(directory) = path.parent() {
        std::fs::create_dir_all(directory)
            .with_context(|| format!("`data`: cannot create {}", directory.display()))?;
    }
    let lock = offbd_store::private_file().create(true).truncate(false).open(&path);
    let lock = lock.with_context(|| format!("cannot create {}", path.display()))?;
    let mut n_tries = 0;
    loop {
        n_tries += 1;
        match lock.try_lock() {
            Ok(()) => return Ok(Some(lock)),
            Err(TryLockError::WouldBlock) if n_tries < LOCK_TRIES => {
                tokio::time::sleep(LOCK_INTERVAL).await;
            }
            Err(TryLockError::WouldBlock) => {
                bail!("`data`: another process uses this store ({} is locked)", path.display())
            }
            Err(TryLockError::Error(error)) => {
                return Err(error).with_context(|| format!("cannot lock {}", path.display()));
            }
        }
    }
}

async fn open(
    location: &Location,
    node: Option<&NodeListener>,
) -> Result<(Store, offbd_store::Writer)> {
    let opened = match node {
        None => Store::open(location).await,
        Some(NodeListener { identity, partitions, .. }) => {
            Store::open_node(location, identity.clone(), *partitions).await
        }
    };
    opened.with_context(|| format!("cannot open the store {location}"))
}

/// The socket of a node for other nodes.
struct NodeListener {
    listener: TcpListener,
    identity: NodeIdentity,
    partitions: Partitions,
}

impl NodeListener {
    async fn bind(cluster: &ClusterConfig) -> Result<Self> {
        let listener = TcpListener::bind(cluster.listen)
            .await
            .with_context(|| format!("`cluster.listen`: cannot listen on {}", cluster.listen))?;
        let identity = cluster.identity(listener.local_addr()?);
        advertised::check(&listener, &identity.address).await?;
        Ok(Self { listener, identity, partitions: cluster.partitions() })
    }
}

impl Server {
    /// Serves `router` on `listener` until the service stops.
    fn listen(&mut self, config: &Config, tls: Option<Tls>, listener: TcpListener, router: Router) {
        let http = HttpListener::new(&config.limits, tls, self.closing.clone());
        self.serving.spawn(http.serve(listener, router));
    }

    /// Stops gracefully: accepts no new connections, ends streams, finishes the requests
    /// in progress, commits their changes, and closes the store.
    ///
    /// # Errors
    /// If that takes longer than `limits.shutdown_s`. Everything acknowledged is durable
    /// in any case.
    pub async fn shutdown(self) -> Result<()> {
        let Self { closing, deadline, mut serving, buses, service, store, workers, lock, .. } =
            self;
        let finish = async {
            service.leave_cluster().await;
            drop(service);
            closing.cancel();
            workers.close();
            let mut served = Ok(());
            while let Some(ended) = serving.join_next().await {
                served = served.and(ended);
            }
            for bus in buses {
                if bus.await.is_err() {
                    tracing::error!("what serves devices over NATS or MQTT panicked");
                }
            }
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
    let mut stop = pin!(stop_signal()?);
    let server = tokio::select! {
        server = start(config) => server?,
        // Nothing has been acknowledged yet.
        stopped = &mut stop => return stopped,
    };
    stop.await?;
    tracing::info!("stopping");
    server.shutdown().await
}

/// Returns a future that waits for SIGINT or SIGTERM. From now on these do not end the process
/// by themselves, even if nothing has waited yet.
#[cfg(unix)]
fn stop_signal() -> Result<impl Future<Output = Result<()>>> {
    use tokio::signal::unix::{SignalKind, signal};
    let mut interrupt = signal(SignalKind::interrupt())?;
    let mut terminate = signal(SignalKind::terminate())?;
    Ok(async move {
        tokio::select! {
            _ = interrupt.recv() => {}
            _ = terminate.recv() => {}
        }
        Ok(())
    })
}

#[cfg(not(unix))]
fn stop_signal() -> Result<impl Future<Output = Result<()>>> {
    Ok(async { Ok(tokio::signal::ctrl_c().await?) })
}

/// Brings the store's schema to this version. Returns a message with its location and the
/// number of migrations.
///
/// # Errors
/// If the store cannot be opened or is newer than this version.
pub async fn migrate(config: &Config) -> Result<usize> {
    config.check()?;
    let location = config.location()?;
    let _lock = lock(&location).await?;
    let migrated = Store::migrate(&location).await;
    migrated.with_context(|| format!("cannot migrate the store {location}"))
}

/// Copies the embedded store to the new `file`, also while a service uses it.
///
/// # Errors
/// If there is no embedded store, `file` exists, or it cannot be written.
pub async fn back_up(config: &Config, file: &Path) -> Result<()> {
    let location = config.location()?;
    let result = offbd_store::back_up(&location, file).await;
    result.with_context(|| format!("cannot back up the store {location}"))
}

/// Restores the embedded store from the copy `file`.
///
/// # Errors
/// If the copy is invalid, the store is in use, or it exists and `replace` is not set.
pub async fn restore(config: &Config, file: &Path, replace: bool) -> Result<()> {
    let location = config.location()?;
    let _lock = lock(&location).await?;
    let result = offbd_store::restore(&location, file, replace).await;
    let hint = match &result {
        Err(StoreError::Exists { .. }) if !replace => " without --replace",
        _ => "",
    };
    result.with_context(|| format!("cannot restore the store {location}{hint}"))
}

/// What a configuration amounts to.
#[derive(Clone, Debug, Serialize)]
pub struct ConfigSummary {
    pub listen: SocketAddr,
    pub requires_token: bool,
    /// The issuer of the JSON Web Tokens that are accepted.
    pub issuer: Option<String>,
    pub is_encrypted: bool,
    pub store: String,
    pub log_format: LogFormat,
    pub log_level: String,
    /// Threads that run engines.
    pub shards: usize,
}

impl fmt::Display for ConfigSummary {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let access = match (self.requires_token, &self.issuer) {
            (true, Some(issuer)) => format!("with a token, or one of {issuer}"),
            (true, None) => "with a token".to_owned(),
            (false, _) => "for everyone on this machine".to_owned(),
        };
        let encrypted = if self.is_encrypted { "encrypted" } else { "not encrypted" };
        let format = match self.log_format {
            LogFormat::Text => "text",
            LogFormat::Json => "json",
        };
        writeln!(f, "listen   {}\naccess   {access}, {encrypted}", self.listen)?;
        writeln!(f, "store    {}\nlog      as {format}, level {}", self.store, self.log_level)?;
        write!(f, "workers  {}", self.shards)
    }
}

/// Checks the configuration and summarises it.
///
/// # Errors
/// Names the first invalid key.
pub fn check(config: &Config) -> Result<ConfigSummary> {
    config.check()?;
    buses::check(config)?;
    Ok(ConfigSummary {
        listen: config.listen,
        requires_token: config.requires_token()?,
        issuer: config.jwt.as_ref().map(|jwt| jwt.issuer.clone()),
        is_encrypted: config.tls.is_some(),
        store: config.location()?.to_string(),
        log_format: config.log.format,
        log_level: config.log.level.clone(),
        shards: config.workers.shards,
    })
}

/// Checks the contents of the store; nothing is changed. Returns `None` if there is no
/// embedded store yet.
///
/// # Errors
/// If the store cannot be read, or has the schema of another version.
pub async fn check_store(config: &Config) -> Result<Option<CheckReport>> {
    let location = config.location()?;
    if location.file().is_some_and(|file| !file.exists()) {
        return Ok(None);
    }
    let report = offbd_store::check(&location).await;
    report.map(Some).with_context(|| format!("cannot check the store {location}"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_page_has_an_address_that_a_browser_opens() {
        for (address, is_encrypted, page) in [
            ("127.0.0.1:8087", false, "http://127.0.0.1:8087/"),
            ("0.0.0.0:80", false, "http://127.0.0.1:80/"),
            ("[::1]:8443", true, "https://[::1]:8443/"),
            ("[::]:8087", false, "http://[::1]:8087/"),
        ] {
            assert_eq!(page_url(address.parse().unwrap(), is_encrypted), page);
        }
    }
}
