//! Recordings as Parquet, Arrow and MCAP files, over HTTP and on the command line. What other
//! programs read and write is tested by `scripts/formats`.

mod tables;
#[cfg(feature = "parquet")]
mod traces;

use offbd::wire::session_file::SessionFormat;
use offbd::wire::table::TableOptions;
#[cfg(feature = "parquet")]
use offbd_core::vocabulary::Sample;

use crate::cli::fixture::CliFixture;
#[cfg(feature = "parquet")]
use crate::support::{Client, rig};
use crate::support::{ServiceFixture, csv};

const IMPORT: &str = "assets/a/sessions/import?name=s";

#[cfg(feature = "parquet")]
const TABLES: &[SessionFormat] = if cfg!(feature = "mcap") {
    &[SessionFormat::Parquet, SessionFormat::Arrow, SessionFormat::Mcap]
} else {
    &[SessionFormat::Parquet, SessionFormat::Arrow]
};

/// Returns the recording of session `id` in `format`.
#[cfg(feature = "parquet")]
async fn export(client: &Client, id: &str, format: SessionFormat) -> Vec<u8> {
    let request = client.request(reqwest::Method::GET, &format!("sessions/{id}/telemetry"));
    let answer = request.header("accept", format.media_type()).send().await.unwrap();
    assert_eq!(answer.status(), 200);
    assert_eq!(answer.headers()["content-type"], format.media_type());
    answer.bytes().await.unwrap().to_vec()
}

#[cfg(feature = "parquet")]
async fn import(client: &Client, path: &str, kind: &str, file: Vec<u8>) -> crate::support::Answer {
    let request = client.request(reqwest::Method::POST, path).header("content-type", kind);
    client.send(request.body(file)).await
}

#[cfg(feature = "parquet")]
fn samples(file: &[u8]) -> Vec<Sample> {
    let file = std::io::Cursor::new(file.to_vec());
    let rows = offbd::wire::session_file::open(file, None, &TableOptions::default()).unwrap();
    rows.map(Result::unwrap).collect()
}

#[cfg(feature = "parquet")]
#[tokio::test]
async fn an_exported_session_is_imported_with_the_same_samples_and_verdict() {
    let fixture = ServiceFixture::start().await;
    let client = &fixture.client;
    client.asset("a").await;
    let recorded = rig(3000, 1500);
    let imported = client.post_text(IMPORT, "text/csv", csv(&recorded)).await.expect(201);
    let hash = imported["session"]["verdict"]["verdict_hash"].as_str().unwrap();
    let id = imported["session"]["id"].as_str().unwrap();
    for &format in TABLES {
        let file = export(client, id, format).await;
        assert_eq!(samples(&file), recorded, "{format}");
        let says_hash = file.windows(hash.len()).any(|part| part == hash.as_bytes());
        assert!(says_hash, "{format}: no verdict hash");
        client.asset(format.suffix()).await;
        let path = IMPORT.replace("assets/a/", &format!("assets/{}/", format.suffix()));
        let again = import(client, &path, format.media_type(), file).await.expect(201);
        assert_eq!(again["accepted"], 3000, "{format}");
        assert_eq!(again["session"]["verdict"]["verdict_hash"], hash, "{format}");
    }
}

#[cfg(feature = "parquet")]
#[tokio::test]
async fn a_stretch_of_a_session_and_an_empty_session_are_exported() {
    let fixture = ServiceFixture::start().await;
    let client = &fixture.client;
    client.asset("a").await;
    let empty = client.post("assets/a/sessions", &serde_json::json!({})).await.expect(201);
    let empty = empty["id"].as_str().unwrap();
    let recorded = rig(500, 500);
    let imported = client.post_text(IMPORT, "text/csv", csv(&recorded)).await.expect(201);
    let id = imported["session"]["id"].as_str().unwrap();
    for &format in TABLES {
        assert_eq!(samples(&export(client, empty, format).await), [], "{format}");
        let path = format!("sessions/{id}/telemetry?from_s={}", recorded[400].t_s);
        let request = client.request(reqwest::Method::GET, &path);
        let request = request.header("accept", format.media_type());
        let file = request.send().await.unwrap().bytes().await.unwrap();
        assert_eq!(samples(&file), recorded[400..], "{format}");
    }
}

#[cfg(feature = "parquet")]
#[tokio::test]
async fn of_a_file_that_is_damaged_or_ends_too_early_nothing_is_kept() {
    let fixture = ServiceFixture::start().await;
    let client = &fixture.client;
    client.asset("a").await;
    let recorded = rig(20_000, 20_000);
    let imported = client.post_text(IMPORT, "text/csv", csv(&recorded)).await.expect(201);
    let id = imported["session"]["id"].as_str().unwrap();
    for &format in TABLES {
        let file = export(client, id, format).await;
        // Behind the first rows, so that some have been taken when the damage is found.
        let part = file[..file.len() * 3 / 4].to_vec();
        let path = IMPORT.replace("name=s", "name=cut");
        let problem = import(client, &path, format.media_type(), part).await.problem(400);
        assert!(problem["detail"].as_str().unwrap().contains("damaged"), "{problem}");
        let sessions = client.get("sessions").await.expect(200);
        assert_eq!(sessions["items"].as_array().unwrap().len(), 1, "{format}: {sessions}");
    }
    let (text, kind) = (csv(&recorded).into_bytes(), "application/vnd.apache.parquet");
    let answer = import(client, &IMPORT.replace("name=s", "name=text"), kind, text).await;
    assert!(answer.problem(400)["detail"].as_str().unwrap().contains("Parquet"));
}

#[cfg(not(feature = "parquet"))]
#[tokio::test]
async fn a_build_without_a_format_says_how_to_get_it() {
    let fixture = ServiceFixture::start().await;
    let client = &fixture.client;
    client.asset("a").await;
    let imported =
        client.post_text(IMPORT, "text/csv", csv(&crate::support::rig(50, 50))).await.expect(201);
    let id = imported["session"]["id"].as_str().unwrap();
    for format in [SessionFormat::Parquet, SessionFormat::Arrow] {
        let request = client.request(reqwest::Method::GET, &format!("sessions/{id}/telemetry"));
        let answer = client.send(request.header("accept", format.media_type())).await;
        assert!(answer.problem(406)["detail"].as_str().unwrap().contains("--features parquet"));
        let answer = client.post_text(IMPORT, format.media_type(), "").await;
        assert!(answer.problem(415)["detail"].as_str().unwrap().contains("--features parquet"));
    }
    let cli = CliFixture::new();
    cli.write("session.csv", &csv(&[]));
    let refused = cli.run(2, "export session.csv -o session.parquet");
    assert!(refused.stderr.contains("--features parquet"), "{}", refused.stderr);
}

#[test]
fn a_session_file_is_written_in_another_format_whole_or_not_at_all() {
    let cli = CliFixture::new();
    cli.ok("simulate --seed 2 --seconds 20 --fault x_servo:dead@5 -o sick.csv");
    let before = cli.read("sick.csv");
    cli.ok("export sick.csv -o copy.csv");
    assert_eq!(cli.read("copy.csv"), before);
    let json = cli.ok("export sick.csv --format json -o -").json();
    assert_eq!(json[0]["session"], "sick.csv");
    assert_eq!(json[0]["samples"].as_array().unwrap().len(), before.lines().count() - 1);
    let hash = |file: &str| {
        let replayed = cli.ok(&format!("replay --format json {file}"));
        replayed.summaries()[0]["verdict_hash"].clone()
    };
    for format in SessionFormat::WRITTEN.iter().filter(|f| f.check().is_ok()) {
        if *format == SessionFormat::Json {
            continue;
        }
        let file = format!("copy.{}", format.suffix());
        cli.ok(&format!("export sick.csv -o {file}"));
        assert_eq!(hash(&file), hash("sick.csv"), "{format}");
        cli.ok(&format!("export {file} -o back.csv"));
        assert_eq!(cli.read("back.csv"), before, "{format}");
    }
    cli.write("bad.csv", "t_s,x_m\n");
    let refused = cli.run(3, "export bad.csv -o new.csv");
    assert!(refused.stderr.contains("cmd_qx_rad"), "{}", refused.stderr);
    cli.run(2, "export sick.csv -o new.xyz");
    let files = std::fs::read_dir(cli.path(".")).unwrap();
    let left: Vec<_> = files.map(|file| file.unwrap().file_name()).collect();
    let is_new = |name: &&std::ffi::OsString| name.to_string_lossy().contains("new");
    assert_eq!(left.iter().filter(is_new).count(), 0, "{left:?}");
}
