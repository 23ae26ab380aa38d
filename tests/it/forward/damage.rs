//! A spool with a bit that has changed on the disk.

use std::path::{Path, PathBuf};

use serde_json::{Value, json};

use super::set_aside::{listed, run};
use super::{Agent, nowhere};
use crate::support::{ServiceFixture, rig};

/// The file of the spool that holds `text`, and where.
fn found(folder: &Path, text: &[u8]) -> (PathBuf, usize) {
    let files = std::fs::read_dir(folder).unwrap().map(|file| file.unwrap().path());
    let mut places = files.filter_map(|file| {
        let bytes = std::fs::read(&file).unwrap();
        let at = bytes.windows(text.len()).position(|part| part == text)?;
        Some((file, at))
    });
    places.next().expect("the spool holds the text")
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_batch_with_a_changed_bit_is_set_aside_and_the_rest_is_sent() {
    let directory = tempfile::tempdir().unwrap();
    let spool = directory.path().join("spool");
    let samples = rig(60, usize::MAX);
    let parts: Vec<_> = samples.chunks(10).collect();
    let agent = Agent::start(&spool, &nowhere(), &[]);
    for part in &parts {
        agent.client.telemetry("a", Some("s"), part).await;
    }
    drop(agent);
    // In the middle, and in what was written last.
    for damaged in [2, 5] {
        let text = json!(parts[damaged][3].t_s).to_string();
        let (file, at) = found(directory.path(), format!("\"t_s\":{text},").as_bytes());
        let mut bytes = std::fs::read(&file).unwrap();
        // A digit becomes another one.
        bytes[at + 6] ^= 1;
        std::fs::write(&file, bytes).unwrap();
    }
    let fixture = ServiceFixture::start().await;
    fixture.client.asset("a").await;
    let to = format!("http://{}", fixture.client.address);
    let agent = Agent::start(&spool, &to, &[]);
    let refused = agent.drained().await["refused"].clone();
    let refused = refused.as_array().unwrap();
    assert_eq!(refused.len(), 2, "{refused:?}");
    for batch in refused {
        assert_eq!(batch["asset"], "a");
        assert!(batch["reason"].as_str().unwrap().contains("checksum"), "{batch}");
    }
    assert_eq!(agent.logged("a batch is damaged and set aside", 2).await.len(), 2);
    let intact = [&samples[..20], &samples[30..50]].concat();
    assert_eq!(fixture.client.recording("a", "s").await, intact);
    drop(agent);

    // What is damaged is not sent, but can be removed.
    let id = refused[0]["id"].to_string();
    let told = run(&spool, &["send-again", &id]);
    assert_eq!(told.status.code(), Some(2));
    assert!(String::from_utf8(told.stderr).unwrap().contains("damaged"));
    assert!(run(&spool, &["send-again", "--all"]).status.success());
    assert_eq!(listed(&spool), *refused);
    assert!(run(&spool, &["remove", "--all"]).status.success());
    assert_eq!(listed(&spool), [] as [Value; 0]);
}
