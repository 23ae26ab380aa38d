//! The file of a spool: frames with checksums, in tiles that follow one another.
//!
//! A frame is a batch with its header. It fills a tile of whole blocks; a tile of which the frame
//! has been removed is free, and new frames are written over it. So a removal changes eight bytes
//! in place, which needs no room on a full disk. Each header says how long its tile is, and has a
//! checksum apart from that of the body: a changed bit of a header is corrected, one of a body is
//! found when the batch is read. The header begins with a random number of the file, so that no
//! body can pass for a frame.

use std::collections::{BTreeMap, BTreeSet};
use std::fs::File;
use std::hash::{BuildHasher, Hasher};
use std::io::{self, Read, Seek, SeekFrom, Write};
use std::path::Path;
use std::sync::Arc;

use serde::{Deserialize, Serialize};

use super::batch::{NewBatch, SpoolError, VERSION};

/// What the file begins with, and once more in its second block.
const MAGIC: [u8; 16] = *b"offbd spool\0\0\0\0\0";
const FILE_HEADER_BYTES: usize = 32;
/// Bytes of a block, the unit of tiles. Chosen: a sector of a disk.
pub(super) const BLOCK: u64 = 512;
/// Blocks of the file before the first tile.
const FIRST: u64 = 2;
/// Bytes of a header before its description of the batch.
const HEADER_BYTES: usize = 48;
/// The states of a tile. So far apart that some changed bits make none into the other.
const KEPT: u64 = 0x5555_5555_5555_5555;
const FREE: u64 = 0xAAAA_AAAA_AAAA_AAAA;
/// Free blocks at the end of the file that are given back to the disk. Chosen: 1 MiB, so that a
/// file does not change its length for each batch.
const SHRINK_BLOCKS: u64 = 2048;

/// What a header says of the batch in its tile.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub(super) struct Description {
    pub asset: String,
    query: String,
    media_type: String,
    /// Why the batch is set aside, if it is.
    pub refusal: Option<String>,
    /// Whether its body is not what the device has sent.
    #[serde(default)]
    pub is_damaged: bool,
}

/// The part of a header with a fixed length, and the description.
#[derive(Clone, Debug)]
struct Header {
    is_free: bool,
    blocks: u64,
    body_bytes: u64,
    id: i64,
    body_checksum: u32,
    /// Bytes of the header with the description.
    bytes: u64,
    /// Missing in a free tile.
    description: Option<Description>,
}

/// A batch in the file.
#[derive(Clone, Debug)]
struct Entry {
    at: u64,
    blocks: u64,
    body_bytes: u64,
    asset: Arc<str>,
    is_refused: bool,
}

/// A batch as it was read.
#[derive(Clone, Debug)]
pub(super) struct Frame {
    pub description: Description,
    pub body: Vec<u8>,
    /// Whether the body is what was written.
    pub is_intact: bool,
}

impl Frame {
    pub(super) fn into_batch(self) -> NewBatch {
        let Description { asset, query, media_type, .. } = self.description;
        NewBatch { asset, query, media_type, body: self.body }
    }
}

/// The open file, locked, and where its batches are.
#[derive(Debug)]
pub(super) struct Log {
    file: File,
    salt: [u8; 8],
    /// Blocks of the file.
    end: u64,
    entries: BTreeMap<i64, Entry>,
    waiting: BTreeMap<Arc<str>, BTreeSet<i64>>,
    /// Free blocks, from where and how many; those that adjoin are one.
    free: BTreeMap<u64, u64>,
    /// Blocks of all batches.
    used: u64,
    next_id: i64,
}

impl Log {
    /// Opens `file`, which is locked, and finds its batches.
    pub(super) fn open(mut file: File) -> Result<Self, SpoolError> {
        let bytes = beginning(&mut file)?;
        let salt = match copies(&bytes).find_map(file_header) {
            Some((VERSION, salt)) => salt,
            Some((version, _)) => return Err(SpoolError::Later(version.into())),
            // New, or the power has failed when it was.
            None if bytes.iter().all(|byte| *byte == 0) => initialize(&mut file)?,
            None => return Err(SpoolError::Foreign),
        };
        let (entries, waiting, free) = Default::default();
        let mut log = Self { file, salt, end: FIRST, entries, waiting, free, used: 0, next_id: 1 };
        log.scan()?;
        Ok(log)
    }

    /// Bytes of all batches.
    pub(super) fn used_bytes(&self) -> u64 {
        self.used * BLOCK
    }

    /// Batches that wait.
    pub(super) fn n_waiting(&self) -> usize {
        self.waiting.values().map(BTreeSet::len).sum()
    }

    /// The assets of which batches wait, in the order of their oldest batch.
    pub(super) fn assets(&self) -> Vec<String> {
        let mut assets: Vec<_> =
            self.waiting.iter().map(|(asset, ids)| (ids.first(), asset)).collect();
        assets.sort_unstable();
        assets.into_iter().map(|(_, asset)| asset.to_string()).collect()
    }

    /// The oldest batch of an asset that waits.
    pub(super) fn oldest(&self, asset: &str) -> Option<i64> {
        self.waiting.get(asset)?.first().copied()
    }

    /// The batches that are set aside, and the bytes of their bodies.
    pub(super) fn refused(&self) -> impl Iterator<Item = (i64, u64)> {
        let refused = self.entries.iter().filter(|(_, entry)| entry.is_refused);
        refused.map(|(id, entry)| (*id, entry.body_bytes))
    }

    pub(super) fn is_refused(&self, id: i64) -> bool {
        self.entries.get(&id).is_some_and(|entry| entry.is_refused)
    }

    /// Adds a batch that waits; it is durable when this returns.
    pub(super) fn put(&mut self, batch: &NewBatch) -> io::Result<()> {
        let id = self.next_id;
        self.next_id += 1;
        self.append(id, batch, None, false)?;
        // The device sends again what was not acknowledged.
        self.file.sync_data().inspect_err(|_| drop(self.remove(id)))
    }

    /// Replaces a batch, which is set aside for a reason, or waits without one.
    pub(super) fn replace(
        &mut self,
        id: i64,
        batch: &NewBatch,
        refusal: Option<String>,
        is_damaged: bool,
    ) -> io::Result<()> {
        // If the power fails before the old one is removed, both are found; see `keep`.
        let old = self.entries.get(&id).cloned();
        self.append(id, batch, refusal, is_damaged)?;
        self.file.sync_data()?;
        match old {
            Some(old) => self.set_free(&old),
            None => Ok(()),
        }
    }

    /// Removes a batch. It may come back if the power fails before [`Self::sync`].
    pub(super) fn remove(&mut self, id: i64) -> io::Result<()> {
        let Some(entry) = self.entries.get(&id).cloned() else { return Ok(()) };
        self.set_free(&entry)?;
        self.forget(id);
        Ok(())
    }

    /// Adds a batch with its id, durable after [`Self::into_file`].
    pub(super) fn add(
        &mut self,
        id: i64,
        batch: &NewBatch,
        refusal: Option<String>,
    ) -> io::Result<()> {
        self.next_id = self.next_id.max(id + 1);
        self.append(id, batch, refusal, false)
    }

    /// The file, whose contents are durable.
    pub(super) fn into_file(self) -> io::Result<File> {
        self.file.sync_all()?;
        Ok(self.file)
    }

    pub(super) fn sync(&self) -> io::Result<()> {
        self.file.sync_data()
    }

    /// Reads what is said of a batch, without the batch.
    pub(super) fn description(&mut self, id: i64) -> io::Result<Description> {
        Ok(self.found_header(id)?.1)
    }

    /// Reads a batch.
    pub(super) fn read(&mut self, id: i64) -> io::Result<Frame> {
        let (header, description) = self.found_header(id)?;
        let body = self.bytes(self.entries[&id].at * BLOCK + header.bytes, header.body_bytes)?;
        let is_intact = crc32fast::hash(&body) == header.body_checksum;
        Ok(Frame { description, body, is_intact })
    }

    /// Reads the header of a batch.
    fn found_header(&mut self, id: i64) -> io::Result<(Header, Description)> {
        let at = self.entries.get(&id).ok_or(io::ErrorKind::NotFound)?.at;
        let mut header = self.header(at)?.ok_or(io::ErrorKind::InvalidData)?;
        let description = header.description.take().ok_or(io::ErrorKind::InvalidData)?;
        Ok((header, description))
    }

    /// Gives free blocks at the end of the file back to the disk, if there are enough of them or
    /// no batch is left.
    pub(super) fn shrink(&mut self) -> io::Result<()> {
        let Some((&at, &blocks)) = self.free.last_key_value() else { return Ok(()) };
        if at + blocks == self.end && (blocks >= SHRINK_BLOCKS || self.entries.is_empty()) {
            self.file.set_len(at * BLOCK)?;
            self.free.remove(&at);
            self.end = at;
        }
        Ok(())
    }

    /// Writes a batch into a tile, and keeps it in mind instead of another one with its id.
    fn append(
        &mut self,
        id: i64,
        batch: &NewBatch,
        refusal: Option<String>,
        is_damaged: bool,
    ) -> io::Result<()> {
        let NewBatch { asset, query, media_type, body } = batch;
        let (asset, query, media_type) = (asset.clone(), query.clone(), media_type.clone());
        let description = Description { asset, query, media_type, refusal, is_damaged };
        let text = serde_json::to_vec(&description)?;
        let blocks = ((HEADER_BYTES + text.len() + body.len()) as u64).div_ceil(BLOCK);
        let mut bytes = self.header_bytes(KEPT, blocks, id, body, &text);
        bytes.extend(body);
        bytes.resize(usize::try_from(blocks * BLOCK).map_err(io::Error::other)?, 0);
        let hole = self.free.iter().find(|(_, room)| **room >= blocks);
        let (at, room) = hole.map_or((self.end, blocks), |(at, room)| (*at, *room));
        if let Err(error) = self.write_tile(at, blocks, room, &bytes) {
            // What is left of it must not be found; a free tile needs no room.
            if at == self.end {
                let _ = self.file.set_len(self.end * BLOCK);
            } else {
                let _ = self.write_free(at, room);
            }
            return Err(error);
        }
        if self.free.remove(&at).is_some() && room > blocks {
            self.free.insert(at + blocks, room - blocks);
        }
        self.end = self.end.max(at + blocks);
        self.forget(id);
        self.keep(id, at, blocks, body.len() as u64, &description);
        Ok(())
    }

    /// Writes a tile, and before it the header of what it leaves free.
    fn write_tile(&mut self, at: u64, blocks: u64, room: u64, bytes: &[u8]) -> io::Result<()> {
        if room > blocks {
            self.write_free(at + blocks, room - blocks)?;
        }
        self.write(at * BLOCK, bytes)
    }

    fn write_free(&mut self, at: u64, blocks: u64) -> io::Result<()> {
        let bytes = self.header_bytes(FREE, blocks, self.next_id - 1, &[], &[]);
        self.write(at * BLOCK, &bytes)
    }

    /// Marks the tile of a batch as free.
    fn set_free(&mut self, entry: &Entry) -> io::Result<()> {
        self.write(entry.at * BLOCK + 8, &FREE.to_le_bytes())?;
        self.add_free(entry.at, entry.blocks);
        Ok(())
    }

    fn add_free(&mut self, mut at: u64, mut blocks: u64) {
        let before = self.free.range(..at).next_back().map(|(start, room)| (*start, *room));
        if let Some((start, room)) = before.filter(|(start, room)| start + room == at) {
            (at, blocks) = (start, room + blocks);
        }
        if let Some(room) = self.free.remove(&(at + blocks)) {
            blocks += room;
        }
        self.free.insert(at, blocks);
    }

    fn keep(&mut self, id: i64, at: u64, blocks: u64, body_bytes: u64, of: &Description) {
        let asset: Arc<str> = of.asset.as_str().into();
        // Shares the name.
        let asset = self.waiting.get_key_value(&asset).map_or(asset, |(asset, _)| asset.clone());
        let is_refused = of.refusal.is_some();
        if !is_refused {
            self.waiting.entry(asset.clone()).or_default().insert(id);
        }
        self.used += blocks;
        self.entries.insert(id, Entry { at, blocks, body_bytes, asset, is_refused });
    }

    fn forget(&mut self, id: i64) {
        let Some(entry) = self.entries.remove(&id) else { return };
        self.used -= entry.blocks;
        if let Some(ids) = self.waiting.get_mut(&entry.asset) {
            ids.remove(&id);
            if ids.is_empty() {
                self.waiting.remove(&entry.asset);
            }
        }
    }

    /// Finds the tiles of the file.
    fn scan(&mut self) -> Result<(), SpoolError> {
        let length = self.file.metadata()?.len();
        let n_blocks = length / BLOCK;
        let (mut at, mut gap) = (FIRST, None);
        let mut gaps = Vec::new();
        while at < n_blocks {
            let Some(header) = self.header(at)? else {
                gap.get_or_insert(at);
                at += 1;
                continue;
            };
            gaps.extend(gap.take().map(|from| (from, at)));
            if at + header.blocks > n_blocks {
                break;
            }
            self.next_id = self.next_id.max(header.id + 1);
            let Header { is_free, blocks, body_bytes, id, description, .. } = header;
            match description {
                Some(description) if !is_free => {
                    self.found(id, at, blocks, body_bytes, &description)?
                }
                _ => self.add_free(at, blocks),
            }
            at += blocks;
        }
        self.end = at;
        if length > at * BLOCK {
            tracing::warn!("the spool ends with an incomplete batch, which was not acknowledged");
            self.file.set_len(at * BLOCK)?;
        }
        gaps.extend(gap.map(|from| (from, at)));
        for (from, to) in gaps {
            self.fill_gap(from, to)?;
        }
        Ok(())
    }

    /// Keeps a batch that was found in mind.
    fn found(
        &mut self,
        id: i64,
        at: u64,
        blocks: u64,
        body_bytes: u64,
        description: &Description,
    ) -> io::Result<()> {
        let is_refused = description.refusal.is_some();
        if let Some(other) = self.entries.get(&id).cloned() {
            // One of them has replaced the other. The one that is set aside says more, and can be
            // sent again.
            let tile = Entry { at, blocks, body_bytes, asset: other.asset.clone(), is_refused };
            if other.is_refused || !is_refused {
                return self.set_free(&tile);
            }
            self.set_free(&other)?;
            self.forget(id);
        }
        self.keep(id, at, blocks, body_bytes, description);
        Ok(())
    }

    /// Makes a frame of blocks whose header cannot be read, or a free tile.
    fn fill_gap(&mut self, from: u64, to: u64) -> io::Result<()> {
        let blocks = to - from;
        let body = self.bytes(from * BLOCK, blocks * BLOCK)?;
        let state = body[8..16].try_into().map(u64::from_le_bytes).unwrap_or_default();
        // Zeros are the length of a file whose contents a power cut has prevented.
        if is_free(state) || body.iter().all(|byte| *byte == 0) {
            self.write_free(from, blocks)?;
            self.add_free(from, blocks);
            return Ok(());
        }
        let id = self.next_id;
        self.next_id += 1;
        let offset = from * BLOCK;
        let reason = format!("the header of a batch at byte {offset} of the spool is destroyed");
        tracing::error!(id, reason, "a batch is damaged and set aside");
        let (asset, query, media_type) = Default::default();
        let batch = NewBatch { asset, query, media_type, body };
        if let Err(error) = self.append(id, &batch, Some(reason), true) {
            tracing::error!(id, %error, "it is set aside at the next start");
            return Ok(());
        }
        self.write_free(from, blocks)?;
        self.add_free(from, blocks);
        Ok(())
    }

    /// Reads the header of the tile at block `at`; returns `None` if there is none. One changed
    /// bit is corrected.
    fn header(&mut self, at: u64) -> io::Result<Option<Header>> {
        /// Bytes that hold nearly every header.
        const USUAL: u64 = 1024;
        /// Bytes that hold every header: a query and a media type of requests.
        const MOST: u64 = 1 << 20;
        let bytes = self.bytes(at * BLOCK, USUAL)?;
        if let Some(header) = self.parsed(&bytes) {
            return Ok(Some(header));
        }
        let n_equal = bytes.iter().zip(&self.salt).take(8).filter(|(a, b)| a == b).count();
        if n_equal < 7 {
            return Ok(None);
        }
        let mut bytes = self.bytes(at * BLOCK, MOST)?;
        if let Some(header) = self.parsed(&bytes) {
            return Ok(Some(header));
        }
        // Further bits are of a body, or of a header so long that it is not worth the time.
        for bit in 0..bytes.len().min(4 * BLOCK as usize) * 8 {
            bytes[bit / 8] ^= 1 << (bit % 8);
            if let Some(header) = self.parsed(&bytes) {
                tracing::warn!(id = header.id, "a changed bit of the spool is corrected");
                self.write(at * BLOCK + (bit / 8) as u64, &bytes[bit / 8..=bit / 8])?;
                return Ok(Some(header));
            }
            bytes[bit / 8] ^= 1 << (bit % 8);
        }
        Ok(None)
    }

    /// Parses a header; returns `None` if its checksum is wrong.
    fn parsed(&self, bytes: &[u8]) -> Option<Header> {
        let (fixed, rest) = bytes.split_first_chunk::<HEADER_BYTES>()?;
        if fixed[..8] != self.salt {
            return None;
        }
        let text = rest.get(..u32_at(fixed, 20)? as usize)?;
        if u32_at(fixed, 44)? != header_checksum(fixed, text) {
            return None;
        }
        let id = fixed[32..40].try_into().map(i64::from_le_bytes).ok()?;
        let state = fixed[8..16].try_into().map(u64::from_le_bytes).ok()?;
        let blocks = u32_at(fixed, 16).filter(|blocks| *blocks > 0)?;
        Some(Header {
            is_free: is_free(state),
            blocks: u64::from(blocks),
            body_bytes: u64::from(u32_at(fixed, 24)?),
            id,
            body_checksum: u32_at(fixed, 40)?,
            bytes: (HEADER_BYTES + text.len()) as u64,
            description: serde_json::from_slice(text).ok(),
        })
    }

    /// A header with its description, `text`.
    fn header_bytes(&self, state: u64, blocks: u64, id: i64, body: &[u8], text: &[u8]) -> Vec<u8> {
        let count = |n: u64| u32::try_from(n).unwrap_or(u32::MAX).to_le_bytes();
        let mut bytes = self.salt.to_vec();
        bytes.extend(state.to_le_bytes());
        bytes.extend(count(blocks));
        bytes.extend(count(text.len() as u64));
        bytes.extend(count(body.len() as u64));
        bytes.extend([0; 4]);
        bytes.extend(id.to_le_bytes());
        bytes.extend(crc32fast::hash(body).to_le_bytes());
        bytes.extend(header_checksum(&bytes, text).to_le_bytes());
        bytes.extend(text);
        bytes
    }

    /// Reads up to `n` bytes, fewer at the end of the file.
    fn bytes(&mut self, from: u64, n: u64) -> io::Result<Vec<u8>> {
        let mut bytes = Vec::new();
        self.file.seek(SeekFrom::Start(from))?;
        (&mut self.file).take(n).read_to_end(&mut bytes)?;
        Ok(bytes)
    }

    fn write(&mut self, from: u64, bytes: &[u8]) -> io::Result<()> {
        self.file.seek(SeekFrom::Start(from))?;
        self.file.write_all(bytes)
    }
}

/// The checksum of a header without its state, which changes in place.
fn header_checksum(fixed: &[u8], text: &[u8]) -> u32 {
    let mut hasher = crc32fast::Hasher::new();
    for part in [&fixed[..8], &fixed[16..44], text] {
        hasher.update(part);
    }
    hasher.finalize()
}

/// Whether a state is nearer to that of a free tile. One that is destroyed is not.
const fn is_free(state: u64) -> bool {
    (state ^ FREE).count_ones() < 16
}

fn u32_at(bytes: &[u8], at: usize) -> Option<u32> {
    bytes.get(at..at + 4)?.try_into().map(u32::from_le_bytes).ok()
}

/// The blocks with the two headers of the file, as far as it has them.
fn beginning(file: &mut File) -> io::Result<Vec<u8>> {
    let mut bytes = Vec::new();
    file.seek(SeekFrom::Start(0))?;
    file.take(FIRST * BLOCK).read_to_end(&mut bytes)?;
    Ok(bytes)
}

/// The two headers of a file.
fn copies(bytes: &[u8]) -> impl Iterator<Item = &[u8; FILE_HEADER_BYTES]> {
    bytes.chunks(BLOCK as usize).filter_map(|block| block.first_chunk())
}

/// The version and the salt of a header of the file whose checksum is right.
fn file_header(bytes: &[u8; FILE_HEADER_BYTES]) -> Option<(u32, [u8; 8])> {
    let is_valid = bytes[..16] == MAGIC && u32_at(bytes, 28)? == crc32fast::hash(&bytes[..28]);
    let salt = bytes[20..28].try_into().ok()?;
    is_valid.then_some((u32_at(bytes, 16)?, salt))
}

/// Writes both headers of a new file; returns its salt.
fn initialize(file: &mut File) -> io::Result<[u8; 8]> {
    let salt = std::hash::RandomState::new().build_hasher().finish().to_le_bytes();
    let mut header = MAGIC.to_vec();
    header.extend(VERSION.to_le_bytes());
    header.extend(salt);
    header.extend(crc32fast::hash(&header).to_le_bytes());
    header.resize(BLOCK as usize, 0);
    file.seek(SeekFrom::Start(0))?;
    file.write_all(&header.repeat(FIRST as usize))?;
    file.sync_all()?;
    Ok(salt)
}

/// Opens the file at `path` for its owner only, creates it if it is missing, and locks it.
pub(super) fn lock(path: &Path) -> Result<File, SpoolError> {
    let file = super::files::private().read(true).write(true).create(true).open(path)?;
    match file.try_lock() {
        Ok(()) => Ok(file),
        Err(std::fs::TryLockError::WouldBlock) => Err(SpoolError::Locked),
        Err(std::fs::TryLockError::Error(error)) => Err(error.into()),
    }
}

#[cfg(test)]
mod tests;
