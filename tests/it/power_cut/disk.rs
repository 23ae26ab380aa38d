//! A disk, as far as a power cut shows it: what is synced is there, and of the rest any part.

use std::collections::BTreeMap;
use std::path::Path;

use crate::support::calls::{CallRecord, Operation};
use crate::support::device::Random;

/// Bytes that a disk writes as a whole.
const SECTOR: usize = 512;

/// A change of a file that is not synced.
#[derive(Clone)]
enum Change {
    Write(usize, Vec<u8>),
    Resize(usize),
}

#[derive(Clone, Default)]
struct DiskFile {
    synced: Vec<u8>,
    unsynced: Vec<Change>,
}

/// A change of a name in the folder: the file that has it from now on, or none.
type Renaming = (String, Option<usize>);

/// The files of a folder in which a history of calls takes place.
#[derive(Clone)]
pub struct Disk {
    folder: String,
    files: Vec<DiskFile>,
    /// Names as processes see them, and as they are on the disk.
    names: BTreeMap<String, usize>,
    synced_names: BTreeMap<String, usize>,
    unsynced_names: Vec<Vec<Renaming>>,
}

/// The files after a power cut.
pub type Image = BTreeMap<String, Vec<u8>>;

impl Disk {
    /// An empty folder.
    pub fn new(folder: &Path) -> Self {
        Self {
            folder: folder.to_str().unwrap().to_owned(),
            files: Vec::new(),
            names: BTreeMap::new(),
            synced_names: BTreeMap::new(),
            unsynced_names: Vec::new(),
        }
    }

    pub fn apply(&mut self, record: &CallRecord) {
        let path = &record.path;
        match &record.operation {
            Operation::Create => {
                self.files.push(DiskFile::default());
                self.rename(vec![(path.clone(), Some(self.files.len() - 1))]);
            }
            Operation::Unlink => self.rename(vec![(path.clone(), None)]),
            Operation::Rename(to) => {
                let file = self.names.get(path).copied();
                self.rename(vec![(path.clone(), None), (to.clone(), file)]);
            }
            Operation::Write(at, data) => self.change(path, Change::Write(*at, data.clone())),
            Operation::Resize(length) => self.change(path, Change::Resize(*length)),
            Operation::Sync if *path == self.folder => {
                let renamed = std::mem::take(&mut self.unsynced_names);
                renamed.into_iter().for_each(|names| set(&mut self.synced_names, names));
            }
            Operation::Sync => {
                let Some(file) = self.file(path) else { return };
                let changes = std::mem::take(&mut file.unsynced);
                changes.iter().for_each(|change| change.apply(&mut file.synced));
            }
            Operation::FailedSync if *path == self.folder => {}
            // What was to be written is lost, and no later sync knows of it.
            Operation::FailedSync => {
                self.file(path).into_iter().for_each(|file| file.unsynced.clear())
            }
            Operation::Send(_) => {}
        }
    }

    /// The file that has a name; none if it was deleted while it was open.
    fn file(&mut self, path: &str) -> Option<&mut DiskFile> {
        let file = self.names.get(path);
        assert!(file.is_some() || path.ends_with(" (deleted)"), "{path} was never created");
        file.map(|file| &mut self.files[*file])
    }

    fn change(&mut self, path: &str, change: Change) {
        self.file(path).into_iter().for_each(|file| file.unsynced.push(change.clone()));
    }

    fn rename(&mut self, names: Vec<Renaming>) {
        set(&mut self.names, names.clone());
        self.unsynced_names.push(names);
    }

    /// Whether a file is there after a power cut, whatever that leaves.
    pub fn keeps(&self, path: &Path) -> bool {
        self.synced_names.contains_key(path.to_str().unwrap())
    }

    /// Draws what a power cut leaves: of the changes of names that are not synced the first
    /// ones, of the writes that are not synced any, whole or some of their sectors.
    pub fn cut(&self, random: &mut Random) -> Image {
        let mut names = self.synced_names.clone();
        let kept = random.below(self.unsynced_names.len() + 1);
        self.unsynced_names[..kept].iter().for_each(|renamed| set(&mut names, renamed.clone()));
        // None of the writes, all of them, or each by chance.
        let fate = random.below(4);
        let after = |file: usize, random: &mut Random| {
            let mut content = self.files[file].synced.clone();
            for change in &self.files[file].unsynced {
                change.apply_part(&mut content, fate, random);
            }
            content
        };
        names.into_iter().map(|(name, file)| (name, after(file, random))).collect()
    }
}

fn set(names: &mut BTreeMap<String, usize>, renamed: Vec<Renaming>) {
    for (name, file) in renamed {
        match file {
            Some(file) => names.insert(name, file),
            None => names.remove(&name),
        };
    }
}

impl Change {
    fn apply(&self, content: &mut Vec<u8>) {
        match self {
            Self::Write(at, data) => write(content, *at, data),
            Self::Resize(length) => content.resize(*length, 0),
        }
    }

    fn apply_part(&self, content: &mut Vec<u8>, fate: usize, random: &mut Random) {
        let of_this = if fate < 2 { fate } else { random.below(3) };
        match (of_this, self) {
            (0, _) => {}
            (2, Self::Write(at, data)) => {
                for (at, sector) in sectors(*at, data) {
                    if random.below(2) == 0 {
                        write(content, at, sector);
                    }
                }
            }
            _ => self.apply(content),
        }
    }
}

/// Divides a write where sectors begin.
fn sectors(at: usize, data: &[u8]) -> impl Iterator<Item = (usize, &[u8])> {
    let (mut at, mut rest) = (at, data);
    std::iter::from_fn(move || {
        let n = (SECTOR - at % SECTOR).min(rest.len());
        let sector = (at, rest.split_off(..n)?);
        at += n;
        (n > 0).then_some(sector)
    })
}

fn write(content: &mut Vec<u8>, at: usize, data: &[u8]) {
    content.resize(content.len().max(at + data.len()), 0);
    content[at..][..data.len()].copy_from_slice(data);
}

#[test]
fn a_cut_leaves_what_is_synced_and_any_part_of_the_rest() {
    let record = |operation| CallRecord { path: "/d/f".to_owned(), operation };
    let mut disk = Disk::new(Path::new("/d"));
    disk.apply(&record(Operation::Create));
    disk.apply(&CallRecord { path: "/d".to_owned(), operation: Operation::Sync });
    disk.apply(&record(Operation::Write(0, vec![1; 1000])));
    disk.apply(&record(Operation::Sync));
    disk.apply(&record(Operation::Write(500, vec![2; 1000])));
    disk.apply(&record(Operation::FailedSync));
    disk.apply(&record(Operation::Write(1000, vec![3; 1000])));
    let images = |disk: &Disk| {
        let mut random = Random(1);
        let images = (0..200).map(|_| disk.cut(&mut random)["/d/f"].clone());
        images.collect::<std::collections::BTreeSet<_>>()
    };
    let found = images(&disk);
    assert!(found.iter().all(|image| image[..1000] == [1; 1000]));
    assert!(found.contains(&vec![1; 1000]), "nothing of the last write");
    let whole = [vec![1; 1000], vec![3; 1000]].concat();
    assert!(found.contains(&whole));
    // Bytes 1000 to 1024, two whole sectors, and 1536 to 2000 are there or not.
    assert_eq!(found.iter().filter(|image| image.len() > 1000).count(), 7);
    disk.apply(&record(Operation::Sync));
    assert_eq!(images(&disk).into_iter().collect::<Vec<_>>(), [whole]);
}
