//! Reads the blocks of the documents: JSON as JSON or an asset file, TOML as a configuration or a
//! mapping file.

use config::{File, FileFormat};
use offbd::config::Config;
use offbd::wire::asset;
use offbd::wire::mapping::{Mapping, MappingView};
use serde::de::DeserializeOwned;
use serde_json::Value;

use super::pages;
use crate::support::fenced::{FencedBlock, blocks, document};

#[test]
fn every_block_of_json_and_toml_in_a_document_can_be_read() {
    let (mut n_json, mut n_toml, mut wrong) = (0, 0, Vec::new());
    for page in pages() {
        for block in blocks(&document(&page)) {
            let read = match &*block.language {
                "json" => json(&block),
                "toml" => toml(&block),
                _ => continue,
            };
            *(if block.language == "json" { &mut n_json } else { &mut n_toml }) += 1;
            if let Err(reason) = read {
                wrong.push(format!("{page}:{}: {reason}", block.line));
            }
        }
    }
    assert!(wrong.is_empty(), "\n{}\n", wrong.join("\n"));
    assert!(n_json > 0 && n_toml > 10, "{n_json} {n_toml}");
}

/// A document with the name of a rig is an asset file.
fn json(block: &FencedBlock) -> Result<(), String> {
    let value: Value = serde_json::from_str(&block.text).map_err(|error| error.to_string())?;
    if value.get("name").is_some() {
        asset::parse_new(block.text.as_bytes()).map_err(|error| error.to_string())?;
    }
    Ok(())
}

/// A table of topics is a mapping file, a line with a crate's path is for Cargo. A section without
/// `listen` belongs to a service that other machines reach, which requires tokens.
fn toml(block: &FencedBlock) -> Result<(), String> {
    let text = &block.text;
    if text.contains("[[topics]]") {
        let view = deserialized::<MappingView>(text)?;
        Mapping::new(view).map_err(|error| error.to_string())?;
    } else if text.contains("path = ") {
        deserialized::<Value>(text)?;
    } else {
        let listen = if text.contains("listen") { "" } else { "listen = \"0.0.0.0:8087\"\n" };
        let config = deserialized::<Config>(&format!("{listen}{text}"))?;
        config.check().map_err(|error| error.to_string())?;
    }
    Ok(())
}

fn deserialized<T: DeserializeOwned>(text: &str) -> Result<T, String> {
    let source = File::from_str(text, FileFormat::Toml);
    let read = config::Config::builder().add_source(source).build();
    read.and_then(config::Config::try_deserialize).map_err(|error| error.to_string())
}

#[test]
fn a_block_that_is_wrong_is_found() {
    let of = |language: &str, text: &str| {
        let page = format!("1. Item:\n\n   ```{language}\n   {text}\n   ```\n");
        let mut found = blocks(&page);
        assert_eq!(found.len(), 1);
        found.remove(0)
    };
    assert_eq!(json(&of("json", r#"{ "name": "a" }"#)), Ok(()));
    assert!(json(&of("json", r#"{ "name": "a", "ball": 1 }"#)).is_err());
    assert!(json(&of("json", "{")).is_err());
    assert_eq!(toml(&of("toml", r#"listen = "0.0.0.0:8087""#)), Ok(()));
    assert!(toml(&of("toml", r#"lisen = "0.0.0.0:8087""#)).is_err());
}
