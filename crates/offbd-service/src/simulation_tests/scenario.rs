//! What happens in a simulation: the devices, and the steps that they, the network, the
//! service and the database take.

use proptest::prelude::*;

use super::disk::PowerCut;
use offbd_store::{CommitFault, CommitPoint};

/// Most devices of a scenario.
pub(super) const MAX_DEVICES: usize = 3;

/// How a device sends.
#[derive(Clone, Copy, Debug)]
pub(super) struct DeviceKind {
    /// Whether it names its sessions.
    pub(super) named: bool,
    /// Whether it numbers its samples.
    pub(super) numbered: bool,
    /// Whether it sends over one connection that waits for room: while a batch waits, no answer
    /// is passed on.
    pub(super) stream: bool,
    /// Batches that it sends before the first is acknowledged.
    pub(super) window: usize,
}

/// One step. A number chooses modulo the number of choices.
#[derive(Clone, Debug)]
pub(super) enum Step {
    /// The device measures `n` samples, one of them invalid if `spoilt`, and sends them.
    Measure { device: usize, n: usize, spoilt: bool },
    /// The device sends again what is not acknowledged.
    Resend { device: usize },
    /// The device begins again: its count and its clock start at zero.
    Reboot { device: usize },
    /// The clock of the device is set forward or back, s.
    DeviceClock { device: usize, by_s: f64 },
    /// The device reads its answers.
    Read { device: usize },
    /// The connection of the device is lost, with the answers on it.
    Disconnect { device: usize },
    /// A request arrives; a copy stays under way if `copied`.
    Deliver { which: usize, copied: bool },
    /// A request is lost.
    Lose { which: usize },
    /// A shard executes a message.
    Shard { which: usize },
    /// An asset is loaded.
    Load,
    /// The writer commits at most so many write sets.
    Commit { most: usize },
    /// The next transaction fails.
    Fail { at: CommitPoint, fault: CommitFault },
    /// The power is cut while the next transaction is committed.
    CutPower(PowerCut),
    /// The next `n` reads for a command fail.
    FailReads { n: u32 },
    /// A person deletes the oldest ended session of a rig.
    Delete { device: usize },
    /// The service goes on with deletions.
    Sweep,
    /// The process is killed and started again.
    Kill,
    /// The process stops in order and is started again.
    Stop,
    /// The wall clock is set forward or back, s.
    WallClock { by_s: i64 },
    /// A person clears or acknowledges the fault of the x servo of a rig.
    Act { device: usize, clears: bool },
    /// A person ends the session of a rig.
    End { device: usize },
    /// Everything goes on for so many rounds.
    Run { rounds: usize },
}

#[derive(Clone, Debug)]
pub(super) struct Scenario {
    pub(super) devices: Vec<DeviceKind>,
    pub(super) steps: Vec<Step>,
}

fn step() -> impl Strategy<Value = Step> {
    let device = || 0..MAX_DEVICES;
    let point = prop_oneof![
        Just(CommitPoint::Begin),
        Just(CommitPoint::BeforeCommit),
        Just(CommitPoint::AfterCommit)
    ];
    let fault =
        prop_oneof![4 => (1..9_u32).prop_map(CommitFault::Error), 2 => Just(CommitFault::Kill)];
    let measure = (device(), 3..30_usize, prop::bool::weighted(0.1));
    prop_oneof![
        14 => measure.prop_map(|(device, n, spoilt)| Step::Measure { device, n, spoilt }),
        4 => device().prop_map(|device| Step::Resend { device }),
        1 => device().prop_map(|device| Step::Reboot { device }),
        1 => (device(), -2000.0..2000.0)
            .prop_map(|(device, by_s)| Step::DeviceClock { device, by_s }),
        5 => device().prop_map(|device| Step::Read { device }),
        1 => device().prop_map(|device| Step::Disconnect { device }),
        12 => (0..8_usize, prop::bool::weighted(0.2))
            .prop_map(|(which, copied)| Step::Deliver { which, copied }),
        1 => (0..8_usize).prop_map(|which| Step::Lose { which }),
        12 => (0..2_usize).prop_map(|which| Step::Shard { which }),
        4 => Just(Step::Load),
        8 => (1..6_usize).prop_map(|most| Step::Commit { most }),
        2 => (point, fault).prop_map(|(at, fault)| Step::Fail { at, fault }),
        1 => power_cut().prop_map(Step::CutPower),
        1 => (1..4_u32).prop_map(|n| Step::FailReads { n }),
        1 => device().prop_map(|device| Step::Delete { device }),
        1 => Just(Step::Sweep),
        1 => Just(Step::Kill),
        1 => Just(Step::Stop),
        1 => (-100_000..100_000_i64).prop_map(|by_s| Step::WallClock { by_s }),
        2 => (device(), any::<bool>()).prop_map(|(device, clears)| Step::Act { device, clears }),
        1 => device().prop_map(|device| Step::End { device }),
        5 => (1..10_usize).prop_map(|rounds| Step::Run { rounds }),
    ]
}

/// A quarter of the time everything was written. Half of the time the sectors were written in
/// order, otherwise some before the end were not.
fn power_cut() -> impl Strategy<Value = PowerCut> {
    let end = prop_oneof![1 => Just(u16::MAX), 3 => any::<u16>()];
    let written = prop_oneof![Just(u64::MAX), any::<u64>()];
    (end, written).prop_map(|(end, written)| PowerCut { end, written })
}

/// Draws a scenario.
pub(super) fn scenario() -> impl Strategy<Value = Scenario> {
    let kind = (any::<bool>(), any::<bool>(), any::<bool>(), 1..7_usize);
    let kind = kind.prop_map(|(named, numbered, stream, window)| DeviceKind {
        named,
        numbered,
        stream,
        window,
    });
    let devices = prop::collection::vec(kind, 1..=MAX_DEVICES);
    let steps = prop::collection::vec(step(), 20..160);
    (devices, steps).prop_map(|(devices, steps)| Scenario { devices, steps })
}
