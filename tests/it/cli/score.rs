use serde_json::Value;

use super::bench::Bench;

/// Counts what `score` counts, from `replay`'s lines and the labels alone.
#[derive(Default, Debug, PartialEq)]
struct Count {
    faulty: u64,
    detected: u64,
    right: u64,
    false_alarms: u64,
    no_chance: u64,
}

fn first_confirmed(bench: &Bench, asset: &str, file: &str) -> Option<(String, f64)> {
    let lines = bench.ok(&format!("replay --format json --asset {asset} corpus/{file}")).json();
    let confirmed = lines.iter().find(|line| line["status"] == "confirmed")?;
    Some((confirmed["code"].as_str()?.to_owned(), confirmed["t_s"].as_f64()?))
}

fn count(bench: &Bench, labels: &[Value]) -> Count {
    let mut count = Count::default();
    for label in labels {
        let (file, rig) = (label["file"].as_str().unwrap(), label["rig"].as_str().unwrap());
        if file.ends_with("calibration.csv") {
            let line =
                format!("calibrate --asset corpus/{rig}/rig.json corpus/{file} -o {rig}.json");
            bench.ok(&line);
            continue;
        }
        let found = first_confirmed(bench, &format!("{rig}.json"), file);
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
fn validate_the_score_of_a_small_corpus_against_a_count_by_hand() {
    let bench = Bench::new();
    bench.ok("simulate --corpus corpus --seconds 30 --seed 5");
    let labels: Vec<Value> = serde_json::from_str(&bench.read("corpus/labels.json")).unwrap();
    assert_eq!(labels.len(), 3 * (1 + 3 + 15));
    let score = &bench.ok("score corpus --format json").json()[0];
    let number = |name: &str| score[name].as_u64().unwrap();
    let scored = Count {
        faulty: number("faulty_sessions"),
        detected: number("detected"),
        right: number("isolated_right"),
        false_alarms: number("false_alarms"),
        no_chance: number("no_chance"),
    };
    assert_eq!(scored, count(&bench, &labels));
    assert!(scored.detected > 0);
    let kinds = score["by_kind"].as_object().unwrap();
    assert_eq!(kinds.values().map(|k| k["n"].as_u64().unwrap()).sum::<u64>(), scored.faulty);
}

#[test]
fn a_corpus_that_is_not_the_labelled_one_is_refused() {
    let bench = Bench::new();
    bench.ok("simulate --corpus corpus --seconds 10");
    bench.ok("simulate --seconds 30 -o corpus/chapter/000.csv");
    let done = bench.run(3, "score corpus --no-calibration");
    assert!(done.stderr.contains("the labels count"), "{}", done.stderr);
    assert!(bench.run(3, "score nowhere").stderr.contains("labels.json"));
}

#[test]
fn every_session_is_listed_on_request() {
    let bench = Bench::new();
    bench.ok("simulate --corpus corpus --seconds 10");
    let done = bench.ok("score corpus --no-calibration --list");
    assert_eq!(done.stderr.lines().count(), 3 * 18);
    assert!(done.stdout.lines().all(|line| line.chars().count() <= 80));
}
