//! Files of cold data: a session as a Parquet file, which other programs can read too, and the
//! comparison of what was written with the recording.

use std::fs::File;
use std::io::{self, Write};
use std::path::Path;

use super::ServiceError;
use offbd_core::vocabulary::Sample;
use offbd_store::{ColdDirectory, SampleStream};
use offbd_wire::session_file::{self, SessionFileError, SessionFormat, SessionInfo, SessionWriter};
use offbd_wire::table::TableOptions;

/// Returns the directory `root` of cold data.
#[must_use]
pub fn cold_directory(root: &Path) -> ColdDirectory {
    ColdDirectory::new(root, read)
}

fn read(file: File) -> Result<SampleStream, String> {
    let rows = session_file::open(file, Some(SessionFormat::Parquet), &TableOptions::default());
    let rows = rows.map_err(|error| error.to_string())?;
    Ok(Box::new(rows.map(|row| row.map_err(|error| error.to_string()))))
}

/// Why a session stays in the database.
#[derive(Debug, thiserror::Error)]
pub(super) enum ColdFileError {
    #[error(transparent)]
    Recording(#[from] ServiceError),
    #[error(transparent)]
    Format(#[from] SessionFileError),
    #[error(transparent)]
    System(#[from] io::Error),
    #[error("its file {0}")]
    Recorded(String),
    #[error("what was written cannot be read: {0}")]
    Unreadable(String),
    #[error("sample {index} of what was written is not that of the recording")]
    Differs { index: u64 },
}

/// Writes the samples that `next` returns, until it returns `None`, to the file `path`.
pub(super) fn write(
    directory: &ColdDirectory,
    path: &str,
    info: &SessionInfo,
    mut next: impl FnMut() -> Result<Option<Vec<Sample>>, ServiceError>,
) -> Result<(), ColdFileError> {
    directory.write(path, |file| {
        let (mut writer, start) = SessionWriter::new(SessionFormat::Parquet, info, true)?;
        file.write_all(&start)?;
        while let Some(samples) = next()? {
            file.write_all(&writer.rows(&samples)?)?;
        }
        Ok(file.write_all(&writer.end()?)?)
    })
}

/// Compares the file `path` with the samples that `next` returns, bit by bit. Returns the
/// file's size and checksum.
pub(super) fn verify(
    directory: &ColdDirectory,
    path: &str,
    mut next: impl FnMut() -> Result<Option<Vec<Sample>>, ServiceError>,
) -> Result<(i64, String), ColdFileError> {
    let measured = directory.measure(path)?;
    let mut found = directory.samples(path).map_err(ColdFileError::Unreadable)?;
    let mut index = 0;
    while let Some(samples) = next()? {
        for sample in samples {
            let found = found.next().transpose().map_err(ColdFileError::Unreadable)?;
            if found.as_ref().map(bits) != Some(bits(&sample)) {
                return Err(ColdFileError::Differs { index });
            }
            index += 1;
        }
    }
    match found.next() {
        None => Ok(measured),
        Some(_) => Err(ColdFileError::Differs { index }),
    }
}

/// All that a sample consists of; two are equal only if they are so to the bit.
fn bits(sample: &Sample) -> (Option<u64>, [Option<u64>; 5]) {
    let Sample { seq, t_s, cmd_qx_rad, cmd_qy_rad, x_m, y_m } = *sample;
    let quantities = [Some(t_s), cmd_qx_rad, cmd_qy_rad, x_m, y_m];
    (seq, quantities.map(|quantity| quantity.map(f64::to_bits)))
}

#[cfg(test)]
#[cfg(feature = "parquet")]
mod tests {
    use proptest::prelude::*;

    use super::*;
    use offbd_core::vocabulary::any_sample;
    use offbd_wire::telemetry::MAX_SEQ;

    const PATH: &str = "2026-01-31/partition-00/s.parquet";

    /// Returns the samples in parts of `n`.
    fn parts(
        samples: &[Sample],
        n: usize,
    ) -> impl FnMut() -> Result<Option<Vec<Sample>>, ServiceError> {
        let mut parts: Vec<Vec<Sample>> = samples.chunks(n).map(<[_]>::to_vec).collect();
        parts.reverse();
        move || Ok(parts.pop())
    }

    /// Any number but those that no recording has.
    fn quantity() -> impl Strategy<Value = f64> {
        any::<u64>().prop_map(f64::from_bits).prop_filter("finite", |value| value.is_finite())
    }

    fn samples() -> impl Strategy<Value = Vec<Sample>> {
        proptest::collection::vec(any_sample(0..=MAX_SEQ, quantity), 1..300)
    }

    fn written(samples: &[Sample]) -> (tempfile::TempDir, ColdDirectory) {
        let folder = tempfile::tempdir().unwrap();
        let directory = cold_directory(folder.path());
        write(&directory, PATH, &SessionInfo::default(), parts(samples, 7)).unwrap();
        (folder, directory)
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(64))]

        #[test]
        fn a_recording_is_read_as_it_was_written(samples in samples()) {
            let (folder, directory) = written(&samples);
            let (n_bytes, _) = verify(&directory, PATH, parts(&samples, 11)).unwrap();
            let names = std::fs::read_dir(folder.path().join(PATH).parent().unwrap()).unwrap();
            prop_assert_eq!(names.count(), 1);
            let length = std::fs::metadata(folder.path().join(PATH)).unwrap().len();
            prop_assert_eq!(n_bytes, length as i64);
        }

        #[test]
        fn another_recording_differs(
            samples in samples(), at in any::<prop::sample::Index>(), bit in 0..52_u32,
        ) {
            let (_folder, directory) = written(&samples);
            let at = at.index(samples.len());
            let mut other = samples.clone();
            other[at].t_s = f64::from_bits(other[at].t_s.to_bits() ^ 1 << bit);
            let differs = verify(&directory, PATH, parts(&other, 5)).unwrap_err();
            let found = match differs {
                ColdFileError::Differs { index } => index,
                other => panic!("{other}"),
            };
            prop_assert_eq!(found, at as u64);
            for other in [&samples[..at], &[&samples[..], &samples[..1]].concat()] {
                prop_assert!(verify(&directory, PATH, parts(other, 5)).is_err());
            }
        }
    }

    #[test]
    fn a_missing_directory_is_not_created() {
        let folder = tempfile::tempdir().unwrap();
        let directory = cold_directory(&folder.path().join("not mounted"));
        let samples = [Sample::default()];
        let info = SessionInfo::default();
        assert!(write(&directory, PATH, &info, parts(&samples, 1)).is_err());
        assert!(directory.remove(PATH).is_err());
        assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 0);
    }

    #[test]
    fn what_is_not_complete_does_not_get_the_name() {
        let folder = tempfile::tempdir().unwrap();
        let directory = cold_directory(folder.path());
        let fail = || Err(ServiceError::Unavailable { what: "a test" });
        let failed = write(&directory, PATH, &SessionInfo::default(), fail);
        assert!(matches!(failed, Err(ColdFileError::Recording(_))));
        assert!(!folder.path().join(PATH).exists());
        directory.remove(PATH).unwrap();
        directory.remove(PATH).unwrap();
        let left = std::fs::read_dir(folder.path().join(PATH).parent().unwrap()).unwrap();
        assert_eq!(left.count(), 0);
    }
}
