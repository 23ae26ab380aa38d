//! What `offbd --version` prints.

use std::sync::LazyLock;

use crate::server::FEATURES;

/// The version, the commit, and the features of this build. `-V` prints the version alone.
static LONG: LazyLock<String> = LazyLock::new(|| {
    let commit = match env!("BUILD_COMMIT") {
        "" => "unknown",
        commit => commit,
    };
    let lab = cfg!(feature = "lab").then_some("lab");
    let features: Vec<&str> = lab.into_iter().chain(FEATURES.iter().copied()).collect();
    let features = if features.is_empty() { "none".to_owned() } else { features.join(", ") };
    format!("{}\ncommit: {commit}\nfeatures: {features}", env!("CARGO_PKG_VERSION"))
});

pub(super) fn long() -> &'static str {
    &LONG
}
