use serde_json::Value;

use super::fixture::CliFixture;

const HEADER: &str = "t_s,cmd_qx_rad,cmd_qy_rad,x_m,y_m";

#[test]
fn equal_seeds_give_equal_bytes() {
    let cli = CliFixture::new();
    let noisy = "simulate --seconds 5 --pushes 20 --late 0.1 --fault sensor:spikes@2 --seed";
    let first = cli.ok(&format!("{noisy} 1")).stdout;
    assert_eq!(first, cli.ok(&format!("{noisy} 1")).stdout);
    assert_ne!(first, cli.ok(&format!("{noisy} 2")).stdout);
}

#[test]
fn a_session_has_the_columns_of_the_contract() {
    let cli = CliFixture::new();
    let plain = cli.ok("simulate --seconds 2").stdout;
    assert_eq!(plain.lines().next(), Some(HEADER));
    assert!((200..=202).contains(&plain.lines().count()));
    let numbered = cli.ok("simulate --seconds 2 --seq").stdout;
    assert_eq!(numbered.lines().next(), Some(format!("seq,{HEADER}").as_str()));
    assert!(numbered.lines().nth(1).unwrap().starts_with("1,0,"));
}

#[test]
fn the_rate_and_the_plate_come_from_the_asset_file() {
    let cli = CliFixture::new();
    cli.write("slow.json", r#"{"name":"slow","sample_rate_hz":20}"#);
    let rows = cli.ok("simulate --asset slow.json --seconds 10").stdout.lines().count() - 1;
    assert!((199..=202).contains(&rows), "{rows} rows in 10 s at 20 Hz");
    cli.write("fast.json", r#"{"name":"fast","sample_rate_hz":5000}"#);
    assert!(cli.run(3, "simulate --asset fast.json").stderr.contains("/sample_rate_hz"));
}

#[test]
fn the_truth_file_describes_the_injected_fault() {
    let cli = CliFixture::new();
    cli.ok("simulate --fault y_servo:gain=0.5@8 --seconds 30 -o s.csv --truth t.json");
    let truth: Value = serde_json::from_str(&cli.read("t.json")).unwrap();
    assert_eq!((&truth["class"], &truth["file"]), (&"y_servo".into(), &"s.csv".into()));
    let fault = &truth["fault"];
    assert_eq!((&fault["kind"], &fault["axis"]), (&"gain".into(), &"y".into()));
    assert_eq!((fault["size"].as_f64(), fault["onset_s"].as_f64()), (Some(0.5), Some(8.0)));
    assert!(fault["chance_s"].as_f64().unwrap() >= 8.0);
    assert_eq!(truth["rows"].as_u64().unwrap() as usize, cli.read("s.csv").lines().count() - 1);
}

#[test]
fn a_gap_omits_rows() {
    let cli = CliFixture::new();
    let done = cli.ok("simulate --seconds 10 --gap 4-6");
    let inside = |line: &str| {
        let t: f64 = line.split(',').next().unwrap().parse().unwrap();
        (4.0..6.0).contains(&t)
    };
    assert!(!done.stdout.lines().skip(1).any(inside));
}

/// Returns the rows of a session as numbers, `None` for an empty field.
fn columns(session: &str) -> Vec<Vec<Option<f64>>> {
    let rows = session.lines().skip(1);
    rows.map(|row| row.split(',').map(|field| field.parse().ok()).collect()).collect()
}

#[test]
fn imperfections_of_real_rigs_can_be_simulated() {
    let cli = CliFixture::new();
    let session = |line: &str| columns(&cli.ok(&format!("simulate --seconds 20 {line}")).stdout);

    let whole = session("--whole-degrees");
    let commands = whole.iter().flat_map(|row| [row[1].unwrap(), row[2].unwrap()]);
    assert!(commands.map(f64::to_degrees).all(|deg| (deg - deg.round()).abs() < 1e-3));

    let beam = session("--one-axis");
    assert!(beam.iter().all(|row| row[1].is_none() && row[4].is_none() && row[2].is_some()));

    let slow = session("--rate-hz 10");
    assert!((199..=202).contains(&slow.len()), "{} rows", slow.len());

    let held = session("--hold-rows 4 --noise-m 0.01 --missing 0");
    let n_readings = held.chunk_by(|a, b| a[3..] == b[3..]).count();
    assert!(n_readings.abs_diff(held.len() / 4) < 3, "{n_readings} readings");

    let steady = session("--dead-band-m 0.002 --reference hold");
    let repeated = steady.windows(2).filter(|w| w[0][3..] == w[1][3..]).count();
    assert!(repeated > steady.len() * 9 / 10, "{repeated} of {} repeat", steady.len());

    // The first reading is of a ball at rest, except for noise and a millimetre.
    let first = |line: &str| (session(line)[1][3].unwrap(), session(line)[1][4].unwrap());
    let (centred, off) = (first(""), first("--origin-m 0.03,-0.01"));
    assert!((off.0 - centred.0 - 0.03).abs() < 1e-3 && (off.1 - centred.1 + 0.01).abs() < 1e-3);
}

/// The integral part of the controller balances the plate: the mean command is minus the level.
#[test]
fn the_commands_balance_a_plate_that_is_off_level() {
    let cli = CliFixture::new();
    let level = "simulate --seconds 60 --reference hold --breakaway-deg 0 --level-deg -2,1.5";
    let rows = columns(&cli.ok(level).stdout);
    let mean = |column: usize| {
        let last = &rows[rows.len() - 2000..];
        last.iter().map(|row| row[column].unwrap()).sum::<f64>() / 2000.0
    };
    let (qx_deg, qy_deg) = (mean(1).to_degrees(), mean(2).to_degrees());
    // The gain of the y servo is 0.96; play causes an error of a twentieth of a degree.
    assert!((qy_deg - 2.0).abs() < 0.1 && (qx_deg + 1.5 / 0.96).abs() < 0.1, "{qx_deg} {qy_deg}");
}

#[test]
fn a_randomly_drawn_rig_depends_only_on_its_seed() {
    let cli = CliFixture::new();
    let session = |line: &str| cli.ok(&format!("simulate --seconds 5 {line}")).stdout;
    assert_eq!(session("--rig-seed 7 --rig a.json"), session("--rig-seed 7 --rig b.json"));
    assert_eq!(cli.read("a.json"), cli.read("b.json"));
    assert_ne!(session("--rig-seed 7"), session("--rig-seed 8 --rig c.json"));
    assert_ne!(cli.read("a.json"), cli.read("c.json"));
    assert_ne!(session("--level-sd-deg 1"), session(""));
    assert_eq!(session("--level-sd-deg 0"), session(""));
}

#[test]
fn a_number_out_of_range_is_rejected_with_its_option() {
    let cli = CliFixture::new();
    for (line, range) in [
        ("--level-deg 12", "-10 to 10"),
        ("--level-deg 1,NaN", "-10 to 10"),
        ("--level-sd-deg -1", "0 to 5"),
        ("--gain 0,1", "0.05 to 5"),
        ("--breakaway-deg 11", "0 to 10"),
        ("--rate-hz 1001", "1 to 1000"),
        ("--noise-m -0.1", "0 to 1"),
        ("--quantum-m 5e-324", "1e-9 to 1"),
        ("--dead-band-m 2", "0 to 1"),
        ("--origin-m 0.1,7", "-1 to 1"),
        ("--refresh-hz -5", "0.1 to 10000"),
        ("--hold-rows 0", "1..=1000"),
        ("--missing 1.5", "0 to 1"),
        ("--pushes inf", "0 to 600"),
        ("--late-window-s 61", "0 to 60"),
    ] {
        let stderr = cli.run(2, &format!("simulate {line}")).stderr;
        let option = line.split(' ').next().unwrap();
        assert!(stderr.contains(option) && stderr.contains(range), "{line}: {stderr}");
    }
}

#[test]
fn incompatible_options_are_rejected() {
    let cli = CliFixture::new();
    for line in [
        "--rig-seed 1 --preset touch",
        "--hold-rows 2 --refresh-hz 10",
        "--corpus c --level-deg 1",
        "--one-axis --fault y_servo:dead@3",
        "--one-axis --fault sensor:freeze_axis=y@3",
    ] {
        let stderr = cli.run(2, &format!("simulate {line}")).stderr;
        assert!(
            line.split(' ').any(|word| word.starts_with("--") && stderr.contains(word)),
            "{stderr}"
        );
    }
    cli.ok("simulate --one-axis --seconds 5 --fault x_servo:dead@3");
}
