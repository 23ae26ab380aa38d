use serde_json::Value;

use super::bench::Bench;

/// Eight sessions, some faulty; their names in order.
fn sessions(bench: &Bench) -> String {
    let names: Vec<String> = (0..8).map(|i| format!("s{i}.csv")).collect();
    for (i, name) in names.iter().enumerate() {
        let fault = if i % 2 == 1 { "--fault x_servo:dead@8" } else { "" };
        bench.ok(&format!("simulate --seconds 25 --seed {} {fault} -o {name}", i + 10));
    }
    names.join(" ")
}

fn keys(object: &Value) -> Vec<&str> {
    object.as_object().unwrap().keys().map(String::as_str).collect()
}

#[test]
fn json_lines_have_the_shape_of_the_contract() {
    let bench = Bench::new();
    bench.calibrated().ok("simulate --seconds 30 --fault x_servo:dead@10 --seed 2 -o sick.csv");
    let lines = bench.ok("replay --asset learnt.json --format json sick.csv").json();
    let (summary, faults) = lines.split_last().unwrap();
    for fault in faults {
        for key in [
            "type",
            "session",
            "t_s",
            "code",
            "kind",
            "status",
            "status_byte",
            "onset_s",
            "axis",
            "command",
            "candidates",
            "evidence",
        ] {
            assert!(keys(fault).contains(&key), "no {key} in {fault}");
        }
        assert_eq!((&fault["type"], &fault["session"]), (&"fault".into(), &"sick.csv".into()));
    }
    let confirmed = faults.iter().find(|f| f["status"] == "confirmed").unwrap();
    assert_eq!(
        ["code", "axis", "command", "status_byte"].map(|k| confirmed[k].as_str().unwrap()),
        ["x_servo", "x", "qy", "2F"]
    );
    assert!((10.0..16.0).contains(&confirmed["t_s"].as_f64().unwrap()));
    assert_eq!(summary["faults"], serde_json::json!(["x_servo"]));
    assert_eq!(
        summary["samples"].as_u64(),
        Some(bench.read("sick.csv").lines().count() as u64 - 1)
    );
    assert_eq!(summary["rejected"], 0);
    assert_eq!(summary["verdict_hash"].as_str().unwrap().len(), 64);
}

#[test]
fn the_verdict_is_the_same_to_the_byte_on_any_number_of_threads() {
    let bench = Bench::new();
    let names = sessions(bench.calibrated());
    let on = |jobs: u16| {
        let line = format!("replay --asset learnt.json --format json --jobs {jobs} {names}");
        bench.ok(&line).stdout
    };
    let one = on(1);
    assert_eq!(one, on(4));
    assert_eq!(one, on(1));
    let order: Vec<&str> = one
        .lines()
        .filter(|l| l.contains(r#""type":"summary""#))
        .map(|l| l.split(r#""session":""#).nth(1).unwrap().split('"').next().unwrap())
        .collect();
    assert_eq!(order.join(" "), names);
}

#[test]
fn a_bad_line_to_the_service_does_not_change_the_verdict() {
    let bench = Bench::new();
    let fault = "simulate --seconds 25 --seed 3 --fault y_servo:dead@8 --seq";
    bench.calibrated().ok(&format!("{fault} -o plain.csv"));
    bench.ok(&format!("{fault} --late 0.2 --duplicates 0.2 --late-window-s 0.05 -o bad-line.csv"));
    assert_ne!(bench.read("plain.csv"), bench.read("bad-line.csv"));
    let done = bench.ok("replay --asset learnt.json --format json plain.csv bad-line.csv");
    let summaries = done.summaries();
    assert_eq!(summaries[0]["verdict_hash"], summaries[1]["verdict_hash"]);
    assert_eq!(summaries[0]["faults"], serde_json::json!(["y_servo"]));
    assert_eq!(summaries[0]["samples"], summaries[1]["samples"]);
}

#[test]
fn bad_rows_are_named_and_counted_and_the_rest_is_judged() {
    let bench = Bench::new();
    bench.ok("simulate --seconds 5 -o good.csv");
    let mut lines: Vec<String> = bench.read("good.csv").lines().map(str::to_owned).collect();
    lines[10] = "0.09,0,0,abc,0".to_owned();
    lines[20] = "0.19,0,0,1e300,0".to_owned();
    lines[30] = "nonsense".to_owned();
    bench.write("bad.csv", &lines.join("\n"));
    let done = bench.ok("replay --format json bad.csv");
    for line in ["line 11", "line 21", "line 31"] {
        assert!(done.stderr.contains(&format!("bad.csv: {line}: ")), "{}", done.stderr);
    }
    let summary = &done.summaries()[0];
    assert_eq!((&summary["rejected"], &summary["samples"]), (&3.into(), &(lines.len() - 4).into()));
}

#[test]
fn of_many_bad_rows_the_first_few_are_named_and_the_rest_is_counted() {
    let bench = Bench::new();
    bench.ok("simulate --seconds 5 -o good.csv");
    let bad = "0,0,0,abc,0\n".repeat(112);
    bench.write("bad.csv", &format!("{}{bad}", bench.read("good.csv")));
    let told = bench.ok("replay bad.csv").stderr;
    assert_eq!(told.lines().count(), 6, "{told}");
    assert!(told.ends_with("bad.csv: 107 more rows rejected\n"), "{told}");
}

#[test]
fn names_are_never_broken_where_stdout_is_no_terminal() {
    let bench = Bench::new();
    bench.ok("simulate --seconds 5 -o a.csv");
    let long = format!("{}.csv", "a-session-with-quite-a-long-name-".repeat(4));
    std::fs::copy(bench.path("a.csv"), bench.path(&long)).unwrap();
    let table = bench.ok(&format!("replay a.csv {long}")).stdout;
    // In the table of verdicts, and in that of what was judged.
    assert_eq!(table.lines().filter(|line| line.contains(&long)).count(), 2, "{table}");
    assert_eq!(table.lines().count(), 7, "{table}");
}

/// What was found of `name`: the codes of its warnings, and the text.
fn warned(bench: &Bench, name: &str) -> (Vec<String>, String) {
    let summary = bench.ok(&format!("replay --format json {name}")).summaries().remove(0);
    let code = |w: &Value| w["code"].as_str().unwrap().to_owned();
    let codes =
        summary["warnings"].as_array().map_or_else(Vec::new, |w| w.iter().map(code).collect());
    (codes, bench.ok(&format!("replay {name}")).stdout)
}

#[test]
fn data_of_another_rig_is_not_judged_to_have_no_fault() {
    let bench = Bench::new();
    bench.ok("simulate --seconds 20 -o good.csv");
    assert_eq!(warned(&bench, "good.csv").0, [""; 0]);
    let rows = |change: &dyn Fn(&str) -> String| {
        let text = bench.read("good.csv");
        let (heading, rows) = text.split_once('\n').unwrap();
        let rows: Vec<String> = rows.lines().map(change).collect();
        bench.write("other.csv", &format!("{heading}\n{}\n", rows.join("\n")));
    };
    rows(&|row| {
        let (t_s, rest) = row.split_once(',').unwrap();
        format!("{},{rest}", 1e3 * t_s.parse::<f64>().unwrap())
    });
    let (codes, table) = warned(&bench, "other.csv");
    assert_eq!(codes, ["rate"]);
    assert!(table.contains("not judged") && table.contains("is t_s in ms?"), "{table}");
    rows(&|row| row.split(',').take(3).chain(["1", "1"]).collect::<Vec<_>>().join(","));
    let (codes, table) = warned(&bench, "other.csv");
    assert_eq!(codes, ["positions"]);
    assert!(table.contains("100 % of the positions lie outside the plate"), "{table}");
    bench.ok("simulate --seconds 2 -o short.csv");
    let (codes, table) = warned(&bench, "short.csv");
    assert_eq!(codes, ["short"]);
    assert!(table.contains("not judged") && !table.contains("no fault"), "{table}");
}

#[test]
fn one_unusable_file_does_not_keep_the_others_from_being_judged() {
    let bench = Bench::new();
    bench.ok("simulate --seconds 3 -o a.csv");
    bench.ok("simulate --seconds 3 -o c.csv");
    let done = bench.run(3, "replay --format json a.csv b.csv c.csv");
    assert!(done.stderr.contains("b.csv"));
    let judged: Vec<Value> = done.summaries().iter().map(|s| s["session"].clone()).collect();
    assert_eq!(judged, ["a.csv", "c.csv"]);
}

#[test]
fn the_table_says_it_in_words_within_eighty_columns() {
    let bench = Bench::new();
    let names = sessions(bench.calibrated());
    let done = bench.ok(&format!("replay --asset learnt.json {names}"));
    assert!(done.stdout.lines().all(|line| line.chars().count() <= 80), "{}", done.stdout);
    assert!(done.stdout.contains("no fault"));
    assert!(done.stdout.contains("x_servo") && done.stdout.contains(" confirmed since "));
    assert_eq!(done.stderr, "");
}

#[test]
fn two_verdicts_are_compared_transition_by_transition() {
    let bench = Bench::new();
    bench.calibrated().ok("simulate --seconds 30 --fault x_servo:dead@10 --seed 2 -o sick.csv");
    let patient = bench.read("learnt.json");
    let mut asset: Value = serde_json::from_str(&patient).unwrap();
    asset["diagnostics"] = serde_json::json!({ "debounce_s": 1.1 });
    bench.write("patient.json", &asset.to_string());
    let same = bench.ok("replay --asset learnt.json --against learnt.json --format json sick.csv");
    let lines = same.json();
    let (comparison, rest) = lines.split_last().unwrap();
    let differences: Vec<&Value> = rest.iter().filter(|l| l["type"] == "difference").collect();
    let faults = rest.iter().filter(|l| l["type"] == "fault").count();
    assert!(faults >= 2 && differences.len() == faults);
    assert!(differences.iter().all(|l| l["change"] == "same" && l["moved_s"] == 0.0));
    assert_eq!((&comparison["type"], &comparison["same"]), (&"comparison".into(), &faults.into()));
    assert_eq!(comparison["verdict_hash"], comparison["against_hash"]);
    let line = "replay --asset learnt.json --against patient.json";
    let other = bench.ok(&format!("{line} --format json sick.csv")).json();
    let pending = other.iter().find(|l| l["type"] == "difference").unwrap();
    assert_eq!((&pending["change"], &pending["code"]), (&"moved".into(), &"x_servo".into()));
    // The debounce before a failure is half a second longer.
    let moved_s = pending["moved_s"].as_f64().unwrap();
    assert!((0.3..0.9).contains(&moved_s), "{moved_s}");
    let t_s = |key: &str| pending[key].as_f64().unwrap();
    assert!((t_s("replayed_t_s") - t_s("recorded_t_s") - moved_s).abs() < 1e-12);
    let table = bench.ok(&format!("{line} sick.csv")).stdout;
    assert!(table.lines().all(|line| line.chars().count() <= 80), "{table}");
    assert!(table.contains("moved") && table.contains("here, s"), "{table}");
    let textbook = bench.ok("replay --asset learnt.json --against-profile textbook sick.csv");
    assert!(textbook.stdout.contains("there only"), "{}", textbook.stdout);
}

/// All words of what a command printed, one blank between two.
fn unwrapped(text: &str) -> String {
    text.split_whitespace().collect::<Vec<_>>().join(" ")
}

#[test]
fn what_was_not_judged_is_said() {
    let bench = Bench::new();
    bench.calibrated().ok("simulate --seconds 0.3 -o moment.csv");
    bench.ok("simulate --seconds 20 -o healthy.csv");
    let moment = bench.ok("replay --asset learnt.json moment.csv").stdout;
    assert!(unwrapped(&moment).contains(" 0.3 not judged judged x_servo "), "{moment}");
    assert!(!moment.contains("no fault"), "{moment}");
    let unlearnt = bench.ok("replay healthy.csv").stdout;
    let words = "no fault of sensor; not learnt: x_servo, y_servo, stuck_ball";
    assert!(unwrapped(&unlearnt).contains(words), "{unlearnt}");
    let lines = bench.ok("replay --asset learnt.json --format json healthy.csv moment.csv").json();
    let summaries: Vec<&Value> = lines.iter().filter(|l| l["type"] == "summary").collect();
    assert_eq!([&summaries[0]["outcome"], &summaries[1]["outcome"]], ["no fault", "not judged"]);
    for monitor in summaries[0]["monitors"].as_array().unwrap() {
        let (seconds, share) = (&monitor["judged_s"], monitor["judged_share"].as_f64().unwrap());
        assert!((0.5..=1.0).contains(&share), "{monitor}");
        assert!((seconds.as_f64().unwrap() / 20.0 - share).abs() < 0.02, "{monitor}");
    }
}
