//! Each call of the service to the operating system fails once, in turn, from the first start
//! on an empty folder to a stop: what was acknowledged is stored once, nothing else is, and
//! the service goes on.

mod scenario;

use std::path::Path;

use futures_util::{StreamExt, stream};
use scenario::{Failure, LARGE_BYTES, Outcome, STAGES, Scenario, Stage};

use crate::support::calls::{CallError, CallFault, CallKind, FILE_CALLS, preloaded};
use crate::support::device::Random;

/// Number of failures of each kind of test, unless the environment variable FAILURES is set;
/// a number larger than that of all calls tries each. SEED chooses others.
const FAILURES: usize = 12;

/// Scenarios that run at the same time.
const AT_ONCE: usize = 2;

fn from_environment(name: &str, default: usize) -> usize {
    std::env::var(name).map_or(default, |n| n.parse().unwrap())
}

/// Returns all failures of `kinds` that can happen in the scenario, in an order that is drawn:
/// first one of each stage and kind, then the second ones.
fn failures(undisturbed: &Outcome, kinds: &[CallKind]) -> Vec<Failure> {
    let mut groups = Vec::new();
    for stage in STAGES {
        for &kind in kinds {
            groups.push(group(stage, kind, undisturbed.count(stage, kind)));
        }
    }
    let mut random = Random(from_environment("SEED", 1) as u64);
    for group in &mut groups {
        for i in (1..group.len()).rev() {
            group.swap(i, random.below(i + 1));
        }
    }
    let longest = groups.iter().map(Vec::len).max().unwrap_or(0);
    let ranks = 0..longest;
    ranks.flat_map(|i| groups.iter().filter_map(move |g| g.get(i)).copied()).collect()
}

fn group(stage: Stage, kind: CallKind, n: u64) -> Vec<Failure> {
    let errors: &[_] = match kind {
        CallKind::Write => &[CallError::Io, CallError::NoSpace, CallError::Torn],
        _ => &[CallError::Io],
    };
    let failure = |number, error| Failure { stage, fault: CallFault { kind, number, error } };
    (1..=n).flat_map(|n| errors.iter().map(move |error| failure(n, *error))).collect()
}

/// Runs the scenario with each of some failures, and compares the outcomes with that of a run
/// without one.
async fn fail_in_turn(kinds: &[CallKind], large_bytes: u64) {
    let scratch = tempfile::tempdir().unwrap();
    let library = preloaded("calls", scratch.path());
    let library: &Path = &library;
    let undisturbed = Scenario::new(library, None, large_bytes).run().await;
    let all = failures(&undisturbed, kinds);
    for stage in STAGES {
        let n = kinds.iter().map(|&kind| (kind, undisturbed.count(stage, kind)));
        println!("{stage:?}: {:?}", n.collect::<Vec<_>>());
    }
    let chosen = &all[..all.len().min(from_environment("FAILURES", FAILURES))];
    let runs = chosen.iter().map(async |&failure| {
        let outcome = Scenario::new(library, Some(failure), large_bytes).run().await;
        assert_eq!(outcome.results, undisturbed.results, "{failure:?}");
        outcome
    });
    let outcomes: Vec<_> = stream::iter(runs).buffer_unordered(AT_ONCE).collect().await;
    let count = |of: fn(&Outcome) -> bool| outcomes.iter().filter(|outcome| of(outcome)).count();
    let n_failed = count(|outcome| outcome.has_failed);
    println!(
        "{n_failed} of {} failures; {} starts refused, {} backups failed, {} processes ended",
        all.len(),
        count(|outcome| outcome.is_refused),
        count(|outcome| outcome.is_backup_failed),
        count(|outcome| outcome.is_ended)
    );
    // Which calls are made depends on the threads, a little.
    assert!(4 * n_failed >= 3 * chosen.len(), "{n_failed} of {} calls failed", chosen.len());
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn each_call_on_a_file_fails_once_and_nothing_is_lost() {
    fail_in_turn(FILE_CALLS, 0).await;
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn each_large_allocation_and_each_thread_fails_once_and_nothing_is_lost() {
    fail_in_turn(&[CallKind::Allocate, CallKind::Thread], LARGE_BYTES).await;
}
