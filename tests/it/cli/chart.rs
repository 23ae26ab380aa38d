use serde_json::Value;

use super::fixture::CliFixture;

fn records(cli: &CliFixture, name: &str) -> Vec<Value> {
    let document: Value = serde_json::from_str(&cli.read(name)).unwrap();
    assert!(document["machine"]["cores"].as_u64() > Some(0), "{document}");
    assert_eq!(document["versions"]["offbd"], env!("CARGO_PKG_VERSION"));
    document["records"].as_array().unwrap().clone()
}

#[test]
fn the_chart_of_estimators_writes_records_and_drawings() {
    let cli = CliFixture::new();
    let done = cli.ok("chart estimators --quick -o new/charts");
    let files = ["estimators.json", "estimators.svg", "estimators.png"];
    for file in files {
        assert!(done.stderr.contains(file), "{}", done.stderr);
        assert!(cli.path("new/charts").join(file).is_file(), "{file}");
    }
    assert!(done.stdout.starts_with("estimator "), "{}", done.stdout);
    assert!(done.stdout.lines().all(|line| line.chars().count() <= 80), "{}", done.stdout);
    let drawing = cli.read("new/charts/estimators.svg");
    for text in
        ["quadratic fit", "Kalman", "delay (ms)", "rms error (m/s²)", "100 Hz, noise 0.5 mm"]
    {
        assert!(drawing.contains(text), "{text}");
    }
    let records = records(&cli, "new/charts/estimators.json");
    let own: Vec<&Value> = records.iter().filter(|r| r["offbd"] == true).collect();
    assert_eq!(own.len(), 1);
    assert_eq!(own[0]["value"], 0.5);
    // Half of the window.
    assert!((own[0]["delay_s"].as_f64().unwrap() - 0.25).abs() < 0.01, "{}", own[0]);
    assert!(records.iter().any(|r| r["front"] == true));
    assert!(records.iter().all(|r| r["cost_ns"].as_f64() > Some(0.0)));
}

#[test]
fn work_precision_includes_the_automatic_choice_and_the_records_of_peers() {
    let cli = CliFixture::new();
    let peer = r#"{"chart":"work-precision","machine":{"cpu":"c","cores":1,"features":[],"os":"o"},
        "versions":{"anvil":"1.2"},"records":[{"scene":"slope","engine":"anvil","model":"rigid",
        "method":"euler","setting":"step_s","value":0.001,"error_m":1e-4,"cpu_us_per_s":50.0,
        "spread":1.0,"note":null}]}"#;
    std::fs::write(cli.path("peers.json"), peer).unwrap();
    let line = "chart work-precision --quick --with peers.json -o charts";
    let done = cli.ok(&format!("{line} --format json"));
    assert!(done.stderr.contains("work-precision.svg"), "{}", done.stderr);
    assert!(cli.read("charts/work-precision.svg").contains("anvil"));
    let records = records(&cli, "charts/work-precision.json");
    assert_eq!(done.json(), records, "what is printed and what is written");
    assert!(records.iter().any(|r| r["engine"] == "anvil"));
    let own: Vec<&Value> = records.iter().filter(|r| r["engine"] == "offbd").collect();
    assert!(own.iter().any(|r| r["front"] == true));
    let chosen: Vec<&Value> = own.iter().copied().filter(|r| r["asked_m"].is_number()).collect();
    assert_eq!(chosen.len(), 5);
    for record in chosen {
        assert!(record["error_m"].as_f64() <= record["asked_m"].as_f64(), "{record}");
    }
}

#[test]
fn detectors_are_compared_on_healthy_and_faulty_sessions() {
    let cli = CliFixture::new();
    let done = cli.ok("chart detectors --quick -o charts");
    assert!(done.stdout.starts_with("method "), "{}", done.stdout);
    assert!(done.stdout.lines().all(|line| line.chars().count() <= 80), "{}", done.stdout);
    let drawing = cli.read("charts/detectors.svg");
    for text in ["s rule", "offbd, weighed", "CUSUM", "false alarms per hour", "0.01 m/s²"] {
        assert!(drawing.contains(text), "{text}");
    }
    assert!(cli.read("charts/detectors-faults.svg").contains("servo dead"));
    let records = records(&cli, "charts/detectors.json");
    let of = |what: &str| -> Vec<&Value> { records.iter().filter(|r| r["of"] == what).collect() };
    // A higher threshold gives fewer false alarms and fewer detections.
    let sweep = of("method");
    for pair in sweep.windows(2).filter(|p| p[0]["method"] == p[1]["method"]) {
        let at = |i: usize, key: &str| pair[i][key].as_u64().unwrap();
        // A CUSUM that restarts after each alarm does not detect monotonically; the verdict
        // has no threshold.
        if pair[0]["unit"] == "nats" || pair[0]["unit"] == "m/s²" {
            assert!(at(0, "false_alarms") >= at(1, "false_alarms"), "{pair:?}");
            assert!(at(0, "n_detected") >= at(1, "n_detected"), "{pair:?}");
        }
    }
    // Every method finds a dead servo; only offbd finds a stuck ball.
    let right = |method: &str, fault: &str| {
        let all = of("fault");
        let kind = all.iter().find(|k| k["method"] == method && k["fault"] == fault);
        kind.map(|k| (k["n_right"].as_u64(), k["n_faults"].as_u64()))
    };
    let (found, chances) = right("offbd, verdict", "x_servo:dead").unwrap();
    assert!(chances > Some(0) && found == chances);
    assert_eq!(right("debounced residual", "stuck_ball:glued").unwrap().0, Some(0));
    let costs = of("cost");
    assert_eq!(costs[0]["ratio"], 1.0);
    assert!(costs.iter().all(|c| c["cost_ns"].as_f64() > Some(0.0)));
}

#[test]
fn a_file_without_records_is_named() {
    let cli = CliFixture::new();
    std::fs::write(cli.path("peers.json"), "{}").unwrap();
    let done = cli.run(3, "chart work-precision --quick --with peers.json");
    assert!(done.stderr.contains("peers.json"), "{}", done.stderr);
}
