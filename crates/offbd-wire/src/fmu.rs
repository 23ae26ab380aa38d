//! FMUs: archives with the digital twin of a rig as a model of FMI 2.0 or 3.0.
//!
//! An FMU holds a description, a page about the model, licences, the start values of the rig, and
//! one shared library for each platform. The libraries are the same for all rigs and both versions.

use std::io::{Cursor, Write};

use offbd_core::engine::Setup;
use offbd_core::vocabulary::Invalid;
pub use offbd_fmu_model::FmiVersion;
use offbd_fmu_model::{LICENCES, MODEL_IDENTIFIER, StartValues, documentation, model_description};
use zip::result::ZipError;
use zip::write::{SimpleFileOptions, ZipWriter};

/// Why there is no FMU.
#[derive(Debug, thiserror::Error)]
pub enum FmuError {
    #[error("{0}")]
    Rig(#[from] Invalid),
    #[error("there are two libraries for {0}")]
    SamePlatform(FmuPlatform),
    #[error("the archive cannot be written: {0}")]
    Archive(#[from] ZipError),
}

/// A platform for which a library was built.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct FmuPlatform {
    machine: &'static str,
    system: &'static str,
    suffix: &'static str,
}

impl std::fmt::Display for FmuPlatform {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "{}-{}", self.machine, self.system)
    }
}

impl FmuPlatform {
    /// Recognises the platform of a shared library by its first bytes: ELF, Mach-O or PE.
    #[must_use]
    pub fn of_library(bytes: &[u8]) -> Option<Self> {
        let word = |at: usize| Some(u16::from_le_bytes(bytes.get(at..at + 2)?.try_into().ok()?));
        let long = |at: usize| Some(u32::from_le_bytes(bytes.get(at..at + 4)?.try_into().ok()?));
        if bytes.starts_with(b"\x7fELF") {
            let machine = [(0x3e, "x86_64"), (0xb7, "aarch64")];
            return Self::with(u32::from(word(18)?), machine, "linux", "so");
        }
        if bytes.starts_with(b"\xcf\xfa\xed\xfe") {
            let machine = [(0x0100_0007, "x86_64"), (0x0100_000c, "aarch64")];
            return Self::with(long(4)?, machine, "darwin", "dylib");
        }
        let header = usize::try_from(long(60)?).ok().filter(|_| bytes.starts_with(b"MZ"))?;
        let machine = [(0x8664, "x86_64"), (0xaa64, "aarch64")];
        let found = bytes.get(header..)?.starts_with(b"PE\0\0");
        Self::with(u32::from(word(header + 4)?), machine, "windows", "dll").filter(|_| found)
    }

    fn with(
        code: u32,
        machines: [(u32, &'static str); 2],
        system: &'static str,
        suffix: &'static str,
    ) -> Option<Self> {
        let machine = machines.into_iter().find(|(known, _)| *known == code)?.1;
        Some(Self { machine, system, suffix })
    }

    /// Returns the place of the library in an FMU. FMI 2.0 has its own names for x86_64 alone.
    fn place(self, version: FmiVersion) -> String {
        let folder = match (version, self.machine, self.system) {
            (FmiVersion::V2, "x86_64", "windows") => "win64".to_owned(),
            (FmiVersion::V2, "x86_64", system) => format!("{system}64"),
            _ => self.to_string(),
        };
        format!("binaries/{folder}/{MODEL_IDENTIFIER}.{}", self.suffix)
    }
}

/// Returns the FMU of the twin of `setup` with these libraries, for importers of `version`. Equal
/// inputs give equal bytes.
///
/// # Errors
/// [`FmuError`] if the rig has a value that the model does not take, or if two libraries are
/// for the same platform.
pub fn archive(
    setup: &Setup,
    version: FmiVersion,
    libraries: &[(FmuPlatform, Vec<u8>)],
) -> Result<Vec<u8>, FmuError> {
    for (i, (platform, _)) in libraries.iter().enumerate() {
        if libraries[..i].iter().any(|(before, _)| before == platform) {
            return Err(FmuError::SamePlatform(*platform));
        }
    }
    let start_values = StartValues::of(setup)?.to_text();
    let mut zip = ZipWriter::new(Cursor::new(Vec::new()));
    let mut add = |name: &str, content: &[u8], mode: u32| {
        zip.start_file(name, SimpleFileOptions::default().unix_permissions(mode))?;
        Ok::<(), ZipError>(zip.write_all(content)?)
    };
    add("modelDescription.xml", model_description(setup, version)?.as_bytes(), 0o644)?;
    add("documentation/index.html", documentation(setup, version)?.as_bytes(), 0o644)?;
    for (file, text) in LICENCES {
        add(&format!("documentation/licenses/{file}"), text.as_bytes(), 0o644)?;
    }
    add(&format!("resources/{}", StartValues::FILE), start_values.as_bytes(), 0o644)?;
    for (platform, library) in libraries {
        add(&platform.place(version), library, 0o755)?;
    }
    Ok(zip.finish()?.into_inner())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_library_is_known_by_its_first_bytes() {
        let place = |bytes: &[u8], version| Some(FmuPlatform::of_library(bytes)?.place(version));
        let name = |bytes: &[u8]| place(bytes, FmiVersion::V3);
        let name_2 = |bytes: &[u8]| place(bytes, FmiVersion::V2);
        let mut elf = b"\x7fELF\x02\x01\x01".to_vec();
        elf.resize(64, 0);
        assert_eq!(name(&elf), None);
        elf[18] = 0x3e;
        assert_eq!(name(&elf).as_deref(), Some("binaries/x86_64-linux/ball_on_plate.so"));
        assert_eq!(name_2(&elf).as_deref(), Some("binaries/linux64/ball_on_plate.so"));
        let mach = b"\xcf\xfa\xed\xfe\x0c\x00\x00\x01";
        assert_eq!(name(mach).as_deref(), Some("binaries/aarch64-darwin/ball_on_plate.dylib"));
        assert_eq!(name_2(mach).as_deref(), Some("binaries/aarch64-darwin/ball_on_plate.dylib"));
        let mut pe = b"MZ".to_vec();
        pe.resize(72, 0);
        pe[60] = 64;
        pe[64..70].copy_from_slice(b"PE\0\0\x64\x86");
        assert_eq!(name(&pe).as_deref(), Some("binaries/x86_64-windows/ball_on_plate.dll"));
        assert_eq!(name_2(&pe).as_deref(), Some("binaries/win64/ball_on_plate.dll"));
        for cut in 0..70 {
            assert_eq!(name(&pe[..cut]), None);
        }
        assert_eq!(name(b"#!/bin/sh"), None);
    }

    #[test]
    fn an_fmu_has_one_library_per_platform() {
        let setup = Setup::new(offbd_core::engine::Rig::chapter("chapter"), None).unwrap();
        let platform = FmuPlatform { machine: "x86_64", system: "linux", suffix: "so" };
        let library = || (platform, b"library".to_vec());
        let made = |libraries: &[_]| archive(&setup, FmiVersion::V3, libraries);
        let fmu = made(&[library()]).unwrap();
        assert_eq!(fmu, made(&[library()]).unwrap());
        let mut files = zip::ZipArchive::new(Cursor::new(fmu)).unwrap();
        assert_eq!(files.len(), 4 + LICENCES.len());
        let read = std::io::read_to_string(files.by_name(&platform.place(FmiVersion::V3)).unwrap())
            .unwrap();
        assert_eq!(read, "library");
        let twice = made(&[library(), library()]).unwrap_err().to_string();
        assert_eq!(twice, "there are two libraries for x86_64-linux");
    }
}
