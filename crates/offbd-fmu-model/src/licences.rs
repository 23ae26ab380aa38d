//! The licences in an FMU.

/// Each file of the folder `documentation/licenses/` of an FMU, with its text. `license.txt` is
/// the one that the standards name.
pub const LICENCES: [(&str, &str); 4] = [
    ("license.txt", ENTRY),
    ("LICENSE-APACHE.txt", include_str!("../LICENSE-APACHE")),
    ("LICENSE-MIT.txt", include_str!("../LICENSE-MIT")),
    ("LICENSES-OF-LIBRARIES.txt", include_str!("../LICENSES-OF-LIBRARIES")),
];

const ENTRY: &str = "\
offbd, whose digital twin this model is, is licensed under the MIT licence (LICENSE-MIT.txt) or the
Apache License, version 2.0 (LICENSE-APACHE.txt), at your choice. The licences of the libraries that
are in the shared library of the model are in LICENSES-OF-LIBRARIES.txt.
";

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_entry_names_the_other_files() {
        let [(_, entry), others @ ..] = LICENCES;
        assert!(others.iter().all(|(file, text)| entry.contains(file) && text.contains("licens")));
    }
}
