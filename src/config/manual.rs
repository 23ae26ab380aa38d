//! Writes what is made of the texts of the keys: the sample file `deploy/offbd.toml`, and the
//! table in the manual. Only for the tests, which compare both with their files.

use std::fmt::Write;

use config::{File, FileFormat, Source};
use serde_json::Value;

use super::Config;
use super::effective::{SECTIONS, top_keys};
use offbd_service::NumberKey;

/// A value for each key without a default, so that the sample shows its form.
const EXAMPLES: &str = r#"
database = "postgres://db.example:5432/offbd"
database_file = "/etc/offbd/database"
auth = "required"
origins = ["https://lab.example"]

[tls]
certificate = "/etc/offbd/certificate.pem"
key = "/etc/offbd/key.pem"

[jwt]
issuer = "https://login.example"
audience = "offbd"
jwks = "https://login.example/keys"

[cluster]
name = "node-1"
listen = "10.0.0.1:8088"
advertise = "node-1.example:8088"

[nats]
url = "tls://nats.example:4222"
user = "offbd"
password = "(hidden)"
password_file = "/etc/offbd/nats-password"
credentials = "/etc/offbd/nats.creds"
ca = "/etc/offbd/nats-ca.pem"
monitor = "http://nats.example:8222"
issuer_seed = "/etc/offbd/issuer.seed"

[mqtt]
url = "mqtts://broker.example"
client_id = "offbd"
user = "offbd"
password = "(hidden)"
password_file = "/etc/offbd/mqtt-password"
ca = "/etc/offbd/broker-ca.pem"
certificate = "/etc/offbd/mqtt-certificate.pem"
key = "/etc/offbd/mqtt-key.pem"
mapping = "/etc/offbd/mapping.toml"

[traces]
endpoint = "http://127.0.0.1:4318"

[retention]
days = 90
fault_days = 365
bytes_per_asset = 1_000_000_000

[notifications]
public_url = "https://offbd.example"
targets = ["hooks.example", "*.chat.example"]
"#;

/// Where a section, or the keys outside of one, are described: title and page.
const PAGES: [(&str, &str, &str); 14] = [
    ("", "Service", "security.md"),
    ("tls", "Encryption", "security.md#encryption"),
    ("jwt", "Identity provider", "security.md#json-web-tokens"),
    ("cluster", "Cluster", "clusters.md"),
    ("nats", "NATS", "buses.md#a-nats-server"),
    ("mqtt", "MQTT", "buses.md#an-mqtt-broker"),
    ("log", "Logs", "monitoring.md#logs"),
    ("traces", "Traces", "monitoring.md#traces"),
    ("limits", "Limits", "limits.md#limits"),
    ("rates", "Rates", "limits.md#limits"),
    ("workers", "Threads and queues", "limits.md#limits"),
    ("retention", "Retention", "store.md#retention"),
    ("communication", "Lost communication", "notifications.md#lost-communication"),
    ("notifications", "Notifications", "notifications.md"),
];

/// The build feature that a section needs.
fn feature(section: &str) -> Option<&'static str> {
    let features = [("nats", "nats"), ("mqtt", "mqtt"), ("traces", "otel")];
    features.iter().find(|(name, _)| *name == section).map(|(_, feature)| *feature)
}

/// A key as the manual shows it.
struct Entry {
    /// With the section, `limits.assets`.
    path: String,
    name: &'static str,
    text: &'static str,
    is_required: bool,
    default: Option<Value>,
    example: Value,
    range: Option<(u64, u64)>,
}

impl Entry {
    /// What it sets, with its range.
    fn text(&self) -> String {
        let range = self.range.map(|(least, most)| format!(" From {least} to {most}."));
        self.text.trim().to_owned() + &range.unwrap_or_default()
    }
}

/// The configuration of [`EXAMPLES`], with the default of each key that it does not have.
fn examples() -> Value {
    read(EXAMPLES).unwrap().values()
}

/// Whether a configuration without a key is invalid, because its section needs it.
fn is_required(examples: &Value, section: &str, name: &str) -> bool {
    let mut without = examples.clone();
    without[section].as_object_mut().is_some_and(|keys| keys.remove(name).is_some())
        && serde_json::from_value::<Config>(without).is_err()
}

fn ranges() -> Vec<NumberKey> {
    let Config { limits, rates, workers, communication, .. } = Config::default();
    [limits.numbers(), rates.numbers(), workers.numbers(), communication.numbers()].concat()
}

fn entries(section: &str) -> Vec<Entry> {
    let (examples, defaults) = (examples(), Config::default().values());
    let given = super::effective::keys_of(&source(EXAMPLES).collect().unwrap());
    let keys: Vec<_> = match section {
        "" => top_keys().collect(),
        _ => SECTIONS.iter().filter(|(name, _)| *name == section).flat_map(|s| s.1).collect(),
    };
    let entry = |&(name, text): &(&'static str, &'static str)| {
        let path = if section.is_empty() { name.to_owned() } else { format!("{section}.{name}") };
        let pointer = format!("/{}", path.replace('.', "/"));
        let example = examples.pointer(&pointer).unwrap().clone();
        let default = match &defaults[section] {
            // The section has no defaults as a whole; each key that has one is not given.
            Value::Null if !section.is_empty() => Some(&example).filter(|_| !given.contains(&path)),
            _ => defaults.pointer(&pointer),
        };
        let default = default.filter(|value| !value.is_null()).cloned();
        let range = ranges().iter().find(|key| key.path == path).map(|key| (key.least, key.most));
        let is_required = is_required(&examples, section, name);
        Entry { path, name, text, is_required, default, example, range }
    };
    keys.into_iter().map(entry).collect()
}

/// Breaks a text into the lines of a comment of up to 98 columns.
fn comment(text: &str) -> String {
    let mut lines = vec!["#".to_owned()];
    for word in text.split_whitespace() {
        let line = lines.last_mut().unwrap();
        match line.len() + 1 + word.len() > 98 {
            true => lines.push(format!("# {word}")),
            false => *line += &format!(" {word}"),
        }
    }
    lines.join("\n") + "\n"
}

/// The sample file: every key as a comment, with its default or an example.
fn sample() -> String {
    let mut text = comment(
        "The configuration of offbd: every key, as a comment. The value is the default, or an \
         example for a key that is not set by default. `offbd check --config FILE --print` shows \
         the values that apply. The environment overrides this file: OFFBD_LISTEN, \
         OFFBD_LIMITS__ASSETS.",
    );
    for (section, title, _) in PAGES {
        text += "\n";
        if !section.is_empty() {
            let needs = feature(section).map(|f| format!(" This needs a build with `{f}`."));
            text += &comment(&format!("{title}.{}", needs.unwrap_or_default()));
            text += &format!("#[{section}]\n\n");
        }
        for entry in entries(section) {
            let Entry { name, default, example, is_required, .. } = &entry;
            let note = match (is_required, default) {
                (true, _) => " Required in this section.",
                (false, None) if !entry.text.to_lowercase().contains("by default") => {
                    " Not set by default."
                }
                _ => "",
            };
            text += &comment(&(entry.text() + note));
            // It depends on the machine.
            let value = if entry.path == "workers.shards" { &Value::from(2) } else { example };
            let value =
                default.as_ref().filter(|_| entry.path != "workers.shards").unwrap_or(value);
            writeln!(text, "#{name} = {value}\n").unwrap();
        }
    }
    text.trim_end().to_owned() + "\n"
}

/// The table of all keys.
fn table() -> String {
    let mut text = "| key | default | meaning |\n| --- | --- | --- |\n".to_owned();
    for (section, title, page) in PAGES {
        let needs = feature(section).map(|feature| format!(" (feature `{feature}`)"));
        writeln!(text, "| **[{title}]({page})**{} | | |", needs.unwrap_or_default()).unwrap();
        for entry in entries(section) {
            let default = match (&entry.default, entry.is_required) {
                _ if entry.path == "workers.shards" => "the cores".to_owned(),
                (_, true) => "required".to_owned(),
                (None, _) => String::new(),
                (Some(Value::Array(_)), _) => "none".to_owned(),
                (Some(value), _) => format!("`{}`", value.to_string().trim_matches('"')),
            };
            writeln!(text, "| `{}` | {default} | {} |", entry.path, entry.text()).unwrap();
        }
    }
    text
}

fn source(toml: &str) -> File<config::FileSourceString, FileFormat> {
    File::from_str(toml, FileFormat::Toml)
}

fn read(toml: &str) -> Result<Config, config::ConfigError> {
    config::Config::builder().add_source(source(toml)).build()?.try_deserialize()
}

/// Compares a file of the project with what it should be; with `UPDATE_MANUAL` it is written.
pub(crate) fn compare(path: &str, expected: impl Fn(&str) -> String) {
    let path = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join(path);
    let text = std::fs::read_to_string(&path).unwrap_or_default();
    let expected = expected(&text);
    if std::env::var_os("UPDATE_MANUAL").is_some() {
        std::fs::write(&path, expected).unwrap();
    } else {
        assert!(text == expected, "{}: UPDATE_MANUAL=1 writes it", path.display());
    }
}

#[test]
fn the_sample_file_and_the_manual_have_every_key() {
    compare("deploy/offbd.toml", |_| sample());
    compare("docs/operations/configuration.md", |text| {
        let (before, rest) = text.split_once("| key | default").unwrap();
        let (_, after) = rest.split_once("\n\n").unwrap();
        format!("{before}{}\n{after}", table())
    });
}

#[test]
fn the_sample_file_is_a_configuration() {
    let sample = sample();
    assert_eq!(read(&sample).unwrap(), Config::default());
    let is_setting = |line: &&str| line.starts_with('[') || line.contains(" = ");
    let lines = sample.lines().filter_map(|line| line.strip_prefix('#')).filter(is_setting);
    let set: Vec<&str> = lines.filter(|line| !line.starts_with(' ')).collect();
    let given = super::effective::keys_of(&source(&set.join("\n")).collect().unwrap());
    let all = PAGES.iter().flat_map(|(section, ..)| entries(section)).map(|entry| entry.path);
    assert_eq!(given, all.collect());
    let config = read(&set.join("\n")).unwrap();
    let mut expected = read(EXAMPLES).unwrap();
    // Keys with both a default and an example have the default in the sample.
    (expected.origins, expected.notifications.targets) = (Vec::new(), Vec::new());
    expected.workers.shards = 2;
    assert_eq!(config, expected);
}
