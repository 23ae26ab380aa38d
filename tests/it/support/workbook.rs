//! Workbooks (`.xlsx`), part by part.

use std::io::{Cursor, Write};

use zip::ZipWriter;
use zip::write::SimpleFileOptions;

const KINDS: &str = "http://schemas.openxmlformats.org/officeDocument/2006/relationships";

/// The names of the parts whose contents tests choose.
pub const SHEET: &str = "xl/worksheets/sheet1.xml";
pub const TEXTS: &str = "xl/sharedStrings.xml";
pub const STYLES: &str = "xl/styles.xml";
pub const DOCUMENT: &str = "xl/workbook.xml";

/// Returns an archive with these parts.
pub fn archive(parts: &[(&str, &[u8])]) -> Vec<u8> {
    let mut writer = ZipWriter::new(Cursor::new(Vec::new()));
    // A long part is to take little time, not little space.
    let options = SimpleFileOptions::default().compression_level(Some(1));
    for (name, contents) in parts {
        writer.start_file(*name, options).unwrap();
        writer.write_all(contents).unwrap();
    }
    writer.finish().unwrap().into_inner()
}

/// Returns a workbook with these parts, and those that lead to them.
pub fn workbook(parts: &[(&str, &[u8])]) -> Vec<u8> {
    let start = format!(
        r#"<Relationships><Relationship Id="r1" Type="{KINDS}/officeDocument" Target="{DOCUMENT}"/></Relationships>"#
    );
    let document = format!(
        r#"<workbook xmlns:r="{KINDS}"><sheets><sheet name="Data" sheetId="1" r:id="r1"/></sheets></workbook>"#
    );
    let relationship = |id: &str, kind: &str, target: &str| {
        format!(r#"<Relationship Id="{id}" Type="{KINDS}/{kind}" Target="{target}"/>"#)
    };
    let lead = [
        relationship("r1", "worksheet", "worksheets/sheet1.xml"),
        relationship("r2", "sharedStrings", "/xl/sharedStrings.xml"),
        relationship("r3", "styles", "styles.xml"),
    ];
    let lead = format!("<Relationships>{}</Relationships>", lead.concat());
    let mut all: Vec<(&str, &[u8])> =
        vec![("_rels/.rels", start.as_bytes()), ("xl/_rels/workbook.xml.rels", lead.as_bytes())];
    if !parts.iter().any(|(name, _)| *name == DOCUMENT) {
        all.push((DOCUMENT, document.as_bytes()));
    }
    all.extend(parts);
    archive(&all)
}

/// Returns a sheet with the header of a session and these rows.
pub fn sheet(rows: &str) -> String {
    let header = ["t_s", "cmd_qx_rad", "cmd_qy_rad", "x_m", "y_m"];
    let header = header.map(|name| format!(r#"<c t="inlineStr"><is><t>{name}</t></is></c>"#));
    format!("<worksheet><sheetData><row>{}</row>{rows}</sheetData></worksheet>", header.concat())
}
