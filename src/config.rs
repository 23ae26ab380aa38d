//! The configuration of the service: defaults, overridden by a TOML file, by the
//! environment (`OFFBD_LISTEN`, `OFFBD_LOG__LEVEL`), and by the command line, in this
//! order.
//!
//! It is one typed structure, which is checked completely at the start. An error names
//! the key. Unknown keys are errors in the file and in the environment.

/// Defines a section of the configuration. The comments are the texts of the manual.
macro_rules! section {
    ($(#[$meta:meta])* pub struct $name:ident { $(
        $(#[doc = $doc:literal])+ $(#[serde $serde:tt])? pub $key:ident: $type:ty,
    )+ }) => {
        #[derive(Clone, Debug, PartialEq, serde::Deserialize, serde::Serialize)]
        #[serde(deny_unknown_fields)]
        $(#[$meta])*
        pub struct $name { $($(#[doc = $doc])+ $(#[serde $serde])? pub $key: $type),+ }

        impl $name {
            /// The name of each key and what it sets.
            pub(crate) const KEYS: &'static [(&'static str, &'static str)] =
                &[$((stringify!($key), concat!($($doc),+))),+];
        }
    };
}

mod bus;
mod cluster;
mod effective;
#[cfg(test)]
pub(crate) mod manual;
mod secrets;

use std::net::{IpAddr, SocketAddr};
use std::path::{Path, PathBuf};
use std::time::Duration;

use config::{Environment, File, FileFormat};
use serde::{Deserialize, Serialize};

pub use self::bus::{BrokerAddress, MqttConfig, NatsConfig};
pub use self::cluster::ClusterConfig;
pub(crate) use self::effective::toml;
pub use self::effective::{EffectiveKey, Source};
pub use self::secrets::ReadableSecret;
use offbd_service::access::jwt::ExpectedClaims;
use offbd_service::{
    CommunicationSettings, Limits, NotificationSettings, NumberKey, OutOfRange, RequestLimits,
    Retention, TargetPolicy, WorkerLimits, config_section,
};
use offbd_store::Location;

/// Name of the database file in the data directory.
const DATABASE_FILE: &str = "offbd.sqlite";

section! {
    /// The configuration of the service.
    #[serde(default)]
    pub struct Config {
        /// The address to listen on; with port 0, any free port.
        pub listen: SocketAddr,
        /// Directory of the SQLite file; created if it is missing.
        pub data: PathBuf,
        /// `sqlite:FILE` or `postgres://USER:PASSWORD@HOST/DATABASE`; by default the SQLite file
        /// in `data`.
        #[serde(serialize_with = "secrets::hide_url")]
        pub database: Option<String>,
        /// A file with the value of `database`, for a URL with a password.
        pub database_file: Option<PathBuf>,
        /// `required`: requests need a token. `off` is permitted only if no other machine can
        /// connect. By default, `required` if other machines can connect.
        pub auth: Option<Auth>,
        /// Other sites whose pages may use the interface, `https://HOST[:PORT]`.
        pub origins: Vec<String>,
        /// Encryption of connections; `None` for none.
        pub tls: Option<TlsConfig>,
        /// The identity provider whose tokens are accepted, if any.
        pub jwt: Option<JwtConfig>,
        /// The cluster that this process is a node of; `None` for one that works alone.
        pub cluster: Option<ClusterConfig>,
        /// The NATS server whose devices are served, if any.
        pub nats: Option<NatsConfig>,
        /// The MQTT broker whose devices are served, if any.
        pub mqtt: Option<MqttConfig>,
        /// Logs, on stderr.
        pub log: LogConfig,
        /// Traces of requests.
        pub traces: TracesConfig,
        /// Limits of requests, memory and connections.
        pub limits: RequestLimits,
        /// Rate limits.
        pub rates: RatesConfig,
        /// Threads and queues.
        pub workers: WorkerLimits,
        /// How long recordings are kept.
        pub retention: RetentionConfig,
        /// When the data of a rig count as lost.
        pub communication: CommunicationSettings,
        /// How notifications are sent.
        pub notifications: NotificationsConfig,
    }
}

/// Whether requests need a token.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Auth {
    Required,
    /// Allowed only if no other machine can connect.
    Off,
}

section! {
    /// Certificate and key for TLS: PEM files, which are read again when they change.
    pub struct TlsConfig {
        /// PEM file with the certificate, followed by the intermediate certificates.
        pub certificate: PathBuf,
        /// PEM file with its private key.
        pub key: PathBuf,
    }
}

section! {
    /// An identity provider whose JSON Web Tokens are accepted besides the service's own
    /// tokens.
    pub struct JwtConfig {
        /// The `iss` that a token must have.
        pub issuer: String,
        /// The `aud` that a token must have, or an element of it.
        pub audience: String,
        /// The provider's public keys (JWKS): a file or an `https://` URL; `http://` is
        /// permitted for this machine only.
        pub jwks: String,
        /// The claim with the role: its name, or a JSON pointer.
        #[serde(default = "role_claim")]
        pub role_claim: String,
        /// The claim with the asset of a device: its name, or a JSON pointer.
        #[serde(default = "asset_claim")]
        pub asset_claim: String,
    }
}

fn role_claim() -> String {
    "offbd_role".to_owned()
}

fn asset_claim() -> String {
    "offbd_asset".to_owned()
}

/// The location of a provider's keys.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum KeyLocation {
    File(PathBuf),
    Url(hyper::Uri),
}

impl JwtConfig {
    fn check(&self, requires_token: bool) -> Result<(), ConfigError> {
        let invalid = |key, reason: &str| Err(ConfigError::Invalid { key, reason: reason.into() });
        if !requires_token {
            let reason = "is set, but requests need no token: set `auth` to `required`";
            return invalid("jwt", reason);
        }
        let blank = |word: &str| word.is_empty() || word.contains(char::is_whitespace);
        match self {
            Self { issuer, .. } if blank(issuer) => {
                invalid("jwt.issuer", "is empty or contains blanks")
            }
            Self { audience, .. } if audience.is_empty() => invalid("jwt.audience", "is empty"),
            Self { role_claim, .. } if role_claim.is_empty() => {
                invalid("jwt.role_claim", "is empty")
            }
            Self { asset_claim, .. } if asset_claim.is_empty() => {
                invalid("jwt.asset_claim", "is empty")
            }
            _ => self.location().map(drop),
        }
    }

    /// The location of the keys.
    ///
    /// # Errors
    /// [`ConfigError::Invalid`] if it is empty or invalid, or if another machine would
    /// send the keys without encryption.
    pub fn location(&self) -> Result<KeyLocation, ConfigError> {
        let invalid =
            |reason: &str| ConfigError::Invalid { key: "jwt.jwks", reason: reason.into() };
        if self.jwks.is_empty() {
            return Err(invalid("is empty"));
        }
        if !self.jwks.contains("://") {
            return Ok(KeyLocation::File(PathBuf::from(&self.jwks)));
        }
        let url: hyper::Uri = self.jwks.parse().map_err(|_| invalid("is not a valid URL"))?;
        let host = url.host().unwrap_or_default().trim_matches(['[', ']']);
        let is_local = host == "localhost" || host.parse().is_ok_and(|ip: IpAddr| ip.is_loopback());
        if url.authority().is_some_and(|authority| authority.as_str().contains('@')) {
            return Err(invalid("contains a user or password, which is not supported"));
        }
        match url.scheme_str() {
            Some("https") => Ok(KeyLocation::Url(url)),
            Some("http") if is_local => Ok(KeyLocation::Url(url)),
            _ => Err(invalid(
                "must begin with `https://`; `http://` is allowed for this machine only",
            )),
        }
    }

    /// The claims that a token must have.
    #[must_use]
    pub fn expected(&self) -> ExpectedClaims {
        let Self { issuer, audience, role_claim, asset_claim, .. } = self.clone();
        ExpectedClaims { issuer, audience, role_claim, asset_claim }
    }
}

config_section! {
    /// Rate limits, in requests per second, which apply if requests need a token. The
    /// requests of ten seconds may come at once; further ones are answered 429 with
    /// `Retry-After`.
    RatesConfig as "rates" |_this| {
        /// Requests per second with one token; then 429 with `Retry-After`. The requests of ten
        /// seconds may come at once. All JSON Web Tokens of one subject count as one token.
        token_per_s: u32 = 2000, 1..=1_000_000;
        /// The same for the requests of one address without a token, or with one that was not
        /// used in the last 5 s.
        address_per_s: u32 = 500, 1..=1_000_000;
    }
}

section! {
    /// Logs, on stderr.
    #[serde(default)]
    pub struct LogConfig {
        /// `text`, or `json` for one object per line.
        pub format: LogFormat,
        /// A filter such as `info`, or `offbd=debug,info`.
        pub level: String,
    }
}

section! {
    /// Traces for OpenTelemetry, by OTLP over HTTP; none without an endpoint.
    #[serde(default)]
    pub struct TracesConfig {
        /// `http://HOST:PORT` of an OpenTelemetry collector. It should run on this machine: the
        /// connection to it is not encrypted.
        pub endpoint: Option<String>,
        /// The share of requests that are traced, 0 to 1.
        pub share: f64,
    }
}

impl Default for TracesConfig {
    fn default() -> Self {
        Self { endpoint: None, share: 1.0 }
    }
}

impl TracesConfig {
    fn check(&self) -> Result<(), ConfigError> {
        let invalid = |key, reason| Err(ConfigError::Invalid { key, reason });
        if !(0.0..=1.0).contains(&self.share) {
            return invalid("traces.share", format!("is {}; it must be from 0 to 1", self.share));
        }
        match &self.endpoint {
            Some(endpoint) if !endpoint.starts_with("http://") => {
                invalid("traces.endpoint", "is not `http://HOST:PORT`".to_owned())
            }
            Some(_) if !cfg!(feature = "otel") => {
                let reason = "needs a build with OpenTelemetry: cargo build --features otel";
                invalid("traces.endpoint", reason.to_owned())
            }
            _ => Ok(()),
        }
    }
}

/// The format of log lines.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum LogFormat {
    /// Text for people.
    #[default]
    Text,
    /// One JSON object per line.
    Json,
}

section! {
    /// How long recordings are kept; without a limit, for ever. See [`Retention`].
    #[serde(default)]
    pub struct RetentionConfig {
        /// Days after which an ended session is deleted in which no fault changed its status; by
        /// default never.
        pub days: Option<usize>,
        /// Days after which an ended session is deleted in which a fault changed its status, not
        /// below `retention.days`; by default never.
        pub fault_days: Option<usize>,
        /// Stored bytes of the ended sessions of one asset, above which the oldest are deleted;
        /// by default no limit.
        pub bytes_per_asset: Option<usize>,
        /// Time between two sweeps, s.
        pub sweep_s: u64,
    }
}

section! {
    /// How notifications are sent. See [`NotificationSettings`].
    #[serde(default)]
    pub struct NotificationsConfig {
        /// Address of the dashboard for links in messages, `https://HOST[:PORT]`.
        pub public_url: Option<String>,
        /// Patterns of the hosts to which messages may be sent, with `*` and `?`; all if empty.
        pub targets: Vec<String>,
        /// Whether messages may be sent to private and loopback addresses.
        pub private_addresses: bool,
        /// Time limit of one attempt, s.
        pub timeout_s: u64,
        /// Delay after the first failed attempt, s; it doubles with each further one, up to an
        /// hour.
        pub first_retry_s: u64,
        /// Age at which a message is given up, s.
        pub give_up_after_s: u64,
    }
}

impl Default for NotificationsConfig {
    fn default() -> Self {
        let settings = NotificationSettings::default();
        Self {
            public_url: None,
            targets: settings.targets.hosts,
            private_addresses: settings.targets.private_addresses,
            timeout_s: settings.timeout.as_secs(),
            first_retry_s: settings.first_retry.as_secs(),
            give_up_after_s: settings.give_up_after.as_secs(),
        }
    }
}

impl NotificationsConfig {
    fn check(&self) -> Result<(), ConfigError> {
        within_s("notifications.timeout_s", self.timeout_s, 1, 60)?;
        within_s("notifications.first_retry_s", self.first_retry_s, 1, 3600)?;
        within_s("notifications.give_up_after_s", self.give_up_after_s, 1, 604_800)?;
        let invalid = |key, reason: &str| Err(ConfigError::Invalid { key, reason: reason.into() });
        if self.targets.iter().any(|pattern| pattern.is_empty() || pattern.contains(['/', ' '])) {
            return invalid("notifications.targets", "has an entry that is not a host name");
        }
        match &self.public_url {
            Some(url) if !is_origin(url) => {
                invalid("notifications.public_url", "is not https://host or https://host:port")
            }
            _ => Ok(()),
        }
    }

    fn settings(&self) -> NotificationSettings {
        NotificationSettings {
            public_url: self.public_url.clone(),
            targets: TargetPolicy {
                hosts: self.targets.clone(),
                private_addresses: self.private_addresses,
            },
            timeout: Duration::from_secs(self.timeout_s),
            first_retry: Duration::from_secs(self.first_retry_s),
            give_up_after: Duration::from_secs(self.give_up_after_s),
        }
    }
}

impl Default for RetentionConfig {
    fn default() -> Self {
        let sweep_s = Retention::default().every.as_secs();
        Self { days: None, bytes_per_asset: None, fault_days: None, sweep_s }
    }
}

impl RetentionConfig {
    fn check(&self) -> Result<(), ConfigError> {
        /// A hundred years.
        const MAX_DAYS: usize = 36_525;
        let days = self.days.unwrap_or(1);
        within("retention.days", days, 1, MAX_DAYS)?;
        within("retention.fault_days", self.fault_days.unwrap_or(MAX_DAYS), days, MAX_DAYS)?;
        let bytes = self.bytes_per_asset.unwrap_or(usize::MAX);
        within("retention.bytes_per_asset", bytes, 1, usize::MAX)?;
        let seconds = usize::try_from(self.sweep_s).unwrap_or(usize::MAX);
        within("retention.sweep_s", seconds, 1, 86_400)
    }

    fn retention(&self) -> Retention {
        let age = |days: usize| Duration::from_secs(days as u64 * 86_400);
        Retention {
            age: self.days.map(age),
            bytes_per_asset: self.bytes_per_asset.map(|bytes| bytes as u64),
            fault_age: self.fault_days.map(age),
            every: Duration::from_secs(self.sweep_s),
        }
    }
}

impl Default for Config {
    fn default() -> Self {
        Self {
            listen: SocketAddr::from(([127, 0, 0, 1], 8087)),
            data: PathBuf::from("offbd-data"),
            database: None,
            database_file: None,
            auth: None,
            origins: Vec::new(),
            tls: None,
            jwt: None,
            cluster: None,
            nats: None,
            mqtt: None,
            log: LogConfig::default(),
            traces: TracesConfig::default(),
            limits: RequestLimits::default(),
            rates: RatesConfig::default(),
            workers: WorkerLimits::default(),
            retention: RetentionConfig::default(),
            communication: CommunicationSettings::default(),
            notifications: NotificationsConfig::default(),
        }
    }
}

impl Default for LogConfig {
    fn default() -> Self {
        Self { format: LogFormat::default(), level: "info".to_owned() }
    }
}

/// Settings from the command line; `None` where it has none.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Flags {
    pub listen: Option<SocketAddr>,
    pub data: Option<PathBuf>,
    pub database: Option<String>,
}

impl Flags {
    /// The keys that are set.
    fn names(&self) -> Vec<&'static str> {
        let Self { listen, data, database } = self;
        let set = [
            ("listen", listen.is_some()),
            ("data", data.is_some()),
            ("database", database.is_some()),
        ];
        set.into_iter().filter_map(|(name, is_set)| is_set.then_some(name)).collect()
    }
}

/// Why a configuration is invalid.
#[derive(Debug, thiserror::Error)]
pub enum ConfigError {
    /// Names the key and, if known, the file.
    #[error("configuration: {0}")]
    Unreadable(#[from] config::ConfigError),
    #[error("configuration: `{key}` {reason}")]
    Invalid { key: &'static str, reason: String },
}

impl From<OutOfRange> for ConfigError {
    fn from(OutOfRange { key, reason }: OutOfRange) -> Self {
        Self::Invalid { key, reason }
    }
}

impl Config {
    /// Loads and checks the configuration: the defaults, overridden by `file` if given,
    /// by the environment and by `flags`, in this order.
    ///
    /// # Errors
    /// [`ConfigError`] with the first invalid key.
    pub fn load(file: Option<&Path>, flags: &Flags) -> Result<Self, ConfigError> {
        Self::from_sources(file, environment(), flags)
    }

    fn from_sources(
        file: Option<&Path>,
        environment: Environment,
        flags: &Flags,
    ) -> Result<Self, ConfigError> {
        let mut builder = config::Config::builder();
        if let Some(file) = file {
            builder = builder.add_source(toml_file(file));
        }
        let mut config: Self = builder.add_source(environment).build()?.try_deserialize()?;
        config.override_with(flags);
        config.read_secrets()?;
        config.check()?;
        Ok(config)
    }

    fn override_with(&mut self, flags: &Flags) {
        if let Some(listen) = flags.listen {
            self.listen = listen;
        }
        if let Some(data) = &flags.data {
            self.data.clone_from(data);
        }
        if flags.database.is_some() {
            self.database.clone_from(&flags.database);
            self.database_file = None;
        }
    }

    /// Checks ranges, and values that depend on each other.
    ///
    /// # Errors
    /// [`ConfigError::Invalid`] with the first invalid key.
    pub fn check(&self) -> Result<(), ConfigError> {
        NumberKey::check_all(&self.limits.numbers())?;
        NumberKey::check_all(&self.rates.numbers())?;
        let requires_token = self.requires_token()?;
        self.jwt.as_ref().map_or(Ok(()), |jwt| jwt.check(requires_token))?;
        self.origins.iter().try_for_each(|origin| check_origin(origin))?;
        NumberKey::check_all(&self.workers.numbers())?;
        if let Err(error) = self.log.level.parse::<tracing_subscriber::EnvFilter>() {
            return Err(ConfigError::Invalid { key: "log.level", reason: error.to_string() });
        }
        self.traces.check()?;
        self.nats.as_ref().map_or(Ok(()), NatsConfig::check)?;
        self.mqtt.as_ref().map_or(Ok(()), |mqtt| mqtt.check(self.nats.is_some()))?;
        self.retention.check()?;
        NumberKey::check_all(&self.communication.numbers())?;
        self.notifications.check()?;
        let location = self.location()?;
        self.cluster.as_ref().map_or(Ok(()), |cluster| cluster.check(&location))
    }

    /// Returns whether requests need a token.
    ///
    /// # Errors
    /// [`ConfigError::Invalid`] if `auth` is `off` although other machines can connect.
    pub fn requires_token(&self) -> Result<bool, ConfigError> {
        let is_local = self.listen.ip().to_canonical().is_loopback();
        if self.auth == Some(Auth::Off) && !is_local {
            let reason = format!(
                "is `off`, but other machines can connect to {}: set `auth` to `required` and \
                 create a token with `offbd token create --name NAME --role admin`, or listen on \
                 127.0.0.1",
                self.listen
            );
            return Err(ConfigError::Invalid { key: "auth", reason });
        }
        Ok(self.auth.map_or(!is_local, |auth| auth == Auth::Required))
    }

    /// The location of the database.
    ///
    /// # Errors
    /// [`ConfigError::Invalid`] if `database` is not a supported URL.
    pub fn location(&self) -> Result<Location, ConfigError> {
        let Some(url) = &self.database else {
            return Ok(Location::File(self.data.join(DATABASE_FILE)));
        };
        Location::of_url(url).map_err(|reason| ConfigError::Invalid { key: "database", reason })
    }

    /// The service's limits.
    #[must_use]
    pub fn service_limits(&self) -> Limits {
        Limits {
            requests: self.limits.clone(),
            workers: self.workers.clone(),
            retention: self.retention.retention(),
            communication: self.communication.clone(),
            notifications: self.notifications.settings(),
            ..Limits::default()
        }
    }
}

fn toml_file(file: &Path) -> File<config::FileSourceFile, FileFormat> {
    File::from(file).format(FileFormat::Toml)
}

/// The variables of the environment: `OFFBD_` and the key, with two underscores behind a section.
fn environment() -> Environment {
    let environment = Environment::with_prefix("OFFBD").prefix_separator("_").separator("__");
    environment
        .try_parsing(true)
        .list_separator(",")
        .with_list_parse_key("origins")
        .with_list_parse_key("notifications.targets")
}

/// Checks that `origin` is written as browsers do (RFC 6454, section 6.1).
fn check_origin(origin: &str) -> Result<(), ConfigError> {
    if is_origin(origin) {
        return Ok(());
    }
    let reason = format!("contains `{origin}`; an origin is https://host or https://host:port");
    Err(ConfigError::Invalid { key: "origins", reason })
}

fn is_origin(origin: &str) -> bool {
    let host = origin.strip_prefix("https://").or_else(|| origin.strip_prefix("http://"));
    let whole = |host: &str| !host.is_empty() && !host.contains(['/', '?', '#', '@', ' ', '*']);
    host.is_some_and(whole) && origin.chars().all(|c| c.is_ascii() && !c.is_ascii_uppercase())
}

/// Like [`within`], for seconds.
fn within_s(key: &'static str, seconds: u64, least: usize, most: usize) -> Result<(), ConfigError> {
    within(key, usize::try_from(seconds).unwrap_or(usize::MAX), least, most)
}

fn within(key: &'static str, value: usize, least: usize, most: usize) -> Result<(), ConfigError> {
    if (least..=most).contains(&value) {
        return Ok(());
    }
    let reason = format!("is {value}; it must be from {least} to {most}");
    Err(ConfigError::Invalid { key, reason })
}

#[cfg(test)]
mod tests {
    use std::collections::HashMap;
    use std::io::Write;

    use super::*;

    fn file(toml: &str) -> tempfile::NamedTempFile {
        let mut file = tempfile::NamedTempFile::new().unwrap();
        file.write_all(toml.as_bytes()).unwrap();
        file
    }

    fn variables(pairs: &[(&str, &str)]) -> Environment {
        let pairs = pairs.iter().map(|(k, v)| ((*k).to_owned(), (*v).to_owned()));
        environment().source(Some(HashMap::from_iter(pairs)))
    }

    fn load(toml: &str, pairs: &[(&str, &str)], flags: &Flags) -> Result<Config, String> {
        let loaded = Config::from_sources(Some(file(toml).path()), variables(pairs), flags);
        loaded.map_err(|e| e.to_string())
    }

    #[test]
    fn the_source_of_each_value_is_told_and_no_secret() {
        let toml = "listen = '127.0.0.1:1'\ndata = 'file'\n[mqtt]\nurl = 'mqtt://a'\n";
        let secret = file("hunter2\n");
        let environment = variables(&[
            ("OFFBD_DATABASE", "postgres://u:hunter2@h/d"),
            ("OFFBD_LIMITS__ASSETS", "7"),
            ("OFFBD_MQTT__USER", "u"),
            ("OFFBD_MQTT__PASSWORD_FILE", secret.path().to_str().unwrap()),
        ]);
        let flags = Flags { listen: Some(([127, 0, 0, 1], 3).into()), ..Flags::default() };
        let file = file(toml);
        let keys = Config::effective_of(Some(file.path()), environment, &flags).unwrap();
        let text = effective::toml(&keys);
        assert!(!text.contains("hunter2"), "{text}");
        let path = file.path().display();
        for (setting, source) in [
            ("listen = \"127.0.0.1:3\"", "--listen"),
            ("data = \"file\"", &path.to_string()),
            ("database = \"postgres://h:5432/d\"", "OFFBD_DATABASE"),
            ("# auth =", "not set"),
            ("assets = 7", "OFFBD_LIMITS__ASSETS"),
            ("connections = 16384", "default"),
            ("url = \"mqtt://a\"", &path.to_string()),
            ("password = \"(hidden)\"", "OFFBD_MQTT__PASSWORD_FILE"),
        ] {
            let line = format!("{setting:<46} # {source}");
            assert!(text.lines().any(|told| told == line), "{line}: {text}");
        }
        assert!(text.contains("\n[mqtt]\n") && !text.contains("[nats]"), "{text}");
        // What is printed can be read again.
        let printed = self::file(&text.replace("(hidden)", "x").replace("password_file", "#"));
        let environment = variables(&[]);
        let again = Config::from_sources(Some(printed.path()), environment, &Flags::default());
        assert_eq!(again.unwrap().limits.assets, 7);
    }

    #[test]
    fn secrets_are_read_from_files() {
        let secret = file("hunter2\r\n");
        let path = secret.path().to_str().unwrap();
        let url = file("postgres://u:hunter2@h/d\n");
        let toml = format!(
            "database_file = '{}'\n[mqtt]\nurl = 'mqtt://a'\nuser = 'u'\npassword_file = '{path}'\n\
             [nats]\nurl = 'nats://a'\nuser = 'u'\npassword_file = '{path}'",
            url.path().display()
        );
        let config = load(&toml, &[], &Flags::default()).unwrap();
        let password = || Some("hunter2".to_owned());
        assert_eq!(config.database.as_deref(), Some("postgres://u:hunter2@h/d"));
        assert_eq!(config.nats.as_ref().unwrap().password, password());
        assert_eq!(config.mqtt.as_ref().unwrap().password, password());
        // A flag overrides the file too.
        let flags = Flags { database: Some("sqlite:x".to_owned()), ..Flags::default() };
        assert_eq!(load(&toml, &[], &flags).unwrap().database.as_deref(), Some("sqlite:x"));
        for (variable, value, key, reason) in [
            ("OFFBD_NATS__PASSWORD", "x", "nats.password_file", "is set besides `nats.password`"),
            ("OFFBD_DATABASE_FILE", "/nowhere", "database_file", "cannot be read: /nowhere"),
            ("OFFBD_MQTT__PASSWORD_FILE", "/dev/null", "mqtt.password_file", "an empty file"),
        ] {
            let error = load(&toml, &[(variable, value)], &Flags::default()).unwrap_err();
            assert!(error.contains(&format!("`{key}`")) && error.contains(reason), "{error}");
        }
    }

    #[cfg(unix)]
    #[test]
    fn secrets_that_everybody_can_read_are_told() {
        use std::os::unix::fs::PermissionsExt;
        let secret = file("hunter2");
        let toml =
            format!("[mqtt]\nurl = 'mqtt://a'\nuser = 'u'\n{{}} = '{}'", secret.path().display());
        let told = |key: &str, mode| {
            let own = file(&toml.replace("{}", key));
            for path in [own.path(), secret.path()] {
                std::fs::set_permissions(path, std::fs::Permissions::from_mode(mode)).unwrap();
            }
            let config =
                Config::from_sources(Some(own.path()), variables(&[]), &Flags::default()).unwrap();
            let told = config.readable_secrets(Some(own.path()));
            told.into_iter().map(|secret| secret.key).collect::<Vec<_>>()
        };
        assert_eq!(told("password_file", 0o644), [Some("mqtt.password_file")]);
        assert_eq!(told("password", 0o644), [None]);
        assert_eq!(told("password_file", 0o640), []);
        assert_eq!(told("password", 0o600), []);
    }

    #[test]
    fn each_source_overrides_the_previous_one() {
        let toml = "listen = '127.0.0.1:1'\ndata = 'file'\n[log]\nlevel = 'debug'\n";
        let environment = [
            ("OFFBD_DATA", "env"),
            ("OFFBD_LIMITS__ASSETS", "7"),
            ("OFFBD_ORIGINS", "https://a.example,https://b.example"),
        ];
        let flags = Flags { listen: Some(([127, 0, 0, 1], 3).into()), ..Flags::default() };
        let config = load(toml, &environment, &flags).unwrap();
        assert_eq!(config.listen.port(), 3);
        assert_eq!(config.data, PathBuf::from("env"));
        assert_eq!(config.log.level, "debug");
        assert_eq!(config.limits.assets, 7);
        assert_eq!(config.origins, ["https://a.example", "https://b.example"]);
        assert_eq!(config.limits.batch_samples, RequestLimits::default().batch_samples);
        assert_eq!(config.location().unwrap(), Location::File("env/offbd.sqlite".into()));
    }

    #[test]
    fn a_token_is_required_if_other_machines_can_connect() {
        for (listen, auth, required) in [
            ("127.0.0.1:1", None, Some(false)),
            ("[::1]:1", None, Some(false)),
            ("[::ffff:127.0.0.1]:1", None, Some(false)),
            ("0.0.0.0:1", None, Some(true)),
            ("[::]:1", None, Some(true)),
            ("192.0.2.1:1", None, Some(true)),
            ("127.0.0.1:1", Some(Auth::Required), Some(true)),
            ("127.0.0.1:1", Some(Auth::Off), Some(false)),
            ("0.0.0.0:1", Some(Auth::Off), None),
        ] {
            let config = Config { listen: listen.parse().unwrap(), auth, ..Config::default() };
            assert_eq!(config.requires_token().ok(), required, "{listen} {auth:?}");
        }
    }

    #[test]
    fn keys_come_from_a_file_or_an_encrypted_connection() {
        let jwks = |jwks: &str| {
            let toml = format!(
                "auth = 'required'\n[jwt]\nissuer = 'https://i'\naudience = 'a'\njwks = '{jwks}'"
            );
            load(&toml, &[], &Flags::default())
                .map(|config| config.jwt.unwrap().location().unwrap())
        };
        assert_eq!(jwks("/etc/jwks.json"), Ok(KeyLocation::File("/etc/jwks.json".into())));
        for url in ["https://i/jwks", "http://127.0.0.1:1/", "http://[::1]:1/", "http://localhost"]
        {
            assert_eq!(jwks(url), Ok(KeyLocation::Url(url.parse().unwrap())));
        }
        for invalid in [
            "",
            "http://i/jwks",
            "http://localhost.example/jwks",
            "ftp://i",
            "https://",
            "https://u:secret@i/jwks",
        ] {
            let error = jwks(invalid).unwrap_err();
            assert!(error.contains("jwt.jwks") && !error.contains("secret"), "{invalid}: {error}");
        }
    }

    #[test]
    fn an_error_names_the_key() {
        let error = |toml: &str, environment: &[(&str, &str)]| {
            load(toml, environment, &Flags::default()).unwrap_err()
        };
        for (toml, key) in [
            ("lisen = 'x'", "lisen"),
            ("listen = 'x'", "listen"),
            ("[limits]\nbatch_samples = 0", "limits.batch_samples"),
            ("[limits]\nbatch_sample = 0", "batch_sample"),
            ("[workers]\nshards = -1", "shards"),
            ("[log]\nformat = 'xml'", "format"),
            ("[log]\nlevel = 'a=b=c'", "log.level"),
            ("database = 'mysql://x'", "database"),
            ("database = 'sqlite:'", "database"),
            ("auth = 'maybe'", "auth"),
            ("auth = 'off'\nlisten = '0.0.0.0:1'", "auth"),
            ("origins = ['https://a.example/']", "origins"),
            ("[tls]\ncertificate = 'a'", "key"),
            ("[jwt]\nissuer = 'a'\naudience = 'b'", "jwks"),
            ("[jwt]\nissuer = 'a'\naudience = 'b'\njwks = 'c'", "auth"),
            ("[limits]\nconnections = 0", "limits.connections"),
            ("[rates]\ntoken_per_s = 0", "rates.token_per_s"),
            ("[traces]\nendpoint = 'https://secret.example'", "traces.endpoint"),
            ("[traces]\nshare = 1.5", "traces.share"),
            ("[traces]\nshare = nan", "traces.share"),
            ("[retention]\ndays = 30\nfault_days = 29", "retention.fault_days"),
            ("database = 'postgres://a:secret@h:port/d'", "database"),
        ] {
            let error = error(toml, &[]);
            assert!(error.contains(key), "{toml}: {error}");
            assert!(!error.contains("secret"), "{error}");
        }
        let error = error("", &[("OFFBD_WORKERS__SHARDS", "many")]);
        assert!(error.contains("shards"), "{error}");
    }
}
