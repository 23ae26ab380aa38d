//! Secrets: they are read from files, hidden where the configuration is shown, and files that
//! every user of the machine can read are named.

use std::path::{Path, PathBuf};

use serde::{Serialize, Serializer};

use super::{Config, ConfigError};
use offbd_store::Location;

/// What is shown instead of a secret.
const HIDDEN: &str = "(hidden)";

pub(super) fn hide<S: Serializer>(
    secret: &Option<String>,
    serializer: S,
) -> Result<S::Ok, S::Error> {
    secret.as_ref().map(|_| HIDDEN).serialize(serializer)
}

/// Hides user and password of a URL.
pub(super) fn hide_url<S: Serializer>(
    url: &Option<String>,
    serializer: S,
) -> Result<S::Ok, S::Error> {
    let shown = url.as_ref().map(|url| match Location::of_url(url) {
        Ok(Location::File(_)) => url.clone(),
        Ok(server) => server.to_string(),
        Err(_) => HIDDEN.to_owned(),
    });
    shown.serialize(serializer)
}

/// A file with a secret that every user of this machine can read.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct ReadableSecret {
    /// The key that names the file; none for the configuration file, which has a secret itself.
    pub key: Option<&'static str>,
    pub file: PathBuf,
}

impl std::fmt::Display for ReadableSecret {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let file = self.file.display();
        match self.key {
            Some(key) => write!(f, "`{key}`: every user of this machine can read {file}")?,
            None => write!(f, "every user of this machine can read {file}, which has a password")?,
        }
        write!(f, "; `chmod o-r` prevents that")
    }
}

impl Config {
    /// Reads the secrets that are in files.
    ///
    /// # Errors
    /// [`ConfigError::Invalid`] if a secret is given twice, or its file cannot be read.
    pub(super) fn read_secrets(&mut self) -> Result<(), ConfigError> {
        let (nats, mqtt) = (&mut self.nats, &mut self.mqtt);
        read("database", "database_file", &mut self.database, self.database_file.as_deref())?;
        if let Some(nats) = nats {
            let file = nats.password_file.as_deref();
            read("nats.password", "nats.password_file", &mut nats.password, file)?;
        }
        if let Some(mqtt) = mqtt {
            let file = mqtt.password_file.as_deref();
            read("mqtt.password", "mqtt.password_file", &mut mqtt.password, file)?;
        }
        Ok(())
    }

    /// The files with secrets that every user of this machine can read; `file` is the
    /// configuration file.
    #[must_use]
    pub fn readable_secrets(&self, file: Option<&Path>) -> Vec<ReadableSecret> {
        let (tls, nats, mqtt) = (self.tls.as_ref(), self.nats.as_ref(), self.mqtt.as_ref());
        let named = [
            ("database_file", self.database_file.as_ref()),
            ("tls.key", tls.map(|tls| &tls.key)),
            ("nats.password_file", nats.and_then(|nats| nats.password_file.as_ref())),
            ("nats.credentials", nats.and_then(|nats| nats.credentials.as_ref())),
            ("nats.issuer_seed", nats.and_then(|nats| nats.issuer_seed.as_ref())),
            ("mqtt.password_file", mqtt.and_then(|mqtt| mqtt.password_file.as_ref())),
            ("mqtt.key", mqtt.and_then(|mqtt| mqtt.key.as_ref())),
        ];
        let own = file.filter(|file| has_password(file)).map(|file| (None, file.to_owned()));
        let named = named.into_iter().filter_map(|(key, file)| Some((Some(key), file?.clone())));
        let files = own.into_iter().chain(named);
        let readable = files.filter(|(_, file)| is_readable_by_all(file));
        readable.map(|(key, file)| ReadableSecret { key, file }).collect()
    }
}

/// Whether a configuration file sets a secret itself.
fn has_password(file: &Path) -> bool {
    let read = config::Config::builder().add_source(super::toml_file(file)).build();
    let Ok(read) = read else { return false };
    let url = read.get_string("database").unwrap_or_default();
    let has = |key| read.get_string(key).is_ok();
    let has_login = url.split_once("://").is_some_and(|(_, rest)| rest.contains('@'));
    has_login || has("nats.password") || has("mqtt.password")
}

#[cfg(unix)]
fn is_readable_by_all(file: &Path) -> bool {
    use std::os::unix::fs::PermissionsExt;
    std::fs::metadata(file).is_ok_and(|metadata| metadata.permissions().mode() & 0o004 != 0)
}

#[cfg(not(unix))]
fn is_readable_by_all(_: &Path) -> bool {
    false
}

/// Sets `secret` to the content of `file`, without the line break at its end.
fn read(
    key: &'static str,
    file_key: &'static str,
    secret: &mut Option<String>,
    file: Option<&Path>,
) -> Result<(), ConfigError> {
    let Some(file) = file else { return Ok(()) };
    let invalid = |reason| ConfigError::Invalid { key: file_key, reason };
    if secret.is_some() {
        return Err(invalid(format!("is set besides `{key}`")));
    }
    let text = std::fs::read_to_string(file)
        .map_err(|error| invalid(format!("cannot be read: {}: {error}", file.display())))?;
    let text = text.trim_end_matches(['\r', '\n']);
    if text.is_empty() {
        return Err(invalid(format!("names an empty file: {}", file.display())));
    }
    *secret = Some(text.to_owned());
    Ok(())
}
