use serde_json::Value;

use super::fixture::CliFixture;

/// The counts of `score`, computed only from the lines of `replay` and the labels.
#[derive(Default, Debug, PartialEq)]
struct Count {
    faulty: u64,
    detected: u64,
    right: u64,
    false_alarms: u64,
    no_chance: u64,
}

fn first_confirmed(cli: &CliFixture, asset: &str, file: &str) -> Option<(String, f64)> {
    let lines = cli.ok(&format!("replay --format json --asset {asset} corpus/{file}")).json();
    let confirmed = lines.iter().find(|line| line["status"] == "confirmed")?;
    Some((confirmed["code"].as_str()?.to_owned(), confirmed["t_s"].as_f64()?))
}

fn count(cli: &CliFixture, labels: &[Value]) -> Count {
    let mut count = Count::default();
    for label in labels {
        let (file, rig) = (label["file"].as_str().unwrap(), label["rig"].as_str().unwrap());
        if file.ends_with("calibration.csv") {
            let line =
                format!("calibrate --asset corpus/{rig}/rig.json corpus/{file} -o {rig}.json");
            cli.ok(&line);
            continue;
        }
        let found = first_confirmed(cli, &format!("{rig}.json"), file);
        match (label["fault"]["onset_s"].as_f64(), found) {
            (None, found) => count.false_alarms += u64::from(found.is_some()),
            (Some(_), None) if label["fault"]["chance_s"].is_null() => count.no_chance += 1,
            (Some(_), None) => count.faulty += 1,
            (Some(onset_s), Some((_, t_s))) if t_s < onset_s => {
                count.false_alarms += 1;
                count.faulty += 1;
            }
            (Some(_), Some((code, _))) => {
                count.faulty += 1;
                count.detected += 1;
                count.right += u64::from(code == label["class"].as_str().unwrap());
            }
        }
    }
    count
}

#[test]
fn validate_the_score_of_a_small_corpus_against_an_independent_count() {
    let cli = CliFixture::new();
    cli.ok("simulate --corpus corpus --seconds 30 --seed 5");
    let labels: Vec<Value> = serde_json::from_str(&cli.read("corpus/labels.json")).unwrap();
    assert_eq!(labels.len(), 3 * (1 + 3 + 15));
    let score = &cli.ok("score corpus --format json").json()[0];
    let number = |name: &str| score[name].as_u64().unwrap();
    let scored = Count {
        faulty: number("faulty_sessions"),
        detected: number("detected"),
        right: number("isolated_right"),
        false_alarms: number("false_alarms"),
        no_chance: number("no_chance"),
    };
    assert_eq!(scored, count(&cli, &labels));
    assert!(scored.detected > 0);
    let kinds = score["by_kind"].as_object().unwrap();
    assert_eq!(kinds.values().map(|k| k["n"].as_u64().unwrap()).sum::<u64>(), scored.faulty);
}

#[test]
fn a_corpus_that_differs_from_its_labels_is_rejected() {
    let cli = CliFixture::new();
    cli.ok("simulate --corpus corpus --seconds 10");
    cli.ok("simulate --seconds 30 -o corpus/chapter/000.csv");
    let done = cli.run(3, "score corpus --no-calibration");
    assert!(done.stderr.contains("the labels count"), "{}", done.stderr);
    assert!(cli.run(3, "score nowhere").stderr.contains("labels.json"));
}

#[test]
fn the_option_list_prints_every_session() {
    let cli = CliFixture::new();
    cli.ok("simulate --corpus corpus --seconds 10");
    let done = cli.ok("score corpus --no-calibration --list");
    assert_eq!(done.stderr.lines().count(), 3 * 18);
    assert!(done.stdout.lines().all(|line| line.chars().count() <= 80));
}
