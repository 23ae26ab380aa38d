//! Where an importer of FMI 2.0 says that the resources are: a URI of a folder.

use std::path::PathBuf;

use percent_encoding::percent_decode_str;

use crate::instance::Refusal;

/// Returns the path of a folder on this computer whose location is given as a URI, such as
/// `file:///tmp/a%20b`.
///
/// # Errors
/// [`Refusal::Location`] with the URI and what is wrong with it.
pub fn path_of_location(uri: &str) -> Result<PathBuf, Refusal> {
    let refused = |why| Refusal::Location { uri: uri.to_owned(), why };
    let Some((scheme, rest)) = uri.split_once(':') else { return Err(refused("is not a URI")) };
    if !scheme.eq_ignore_ascii_case("file") {
        return Err(refused("is not the address of a file"));
    }
    let path = match rest.strip_prefix("//") {
        None => rest,
        Some(host) => host.strip_prefix("localhost").unwrap_or(host),
    };
    if !path.starts_with('/') {
        return Err(refused("is not on this computer"));
    }
    let path = percent_decode_str(path).decode_utf8().map_err(|_| refused("is not UTF-8"))?;
    Ok(PathBuf::from(without_slash_of_drive(&path)))
}

/// Returns `C:/a` for `/C:/a`, and any other path as it is.
fn without_slash_of_drive(path: &str) -> &str {
    match path.as_bytes() {
        [b'/', drive, b':', ..] if cfg!(windows) && drive.is_ascii_alphabetic() => &path[1..],
        _ => path,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_form_of_a_file_uri_is_a_path() {
        let wanted = PathBuf::from("/tmp/a b/ü");
        for uri in [
            "file:///tmp/a%20b/%C3%BC",
            "file:/tmp/a%20b/ü",
            "file://localhost/tmp/a b/ü",
            "FILE:///tmp/a b/%c3%bc",
        ] {
            assert_eq!(path_of_location(uri), Ok(wanted.clone()), "{uri}");
        }
    }

    #[test]
    fn another_location_is_refused_in_words() {
        let refused = |uri: &str| path_of_location(uri).unwrap_err().to_string();
        assert_eq!(refused("/tmp"), "the location of the resources, /tmp, is not a URI");
        assert!(refused("https://example.com/a").ends_with("is not the address of a file"));
        assert!(refused("file://server/share").ends_with("is not on this computer"));
        assert!(refused("file:relative").ends_with("is not on this computer"));
        assert!(refused("file:///%ff").ends_with("is not UTF-8"));
    }
}
