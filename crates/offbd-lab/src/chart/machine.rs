//! The machine and the versions with which numbers were measured.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};

/// The file of a chart: the records, the machine and the versions.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Document<R> {
    pub chart: String,
    pub machine: Machine,
    /// Versions of `offbd`, `rustc`, and other programs measured.
    pub versions: BTreeMap<String, String>,
    pub records: Vec<R>,
}

/// The machine on which something was measured.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Machine {
    /// Model name of the processor, or `unknown`.
    pub cpu: String,
    /// Number of cores available to this process.
    pub cores: usize,
    /// Instruction set extensions relevant to arithmetic.
    pub features: Vec<String>,
    /// Operating system and architecture, as in `linux x86_64`.
    pub os: String,
}

impl Machine {
    /// Returns this machine.
    #[must_use]
    pub fn this() -> Self {
        Self {
            cpu: cpu_model(),
            cores: std::thread::available_parallelism().map_or(1, usize::from),
            features: features(),
            os: format!("{} {}", std::env::consts::OS, std::env::consts::ARCH),
        }
    }
}

/// Returns the versions of this program and of the compiler that built it.
#[must_use]
pub fn versions() -> BTreeMap<String, String> {
    let pair = |name: &str, version: &str| (name.to_owned(), version.to_owned());
    BTreeMap::from([
        pair("offbd", env!("CARGO_PKG_VERSION")),
        pair("rustc", env!("BUILD_RUSTC_VERSION")),
    ])
}

/// Reads the processor's model from /proc/cpuinfo on Linux; elsewhere returns `unknown`.
fn cpu_model() -> String {
    let text = std::fs::read_to_string("/proc/cpuinfo").unwrap_or_default();
    let named = |line: &&str| line.starts_with("model name") || line.starts_with("Model");
    let model = text.lines().find(named).and_then(|line| line.split_once(':'));
    model.map_or_else(|| "unknown".to_owned(), |(_, name)| name.trim().to_owned())
}

#[cfg(target_arch = "x86_64")]
fn features() -> Vec<String> {
    let known = [
        ("sse4.2", std::is_x86_feature_detected!("sse4.2")),
        ("avx", std::is_x86_feature_detected!("avx")),
        ("avx2", std::is_x86_feature_detected!("avx2")),
        ("fma", std::is_x86_feature_detected!("fma")),
        ("avx512f", std::is_x86_feature_detected!("avx512f")),
    ];
    known.into_iter().filter(|(_, has)| *has).map(|(name, _)| name.to_owned()).collect()
}

#[cfg(not(target_arch = "x86_64"))]
fn features() -> Vec<String> {
    Vec::new()
}
