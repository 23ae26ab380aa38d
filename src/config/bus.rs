//! The sections `nats` and `mqtt`: where devices are reached besides HTTP.

use std::path::PathBuf;

use super::{ClusterConfig, ConfigError, secrets};

/// The name by which a broker knows a service that works alone; a node's has the name of the
/// node behind it.
const CLIENT_ID: &str = "offbd";

/// Longest name by which a broker knows the service. Chosen: longer than that of any node.
const MAX_CLIENT_ID: usize = 128;

section! {
    /// A NATS server whose devices are served.
    pub struct NatsConfig {
        /// `nats://HOST:PORT`, or `tls://HOST:PORT` for an encrypted connection; several servers
        /// of one cluster with `,` between.
        pub url: String,
        /// The user that the service connects as, with a password.
        pub user: Option<String>,
        /// The password of this user.
        #[serde(serialize_with = "secrets::hide")]
        pub password: Option<String>,
        /// A file with this password.
        pub password_file: Option<PathBuf>,
        /// A file with credentials, instead of user and password.
        pub credentials: Option<PathBuf>,
        /// PEM file with the certificates from which the server's must come.
        pub ca: Option<PathBuf>,
        /// The server's monitoring, `http://HOST:PORT`, where its settings are checked; several
        /// with `,` between.
        pub monitor: Option<String>,
        /// Whether faults are published.
        #[serde(default = "yes")]
        pub faults: bool,
        /// A file with the seed of the account key by which the server asks for the rights of
        /// devices (auth callout).
        pub issuer_seed: Option<PathBuf>,
        /// The account of the server that devices are in.
        #[serde(default = "account")]
        pub account: String,
    }
}

section! {
    /// An MQTT broker whose devices are served.
    pub struct MqttConfig {
        /// `mqtt://HOST[:PORT]`, or `mqtts://HOST[:PORT]` for an encrypted connection; port 1883
        /// or 8883 by default.
        pub url: String,
        /// The name by which the broker knows the service: 1 to 128 letters, digits, `-`, `_` and
        /// `.`; two services need two. By default `offbd`, and of a node with its name behind it,
        /// as `offbd-node-1`.
        pub client_id: Option<String>,
        /// The user that the service connects as, with a password.
        pub user: Option<String>,
        /// The password of this user.
        #[serde(serialize_with = "secrets::hide")]
        pub password: Option<String>,
        /// A file with this password.
        pub password_file: Option<PathBuf>,
        /// PEM file with the certificates from which the broker's must come; by default the roots
        /// of this machine. With `mqtts://` only.
        pub ca: Option<PathBuf>,
        /// PEM file with the certificate of the service, for a broker that demands one. With
        /// `mqtts://` and `key` only.
        pub certificate: Option<PathBuf>,
        /// PEM file with its private key.
        pub key: Option<PathBuf>,
        /// Whether batches are accepted; `false` if the broker is the NATS server of `nats`, which
        /// delivers them already.
        #[serde(default = "yes")]
        pub telemetry: bool,
        /// Whether faults are published.
        #[serde(default = "yes")]
        pub faults: bool,
        /// Whether `offbd/v1/=service/CLIENT_ID/state` is `online` while the service is connected,
        /// and `offline` afterwards (last will). The broker must permit the service to publish
        /// there.
        #[serde(default)]
        pub state: bool,
        /// A mapping file, for devices with their own topics and formats.
        pub mapping: Option<PathBuf>,
    }
}

/// Host and port of a broker.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct BrokerAddress {
    pub host: String,
    pub port: u16,
    /// Whether the connection is encrypted.
    pub encrypted: bool,
}

const fn yes() -> bool {
    true
}

fn account() -> String {
    "$G".to_owned()
}

fn invalid<T>(key: &'static str, reason: impl Into<String>) -> Result<T, ConfigError> {
    Err(ConfigError::Invalid { key, reason: reason.into() })
}

/// Checks that user and password are given together.
fn login(
    key: &'static str,
    user: Option<&String>,
    password: Option<&String>,
) -> Result<Option<(String, String)>, ConfigError> {
    match (user, password) {
        (Some(user), Some(password)) => Ok(Some((user.clone(), password.clone()))),
        (None, None) => Ok(None),
        _ => invalid(key, "needs both a user and a password"),
    }
}

impl NatsConfig {
    pub(super) fn check(&self) -> Result<(), ConfigError> {
        if !cfg!(feature = "nats") {
            return invalid("nats", "needs a build with NATS: cargo build --features nats");
        }
        let is_server = |url: &str| {
            let rest = url.strip_prefix("nats://").or_else(|| url.strip_prefix("tls://"));
            rest.is_some_and(|rest| !rest.is_empty() && !rest.contains(['@', '/', ' ']))
        };
        if !self.url.split(',').all(is_server) {
            return invalid(
                "nats.url",
                "is not `nats://HOST:PORT` or `tls://HOST:PORT`; user and password have \
                 their own keys",
            );
        }
        let is_monitor = |url: &str| url.trim().starts_with("http://");
        if self.monitor.as_ref().is_some_and(|urls| !urls.split(',').all(is_monitor)) {
            return invalid("nats.monitor", "is not `http://HOST:PORT`");
        }
        if self.account.is_empty() || self.account.contains(char::is_whitespace) {
            return invalid("nats.account", "is empty or contains blanks");
        }
        if self.credentials.is_some() && self.user.is_some() {
            return invalid("nats.credentials", "is set besides `nats.user`");
        }
        self.login().map(drop)
    }

    /// The user and the password of the service.
    ///
    /// # Errors
    /// [`ConfigError::Invalid`] if only one of them is given.
    pub fn login(&self) -> Result<Option<(String, String)>, ConfigError> {
        login("nats.user", self.user.as_ref(), self.password.as_ref())
    }
}

impl MqttConfig {
    /// A broker that needs no login, with the default of each key.
    #[must_use]
    pub const fn at(url: String) -> Self {
        Self {
            url,
            client_id: None,
            user: None,
            password: None,
            password_file: None,
            ca: None,
            certificate: None,
            key: None,
            telemetry: true,
            faults: true,
            state: false,
            mapping: None,
        }
    }

    pub(super) fn check(&self, nats: bool) -> Result<(), ConfigError> {
        if !cfg!(feature = "mqtt") {
            return invalid("mqtt", "needs a build with MQTT: cargo build --features mqtt");
        }
        // MQTT 3.1.1, section 3.1.3.1, permits any text. Every broker must accept up to 23
        // letters and digits; the usual ones accept all that is accepted here.
        let is_plain = |c: char| c.is_ascii_alphanumeric() || "-_.".contains(c);
        let is_id =
            |id: &String| (1..=MAX_CLIENT_ID).contains(&id.len()) && id.chars().all(is_plain);
        if !self.client_id.iter().all(is_id) {
            let reason = "must be 1 to 128 letters, digits, `-`, `_` and `.`";
            return invalid("mqtt.client_id", reason);
        }
        if self.ca.is_some() && !self.address()?.encrypted {
            return invalid("mqtt.ca", "is set, but `mqtt.url` is not `mqtts://…`");
        }
        if self.certificate.is_some() != self.key.is_some() {
            return invalid("mqtt.certificate", "and `mqtt.key` are needed together");
        }
        if self.certificate.is_some() && !self.address()?.encrypted {
            return invalid("mqtt.certificate", "is set, but `mqtt.url` is not `mqtts://…`");
        }
        if self.mapping.is_some() && !self.telemetry {
            return invalid("mqtt.mapping", "is set, but `mqtt.telemetry` is false");
        }
        if !nats && !self.telemetry && !self.faults {
            return invalid("mqtt", "does nothing: `telemetry` and `faults` are false");
        }
        self.address()?;
        self.login().map(drop)
    }

    /// The name by which the broker knows this process, a node of `cluster` if there is one.
    #[must_use]
    pub fn client_id(&self, cluster: Option<&ClusterConfig>) -> String {
        let own = || match cluster {
            Some(ClusterConfig { name, .. }) => format!("{CLIENT_ID}-{name}"),
            None => CLIENT_ID.to_owned(),
        };
        self.client_id.clone().unwrap_or_else(own)
    }

    /// The user and the password of the service.
    ///
    /// # Errors
    /// [`ConfigError::Invalid`] if only one of them is given.
    pub fn login(&self) -> Result<Option<(String, String)>, ConfigError> {
        login("mqtt.user", self.user.as_ref(), self.password.as_ref())
    }

    /// The address of the broker.
    ///
    /// # Errors
    /// [`ConfigError::Invalid`] if the URL is not that of a broker.
    pub fn address(&self) -> Result<BrokerAddress, ConfigError> {
        let reason = "is not `mqtt://HOST[:PORT]` or `mqtts://HOST[:PORT]`; user and password have \
            their own keys";
        let (rest, encrypted) =
            match (self.url.strip_prefix("mqtt://"), self.url.strip_prefix("mqtts://")) {
                (Some(rest), _) => (rest, false),
                (None, Some(rest)) => (rest, true),
                (None, None) => return invalid("mqtt.url", reason),
            };
        let authority: Result<hyper::http::uri::Authority, _> = rest.parse();
        match authority {
            Ok(authority) if !rest.contains('@') && !authority.host().is_empty() => {
                let default = if encrypted { 8883 } else { 1883 };
                let port = authority.port_u16().unwrap_or(default);
                let host = authority.host().trim_matches(['[', ']']).to_owned();
                Ok(BrokerAddress { host, port, encrypted })
            }
            _ => invalid("mqtt.url", reason),
        }
    }
}

#[cfg(all(test, feature = "nats", feature = "mqtt"))]
mod tests {
    use super::*;

    fn nats(change: impl FnOnce(&mut NatsConfig)) -> Result<(), String> {
        let mut config = NatsConfig {
            url: "nats://a:4222,tls://b".to_owned(),
            user: None,
            password: None,
            password_file: None,
            credentials: None,
            ca: None,
            monitor: None,
            faults: true,
            issuer_seed: None,
            account: account(),
        };
        change(&mut config);
        config.check().map_err(|error| error.to_string())
    }

    fn broker() -> MqttConfig {
        MqttConfig::at("mqtt://a".to_owned())
    }

    fn mqtt(change: impl FnOnce(&mut MqttConfig)) -> Result<BrokerAddress, String> {
        let mut config = broker();
        change(&mut config);
        config.check(false).and_then(|()| config.address()).map_err(|error| error.to_string())
    }

    #[test]
    fn a_broker_knows_each_node_by_its_own_name() {
        let node = |name: &str| ClusterConfig {
            name: name.to_owned(),
            listen: ([127, 0, 0, 1], 0).into(),
            advertise: None,
            partitions: 1,
        };
        assert_eq!(broker().client_id(None), "offbd");
        assert_eq!(broker().client_id(Some(&node("node-1"))), "offbd-node-1");
        assert_eq!(broker().client_id(Some(&node("node-2"))), "offbd-node-2");
        for id in ["node-1", "a.b_c", &node(&"n".repeat(64)).name] {
            let named = MqttConfig { client_id: Some(id.to_owned()), ..broker() };
            assert_eq!(named.check(false).map_err(|error| error.to_string()), Ok(()), "{id}");
            assert_eq!(named.client_id(Some(&node("node-1"))), id);
        }
    }

    #[test]
    fn an_address_has_the_port_of_its_kind() {
        let address =
            |host: &str, port, encrypted| BrokerAddress { host: host.to_owned(), port, encrypted };
        for (url, expected) in [
            ("mqtt://a", address("a", 1883, false)),
            ("mqtts://a.example", address("a.example", 8883, true)),
            ("mqtt://[::1]:7", address("::1", 7, false)),
        ] {
            assert_eq!(mqtt(|config| config.url = url.to_owned()), Ok(expected));
        }
        assert_eq!(nats(|_| {}), Ok(()));
    }

    #[test]
    fn an_error_names_the_key_and_no_secret() {
        let secret = || Some("secret".to_owned());
        for (result, key) in [
            (nats(|config| config.url = "http://secret".to_owned()), "nats.url"),
            (nats(|config| config.url = "nats://u:secret@h".to_owned()), "nats.url"),
            (nats(|config| config.url = "nats://a,".to_owned()), "nats.url"),
            (nats(|config| config.password = secret()), "nats.user"),
            (nats(|config| config.monitor = Some("h:8222".to_owned())), "nats.monitor"),
            (nats(|config| config.account = "a b".to_owned()), "nats.account"),
            (mqtt(|config| config.url = "mqtt://u:secret@h".to_owned()).map(drop), "mqtt.url"),
            (mqtt(|config| config.url = "h:1883".to_owned()).map(drop), "mqtt.url"),
            (mqtt(|config| config.url = "mqtt://".to_owned()).map(drop), "mqtt.url"),
            (mqtt(|config| config.password = secret()).map(drop), "mqtt.user"),
            (mqtt(|config| config.client_id = Some("a b".to_owned())).map(drop), "mqtt.client_id"),
            (mqtt(|config| config.client_id = Some(String::new())).map(drop), "mqtt.client_id"),
            (mqtt(|config| config.ca = Some("ca".into())).map(drop), "mqtt.ca"),
            (mqtt(|config| config.key = Some("k".into())).map(drop), "mqtt.certificate"),
            (
                mqtt(|config| {
                    config.certificate = Some("c".into());
                    config.key = Some("k".into());
                })
                .map(drop),
                "mqtt.certificate",
            ),
            (
                mqtt(|config| {
                    config.telemetry = false;
                    config.mapping = Some("m".into());
                })
                .map(drop),
                "mqtt.mapping",
            ),
        ] {
            let error = result.unwrap_err();
            assert!(error.contains(&format!("`{key}`")) && !error.contains("secret"), "{error}");
        }
    }
}
