//! The values that apply, each with where it comes from.

use std::collections::HashSet;
use std::fmt;
use std::path::{Path, PathBuf};

use config::{Environment, Source as _, Value, ValueKind};
use serde::Serialize;

use super::{
    ClusterConfig, Config, ConfigError, Flags, JwtConfig, LogConfig, MqttConfig, NatsConfig,
    NotificationsConfig, RatesConfig, RetentionConfig, TlsConfig, TracesConfig,
};
use offbd_service::{CommunicationSettings, RequestLimits, WorkerLimits};

/// Keys with their texts.
type Keys = &'static [(&'static str, &'static str)];

/// The sections, each with its keys.
pub(super) const SECTIONS: [(&str, Keys); 13] = [
    ("tls", TlsConfig::KEYS),
    ("jwt", JwtConfig::KEYS),
    ("cluster", ClusterConfig::KEYS),
    ("nats", NatsConfig::KEYS),
    ("mqtt", MqttConfig::KEYS),
    ("log", LogConfig::KEYS),
    ("traces", TracesConfig::KEYS),
    ("limits", RequestLimits::KEYS),
    ("rates", RatesConfig::KEYS),
    ("workers", WorkerLimits::KEYS),
    ("retention", RetentionConfig::KEYS),
    ("communication", CommunicationSettings::KEYS),
    ("notifications", NotificationsConfig::KEYS),
];

/// The keys outside the sections.
pub(super) fn top_keys() -> impl Iterator<Item = &'static (&'static str, &'static str)> {
    let is_section = |name| SECTIONS.iter().any(|(section, _)| *section == name);
    Config::KEYS.iter().filter(move |(name, _)| !is_section(*name))
}

/// Where a value comes from.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Source {
    Default,
    File(PathBuf),
    /// The name of the variable.
    Environment(String),
    /// The name of the flag.
    Flag(&'static str),
}

impl fmt::Display for Source {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Default => f.write_str("default"),
            Self::File(file) => write!(f, "{}", file.display()),
            Self::Environment(name) => f.write_str(name),
            Self::Flag(name) => write!(f, "--{name}"),
        }
    }
}

impl Serialize for Source {
    fn serialize<S: serde::Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.collect_str(self)
    }
}

/// A key with the value that applies.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct EffectiveKey {
    /// The section; empty for none.
    pub section: &'static str,
    /// The key within its section.
    pub name: &'static str,
    /// Null for a key without a value. Secrets are hidden.
    pub value: serde_json::Value,
    pub source: Source,
}

impl Config {
    /// Returns the values that apply, by section, without those of sections that are not set.
    ///
    /// # Errors
    /// As [`Self::load`].
    pub fn effective(file: Option<&Path>, flags: &Flags) -> Result<Vec<EffectiveKey>, ConfigError> {
        Self::effective_of(file, super::environment(), flags)
    }

    pub(super) fn effective_of(
        file: Option<&Path>,
        environment: Environment,
        flags: &Flags,
    ) -> Result<Vec<EffectiveKey>, ConfigError> {
        let of_file = file.map(|file| super::toml_file(file).collect()).transpose()?;
        let set = SetKeys {
            file: file.map(Path::to_owned),
            in_file: keys_of(&of_file.unwrap_or_default()),
            in_environment: keys_of(&environment.collect()?),
            flags: flags.names(),
        };
        Ok(Self::from_sources(file, environment, flags)?.keys(&set))
    }

    fn keys(&self, set: &SetKeys) -> Vec<EffectiveKey> {
        let values = self.values();
        let top = top_keys().map(|(name, _)| ("", *name, values[name].clone()));
        let of_sections = SECTIONS.iter().filter(|(section, _)| !values[section].is_null());
        let within = of_sections.flat_map(|&(section, keys)| {
            let values = &values[section];
            keys.iter().map(move |(name, _)| (section, *name, values[name].clone()))
        });
        let keys = top.chain(within);
        keys.map(|(section, name, value)| {
            let source = set.source(section, name);
            EffectiveKey { section, name, value, source }
        })
        .collect()
    }

    /// The values by section and key; secrets are hidden.
    pub(super) fn values(&self) -> serde_json::Value {
        serde_json::to_value(self).expect("the configuration has text keys only")
    }
}

/// The keys that the sources set.
struct SetKeys {
    file: Option<PathBuf>,
    in_file: HashSet<String>,
    in_environment: HashSet<String>,
    flags: Vec<&'static str>,
}

impl SetKeys {
    fn source(&self, section: &str, name: &'static str) -> Source {
        let path = if section.is_empty() { name.to_owned() } else { format!("{section}.{name}") };
        if section.is_empty() && self.flags.contains(&name) {
            return Source::Flag(name);
        }
        // A secret of a file has the source of the key that names the file.
        let names = [path.clone(), format!("{path}_file")];
        if let Some(name) = names.iter().find(|&name| self.in_environment.contains(name)) {
            return Source::Environment(variable(name));
        }
        match &self.file {
            Some(file) if names.iter().any(|name| self.in_file.contains(name)) => {
                Source::File(file.clone())
            }
            _ => Source::Default,
        }
    }
}

/// The variable of the environment that sets a key.
fn variable(path: &str) -> String {
    format!("OFFBD_{}", path.replace('.', "__").to_uppercase())
}

/// The paths of all keys of a source.
pub(super) fn keys_of(values: &config::Map<String, Value>) -> HashSet<String> {
    let mut keys = HashSet::new();
    for (name, value) in values {
        match &value.kind {
            ValueKind::Table(inner) => {
                keys.extend(keys_of(inner).into_iter().map(|key| format!("{name}.{key}")));
            }
            _ => {
                keys.insert(name.clone());
            }
        }
    }
    keys
}

/// Writes `keys` as a TOML file, with the source of each value behind it.
#[must_use]
pub(crate) fn toml(keys: &[EffectiveKey]) -> String {
    let mut text = String::new();
    let mut section = "";
    for key in keys {
        if key.section != section {
            section = key.section;
            text += &format!("\n[{section}]\n");
        }
        let EffectiveKey { name, value, source, .. } = key;
        // Scalars and lists have the same form in JSON and TOML.
        let (setting, source) = match value.is_null() {
            true => (format!("# {name} ="), "not set".to_owned()),
            false => (format!("{name} = {value}"), source.to_string()),
        };
        text += &format!("{setting:<46} # {source}\n");
    }
    text
}
