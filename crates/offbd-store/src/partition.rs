//! Partitions: every asset belongs to one, by a hash of its name. Each partition has one
//! owner at a time, and numbers its transactions for itself.

use super::Micros;
use super::from_row::from_row;

/// Bits of a journal row's id for the number of the commit; those above are the partition.
const COMMIT_BITS: u32 = 48;

/// Most partitions. Chosen: more than nodes and cores of any cluster that one database
/// supports.
pub const MAX_PARTITIONS: u32 = 4096;

/// The channel on which PostgreSQL tells all nodes that a partition has another owner.
pub const TRANSFERS: &str = "offbd_partition";

/// The channel on which PostgreSQL tells all nodes that there are events.
pub const EVENTS: &str = "offbd_event";

/// The number of a partition, from 0.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct PartitionId(pub u32);

impl PartitionId {
    /// The id of the journal row of this partition's commit `number`. With one partition it
    /// is that number.
    pub(super) fn journal_row(self, number: i64) -> i64 {
        (i64::from(self.0) << COMMIT_BITS) | number
    }

    /// The partition of a journal row.
    pub(super) fn of_journal_row(row: i64) -> Self {
        Self(u32::try_from(row >> COMMIT_BITS).unwrap_or_default())
    }

    /// The first id of a journal row of the next partition.
    pub(super) fn next_journal_row(self) -> i64 {
        Self(self.0 + 1).journal_row(0)
    }

    pub(super) fn bound(self) -> i64 {
        i64::from(self.0)
    }
}

impl std::fmt::Display for PartitionId {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        self.0.fmt(f)
    }
}

/// How many partitions the database has, and so which one an asset belongs to.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Partitions {
    n: u32,
}

impl Partitions {
    /// One partition, of all assets.
    pub const ONE: Self = Self { n: 1 };

    /// `n` partitions, at least one.
    #[must_use]
    pub const fn new(n: u32) -> Self {
        Self { n: if n == 0 { 1 } else { n } }
    }

    /// The number of partitions.
    #[must_use]
    pub const fn count(self) -> u32 {
        self.n
    }

    /// All partitions.
    pub fn all(self) -> impl Iterator<Item = PartitionId> {
        (0..self.n).map(PartitionId)
    }

    /// The partition of the asset `name`: FNV-1a of its subject token (see
    /// [`subject_token`]), as NATS computes it in `{{partition(n, …)}}`.
    #[must_use]
    pub fn of(self, name: &str) -> PartitionId {
        PartitionId(fnv1a(encoded(name)) % self.n)
    }
}

/// The name of an asset as a token of a NATS subject, in which `.` separates tokens: each
/// `.` is written `=2E`.
#[must_use]
pub fn subject_token(name: &str) -> String {
    name.replace('.', DOT)
}

const DOT: &str = "=2E";

/// The bytes of [`subject_token`].
fn encoded(name: &str) -> impl Iterator<Item = u8> {
    name.bytes().flat_map(|byte| {
        let dot = if byte == b'.' { DOT } else { "" };
        dot.bytes().chain((byte != b'.').then_some(byte))
    })
}

/// FNV-1a, 32 bits (Fowler, Noll, Vo; IETF draft-eastlake-fnv).
fn fnv1a(bytes: impl Iterator<Item = u8>) -> u32 {
    const OFFSET_BASIS: u32 = 0x811c_9dc5;
    const PRIME: u32 = 0x0100_0193;
    bytes.fold(OFFSET_BASIS, |hash, byte| (hash ^ u32::from(byte)).wrapping_mul(PRIME))
}

/// A partition as stored.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct PartitionRow {
    pub id: i64,
    /// Number of owners so far.
    pub epoch: i64,
    /// Number of transactions that changed the partition.
    pub n_commits: i64,
    /// The id of the node that owns it.
    pub owner: Option<String>,
}

from_row!(PartitionRow { id, epoch, n_commits, owner });

impl PartitionRow {
    /// The number of the partition.
    #[must_use]
    pub fn partition(&self) -> PartitionId {
        PartitionId(u32::try_from(self.id).unwrap_or_default())
    }
}

/// A process of a cluster.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct NodeIdentity {
    /// Unique for each start of a process.
    pub id: String,
    pub name: String,
    /// Where other nodes reach it, `HOST:PORT`.
    pub address: String,
    pub version: String,
}

/// A node whose connection the database server has.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct NodeRow {
    pub id: String,
    pub name: String,
    pub address: String,
    pub version: String,
    /// 1 once it hands its partitions over.
    pub leaving: i64,
    /// The time of the database server when this was read.
    pub read_at: Micros,
}

from_row!(NodeRow { id, name, address, version, leaving, read_at });

#[cfg(test)]
mod tests {
    use super::*;

    /// Published vectors of FNV-1a 32 (Noll's test suite).
    #[test]
    fn validate_the_hash_against_published_vectors() {
        for (text, hash) in [("", 0x811c_9dc5), ("a", 0xe40c_292c), ("foobar", 0xbf9c_f968)] {
            assert_eq!(fnv1a(text.bytes()), hash, "{text}");
        }
    }

    #[test]
    fn a_name_is_hashed_as_it_stands_in_a_subject() {
        for name in ["rig", "a.b", ".", "lab-1.rig_2.x"] {
            assert_eq!(encoded(name).collect::<Vec<_>>(), subject_token(name).into_bytes());
        }
        assert!(Partitions::new(64).all().count() == 64 && Partitions::new(0).count() == 1);
    }

    #[test]
    fn a_journal_row_tells_its_partition() {
        assert_eq!(PartitionId(0).journal_row(7), 7, "as before there were partitions");
        for p in [PartitionId(0), PartitionId(1), PartitionId(MAX_PARTITIONS - 1)] {
            let row = p.journal_row(123_456_789);
            assert_eq!(PartitionId::of_journal_row(row), p);
            assert!((p.journal_row(0)..p.next_journal_row()).contains(&row));
        }
    }
}
