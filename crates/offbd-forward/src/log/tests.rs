use std::path::PathBuf;

use super::*;

/// The next one of a row of pseudo-random numbers, below `n` (the constants are Knuth's, of MMIX).
fn below(state: &mut u64, n: u64) -> u64 {
    *state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
    (*state >> 33) % n
}

struct Fixture {
    _directory: tempfile::TempDir,
    path: PathBuf,
}

impl Fixture {
    fn new() -> Self {
        let directory = tempfile::tempdir().unwrap();
        let path = directory.path().join("spool");
        Self { _directory: directory, path }
    }

    fn open(&self) -> Log {
        Log::open(lock(&self.path).unwrap()).unwrap()
    }
}

fn batch(asset: &str, n: usize, bytes: usize) -> NewBatch {
    let body = (0..bytes).map(|i| (i * 7 + n) as u8).collect();
    NewBatch { asset: asset.into(), query: format!("n={n}"), media_type: "text/csv".into(), body }
}

/// Everything in the file: the batches, and whether each is set aside or damaged.
fn contents(log: &mut Log) -> Vec<(i64, NewBatch, bool, bool)> {
    let ids: Vec<_> = log.entries.keys().copied().collect();
    let mut contents = Vec::new();
    for id in ids {
        let frame = log.read(id).unwrap();
        let is_damaged = frame.description.is_damaged || !frame.is_intact;
        let is_refused = frame.description.refusal.is_some();
        contents.push((id, frame.into_batch(), is_refused, is_damaged));
    }
    contents
}

/// Compares what the log says of its batches with `model`: each batch, and whether it is set aside.
fn assert_told(log: &Log, model: &BTreeMap<i64, (NewBatch, bool)>) {
    let waiting: Vec<_> = model.iter().filter(|(_, (_, is_refused))| !is_refused).collect();
    let of = |asset: &str| waiting.iter().find(|(_, (batch, _))| batch.asset == asset);
    assert_eq!(log.n_waiting(), waiting.len());
    let mut assets: Vec<&str> = Vec::new();
    for (_, (batch, _)) in &waiting {
        if !assets.contains(&batch.asset.as_str()) {
            assets.push(&batch.asset);
        }
    }
    assert_eq!(log.assets(), assets, "in the order of their oldest batch");
    for asset in ["a", "b", "c", "d", "other"] {
        assert_eq!(log.oldest(asset), of(asset).map(|(id, _)| **id));
    }
    let refused = model.iter().filter(|(_, (_, is_refused))| *is_refused);
    let refused = refused.map(|(id, (batch, _))| (*id, batch.body.len() as u64));
    assert!(log.refused().eq(refused));
    for id in 0..=log.next_id {
        assert_eq!(log.is_refused(id), model.get(&id).is_some_and(|(_, is_refused)| *is_refused));
    }
}

/// A file with batches that wait, one that is set aside, and free tiles between them.
fn filled(log: &mut Log) {
    for n in 0..8 {
        log.put(&batch(["a", "b"][n % 2], n, 300 * n)).unwrap();
    }
    log.remove(2).unwrap();
    log.remove(5).unwrap();
    log.remove(6).unwrap();
    log.replace(4, &batch("b", 4, 100), Some("no".into()), false).unwrap();
    log.sync().unwrap();
}

#[test]
fn every_changed_bit_is_corrected_or_found_in_one_batch() {
    let fixture = Fixture::new();
    let mut log = fixture.open();
    filled(&mut log);
    let before = contents(&mut log);
    let tiles: Vec<_> = log.entries.values().map(|entry| entry.at).collect();
    drop(log);
    let intact = std::fs::read(&fixture.path).unwrap();
    let mut n_found = 0;
    for bit in 0..intact.len() * 8 {
        // Many bits of the headers, and some of all others.
        let is_header = tiles.contains(&(bit as u64 / 8 / BLOCK)) && (bit / 8) % 512 < 128;
        if bit % (if is_header { 5 } else { 61 }) != 0 {
            continue;
        }
        let mut bytes = intact.clone();
        bytes[bit / 8] ^= 1 << (bit % 8);
        std::fs::write(&fixture.path, bytes).unwrap();
        let after = contents(&mut fixture.open());
        let ids = |contents: &[(i64, NewBatch, bool, bool)]| {
            contents.iter().map(|batch| (batch.0, batch.1.asset.clone())).collect::<Vec<_>>()
        };
        assert_eq!(ids(&after), ids(&before), "bit {bit}");
        let changed: Vec<_> = after.iter().zip(&before).filter(|(a, b)| a != b).collect();
        assert!(changed.len() <= 1, "bit {bit}");
        assert!(changed.iter().all(|(batch, _)| batch.3), "bit {bit} is not found");
        n_found += changed.len();
    }
    assert!(n_found > 300, "{n_found}");
}

#[test]
fn of_a_header_that_is_destroyed_the_place_is_told_and_the_rest_stays() {
    let fixture = Fixture::new();
    let mut log = fixture.open();
    filled(&mut log);
    let before = contents(&mut log);
    let at = log.entries[&7].at * BLOCK;
    drop(log);
    let mut bytes = std::fs::read(&fixture.path).unwrap();
    bytes[at as usize..][..512].fill(0xFF);
    std::fs::write(&fixture.path, bytes).unwrap();
    for _ in 0..2 {
        let mut log = fixture.open();
        let after = contents(&mut log);
        let (kept, damaged): (Vec<_>, Vec<_>) = after.iter().partition(|batch| !batch.3);
        assert!(kept.into_iter().eq(before.iter().filter(|batch| batch.0 != 7)));
        assert_eq!(damaged.len(), 1);
        let reason = log.description(damaged[0].0).unwrap().refusal.unwrap();
        assert!(reason.contains(&format!("at byte {at} ")), "{reason}");
    }
}

#[test]
fn a_file_that_a_power_cut_has_shortened_keeps_what_is_complete() {
    let fixture = Fixture::new();
    let mut log = fixture.open();
    for n in 0..5 {
        log.put(&batch("a", n, 700 * n)).unwrap();
    }
    let before = contents(&mut log);
    let ends: Vec<_> =
        log.entries.values().map(|entry| (entry.at + entry.blocks) * BLOCK).collect();
    drop(log);
    let intact = std::fs::read(&fixture.path).unwrap();
    for length in (0..=intact.len()).filter(|length| length % 128 == 0 && *length >= 512) {
        std::fs::write(&fixture.path, &intact[..length]).unwrap();
        let n = ends.iter().filter(|end| **end <= length as u64).count();
        let mut log = fixture.open();
        assert_eq!(contents(&mut log), before[..n], "{length}");
        // What comes next is kept too.
        log.put(&batch("b", 9, 10)).unwrap();
        drop(log);
        assert_eq!(contents(&mut fixture.open()).len(), n + 1, "{length}");
    }
}

#[test]
fn a_batch_found_waiting_and_set_aside_is_set_aside() {
    let fixture = Fixture::new();
    let mut log = fixture.open();
    log.put(&batch("a", 1, 10)).unwrap();
    let at = log.entries[&1].at * BLOCK;
    log.replace(1, &batch("a", 1, 5), Some("no".into()), false).unwrap();
    let after = contents(&mut log);
    // The power has failed before the old tile was free.
    log.write(at + 8, &KEPT.to_le_bytes()).unwrap();
    drop(log);
    for _ in 0..2 {
        let mut log = fixture.open();
        assert_eq!((contents(&mut log), log.n_waiting()), (after.clone(), 0));
    }
}

#[test]
fn any_changes_are_there_after_a_restart_and_the_file_does_not_grow() {
    for mut seed in 0..20 {
        let fixture = Fixture::new();
        let mut log = fixture.open();
        let mut model = BTreeMap::new();
        let mut most = 0;
        for n in 0..300 {
            let ids: Vec<_> = model.keys().copied().collect();
            match below(&mut seed, 6) {
                0..3 if ids.len() < 20 => {
                    let batch = batch(["a", "b", "c"][n % 3], n, below(&mut seed, 3000) as usize);
                    log.put(&batch).unwrap();
                    model.insert(log.next_id - 1, (batch, false));
                }
                3 if !ids.is_empty() => {
                    let id = ids[below(&mut seed, ids.len() as u64) as usize];
                    let batch = batch("d", n, below(&mut seed, 2000) as usize);
                    let is_refused = below(&mut seed, 2) == 0;
                    log.replace(id, &batch, is_refused.then(|| "no".into()), false).unwrap();
                    model.insert(id, (batch, is_refused));
                }
                4 if below(&mut seed, 5) == 0 => {
                    drop(log);
                    log = fixture.open();
                }
                _ if !ids.is_empty() => {
                    let id = ids[below(&mut seed, ids.len() as u64) as usize];
                    log.remove(id).unwrap();
                    log.shrink().unwrap();
                    model.remove(&id);
                }
                _ => {}
            }
            let expected: Vec<_> =
                model.iter().map(|(id, (batch, is))| (*id, batch.clone(), *is, false)).collect();
            assert_eq!(contents(&mut log), expected);
            assert_told(&log, &model);
            most = most.max(log.used_bytes());
        }
        let length = fixture.path.metadata().unwrap().len();
        assert!(length < 3 * most, "{length} bytes for {most}");
        model.keys().for_each(|id| log.remove(*id).unwrap());
        log.shrink().unwrap();
        assert_eq!(fixture.path.metadata().unwrap().len(), FIRST * BLOCK);
    }
}

#[test]
fn the_disk_gets_back_only_many_free_blocks_at_the_end() {
    let fixture = Fixture::new();
    let mut log = fixture.open();
    let length = || fixture.path.metadata().unwrap().len();
    let many = batch("a", 1, (SHRINK_BLOCKS * BLOCK) as usize);
    for batch in [&many, &batch("a", 2, 10), &many, &batch("a", 4, 10)] {
        log.put(batch).unwrap();
    }
    let full = length();
    log.remove(1).unwrap();
    log.shrink().unwrap();
    assert_eq!((length(), contents(&mut log).len()), (full, 3), "batches lie behind them");
    log.remove(4).unwrap();
    log.shrink().unwrap();
    assert_eq!(length(), full, "these are few");
    log.remove(3).unwrap();
    log.shrink().unwrap();
    assert!(length() <= full - SHRINK_BLOCKS * BLOCK, "{} of {full}", length());
    drop(log);
    assert_eq!(contents(&mut fixture.open()), [(2, batch("a", 2, 10), false, false)]);
}

/// As from the database of an earlier version, in any order.
#[test]
fn batches_that_are_added_keep_their_ids_and_later_ones_follow() {
    let fixture = Fixture::new();
    let mut log = fixture.open();
    log.add(7, &batch("a", 1, 10), None).unwrap();
    log.add(3, &batch("b", 2, 20), Some("no".into())).unwrap();
    log.put(&batch("c", 3, 30)).unwrap();
    let model = BTreeMap::from([
        (3, (batch("b", 2, 20), true)),
        (7, (batch("a", 1, 10), false)),
        (8, (batch("c", 3, 30), false)),
    ]);
    assert_told(&log, &model);
    drop(log.into_file().unwrap());
    assert_told(&fixture.open(), &model);
}

#[test]
fn a_later_version_and_a_file_of_another_kind_are_refused_and_left_as_they_are() {
    let fixture = Fixture::new();
    fixture.open().put(&batch("a", 1, 10)).unwrap();
    let mut bytes = std::fs::read(&fixture.path).unwrap();
    for copy in [0, 512] {
        bytes[copy + 16] = 9;
        let checksum = crc32fast::hash(&bytes[copy..copy + 28]);
        bytes[copy + 28..copy + 32].copy_from_slice(&checksum.to_le_bytes());
    }
    for (bytes, told) in
        [(bytes, "format 9 of a later version"), (b"secret".to_vec(), "not a spool")]
    {
        std::fs::write(&fixture.path, &bytes).unwrap();
        let refused = Log::open(lock(&fixture.path).unwrap()).unwrap_err().to_string();
        assert!(refused.contains(told), "{refused}");
        assert_eq!(std::fs::read(&fixture.path).unwrap(), bytes);
    }
}
