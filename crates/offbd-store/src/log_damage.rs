//! Damage of an SQLite write-ahead log (WAL).
//!
//! After a crash SQLite takes the log up to the first frame whose checksum is wrong, because
//! what a power cut has torn ends the log in this way. A bit that went wrong in the middle
//! ends it there as well, and the commits behind it would be lost silently. The two can be
//! told apart: each commit is on the disk before the next one begins, so a power cut tears
//! at most the last one. Two whole commits of the same log behind a wrong frame prove damage.
//! Damage of the last two commits alone is not found.
//!
//! Format: <https://www.sqlite.org/fileformat2.html#the_write_ahead_log>

use std::fs::File;
use std::io::{BufReader, ErrorKind, Read};
use std::ops::RangeInclusive;
use std::path::{Path, PathBuf};

use super::StoreError;

const HEADER_BYTES: usize = 32;
const FRAME_HEADER_BYTES: usize = 24;

/// The header's first number if checksums are computed from little-endian numbers; one more
/// if from big-endian ones.
const MAGIC: u32 = 0x377f_0682;

/// SQLite's page sizes.
const PAGE_BYTES: RangeInclusive<usize> = 512..=65_536;

/// Bytes that are read at a time.
const BUFFER_BYTES: usize = 1 << 18;

/// The first wrong frame of a damaged log.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Damage {
    /// Whole frames before it; `None` if the header of the log is wrong.
    n_before: Option<u64>,
    /// Bytes before it.
    offset: u64,
}

/// Checks the log of the database `file`, also while a service writes to it.
///
/// # Errors
/// [`StoreError::DamagedLog`] if it is damaged; [`StoreError::File`].
pub(super) async fn check_log(file: &Path) -> Result<(), StoreError> {
    let log = log_of(file);
    let checked = tokio::task::spawn_blocking(move || check(&log)).await;
    checked.unwrap_or_else(|panic| std::panic::resume_unwind(panic.into_panic()))
}

fn log_of(file: &Path) -> PathBuf {
    let mut log = file.as_os_str().to_owned();
    log.push("-wal");
    log.into()
}

fn check(log: &Path) -> Result<(), StoreError> {
    let read = || find_damage(log).map_err(|source| StoreError::File { file: log.into(), source });
    // A frame that was being written at the first reading is whole at the second one.
    match (read()?, read()?) {
        (Some(first), Some(second)) if first == second => Err(StoreError::DamagedLog {
            part: match second.n_before {
                Some(n) => format!("frame {}", n + 1),
                None => "the header".to_owned(),
            },
            log: log.to_owned(),
            n_bytes: second.offset,
        }),
        _ => Ok(()),
    }
}

/// Reads `log`; a missing one is not damaged.
fn find_damage(log: &Path) -> std::io::Result<Option<Damage>> {
    let file = match File::open(log) {
        Err(error) if error.kind() == ErrorKind::NotFound => return Ok(None),
        file => file?,
    };
    find_in(&mut BufReader::with_capacity(BUFFER_BYTES, file))
}

fn find_in(log: &mut impl Read) -> std::io::Result<Option<Damage>> {
    let mut header = [0; HEADER_BYTES];
    if !is_filled(log, &mut header)? {
        return Ok(None);
    }
    let Some(format) = Format::of(&header) else {
        // SQLite writes frames only after the header is on the disk.
        let has_frames = is_filled(log, &mut [0; FRAME_HEADER_BYTES + *PAGE_BYTES.start()])?;
        return Ok(has_frames.then_some(Damage { n_before: None, offset: 0 }));
    };
    let mut frame = vec![0; FRAME_HEADER_BYTES + format.page_bytes];
    let mut before = number_pair(&header[24..]);
    let (mut n_before, mut is_whole) = (0, true);
    // Commits that follow each other behind the first wrong frame.
    let mut n_commits = 0;
    while is_filled(log, &mut frame)? {
        let follows = format.follows(&frame, before);
        if is_whole && follows {
            n_before += 1;
        } else if follows {
            n_commits += u32::from(is_commit(&frame));
        } else {
            (is_whole, n_commits) = (false, 0);
        }
        if n_commits == 2 {
            let offset = HEADER_BYTES as u64 + n_before * frame.len() as u64;
            return Ok(Some(Damage { n_before: Some(n_before), offset }));
        }
        before = number_pair(&frame[16..]);
    }
    Ok(None)
}

/// Fills `buffer`; returns `false` if the file ends before.
fn is_filled(log: &mut impl Read, buffer: &mut [u8]) -> std::io::Result<bool> {
    match log.read_exact(buffer) {
        Err(error) if error.kind() == ErrorKind::UnexpectedEof => Ok(false),
        read => read.map(|()| true),
    }
}

fn number(bytes: &[u8]) -> u32 {
    bytes.first_chunk().map_or(0, |bytes| u32::from_be_bytes(*bytes))
}

/// A stored checksum.
fn number_pair(bytes: &[u8]) -> [u32; 2] {
    [number(bytes), number(&bytes[4..])]
}

/// Whether a frame is the last one of a commit: it has the size of the database after it.
fn is_commit(frame: &[u8]) -> bool {
    number(&frame[4..]) != 0
}

/// What the header says about all frames.
struct Format {
    big_endian: bool,
    page_bytes: usize,
    /// Two random numbers that change when the log begins again.
    salts: [u8; 8],
}

impl Format {
    /// Returns `None` if the header is wrong.
    fn of(header: &[u8; HEADER_BYTES]) -> Option<Self> {
        let big_endian = match number(header).checked_sub(MAGIC)? {
            0 => false,
            1 => true,
            _ => return None,
        };
        let page_bytes = usize::try_from(number(&header[8..])).ok()?;
        let is_size = page_bytes.is_power_of_two() && PAGE_BYTES.contains(&page_bytes);
        let salts = *header[16..].first_chunk()?;
        let format = Self { big_endian, page_bytes, salts };
        let sum = format.add([0, 0], &header[..24]);
        (is_size && sum == number_pair(&header[24..])).then_some(format)
    }

    /// Whether `frame` belongs to this log and was written after the frame, or the header,
    /// with the checksum `before`.
    fn follows(&self, frame: &[u8], before: [u32; 2]) -> bool {
        let sum = || self.add(self.add(before, &frame[..8]), &frame[FRAME_HEADER_BYTES..]);
        frame[8..16] == self.salts && sum() == number_pair(&frame[16..])
    }

    /// The checksum of `bytes` that follow those with the checksum `sum`.
    fn add(&self, sum: [u32; 2], bytes: &[u8]) -> [u32; 2] {
        let [mut a, mut b] = sum;
        let number = |bytes: [u8; 4]| match self.big_endian {
            true => u32::from_be_bytes(bytes),
            false => u32::from_le_bytes(bytes),
        };
        for &[first, second] in bytes.as_chunks().0.as_chunks::<2>().0 {
            a = a.wrapping_add(number(first)).wrapping_add(b);
            b = b.wrapping_add(number(second)).wrapping_add(a);
        }
        [a, b]
    }
}

#[cfg(test)]
mod tests {
    use std::collections::HashSet;
    use std::ops::Range;

    use sqlx::Connection;

    use super::*;
    use crate::ChangeSet;
    use crate::{AssetRow, Location, Store, Write, Writer, checkpoint, page_checksums};

    /// The files of a database whose process was killed.
    struct Killed {
        folder: tempfile::TempDir,
        location: Location,
        /// The log before the last commit, and after it.
        before_last: Vec<u8>,
        log: Vec<u8>,
        n_assets: i64,
    }

    const FRAME_BYTES: usize = FRAME_HEADER_BYTES + 4096;

    async fn create_assets(writer: &mut Writer, numbers: Range<i64>) {
        for n in numbers {
            let row = AssetRow {
                name: n.to_string(),
                document: format!("{:3000}", "{}"),
                revision: 1,
                created_at: 0,
                updated_at: 0,
            };
            writer
                .commit(&mut [ChangeSet::unpartitioned(&mut vec![Write::CreateAsset(row)])])
                .await
                .unwrap();
        }
    }

    /// Commits `n_assets`. If `n_old` is positive, the log begins again after that many.
    async fn killed(n_old: i64, n_assets: i64) -> Killed {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("running");
        let (store, mut writer) = Store::open(&Location::File(file.clone())).await.unwrap();
        let log = || std::fs::read(log_of(&file)).unwrap();
        create_assets(&mut writer, 0..n_old).await;
        if n_old > 0 {
            let mut other = page_checksums::open(&file).await.unwrap();
            checkpoint::copy(&mut other).await.unwrap();
            other.close().await.unwrap();
        }
        create_assets(&mut writer, n_old..n_assets - 1).await;
        let before_last = log();
        create_assets(&mut writer, n_assets - 1..n_assets).await;
        let copy = folder.path().join("killed");
        std::fs::copy(&file, &copy).unwrap();
        let log = log();
        writer.close().await.unwrap();
        store.close().await;
        Killed { folder, location: Location::File(copy), before_last, log, n_assets }
    }

    impl Killed {
        /// What is lost with this log: a number of assets, or the error of the start.
        async fn n_lost(&self, log: &[u8]) -> Result<i64, StoreError> {
            let file = self.folder.path().join("restarted");
            std::fs::copy(self.location.file().unwrap(), &file).unwrap();
            std::fs::write(log_of(&file), log).unwrap();
            let _ = std::fs::remove_file(self.folder.path().join("restarted-shm"));
            let (store, writer) = Store::open(&Location::File(file)).await?;
            let count = sqlx::query_scalar("SELECT count(*) FROM asset").fetch_one(&store.pool);
            let n: i64 = count.await.unwrap();
            store.close().await;
            writer.close().await.unwrap();
            Ok(self.n_assets - n)
        }
    }

    #[tokio::test]
    async fn a_wrong_bit_is_found_unless_it_is_in_the_last_two_commits() {
        let killed = killed(0, 12).await;
        assert_eq!(killed.n_lost(&killed.log).await.unwrap(), 0);
        let n_frames = (killed.log.len() - HEADER_BYTES) / FRAME_BYTES;
        assert!(n_frames >= 24, "{n_frames}");
        let header_bits = (0..HEADER_BYTES * 8).step_by(17);
        let frame_bits = (HEADER_BYTES * 8..killed.log.len() * 8).step_by(16_001);
        let frame_header_bits = (0..n_frames).flat_map(|n| {
            let start = (HEADER_BYTES + n * FRAME_BYTES) * 8;
            (start..start + FRAME_HEADER_BYTES * 8).step_by(31)
        });
        let mut cuts = HashSet::new();
        for bit in header_bits.chain(frame_bits).chain(frame_header_bits) {
            let mut log = killed.log.clone();
            log[bit / 8] ^= 1 << (bit % 8);
            let Some(damage) = find_in(&mut &*log).unwrap() else {
                let n_lost = killed.n_lost(&log).await.unwrap();
                assert!(n_lost <= 2, "bit {bit} loses {n_lost} commits silently");
                continue;
            };
            let offset = usize::try_from(damage.offset).unwrap();
            assert!(offset <= bit / 8 && bit / 8 < offset + FRAME_BYTES, "bit {bit}");
            if cuts.insert(offset) {
                // The error says how to go on with what precedes it.
                let error = killed.n_lost(&log).await.unwrap_err();
                assert!(error.to_string().contains(&format!("--size {offset} ")), "{error}");
                killed.n_lost(&log[..offset]).await.unwrap();
            }
        }
        assert!(cuts.len() > 20, "{}", cuts.len());
    }

    /// A power cut leaves each sector of the last commit as it was before or after it.
    #[tokio::test]
    async fn what_a_power_cut_has_torn_is_not_damage() {
        // In a new log, and over the frames of an older one.
        for n_old in [0, 20] {
            let killed = killed(n_old, n_old + 8).await;
            let Killed { before_last, log, .. } = &killed;
            assert_eq!(before_last.len() == log.len(), n_old > 0);
            let mut before = before_last.clone();
            before.resize(log.len(), 0);
            let range = |sector: usize| sector * 512..(sector * 512 + 512).min(log.len());
            let is_changed = |&sector: &usize| log[range(sector)] != before[range(sector)];
            let changed: Vec<usize> = (0..log.len().div_ceil(512)).filter(is_changed).collect();
            assert!(changed.len() > 8, "{changed:?}");
            for &lost in &changed {
                let mut torn = log.clone();
                torn[range(lost)].copy_from_slice(&before[range(lost)]);
                assert_eq!(killed.n_lost(&torn).await.unwrap(), 1, "sector {lost}");
                let mut torn = before.clone();
                torn[range(lost)].copy_from_slice(&log[range(lost)]);
                assert_eq!(killed.n_lost(&torn).await.unwrap(), 1, "only sector {lost}");
            }
        }
    }
}
