//! Private brokers: nats-server and mosquitto. They end with the process that started them,
//! even if that is killed.

use std::io::Write;
use std::net::{TcpListener, TcpStream};
use std::path::{Path, PathBuf};
use std::process::{Child, ChildStdin, Command, Stdio};
use std::sync::atomic::{AtomicU32, Ordering};

/// Version of nats-server that `scripts/nats-server` installs.
const NATS_VERSION: &str = "2.15.1";

/// Runs a program until a line is read or the input ends, then kills it.
const WATCH: &str = r#""$@" & server=$!; read -r line; kill -KILL $server; wait $server"#;

/// A running program.
struct Watched {
    child: Child,
    input: Option<ChildStdin>,
}

impl Watched {
    fn start(program: &Path, arguments: &[String], environment: &[(&str, String)]) -> Self {
        let mut command = Command::new("sh");
        command.args(["-c", WATCH, "watch"]).arg(program).args(arguments);
        command.envs(environment.iter().map(|(name, value)| (*name, value)));
        let mut child = command
            .stdin(Stdio::piped())
            .stdout(Stdio::null())
            .stderr(Stdio::null())
            .spawn()
            .unwrap();
        let input = child.stdin.take();
        Self { child, input }
    }
}

impl Drop for Watched {
    fn drop(&mut self) {
        drop(self.input.take());
        self.child.wait().unwrap();
    }
}

/// Ports below those that Linux gives to connections and to listeners that ask for any.
const ASKED_FOR: std::ops::Range<u32> = 20_000..32_768;

/// Returns a port that nobody listens on, another one each time. Until a server listens on it, the
/// system gives it to nobody.
pub fn free_port() -> u16 {
    static N_ASKED: AtomicU32 = AtomicU32::new(0);
    let start = std::process::id().wrapping_mul(101);
    loop {
        let n = start.wrapping_add(N_ASKED.fetch_add(1, Ordering::Relaxed));
        let port = ASKED_FOR.start + n % (ASKED_FOR.end - ASKED_FOR.start);
        let port = u16::try_from(port).unwrap();
        if TcpListener::bind(("127.0.0.1", port)).is_ok() {
            return port;
        }
    }
}

#[expect(clippy::disallowed_methods, reason = "a test must not wait forever")]
fn wait_for_port(port: u16) {
    let start = std::time::Instant::now();
    while TcpStream::connect(("127.0.0.1", port)).is_err() {
        assert!(start.elapsed() < super::DEADLINE, "nobody listens on port {port}");
        std::thread::sleep(super::POLL_PAUSE);
    }
}

/// Returns the first of these programs that exists.
fn find(name: &str, places: &[PathBuf], missing: &str) -> PathBuf {
    let path = std::env::var_os("PATH").unwrap_or_default();
    let in_path = std::env::split_paths(&path).map(|directory| directory.join(name));
    let known = places.iter().cloned().chain(in_path).find(|program| program.exists());
    known.unwrap_or_else(|| panic!("{missing}"))
}

/// A nats-server with the configuration that is shipped, on its own ports.
pub struct Nats {
    directory: tempfile::TempDir,
    pub port: u16,
    pub mqtt_port: u16,
    pub monitor_port: u16,
    /// The key that signs the rights of devices.
    pub issuer: nkeys::KeyPair,
    running: Option<Watched>,
}

pub const NATS_PASSWORD: &str = "the-password-of-the-service";

impl Nats {
    pub fn start() -> Self {
        Self::start_with(|configuration| configuration)
    }

    /// Starts a server whose configuration is the shipped one after `change`.
    pub fn start_with(change: impl FnOnce(String) -> String) -> Self {
        let directory = tempfile::tempdir().unwrap();
        let (port, mqtt_port, monitor_port) = (free_port(), free_port(), free_port());
        let shipped = include_str!("../../../deploy/nats/offbd.conf");
        let mut configuration = change(shipped.to_owned());
        for (standard, own) in [
            ("0.0.0.0:4222", format!("127.0.0.1:{port}")),
            ("0.0.0.0:1883", format!("127.0.0.1:{mqtt_port}")),
            ("127.0.0.1:8222", format!("127.0.0.1:{monitor_port}")),
            ("/var/lib/nats", directory.path().join("store").display().to_string()),
        ] {
            assert!(configuration.contains(standard), "{standard}");
            configuration = configuration.replace(standard, &own);
        }
        std::fs::write(directory.path().join("conf"), configuration).unwrap();
        let issuer = nkeys::KeyPair::new_account();
        let mut nats = Self { directory, port, mqtt_port, monitor_port, issuer, running: None };
        nats.restart();
        nats
    }

    /// Kills the server, if it runs.
    pub fn kill(&mut self) {
        self.running = None;
    }

    /// Kills the server if it runs, and starts it with the same ports and data.
    pub fn restart(&mut self) {
        self.kill();
        let arguments = ["-c".to_owned(), self.directory.path().join("conf").display().to_string()];
        let environment = [
            ("OFFBD_NATS_PASSWORD", NATS_PASSWORD.to_owned()),
            ("OFFBD_ISSUER", self.issuer.public_key()),
        ];
        self.running = Some(Watched::start(&nats_server(), &arguments, &environment));
        wait_for_port(self.port);
        wait_for_port(self.mqtt_port);
    }

    /// Kills the server, and starts it without what it has stored.
    pub fn forget(&mut self) {
        self.kill();
        std::fs::remove_dir_all(self.directory.path().join("store")).unwrap();
        self.restart();
    }

    /// Returns the section of the service's configuration.
    pub fn config(&self) -> offbd::config::NatsConfig {
        let seed = self.directory.path().join("seed");
        std::fs::write(&seed, self.issuer.seed().unwrap()).unwrap();
        offbd::config::NatsConfig {
            url: format!("nats://127.0.0.1:{}", self.port),
            user: Some("offbd".to_owned()),
            password: Some(NATS_PASSWORD.to_owned()),
            password_file: None,
            credentials: None,
            ca: None,
            monitor: Some(format!("http://127.0.0.1:{}", self.monitor_port)),
            faults: true,
            issuer_seed: Some(seed),
            account: "OFFBD".to_owned(),
        }
    }
}

/// Servers of one NATS cluster, without JetStream and so without MQTT.
pub struct NatsServers {
    directory: tempfile::TempDir,
    pub ports: Vec<u16>,
    issuer: nkeys::KeyPair,
    running: Vec<Option<Watched>>,
}

impl NatsServers {
    pub fn start(n: usize) -> Self {
        let directory = tempfile::tempdir().unwrap();
        let between: Vec<_> = (0..n).map(|_| free_port()).collect();
        let routes: Vec<_> =
            between.iter().map(|port| format!("nats://127.0.0.1:{port}")).collect();
        let ports: Vec<_> = (0..n).map(|_| free_port()).collect();
        for (i, port) in ports.iter().enumerate() {
            let configuration = format!(
                "server_name: n{i}\nlisten: 127.0.0.1:{port}\nmax_payload: 8MB\n\
                 cluster {{ name: offbd, listen: 127.0.0.1:{}, routes: [ {} ] }}\n\
                 accounts {{ OFFBD {{ users: [ {{ user: offbd, password: \
                 $OFFBD_NATS_PASSWORD }} ] }} }}\n\
                 authorization {{ timeout: 5, auth_callout {{ account: OFFBD, \
                 auth_users: [ offbd ], issuer: $OFFBD_ISSUER }} }}\n",
                between[i],
                routes.join(", "),
            );
            std::fs::write(directory.path().join(i.to_string()), configuration).unwrap();
        }
        let (issuer, running) = (nkeys::KeyPair::new_account(), (0..n).map(|_| None).collect());
        let mut servers = Self { directory, ports, issuer, running };
        (0..n).for_each(|i| servers.restart(i));
        servers
    }

    pub fn kill(&mut self, i: usize) {
        self.running[i] = None;
    }

    pub fn restart(&mut self, i: usize) {
        self.kill(i);
        let conf = self.directory.path().join(i.to_string()).display().to_string();
        let environment = [
            ("OFFBD_NATS_PASSWORD", NATS_PASSWORD.to_owned()),
            ("OFFBD_ISSUER", self.issuer.public_key()),
        ];
        let server = Watched::start(&nats_server(), &["-c".to_owned(), conf], &environment);
        self.running[i] = Some(server);
        wait_for_port(self.ports[i]);
    }

    /// All servers, as in the service's configuration.
    pub fn url(&self) -> String {
        let urls: Vec<_> =
            self.ports.iter().map(|port| format!("nats://127.0.0.1:{port}")).collect();
        urls.join(",")
    }

    /// A file with the key that signs the rights of devices.
    pub fn seed(&self) -> PathBuf {
        let file = self.directory.path().join("seed");
        std::fs::write(&file, self.issuer.seed().unwrap()).unwrap();
        file
    }
}

fn nats_server() -> PathBuf {
    let target = std::env::var_os("CARGO_TARGET_DIR")
        .map_or_else(|| Path::new(env!("CARGO_MANIFEST_DIR")).join("target"), PathBuf::from);
    let installed = target.join(format!("nats-server-{NATS_VERSION}/bin/nats-server"));
    let given = std::env::var_os("NATS_SERVER").map(PathBuf::from);
    let places: Vec<PathBuf> = given.into_iter().chain([installed]).collect();
    find("nats-server", &places, "no nats-server: run scripts/nats-server, or set NATS_SERVER")
}

/// The file that mosquitto stores everything in.
const MOSQUITTO_STORE: &str = "mosquitto.db";

/// A mosquitto that everybody may use.
pub struct Mosquitto {
    directory: tempfile::TempDir,
    pub port: u16,
    running: Option<Watched>,
}

impl Mosquitto {
    pub fn start() -> Self {
        Self::start_with(None)
    }

    /// Starts a broker with these lines as its list of permitted topics, if there are some.
    pub fn start_with(topics: Option<&str>) -> Self {
        Self::start_of(|directory| {
            let list = directory.join("topics");
            if let Some(topics) = topics {
                std::fs::write(&list, topics).unwrap();
            }
            topics.map(|_| format!("acl_file {}", list.display())).into_iter().collect()
        })
    }

    /// Starts a broker that is reached over TLS as `localhost`, with further lines in its
    /// configuration; its certificate is `ca`, which clients may use too.
    pub fn start_encrypted(more: &[&str]) -> Self {
        let made = rcgen::generate_simple_self_signed(["localhost".to_owned()]).unwrap();
        Self::start_of(|directory| {
            let (certificate, key) = (directory.join("ca"), directory.join("key"));
            std::fs::write(&certificate, made.cert.pem()).unwrap();
            std::fs::write(&key, made.signing_key.serialize_pem()).unwrap();
            let (certificate, key) = (certificate.display(), key.display());
            let own = ["cafile", "certfile"].map(|name| format!("{name} {certificate}"));
            let more = more.iter().map(|&line| line.to_owned());
            own.into_iter().chain([format!("keyfile {key}")]).chain(more).collect()
        })
    }

    /// Starts a broker with further lines in its configuration.
    pub fn start_of(more: impl FnOnce(&Path) -> Vec<String>) -> Self {
        let directory = tempfile::tempdir().unwrap();
        let port = free_port();
        let mut lines = vec![
            format!("listener {port} 127.0.0.1"),
            "allow_anonymous true".to_owned(),
            // So that a kill loses nothing that it has acknowledged, and devices in tests are not
            // held up.
            "persistence true".to_owned(),
            format!("persistence_location {}/", directory.path().display()),
            "autosave_on_changes true".to_owned(),
            "autosave_interval 1".to_owned(),
            "max_queued_messages 0".to_owned(),
        ];
        lines.extend(more(directory.path()));
        std::fs::write(directory.path().join("conf"), lines.join("\n") + "\n").unwrap();
        #[cfg(unix)]
        {
            // Started as root, it continues as another user.
            use std::os::unix::fs::PermissionsExt;
            let all = std::fs::Permissions::from_mode(0o777);
            std::fs::set_permissions(directory.path(), all).unwrap();
        }
        let mut mosquitto = Self { directory, port, running: None };
        mosquitto.restart();
        mosquitto
    }

    pub fn kill(&mut self) {
        self.running = None;
    }

    /// What is stored; the broker must not run.
    pub fn stored(&self) -> Vec<u8> {
        std::fs::read(self.directory.path().join(MOSQUITTO_STORE)).unwrap()
    }

    /// Kills the broker, and starts it with `stored`, or with nothing.
    pub fn restart_with(&mut self, stored: Option<&[u8]>) {
        self.kill();
        let store = self.directory.path().join(MOSQUITTO_STORE);
        match stored {
            Some(stored) => std::fs::write(store, stored),
            None => std::fs::remove_file(store),
        }
        .unwrap();
        self.restart();
    }

    pub fn restart(&mut self) {
        self.kill();
        let places = [PathBuf::from("/usr/sbin/mosquitto")];
        let program = find("mosquitto", &places, "no mosquitto: install `mosquitto`");
        let conf = self.directory.path().join("conf").display().to_string();
        self.running = Some(Watched::start(&program, &["-c".to_owned(), conf], &[]));
        wait_for_port(self.port);
    }

    /// Returns the section of the service's configuration.
    pub fn config(&self) -> offbd::config::MqttConfig {
        mqtt_config(self.port)
    }

    /// Returns the same for a broker that is reached over TLS.
    pub fn encrypted_config(&self) -> offbd::config::MqttConfig {
        offbd::config::MqttConfig {
            url: format!("mqtts://localhost:{}", self.port),
            ca: Some(self.directory.path().join("ca")),
            ..self.config()
        }
    }

    /// The private key of a broker that is reached over TLS.
    pub fn key(&self) -> PathBuf {
        self.directory.path().join("key")
    }

    /// Publishes each line of `input` with the program mosquitto_pub.
    pub fn publish_lines(&self, arguments: &[&str], input: &str) {
        let mut command = Command::new("mosquitto_pub");
        command.args(["-h", "127.0.0.1", "-p", &self.port.to_string(), "-l"]).args(arguments);
        let mut child = command.stdin(Stdio::piped()).spawn().unwrap();
        child.stdin.take().unwrap().write_all(input.as_bytes()).unwrap();
        assert!(child.wait().unwrap().success());
    }

    /// Returns what the program mosquitto_sub prints.
    pub fn subscribe(&self, arguments: &[&str]) -> String {
        let mut command = Command::new("mosquitto_sub");
        command.args(["-h", "127.0.0.1", "-p", &self.port.to_string()]).args(arguments);
        String::from_utf8(command.output().unwrap().stdout).unwrap()
    }
}

/// Returns the section of the service's configuration for a broker that everybody may use.
pub fn mqtt_config(port: u16) -> offbd::config::MqttConfig {
    offbd::config::MqttConfig::at(format!("mqtt://127.0.0.1:{port}"))
}
