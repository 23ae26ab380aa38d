//! Tables as programs and owners write them, through every door: each gives the same samples and
//! the same verdict.

use serde_json::{Value, json};

use crate::cli::fixture::CliFixture;
use crate::support::ServiceFixture;
#[cfg(feature = "xlsx")]
use crate::support::workbook::{SHEET, workbook};

/// A file as its owner has it.
struct OddFile {
    name: &'static str,
    /// The file.
    bytes: Vec<u8>,
    /// How its columns are read; empty if they have the names of the quantities.
    columns: &'static str,
    rate: Option<f64>,
}

impl OddFile {
    /// Whether it can be a batch of telemetry in CSV, which has times.
    fn is_batch(&self) -> bool {
        let other = ["json", "parquet", "arrow", "mcap", "workbook"];
        self.rate.is_none() && !other.iter().any(|kind| self.name.starts_with(kind))
    }
}

/// The rows of a recording in which an x servo dies: time, commands, positions.
fn rows(cli: &CliFixture) -> Vec<[Option<f64>; 5]> {
    cli.ok("simulate --seconds 30 --fault x_servo:dead@10 -o sick.csv");
    read_rows(cli)
}

fn read_rows(cli: &CliFixture) -> Vec<[Option<f64>; 5]> {
    let text = cli.read("sick.csv");
    let cells = |line: &str| -> [Option<f64>; 5] {
        let cells: Vec<Option<f64>> = line.split(',').map(|cell| cell.parse().ok()).collect();
        cells.try_into().unwrap()
    };
    text.lines().skip(1).map(cells).collect()
}

/// Writes a table; `cell` returns the text of a value in a column.
fn table(
    header: &str,
    rows: &[[Option<f64>; 5]],
    separator: &str,
    cell: impl Fn(usize, Option<f64>) -> String,
) -> String {
    let line = |row: &[Option<f64>; 5]| {
        let cells = row.iter().enumerate().map(|(i, value)| cell(i, *value));
        cells.collect::<Vec<_>>().join(separator)
    };
    let mut lines: Vec<String> = rows.iter().map(line).collect();
    if !header.is_empty() {
        lines.insert(0, header.to_owned());
    }
    lines.join("\n") + "\n"
}

const HEADER: &str = "t_s,cmd_qx_rad,cmd_qy_rad,x_m,y_m";

fn plain(_: usize, value: Option<f64>) -> String {
    value.map_or(String::new(), |value| value.to_string())
}

/// A data frame as R's `write.table` writes it: no name stands above the numbers of the rows.
fn named_rows(rows: &[[Option<f64>; 5]]) -> String {
    let quoted = |name: &str| format!("\"{name}\"");
    let names: Vec<String> = HEADER.split(',').map(quoted).collect();
    let text = table("", rows, " ", |_, value| value.map_or("NA".to_owned(), |v| v.to_string()));
    let numbered = text.lines().enumerate().map(|(i, row)| format!("\"{}\" {row}\n", i + 1));
    names.join(" ") + "\n" + &numbered.collect::<String>()
}

/// The same recording in the layouts of many programs.
fn files(rows: &[[Option<f64>; 5]]) -> Vec<OddFile> {
    let semicolons = HEADER.replace(',', ";");
    let commas = |i, value| plain(i, value).replace('.', ",");
    let file = |name, text: String, columns| OddFile {
        name,
        bytes: text.into_bytes(),
        columns,
        rate: None,
    };
    let utf16 = table(&HEADER.replace(',', "\t"), rows, "\t", plain);
    let utf16 =
        [0xfeff].into_iter().chain(utf16.encode_utf16()).flat_map(u16::to_le_bytes).collect();
    let mut files = json_files(rows);
    files.extend([
        file("plain", table(HEADER, rows, ",", plain), ""),
        file("spreadsheet", table(&semicolons, rows, ";", commas), ""),
        file(
            "nan",
            table(HEADER, rows, ",", |i, value| {
                value.map_or("nan".to_owned(), |value| plain(i, Some(value)))
            }),
            "",
        ),
        file(
            "comments",
            format!("% a log\n% of Monday\n\n{}", table(HEADER, rows, ",", plain))
                .replace("\n0.5,", "\n% half\n0.5,"),
            "",
        ),
        OddFile { name: "utf16", bytes: utf16, columns: "", rate: None },
        file(
            "numpy",
            format!(
                "# {}",
                table(&HEADER.replace(',', " "), rows, " ", |i, value| {
                    value.map_or("nan".to_owned(), |value| plain(i, Some(value)))
                })
            ),
            "",
        ),
        file(
            "separators at the end",
            table(HEADER, rows, ",", plain).replace('\n', ",\n").replacen(",\n", "\n", 1),
            "",
        ),
        file("separator behind the names", table(&format!("{HEADER},"), rows, ",", plain), ""),
        file("carriage returns", table(HEADER, rows, ",", plain).replace('\n', "\r"), ""),
        file("header twice", format!("{HEADER}\n{}", table(HEADER, rows, ",", plain)), ""),
        file(
            "names before each value",
            table("", rows, " ", |i, value| {
                let value = value.map_or("nan".to_owned(), |value| plain(i, Some(value)));
                format!("{}:{value}", HEADER.split(',').nth(i).unwrap())
            }),
            "",
        ),
        file("names of rows", named_rows(rows), ""),
        file("units", format!("{HEADER}\ns,rad,rad,m,m\n{}", table("", rows, ",", plain)), ""),
        file(
            "own names",
            table("Zeit,Winkel X,Winkel Y,Ball X,Ball Y", rows, ",", plain),
            "t_s=Zeit, cmd_qx_rad='Winkel X', cmd_qy_rad='Winkel Y', x_m='Ball X', y_m='Ball Y'",
        ),
        file(
            "no header",
            table("", rows, ",", plain),
            "t_s=#1, cmd_qx_rad=#2, cmd_qy_rad=#3, x_m=#4, y_m=#5",
        ),
    ]);
    #[cfg(feature = "parquet")]
    {
        let columns = "t_s=Zeit, cmd_qx_rad=Roll, cmd_qy_rad=Pitch, x_m=X, y_m=Y";
        for (name, bytes) in [("parquet", parquet_file(rows)), ("arrow", arrow_file(rows))] {
            files.push(OddFile { name, bytes, columns, rate: None });
        }
    }
    #[cfg(feature = "mcap")]
    {
        let columns = "t_s=stamp, cmd_qx_rad='q[0]', cmd_qy_rad='q[1]', x_m=ball.x, y_m=ball.y";
        files.push(OddFile { name: "mcap", bytes: mcap_file(rows), columns, rate: None });
    }
    #[cfg(feature = "xlsx")]
    {
        let columns = "t_s=Zeit, cmd_qx_rad=Roll, cmd_qy_rad=Pitch, x_m=X, y_m=Y";
        files.push(OddFile { name: "workbook", bytes: spreadsheet(rows), columns, rate: None });
    }
    files
}

/// The same recording in layouts whose numbers are rounded: other units, counts, dates.
fn rounded_files(rows: &[[Option<f64>; 5]]) -> Vec<OddFile> {
    let text = |name, columns, header: &str, end: &str, cell: &dyn Fn(usize, f64) -> String| {
        let words = ["", "nan", "NaN", "NA", "N/A", "None", "null", "nil", "-", "--", "?", "#N/A"];
        let mut n_missing = 0;
        let mut lines = vec![header.to_owned()];
        for row in rows {
            let mut cells = Vec::new();
            for (i, value) in row.iter().enumerate() {
                n_missing += usize::from(value.is_none());
                cells.push(value.map_or_else(
                    || words[n_missing % words.len()].to_owned(),
                    |value| cell(i, value),
                ));
            }
            lines.push(cells.join(","));
        }
        let bytes = (lines.join(end) + end).into_bytes();
        OddFile { name, bytes, columns, rate: None }
    };
    let degrees = |i: usize, value: f64| match i {
        1 | 2 => format!("{:.3}", value.to_degrees()),
        _ => value.to_string(),
    };
    // Three servos at 0, 120 and 240 degrees, whose angles are a linear map of those of the plate.
    let legs = |row: &[Option<f64>; 5]| {
        let [t, qx, qy, x, y] = row;
        let (qx, qy) = (qx.unwrap().to_degrees(), qy.unwrap().to_degrees());
        let leg =
            |at: f64| format!("{:.4}", qy * at.to_radians().cos() + qx * at.to_radians().sin());
        let cells = [plain(0, *t), leg(0.0), leg(120.0), leg(240.0), plain(3, *x), plain(4, *y)];
        cells.join(",")
    };
    let legs: Vec<String> = rows.iter().map(legs).collect();
    let legs = format!("t_s,a,b,c,x_m,y_m\n{}\n", legs.join("\n"));
    let date = |value: f64| {
        let micros = (value * 1e6).round() as u64;
        let (seconds, micros) = (micros / 1_000_000, micros % 1_000_000);
        format!("13:51:{seconds:02}.{micros:06}")
    };
    let apart = "t_s=date+clock, cmd_qx_rad=qx, cmd_qy_rad=qy, x_m=x, y_m=y";
    let mut files = vec![
        text(
            "degrees",
            "cmd_qx_rad=roll/deg, cmd_qy_rad=pitch/deg",
            "t_s,roll,pitch,x_m,y_m",
            "\r\n",
            &degrees,
        ),
        text(
            "pixels",
            "x_m=px*0.0005-0.16, y_m=0.12-py*0.0005",
            "t_s,cmd_qx_rad,cmd_qy_rad,px,py",
            "\n",
            &|i, value| match i {
                3 => format!("{:.0}", (value + 0.16) / 0.0005),
                4 => format!("{:.0}", (0.12 - value) / 0.0005),
                _ => value.to_string(),
            },
        ),
        text(
            "microcontroller",
            "t_s=us/us, cmd_qx_rad=q0*1e-4, cmd_qy_rad=q1*1e-4, x_m=x*1e-5, y_m=y*1e-5",
            "us,q0,q1,x,y",
            ",\n",
            &|i, value| format!("{:.0}", value * [1e6, 1e4, 1e4, 1e5, 1e5][i]),
        ),
        text(
            "dates",
            "t_s=when, cmd_qx_rad=qx, cmd_qy_rad=qy, x_m=x, y_m=y",
            "when,qx,qy,x,y",
            "\n",
            &|i, value| {
                if i == 0 { format!("2026-02-20T{}+01:00", date(value)) } else { value.to_string() }
            },
        ),
        text("date and time", apart, "date,clock,qx,qy,x,y", "\n", &|i, value| {
            if i == 0 { format!("20.02.2026,{}", date(value)) } else { value.to_string() }
        }),
        OddFile {
            name: "three servos",
            bytes: legs.into_bytes(),
            columns: "cmd_qy_rad=a/deg*0.6666666666666667-b/deg*0.3333333333333333-c/deg*0.3333333333333333, \
                      cmd_qx_rad=b/deg*0.5773502691896258-c/deg*0.5773502691896258",
            rate: None,
        },
    ];
    let even = table("cmd_qx_rad;cmd_qy_rad;x_m;y_m", rows, ";", |i, value| match i {
        0 => String::new(),
        _ => plain(i, value),
    });
    // Without the empty cells of the time, and with a mark of the byte order.
    let even = format!("\u{feff}{}", even.replace("\n;", "\n"));
    files.push(OddFile { name: "rate", bytes: even.into_bytes(), columns: "", rate: Some(100.0) });
    files
}

/// JSON documents, as programs write them.
fn json_files(rows: &[[Option<f64>; 5]]) -> Vec<OddFile> {
    let names = || HEADER.split(',');
    // A missing value is null, or its key is absent.
    let object = |row: &[Option<f64>; 5], has_nulls: bool| -> Value {
        let members = names().zip(row).filter(|(_, value)| has_nulls || value.is_some());
        members.map(|(name, value)| (name.to_owned(), json!(value))).collect()
    };
    let lines: Vec<String> = rows.iter().map(|row| object(row, false).to_string()).collect();
    let columns: Value = names()
        .enumerate()
        .map(|(i, name)| (name.to_owned(), rows.iter().map(|row| json!(row[i])).collect::<Value>()))
        .collect();
    let nested = |[t, qx, qy, x, y]: &[Option<f64>; 5]| json!({ "stamp": { "s": t }, "q": [qx, qy], "ball": { "x": x, "y": y } });
    let file = |name, document: Value, columns| OddFile {
        name,
        bytes: document.to_string().into_bytes(),
        columns,
        rate: None,
    };
    let rows_of = |has_nulls| rows.iter().map(|row| object(row, has_nulls)).collect::<Value>();
    vec![
        file("json rows", rows_of(false), ""),
        file("json batch", json!({ "session": "s", "samples": rows_of(true) }), ""),
        file("json columns", columns, ""),
        file("json split", json!({ "columns": names().collect::<Vec<_>>(), "data": rows }), ""),
        OddFile {
            // As Python writes a missing number.
            name: "json with NaN",
            bytes: rows_of(true).to_string().replace("null", "NaN").into_bytes(),
            columns: "",
            rate: None,
        },
        OddFile {
            name: "json lines",
            bytes: lines.join("\n").into_bytes(),
            columns: "",
            rate: None,
        },
        file(
            "json nested",
            rows.iter().map(nested).collect(),
            "t_s=stamp.s, cmd_qx_rad='q[0]', cmd_qy_rad='q[1]', x_m=ball.x, y_m=ball.y",
        ),
    ]
}

/// The rows as columns with other names, types and units, and beside them columns that are not read.
#[cfg(feature = "parquet")]
fn record_batch(rows: &[[Option<f64>; 5]]) -> arrow_array::RecordBatch {
    use arrow_array::{ArrayRef, BooleanArray, Float64Array, Int64Array, StringArray};
    use std::sync::Arc;

    let column =
        |i: usize| -> ArrayRef { Arc::new(Float64Array::from_iter(rows.iter().map(|row| row[i]))) };
    let note: ArrayRef = Arc::new(StringArray::from(vec!["a note"; rows.len()]));
    let is_seen: ArrayRef = Arc::new(BooleanArray::from_iter(rows.iter().map(|r| r[3].is_some())));
    let number: ArrayRef = Arc::new(Int64Array::from_iter_values(0..rows.len() as i64));
    arrow_array::RecordBatch::try_from_iter([
        ("index", number),
        ("note", note),
        ("Zeit", column(0)),
        ("seen", is_seen),
        ("Roll", column(1)),
        ("Pitch", column(2)),
        ("X", column(3)),
        ("Y", column(4)),
    ])
    .unwrap()
}

#[cfg(feature = "parquet")]
fn parquet_file(rows: &[[Option<f64>; 5]]) -> Vec<u8> {
    let batch = record_batch(rows);
    let mut file = Vec::new();
    let mut writer = parquet::arrow::ArrowWriter::try_new(&mut file, batch.schema(), None).unwrap();
    writer.write(&batch).unwrap();
    writer.close().unwrap();
    file
}

#[cfg(feature = "parquet")]
fn arrow_file(rows: &[[Option<f64>; 5]]) -> Vec<u8> {
    let batch = record_batch(rows);
    let mut writer = arrow_ipc::writer::FileWriter::try_new(Vec::new(), &batch.schema()).unwrap();
    writer.write(&batch).unwrap();
    writer.finish().unwrap();
    writer.into_inner().unwrap()
}

/// Messages of a robot: one topic in JSON, with values within values, and one in another encoding.
#[cfg(feature = "mcap")]
fn mcap_file(rows: &[[Option<f64>; 5]]) -> Vec<u8> {
    use mcap::records::MessageHeader;
    use std::collections::BTreeMap;

    let mut writer = mcap::WriteOptions::new().create(std::io::Cursor::new(Vec::new())).unwrap();
    let mut channel = |topic: &str, encoding: &str| {
        writer.add_channel(0, topic, encoding, &BTreeMap::new()).unwrap()
    };
    let (state, camera) = (channel("/state", "json"), channel("/camera", "cdr"));
    for (sequence, [t, qx, qy, x, y]) in (0..).zip(rows) {
        let message = json!({ "stamp": t, "q": [qx, qy], "ball": { "x": x, "y": y } }).to_string();
        let header =
            |channel_id| MessageHeader { channel_id, sequence, log_time: 7, publish_time: 7 };
        writer.write_to_known_channel(&header(camera), b"picture").unwrap();
        writer.write_to_known_channel(&header(state), message.as_bytes()).unwrap();
    }
    writer.finish().unwrap();
    writer.into_inner().into_inner()
}

/// A workbook with a title, other names and a line of units; a cell without a value is absent.
#[cfg(feature = "xlsx")]
fn spreadsheet(rows: &[[Option<f64>; 5]]) -> Vec<u8> {
    let text = |text: &str| format!(r#"<c t="inlineStr"><is><t>{text}</t></is></c>"#);
    let texts = |words: [&str; 5]| format!("<row>{}</row>", words.map(text).concat());
    let mut sheet = format!("<row r=\"1\">{}</row>", text("Rig 3"));
    sheet += &texts(["Zeit", "Roll", "Pitch", "X", "Y"]);
    sheet += &texts(["s", "rad", "rad", "m", "m"]);
    for (i, row) in rows.iter().enumerate() {
        let cell = |(column, value): (char, &Option<f64>)| {
            value.map(|value| format!(r#"<c r="{column}{}"><v>{value}</v></c>"#, i + 4))
        };
        let cells: String = ('A'..='E').zip(row).filter_map(cell).collect();
        sheet += &format!("<row r=\"{}\">{cells}</row>", i + 4);
    }
    let sheet = format!("<worksheet><sheetData>{sheet}</sheetData></worksheet>");
    workbook(&[(SHEET, sheet.as_bytes())])
}

/// The verdict of `offbd replay`.
fn replayed(cli: &CliFixture, file: &OddFile) -> Value {
    std::fs::write(cli.path("odd.txt"), &file.bytes).unwrap();
    let mut args = vec!["replay", "--asset", "a.json", "--format", "json", "odd.txt"];
    if !file.columns.is_empty() {
        args.extend(["--columns", file.columns]);
    }
    let rate = file.rate.map(|rate| rate.to_string());
    if let Some(rate) = &rate {
        args.extend(["--rate", rate]);
    }
    let output = cli.args(0, &args);
    let summary = output.stdout.lines().last().unwrap();
    serde_json::from_str(summary).unwrap()
}

#[tokio::test]
async fn a_recording_in_any_layout_is_judged_the_same_through_every_door() {
    let cli = CliFixture::new();
    let rows = rows(&cli);
    let fixture = ServiceFixture::start().await;
    let client = &fixture.client;
    client.asset("a").await;
    cli.write("a.json", &client.get("assets/a").await.text);
    let mut hashes = Vec::new();
    let n_files = files(&rows).len();
    for (i, file) in files(&rows).iter().chain(&rounded_files(&rows)).enumerate() {
        let summary = replayed(&cli, file);
        // Of another asset, as an asset remembers the faults of its earlier sessions.
        client.asset(&format!("a{i}")).await;
        let rate = file.rate.map(|rate| format!("&rate={rate}")).unwrap_or_default();
        let columns = encoded(file.columns);
        let path = format!("assets/a{i}/sessions/import?name=s&columns={columns}{rate}");
        let request = client
            .request(reqwest::Method::POST, &path)
            .header("content-type", "application/octet-stream");
        let imported = client.send(request.body(file.bytes.clone())).await.expect(201);
        assert_eq!(imported["rejected"], 0, "{}", file.name);
        let hash = &imported["session"]["verdict"]["verdict_hash"];
        assert_eq!(hash, &summary["verdict_hash"], "{}", file.name);
        assert!(!summary["faults"].as_array().unwrap().is_empty(), "{}", file.name);
        if file.is_batch() {
            client.asset(&format!("t{i}")).await;
            let path = format!("assets/t{i}/telemetry?session=s&columns={columns}");
            let request = client.request(reqwest::Method::POST, &path);
            let request = request.header("content-type", "text/csv").body(file.bytes.clone());
            client.send(request).await.expect(200);
            let streamed = client.end(&format!("t{i}"), "s").await;
            assert_eq!(&streamed["verdict"]["verdict_hash"], hash, "{}", file.name);
        }
        hashes.push((file.name, hash.clone()));
    }
    let same = &hashes[..n_files];
    assert!(same.iter().all(|(_, hash)| *hash == same[0].1), "{same:?}");
}

fn encoded(text: &str) -> String {
    let kept = |b: u8| b.is_ascii_alphanumeric();
    text.bytes()
        .map(|b| if kept(b) { char::from(b).to_string() } else { format!("%{b:02X}") })
        .collect()
}

#[tokio::test]
async fn two_runs_in_one_log_are_two_sessions() {
    let cli = CliFixture::new();
    let rows = rows(&cli);
    let one = table(HEADER, &rows, ",", plain);
    let log = format!("{one}{one}");
    cli.write("log.csv", &log);
    let fixture = ServiceFixture::start().await;
    fixture.client.asset("a").await;
    cli.write("a.json", &fixture.client.get("assets/a").await.text);
    let output = cli.ok("replay --asset a.json --format json log.csv");
    let names: Vec<Value> = output
        .stdout
        .lines()
        .map(|line| serde_json::from_str::<Value>(line).unwrap())
        .filter(|line| line["type"] == "summary")
        .map(|line| json!([line["session"], line["verdict_hash"]]))
        .collect();
    assert_eq!(names.len(), 2);
    assert_eq!((&names[0][0], &names[1][0]), (&json!("log.csv"), &json!("log.csv#2")));
    assert_eq!(names[0][1], names[1][1]);
    let path = "assets/a/sessions/import?name=log";
    let imported = fixture.client.post_text(path, "text/csv", log).await.expect(201);
    assert_eq!(imported["accepted"], 2 * rows.len());
    let sessions = [&imported["session"], &imported["more_sessions"][0]];
    assert_eq!(sessions.map(|session| &session["name"]), [&json!("log"), &json!("log#2")]);
    for session in sessions {
        assert_eq!((&session["state"], &session["samples"]), (&json!("ended"), &json!(rows.len())));
    }
    // The second run is judged with the memory of the first.
    assert_eq!(sessions[0]["verdict"]["verdict_hash"], names[0][1]);
}

/// A batch may have two runs too; it does not name its session, and the device may have sent the
/// first one before.
#[tokio::test]
async fn two_runs_in_one_batch_are_two_sessions() {
    let cli = CliFixture::new();
    let first = rows(&cli);
    let second: Vec<_> =
        first.iter().map(|&[t, qx, qy, x, y]| [t, qx, qy, x.map(|x| x + 1e-4), y]).collect();
    let log = [&first, &second].map(|rows| table(HEADER, rows, ",", plain)).concat();
    let fixture = ServiceFixture::start().await;
    let client = &fixture.client;
    client.asset("a").await;
    for (accepted, duplicate) in [(2 * first.len(), 0), (0, 2 * first.len())] {
        let ack = client.post_text("assets/a/telemetry", "text/csv", log.clone()).await;
        let ack = ack.expect(200);
        let found = (&ack["accepted"], &ack["duplicate"], &ack["rejected"]);
        assert_eq!(found, (&json!(accepted), &json!(duplicate), &json!([])));
        let sessions = client.get("sessions?asset=a").await.expect(200);
        let samples = |session: &Value| session["samples"].clone();
        let samples: Vec<_> = sessions["items"].as_array().unwrap().iter().map(samples).collect();
        assert_eq!(samples, vec![json!(first.len()); 2]);
    }
}

#[tokio::test]
async fn a_dry_run_says_how_a_file_would_be_read_and_imports_nothing() {
    let cli = CliFixture::new();
    let rows = rows(&cli);
    let text = table("time,MV_x,MV_y,x,y", &rows, ",", plain);
    let fixture = ServiceFixture::start().await;
    let client = &fixture.client;
    client.asset("a").await;
    let path = "assets/a/sessions/import?dry_run=true";
    let seen = client.post_text(path, "text/csv", text.clone()).await.expect(200);
    cli.write("odd.csv", &text);
    let inspected: Value =
        serde_json::from_str(&cli.ok("inspect --format json odd.csv").stdout).unwrap();
    assert_eq!(seen, inspected);
    assert_eq!(seen["rows"], rows.len());
    assert_eq!(client.get("sessions").await.expect(200)["items"], json!([]));
    let refused = client.post_text("assets/a/sessions/import", "text/csv", text).await.expect(400);
    let detail = refused["detail"].as_str().unwrap();
    assert!(detail.contains("lacks the column `t_s`; it has `time`, `MV_x`"), "{detail}");
    for (path, text) in [("dry_run=true", "[null, null]"), ("dry_run=true&rate=5e-324", HEADER)] {
        let path = format!("assets/a/sessions/import?{path}");
        client.post_text(&path, "text/csv", text.to_owned()).await.expect(400);
    }
    let path = "assets/a/sessions/import?columns=x_m%3Dball%2Ffurlong";
    let refused = client.post_text(path, "text/csv", String::new()).await.expect(400);
    assert!(refused["detail"].as_str().unwrap().contains("`furlong`"), "{refused}");
    assert_eq!(client.get("sessions").await.expect(200)["items"], json!([]));
}

/// An asset file says once how the files of its rig are read.
#[tokio::test]
async fn the_asset_file_has_the_columns_of_its_files() {
    let cli = CliFixture::new();
    let rows = rows(&cli);
    let odd = table("Zeit,Roll,Pitch,X,Y", &rows, ",", plain);
    let fixture = ServiceFixture::start().await;
    let client = &fixture.client;
    let columns = "t_s=Zeit, cmd_qx_rad=Roll, cmd_qy_rad=Pitch, x_m=X, y_m=Y";
    client.post("assets", &json!({ "name": "a", "columns": columns })).await.expect(201);
    client.asset("b").await;
    cli.write("a.json", &client.get("assets/a").await.text);
    cli.write("odd.csv", &odd);
    let replay = "replay --asset a.json --format json";
    let hash = |file: &str| {
        let output = cli.ok(&format!("{replay} {file}")).stdout;
        let summary: Value = serde_json::from_str(output.lines().last().unwrap()).unwrap();
        summary["verdict_hash"].clone()
    };
    // A file without these columns is read by its own names.
    assert_eq!(hash("odd.csv"), hash("sick.csv"));
    let import = "sessions/import?name=s";
    let imported = client.post_text(&format!("assets/a/{import}"), "text/csv", odd.clone()).await;
    let verdict = imported.expect(201)["session"]["verdict"].clone();
    assert_eq!(verdict["verdict_hash"], hash("odd.csv"));
    client.post_text(&format!("assets/b/{import}"), "text/csv", odd.clone()).await.expect(400);
    let inspect = "assets/a/sessions/import?dry_run=true";
    let seen = client.post_text(inspect, "text/csv", odd).await.expect(200);
    assert!(seen["quantities"].as_array().unwrap().iter().all(|q| q["reason"].is_null()), "{seen}");
    let wrong = json!({ "name": "c", "columns": "x_m=ball/furlong" });
    let refused = client.post("assets", &wrong).await.expect(422);
    assert!(refused.to_string().contains("/columns"), "{refused}");
}

/// Names may be those of the quantities, in other units: what a node hands over from a bus is not
/// converted again.
#[tokio::test]
async fn columns_apply_once_to_a_batch() {
    let fixture = ServiceFixture::start().await;
    let client = &fixture.client;
    let asset = json!({ "name": "a", "columns": "x_m=x_m/mm, y_m=y_m/mm" });
    client.post("assets", &asset).await.expect(201);
    let table = format!("{HEADER}\n0.0,0.0,0.0,40.0,10.0\n");
    client.post_text("assets/a/telemetry?session=own", "text/csv", table.clone()).await.expect(200);
    let request = client.request(reqwest::Method::POST, "assets/a/telemetry?session=bus");
    let request = request.header("content-type", "text/csv").header("x-offbd-from-bus", "1");
    client.send(request.body(table)).await.expect(200);
    for (session, x_m) in [("own", 0.04), ("bus", 40.0)] {
        assert_eq!(client.recording("a", session).await[0].x_m, Some(x_m), "{session}");
    }
}

#[tokio::test]
async fn unknown_keys_of_a_batch_are_named() {
    let fixture = ServiceFixture::start().await;
    let client = &fixture.client;
    client.asset("a").await;
    let batch = json!({ "samples": [{ "t_s": 0.0, "x": 0.1, "cmd_qx": 0.0 }, { "t_s": 0.01, "x_m": 0.1 }] });
    let ack = client.post("assets/a/telemetry", &batch).await.expect(200);
    assert_eq!(ack["accepted"], 1);
    assert!(ack["rejected"][0]["reason"].as_str().unwrap().contains("none of the keys"), "{ack}");
    let meant = json!([{ "key": "cmd_qx", "meant": "cmd_qx_rad" }, { "key": "x", "meant": "x_m" }]);
    assert_eq!(ack["unknown"], meant);
    assert_eq!(client.get("assets/a/link").await.expect(200)["unknown"], meant);
}

/// The summary of `offbd replay` for some rows.
fn summary(cli: &CliFixture, rows: &[[Option<f64>; 5]]) -> Value {
    cli.write("some.csv", &table(HEADER, rows, ",", plain));
    let output = cli.ok("replay --format json some.csv").stdout;
    serde_json::from_str(output.lines().last().unwrap()).unwrap()
}

#[test]
fn a_session_that_begins_before_the_ball_waits_for_it() {
    let cli = CliFixture::new();
    cli.ok("simulate --seconds 30 -o sick.csv");
    let mut rows = read_rows(&cli);
    for row in &mut rows {
        (row[3], row[4]) = (None, None);
    }
    let dead = summary(&cli, &rows);
    assert_eq!(dead["faults"], json!(["sensor"]), "commands ask for a ball: {dead}");
    for row in &mut rows {
        (row[1], row[2]) = (Some(0.0), Some(0.0));
    }
    let waiting = summary(&cli, &rows);
    assert_eq!(waiting["faults"], json!([]), "{waiting}");
}

/// A form with files, as curl and browsers send it.
fn form(files: &[(&str, &str)]) -> Vec<u8> {
    let part = |(name, text): &(&str, &str)| {
        format!(
            "--edge\r\nContent-Disposition: form-data; name=\"file\"; filename=\"{name}\"\r\n\
             Content-Type: text/csv\r\n\r\n{text}\r\n"
        )
    };
    let parts: String = files.iter().map(part).collect();
    (parts + "--edge--\r\n").into_bytes()
}

#[tokio::test]
async fn the_files_of_a_form_are_one_recording_or_none() {
    let cli = CliFixture::new();
    let rows = rows(&cli);
    let part = |rows: &[[Option<f64>; 5]]| table(HEADER, rows, ",", plain);
    let (first, rest, overlap) = (part(&rows[..1000]), part(&rows[1000..]), part(&rows[900..]));
    let fixture = ServiceFixture::start().await;
    let client = &fixture.client;
    for asset in ["a", "b", "c"] {
        client.asset(asset).await;
    }
    let import = async |asset: &str, query: &str, files: &[(&str, &str)]| {
        let path = format!("assets/{asset}/sessions/import?name=s&{query}");
        let request = client
            .request(reqwest::Method::POST, &path)
            .header("content-type", "multipart/form-data; boundary=edge");
        client.send(request.body(form(files))).await
    };
    let whole = import("a", "", &[("whole.csv", &part(&rows))]).await.expect(201);
    let joined = import("b", "join=true", &[("2.csv", &rest), ("1.csv", &first)]).await.expect(201);
    let verdict = |imported: &Value| imported["session"]["verdict"]["verdict_hash"].clone();
    assert_eq!(verdict(&joined), verdict(&whole));
    let before = client.get("sessions").await.expect(200)["items"].clone();
    for (query, files, reason) in [
        ("join=true", &[("1.csv", &*first), ("2.csv", "nothing")][..], "2.csv: no line has two"),
        ("join=true", &[("1.csv", &first), ("2.csv", &overlap)], "2.csv: it has a sample at"),
        ("join=false", &[("1.csv", &first), ("2.csv", &rest)], "the form has 2 files"),
        ("dry_run=true", &[("1.csv", &first), ("2.csv", &rest)], "one file at a time"),
        ("", &[], "the form"),
    ] {
        let refused = import("c", query, files).await.expect(400);
        assert!(refused["detail"].as_str().unwrap().contains(reason), "{refused}");
    }
    assert_eq!(client.get("sessions").await.expect(200)["items"], before, "nothing is imported");
}

/// A recording in parts, whose names are not in the order of their times.
#[test]
fn parts_of_one_recording_are_judged_as_the_whole() {
    let cli = CliFixture::new();
    let rows = rows(&cli);
    let part = |rows: &[[Option<f64>; 5]]| table(HEADER, rows, ",", plain);
    std::fs::create_dir(cli.path("parts")).unwrap();
    cli.write("whole.csv", &part(&rows));
    cli.write("parts/b.csv", &part(&rows[..1000]));
    cli.write("parts/a.csv", &part(&rows[1000..]));
    let hash = |line: &str| {
        let summary: Value = serde_json::from_str(line).unwrap();
        summary["verdict_hash"].clone()
    };
    let judged = |line: &str| hash(cli.ok(line).stdout.lines().last().unwrap());
    let whole = judged("replay --format json whole.csv");
    assert_eq!(judged("replay --format json --join parts"), whole);
    assert_eq!(judged("replay --format json --join parts/a.csv parts/b.csv"), whole);
    assert_ne!(judged("replay --format json parts/a.csv"), whole);

    let refused = |line: &str| cli.run(3, line).stderr;
    let overlapping = refused("replay --join whole.csv parts/b.csv");
    let expected =
        "whole.csv: it has a sample at 0.00 s, and parts/b.csv ends at 9.99 s: they overlap";
    assert!(overlapping.contains(expected), "{overlapping}");
    cli.write("runs.csv", &(part(&rows[..10]) + &part(&rows[..10])));
    let runs = refused("replay --join runs.csv parts/a.csv");
    assert!(runs.contains("runs.csv: its clock starts again; it has several runs"), "{runs}");
}
