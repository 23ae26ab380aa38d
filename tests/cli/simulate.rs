use serde_json::Value;

use crate::bench::Bench;

const HEADER: &str = "t_s,cmd_qx_rad,cmd_qy_rad,x_m,y_m";

#[test]
fn equal_seeds_give_equal_bytes() {
    let bench = Bench::new();
    let noisy = "simulate --seconds 5 --pushes 20 --late 0.1 --fault sensor:spikes@2 --seed";
    let first = bench.ok(&format!("{noisy} 1")).stdout;
    assert_eq!(first, bench.ok(&format!("{noisy} 1")).stdout);
    assert_ne!(first, bench.ok(&format!("{noisy} 2")).stdout);
}

#[test]
fn a_session_has_the_columns_of_the_contract() {
    let bench = Bench::new();
    let plain = bench.ok("simulate --seconds 2").stdout;
    assert_eq!(plain.lines().next(), Some(HEADER));
    assert!((200..=202).contains(&plain.lines().count()));
    let numbered = bench.ok("simulate --seconds 2 --seq").stdout;
    assert_eq!(numbered.lines().next(), Some(format!("seq,{HEADER}").as_str()));
    assert!(numbered.lines().nth(1).unwrap().starts_with("1,0,"));
}

#[test]
fn the_rate_and_the_plate_come_from_the_asset_file() {
    let bench = Bench::new();
    bench.write("slow.json", r#"{"name":"slow","sample_rate_hz":20}"#);
    let rows = bench.ok("simulate --asset slow.json --seconds 10").stdout.lines().count() - 1;
    assert!((199..=202).contains(&rows), "{rows} rows in 10 s at 20 Hz");
    bench.write("fast.json", r#"{"name":"fast","sample_rate_hz":5000}"#);
    assert!(bench.run(3, "simulate --asset fast.json").stderr.contains("/sample_rate_hz"));
}

#[test]
fn the_truth_says_what_was_injected() {
    let bench = Bench::new();
    bench.ok("simulate --fault y_servo:gain=0.5@8 --seconds 30 -o s.csv --truth t.json");
    let truth: Value = serde_json::from_str(&bench.read("t.json")).unwrap();
    assert_eq!((&truth["class"], &truth["file"]), (&"y_servo".into(), &"s.csv".into()));
    let fault = &truth["fault"];
    assert_eq!((&fault["kind"], &fault["axis"]), (&"gain".into(), &"y".into()));
    assert_eq!((fault["size"].as_f64(), fault["onset_s"].as_f64()), (Some(0.5), Some(8.0)));
    assert!(fault["chance_s"].as_f64().unwrap() >= 8.0);
    assert_eq!(truth["rows"].as_u64().unwrap() as usize, bench.read("s.csv").lines().count() - 1);
}

#[test]
fn a_gap_leaves_rows_out() {
    let bench = Bench::new();
    let done = bench.ok("simulate --seconds 10 --gap 4-6");
    let inside = |line: &str| {
        let t: f64 = line.split(',').next().unwrap().parse().unwrap();
        (4.0..6.0).contains(&t)
    };
    assert!(!done.stdout.lines().skip(1).any(inside));
}
