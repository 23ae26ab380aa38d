use serde_json::Value;

use super::fixture::CliFixture;

/// Writes eight sessions, every second one faulty, and returns their names in order.
fn sessions(cli: &CliFixture) -> String {
    let names: Vec<String> = (0..8).map(|i| format!("s{i}.csv")).collect();
    for (i, name) in names.iter().enumerate() {
        let fault = if i % 2 == 1 { "--fault x_servo:dead@8" } else { "" };
        cli.ok(&format!("simulate --seconds 25 --seed {} {fault} -o {name}", i + 10));
    }
    names.join(" ")
}

fn keys(object: &Value) -> Vec<&str> {
    object.as_object().unwrap().keys().map(String::as_str).collect()
}

#[test]
fn json_lines_have_the_keys_of_the_contract() {
    let cli = CliFixture::new();
    cli.calibrated().ok("simulate --seconds 30 --fault x_servo:dead@10 --seed 2 -o sick.csv");
    let lines = cli.ok("replay --asset calibrated.json --format json sick.csv").json();
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
    assert_eq!(summary["samples"].as_u64(), Some(cli.read("sick.csv").lines().count() as u64 - 1));
    assert_eq!(summary["rejected"], 0);
    assert_eq!(summary["verdict_hash"].as_str().unwrap().len(), 64);
}

#[test]
fn the_output_does_not_depend_on_the_number_of_threads() {
    let cli = CliFixture::new();
    let names = sessions(cli.calibrated());
    let on = |jobs: u16| {
        let line = format!("replay --asset calibrated.json --format json --jobs {jobs} {names}");
        cli.ok(&line).stdout
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
fn late_and_duplicate_rows_do_not_change_the_verdict() {
    let cli = CliFixture::new();
    let fault = "simulate --seconds 25 --seed 3 --fault y_servo:dead@8 --seq";
    cli.calibrated().ok(&format!("{fault} -o plain.csv"));
    cli.ok(&format!("{fault} --late 0.2 --duplicates 0.2 --late-window-s 0.05 -o disturbed.csv"));
    assert_ne!(cli.read("plain.csv"), cli.read("disturbed.csv"));
    let done = cli.ok("replay --asset calibrated.json --format json plain.csv disturbed.csv");
    let summaries = done.summaries();
    assert_eq!(summaries[0]["verdict_hash"], summaries[1]["verdict_hash"]);
    assert_eq!(summaries[0]["faults"], serde_json::json!(["y_servo"]));
    assert_eq!(summaries[0]["samples"], summaries[1]["samples"]);
}

#[test]
fn invalid_rows_are_reported_and_counted_and_the_rest_is_judged() {
    let cli = CliFixture::new();
    cli.ok("simulate --seconds 5 -o good.csv");
    let mut lines: Vec<String> = cli.read("good.csv").lines().map(str::to_owned).collect();
    lines[10] = "0.09,0,0,abc,0".to_owned();
    lines[20] = "0.19,0,0,1e300,0".to_owned();
    lines[30] = "nonsense".to_owned();
    cli.write("bad.csv", &lines.join("\n"));
    let done = cli.ok("replay --format json bad.csv");
    for line in ["line 11", "line 21", "line 31"] {
        assert!(done.stderr.contains(&format!("bad.csv: {line}: ")), "{}", done.stderr);
    }
    let summary = &done.summaries()[0];
    assert_eq!((&summary["rejected"], &summary["samples"]), (&3.into(), &(lines.len() - 4).into()));
}

#[test]
fn only_the_first_invalid_rows_are_reported_and_the_rest_is_counted() {
    let cli = CliFixture::new();
    cli.ok("simulate --seconds 5 -o good.csv");
    let bad = "0,0,0,abc,0\n".repeat(112);
    cli.write("bad.csv", &format!("{}{bad}", cli.read("good.csv")));
    let stderr = cli.ok("replay bad.csv").stderr;
    assert_eq!(stderr.lines().count(), 6, "{stderr}");
    assert!(stderr.ends_with("bad.csv: 107 more rows rejected\n"), "{stderr}");
}

#[test]
fn names_are_not_wrapped_if_stdout_is_not_a_terminal() {
    let cli = CliFixture::new();
    cli.ok("simulate --seconds 5 -o a.csv");
    let long = format!("{}.csv", "a-session-with-quite-a-long-name-".repeat(4));
    std::fs::copy(cli.path("a.csv"), cli.path(&long)).unwrap();
    let table = cli.ok(&format!("replay a.csv {long}")).stdout;
    // In the table of verdicts and in the table of judged times.
    assert_eq!(table.lines().filter(|line| line.contains(&long)).count(), 2, "{table}");
    assert_eq!(table.lines().count(), 7, "{table}");
}

/// Replays `name`; returns the codes of its warnings, and the table.
fn warnings(cli: &CliFixture, name: &str) -> (Vec<String>, String) {
    let summary = cli.ok(&format!("replay --format json {name}")).summaries().remove(0);
    let code = |w: &Value| w["code"].as_str().unwrap().to_owned();
    let codes =
        summary["warnings"].as_array().map_or_else(Vec::new, |w| w.iter().map(code).collect());
    (codes, cli.ok(&format!("replay {name}")).stdout)
}

#[test]
fn data_that_contradict_the_asset_file_do_not_give_no_fault() {
    let cli = CliFixture::new();
    cli.ok("simulate --seconds 20 -o good.csv");
    assert_eq!(warnings(&cli, "good.csv").0, [""; 0]);
    let rows = |change: &dyn Fn(&str) -> String| {
        let text = cli.read("good.csv");
        let (heading, rows) = text.split_once('\n').unwrap();
        let rows: Vec<String> = rows.lines().map(change).collect();
        cli.write("other.csv", &format!("{heading}\n{}\n", rows.join("\n")));
    };
    rows(&|row| {
        let (t_s, rest) = row.split_once(',').unwrap();
        format!("{},{rest}", 1e3 * t_s.parse::<f64>().unwrap())
    });
    let (codes, table) = warnings(&cli, "other.csv");
    assert_eq!(codes, ["rate"]);
    assert!(table.contains("not judged") && table.contains("is t_s in ms?"), "{table}");
    rows(&|row| row.split(',').take(3).chain(["1", "1"]).collect::<Vec<_>>().join(","));
    let (codes, table) = warnings(&cli, "other.csv");
    assert_eq!(codes, ["positions"]);
    assert!(table.contains("100 % of the positions lie outside the plate"), "{table}");
    cli.ok("simulate --seconds 2 -o short.csv");
    let (codes, table) = warnings(&cli, "short.csv");
    assert_eq!(codes, ["short"]);
    assert!(table.contains("not judged") && !table.contains("no fault"), "{table}");
}

#[test]
fn an_unusable_file_does_not_prevent_judging_the_others() {
    let cli = CliFixture::new();
    cli.ok("simulate --seconds 3 -o a.csv");
    cli.ok("simulate --seconds 3 -o c.csv");
    let done = cli.run(3, "replay --format json a.csv b.csv c.csv");
    assert!(done.stderr.contains("b.csv"));
    let judged: Vec<Value> = done.summaries().iter().map(|s| s["session"].clone()).collect();
    assert_eq!(judged, ["a.csv", "c.csv"]);
}

#[test]
fn the_table_of_verdicts_fits_in_eighty_columns() {
    let cli = CliFixture::new();
    let names = sessions(cli.calibrated());
    let done = cli.ok(&format!("replay --asset calibrated.json {names}"));
    assert!(done.stdout.lines().all(|line| line.chars().count() <= 80), "{}", done.stdout);
    assert!(done.stdout.contains("no fault"));
    assert!(done.stdout.contains("x_servo") && done.stdout.contains(" confirmed since "));
    assert_eq!(done.stderr, "");
}

#[test]
fn two_verdicts_are_compared_transition_by_transition() {
    let cli = CliFixture::new();
    cli.calibrated().ok("simulate --seconds 30 --fault x_servo:dead@10 --seed 2 -o sick.csv");
    let mut asset: Value = serde_json::from_str(&cli.read("calibrated.json")).unwrap();
    asset["diagnostics"] = serde_json::json!({ "debounce_s": 1.1 });
    cli.write("slow.json", &asset.to_string());
    let same =
        cli.ok("replay --asset calibrated.json --against calibrated.json --format json sick.csv");
    let lines = same.json();
    let (comparison, rest) = lines.split_last().unwrap();
    let differences: Vec<&Value> = rest.iter().filter(|l| l["type"] == "difference").collect();
    let faults = rest.iter().filter(|l| l["type"] == "fault").count();
    assert!(faults >= 2 && differences.len() == faults);
    assert!(differences.iter().all(|l| l["change"] == "same" && l["moved_s"] == 0.0));
    assert_eq!((&comparison["type"], &comparison["same"]), (&"comparison".into(), &faults.into()));
    assert_eq!(comparison["verdict_hash"], comparison["against_hash"]);
    let line = "replay --asset calibrated.json --against slow.json";
    let other = cli.ok(&format!("{line} --format json sick.csv")).json();
    let pending = other.iter().find(|l| l["type"] == "difference").unwrap();
    assert_eq!((&pending["change"], &pending["code"]), (&"moved".into(), &"x_servo".into()));
    // The debounce time is half a second longer.
    let moved_s = pending["moved_s"].as_f64().unwrap();
    assert!((0.3..0.9).contains(&moved_s), "{moved_s}");
    let t_s = |key: &str| pending[key].as_f64().unwrap();
    assert!((t_s("replayed_t_s") - t_s("recorded_t_s") - moved_s).abs() < 1e-12);
    let table = cli.ok(&format!("{line} sick.csv")).stdout;
    assert!(table.lines().all(|line| line.chars().count() <= 80), "{table}");
    assert!(table.contains("moved") && table.contains("here, s"), "{table}");
    let textbook = cli.ok("replay --asset calibrated.json --against-profile textbook sick.csv");
    assert!(textbook.stdout.contains("there only"), "{}", textbook.stdout);
}

/// Returns a printed text with single spaces in place of line breaks and columns.
fn unwrapped(text: &str) -> String {
    text.split_whitespace().collect::<Vec<_>>().join(" ")
}

#[test]
fn verdicts_have_colours_only_where_they_are_wanted() {
    let cli = CliFixture::new();
    cli.calibrated().ok("simulate --seconds 30 --fault x_servo:dead@10 --seed 2 -o sick.csv");
    let line = "replay --asset calibrated.json sick.csv healthy.csv";
    let coloured = cli.with(&[("CLICOLOR_FORCE", "1")], line);
    for words in ["\u{1b}[31mx_servo (", "\u{1b}[32mno fault\u{1b}[0m"] {
        assert!(coloured.contains(words), "{coloured}");
    }
    assert!(!cli.with(&[], line).contains('\u{1b}'), "a pipe");
    let refused = [("CLICOLOR_FORCE", "1"), ("NO_COLOR", "1")];
    assert!(!cli.with(&refused, line).contains('\u{1b}'), "NO_COLOR");
}

#[test]
fn unjudged_monitors_are_reported() {
    let cli = CliFixture::new();
    cli.calibrated().ok("simulate --seconds 0.3 -o short.csv");
    cli.ok("simulate --seconds 20 -o healthy.csv");
    let short = cli.ok("replay --asset calibrated.json short.csv").stdout;
    assert!(unwrapped(&short).contains(" 0.3 not judged judged x_servo "), "{short}");
    assert!(!short.contains("no fault"), "{short}");
    let unlearnt = cli.ok("replay healthy.csv").stdout;
    let words = "no fault of sensor; not calibrated: x_servo, y_servo, stuck_ball";
    assert!(unwrapped(&unlearnt).contains(words), "{unlearnt}");
    let book = cli.ok("replay --asset calibrated.json --profile textbook healthy.csv").stdout;
    assert!(unwrapped(&book).contains("; no test in this profile: stuck_ball, sensor"), "{book}");
    let lines = cli.ok("replay --asset calibrated.json --format json healthy.csv short.csv").json();
    let summaries: Vec<&Value> = lines.iter().filter(|l| l["type"] == "summary").collect();
    assert_eq!([&summaries[0]["outcome"], &summaries[1]["outcome"]], ["no fault", "not judged"]);
    for monitor in summaries[0]["monitors"].as_array().unwrap() {
        let (seconds, share) = (&monitor["judged_s"], monitor["judged_share"].as_f64().unwrap());
        assert!((0.5..=1.0).contains(&share), "{monitor}");
        assert!((seconds.as_f64().unwrap() / 20.0 - share).abs() < 0.02, "{monitor}");
    }
}
