//! A private PostgreSQL server with its own directory and socket. It ends with the process
//! that started it, even if that is killed.

use std::io::{BufRead, BufReader, Write};
use std::path::{Path, PathBuf};
use std::process::{Child, ChildStdin, Command, Stdio};
use std::sync::{Mutex, OnceLock};

const MISSING: &str = "no `initdb` of PostgreSQL in PATH or /usr/lib/postgresql/*/bin: install \
    `postgresql`, or set POSTGRES_PROGRAMS to the directory that has it";

/// Runs the server with the programs in $1, the data in $2 and the address $3, if it is not empty,
/// with the port $4, until it reads a line, which is the signal to stop with. Prints `ready` when the server is ready and `gone` when it has
/// stopped. At the end of input it stops the server at once and removes the data.
const WATCH: &str = r#"
"$1/postgres" -D "$2" -c listen_addresses="$3" -c port="$4" -c unix_socket_directories="$2" \
    -c max_connections=200 >>"$2/log" 2>&1 & server=$!
until grep -qs ready "$2/postmaster.pid"; do kill -0 $server || exit 1; sleep 0.05; done
echo ready
if read -r signal; then
    kill -s "$signal" $server; wait $server
    echo gone
else
    kill -s QUIT $server; wait $server
    rm -rf "$2"
fi
"#;

/// The port in the name of the server's socket, unless it listens on its own port.
const PORT: u16 = 5432;

pub struct Postgres {
    directory: PathBuf,
    /// The port of 127.0.0.1 that it listens on, if it does.
    tcp_port: Option<u16>,
    running: Option<(Child, ChildStdin, BufReader<std::process::ChildStdout>)>,
}

impl Postgres {
    /// Starts `psql` with these commands, and does not read what it prints: once the pipe is full,
    /// it reads nothing from the server any more.
    pub fn unread_client(&self, database: &str, commands: &[&str]) -> Child {
        let mut psql = Command::new(programs().join("psql"));
        psql.args(["-X", "-U", "offbd", "-d", database, "-h"]).arg(&self.directory);
        for command in commands {
            psql.args(["-c", command]);
        }
        psql.stdout(Stdio::piped()).spawn().unwrap()
    }

    /// Starts a new server in an empty directory. Its collation is English, to show that
    /// nothing depends on the order of bytes.
    pub fn new() -> Self {
        Self::in_directory(tempfile::tempdir().unwrap().keep(), None)
    }

    /// As [`Self::new`], for clients over TCP on `port`, which has to be free.
    pub fn on_port(port: u16) -> Self {
        Self::in_directory(tempfile::tempdir().unwrap().keep(), Some(port))
    }

    fn in_directory(directory: PathBuf, tcp_port: Option<u16>) -> Self {
        if is_root() {
            let owner = Command::new("chown").arg("nobody").arg(&directory).status().unwrap();
            assert!(owner.success());
        }
        fill(&directory);
        let mut server = Self { directory, tcp_port, running: None };
        server.start();
        server
    }

    pub fn start(&mut self) {
        let address = if self.tcp_port.is_some() { "127.0.0.1" } else { "" };
        let mut child = as_nobody("sh")
            .args(["-c", WATCH, "watch"])
            .args([programs(), &self.directory])
            .args([address, &self.tcp_port.unwrap_or(PORT).to_string()])
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .spawn()
            .unwrap();
        let (input, output) = (child.stdin.take().unwrap(), child.stdout.take().unwrap());
        let mut output = BufReader::new(output);
        let mut line = String::new();
        output.read_line(&mut line).unwrap();
        assert_eq!(line, "ready\n", "see {}/log", self.directory.display());
        self.running = Some((child, input, output));
    }

    /// Stops the server with a signal: `INT` aborts running transactions, `QUIT` is a crash.
    pub fn stop(&mut self, signal: &str) {
        let (mut child, mut input, mut output) = self.running.take().unwrap();
        writeln!(input, "{signal}").unwrap();
        let mut line = String::new();
        output.read_line(&mut line).unwrap();
        assert_eq!(line, "gone\n");
        child.wait().unwrap();
    }

    pub fn directory(&self) -> &Path {
        &self.directory
    }

    /// Returns the URL of the database of this name, which is created if it does not exist.
    pub fn database(&self, name: &str) -> String {
        match self.tcp_port {
            Some(port) => database(Path::new(&format!("127.0.0.1:{port}")), name),
            None => database(&self.directory, name),
        }
    }
}

impl Drop for Postgres {
    fn drop(&mut self) {
        let Some((mut child, input, _)) = self.running.take() else { return };
        drop(input);
        child.wait().unwrap();
    }
}

fn database(server: &Path, name: &str) -> String {
    let made = Command::new(programs().join("createdb"))
        .args(["--maintenance-db", &url(server, "postgres"), name])
        .output()
        .unwrap();
    let error = String::from_utf8_lossy(&made.stderr);
    assert!(made.status.success() || error.contains("already exists"), "{error}");
    url(server, name)
}

/// Returns the URL of a database on a server: the directory of its socket, or its address and
/// port.
pub fn url(server: &Path, name: &str) -> String {
    let server = server.to_str().unwrap().replace('/', "%2F");
    format!("postgres://offbd@{server}/{name}")
}

/// Returns the URL of a database on the server that all tests of this process share.
pub fn shared_database(name: &str) -> String {
    static DIRECTORY: OnceLock<PathBuf> = OnceLock::new();
    let directory = DIRECTORY.get_or_init(|| {
        let directory = std::env::temp_dir().join(format!("offbd-postgres-{}", std::process::id()));
        std::fs::create_dir(&directory).unwrap();
        // The server runs as long as the process.
        std::mem::forget(Postgres::in_directory(directory.clone(), None));
        directory
    });
    database(directory, name)
}

/// Makes the data of a new server in the empty `directory`: a copy of those of an earlier one.
fn fill(directory: &Path) {
    static MADE: Mutex<()> = Mutex::new(());
    let _one_at_a_time = MADE.lock().unwrap();
    let version = Command::new(programs().join("postgres")).arg("--version").output().unwrap();
    let version = String::from_utf8(version.stdout).unwrap().replace([' ', '\n', '/'], "-");
    let made = Path::new(env!("CARGO_TARGET_TMPDIR")).join(version);
    if !made.exists() {
        initialise(directory);
        // Whole, or not there.
        let copy = made.with_extension(std::process::id().to_string());
        copy_all(directory, &copy);
        let _ = std::fs::rename(&copy, &made);
    } else {
        copy_all(&made.join("."), directory);
    }
}

fn copy_all(from: &Path, to: &Path) {
    let copied = Command::new("cp").arg("-a").arg(from).arg(to).output().unwrap();
    assert!(copied.status.success(), "{}", String::from_utf8_lossy(&copied.stderr));
}

fn initialise(directory: &Path) {
    let made = as_nobody(programs().join("initdb"))
        .args(["--username=offbd", "--auth=trust", "--encoding=UTF8", "--locale=C"])
        .args(["--locale-provider=icu", "--icu-locale=en-US", "--no-sync", "-D"])
        .arg(directory)
        .output()
        .unwrap();
    assert!(made.status.success(), "{}", String::from_utf8_lossy(&made.stderr));
}

fn programs() -> &'static PathBuf {
    static PROGRAMS: OnceLock<PathBuf> = OnceLock::new();
    PROGRAMS.get_or_init(|| {
        if let Some(directory) = std::env::var_os("POSTGRES_PROGRAMS") {
            return directory.into();
        }
        let path = std::env::var_os("PATH").unwrap_or_default();
        let versions = std::fs::read_dir("/usr/lib/postgresql").into_iter().flatten().flatten();
        let mut installed: Vec<_> = versions.map(|version| version.path().join("bin")).collect();
        installed.sort();
        let known = installed.into_iter().rev().chain(std::env::split_paths(&path));
        let whole = |directory: &PathBuf| {
            ["initdb", "postgres", "createdb"].iter().all(|name| directory.join(name).exists())
        };
        known.into_iter().find(whole).expect(MISSING)
    })
}

fn is_root() -> bool {
    let id = Command::new("id").arg("-u").output().unwrap();
    id.stdout == b"0\n"
}

/// Returns the command for `program`, as another user if the tests run as root: the server
/// refuses to run as root.
fn as_nobody(program: impl AsRef<std::ffi::OsStr>) -> Command {
    if !is_root() {
        return Command::new(program);
    }
    let mut command = Command::new("runuser");
    command.args(["-u", "nobody", "--"]).arg(program).current_dir("/");
    command
}
