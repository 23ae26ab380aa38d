//! A chart of three artificial records, from the records to the files.

use resvg::tiny_skia::Pixmap;
use serde::{Deserialize, Serialize};

use super::*;

#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
struct MadeUpRecord {
    method: String,
    error_m: Option<f64>,
    cost_us: f64,
}

fn records() -> Vec<MadeUpRecord> {
    let record = |method: &str, error_m, cost_us| MadeUpRecord {
        method: method.to_owned(),
        error_m,
        cost_us,
    };
    vec![
        record("plain", Some(1e-3), 1.0),
        record("fine", Some(1e-7), 90.0),
        record("lost", None, 5.0),
    ]
}

fn axes() -> (Axis, Axis) {
    (Axis::new("cost (µs)", Scale::Log(0.1, 1e3)), Axis::new("error (m)", Scale::Log(1e-9, 1.0)))
}

fn lines() -> Panel {
    let (x, y) = axes();
    let mut panel = Panel::new("lines & <points>", x, y);
    for (i, record) in records().into_iter().enumerate() {
        let points = record.error_m.map(|e| (record.cost_us, e)).into_iter().collect();
        panel.series.push(Series::new(record.method, Look::of(i), Stroke::LineAndMarkers, points));
    }
    let on = vec![(1.0, 1e-3), (90.0, 1e-7)];
    panel.series.push(Series::new("the front", Look::BLACK, Stroke::Front, on));
    panel.marks.push(Mark { name: "chosen".into(), text: "this one".into(), at: (90.0, 1e-7) });
    panel
}

fn map() -> Panel {
    let (x, y) = axes();
    let category = |i: usize, name: &str| Category { name: name.into(), look: Look::of(i) };
    let categories = vec![category(0, "stable"), category(1, "lost contact")];
    let mut panel = Panel::new("a map", x, y);
    let (xs, ys) = ([1.0, 10.0, 100.0], [1e-6, 1e-3]);
    panel.regions = Some(Regions::centred_log(categories, &xs, &ys, |i, j| (i + j) % 2));
    panel
}

fn chart() -> Chart {
    let figure = Figure {
        title: "Three records".into(),
        subtitle: "Fine is more exact than plain.".into(),
        columns: 2,
        panel_height: 700,
        panels: vec![lines(), map()],
    };
    let records = records().into_iter().map(|r| serde_json::to_value(r).unwrap()).collect();
    let versions = vec![("other".to_owned(), "3.1".to_owned())];
    Chart {
        name: "made-up",
        records,
        figures: vec![("", figure)],
        table: ChartTable::default(),
        versions,
    }
}

#[test]
fn a_drawing_keeps_its_labels_as_text() {
    let drawing = svg(&chart().figures[0].1);
    let texts: Vec<&str> = drawing
        .split("<text")
        .skip(1)
        .filter_map(|t| t.split_once('>')?.1.split_once("</text>"))
        .map(|(text, _)| text.trim())
        .collect();
    for label in [
        "Three records",
        "Fine is more exact than plain.",
        "cost (µs)",
        "error (m)",
        "plain",
        "fine",
        "lost",
        "the front",
        "chosen",
        "this one",
        "a map",
        "stable",
        "lost contact",
        "10⁻⁶",
        "lines &amp; &lt;points&gt;",
    ] {
        assert!(texts.contains(&label), "no text {label:?} among {texts:?}");
    }
    // Each name once, although its line or marker appears in panel and legend.
    assert_eq!(texts.iter().filter(|t| **t == "plain").count(), 1);
}

#[test]
fn the_pixels_have_the_size_of_the_drawing_and_are_not_blank() {
    let drawing = svg(&chart().figures[0].1);
    let pixels = Pixmap::decode_png(&png(&drawing).unwrap()).unwrap();
    assert_eq!(pixels.width(), 1800);
    assert!(drawing.contains(&format!("width=\"1800\" height=\"{}\"", pixels.height())));
    let count = |rgb: (u8, u8, u8)| {
        pixels.pixels().iter().filter(|p| (p.red(), p.green(), p.blue()) == rgb).count()
    };
    // Cells of the map, and black text, which needs the embedded font.
    assert!(count(Look::of(0).rgb) > 10_000, "no blue");
    assert!(count((0, 0, 0)) > 1_000, "no text");
}

#[test]
fn files_are_written_and_records_read_back() {
    let dir = tempfile::tempdir().unwrap();
    let written = write(&chart(), &dir.path().join("new")).unwrap();
    let names: Vec<_> = written.iter().map(|p| p.file_name().unwrap().to_str().unwrap()).collect();
    assert_eq!(names, ["made-up.json", "made-up.svg", "made-up.png"]);
    let read: Document<MadeUpRecord> =
        serde_json::from_slice(&std::fs::read(&written[0]).unwrap()).unwrap();
    assert_eq!((read.chart.as_str(), read.records), ("made-up", records()));
    assert_eq!(read.versions["other"], "3.1");
    assert_eq!(read.versions["offbd"], env!("CARGO_PKG_VERSION"));
    assert!(read.versions["rustc"].starts_with("1."), "{:?}", read.versions);
    assert_eq!(read.machine, Machine::this());
    assert!(read.machine.cores > 0);
}

#[test]
fn what_cannot_be_written_is_named() {
    let dir = tempfile::tempdir().unwrap();
    std::fs::write(dir.path().join("file"), "").unwrap();
    let error = write(&chart(), &dir.path().join("file")).unwrap_err();
    assert!(error.to_string().contains("file"), "{error}");
}
