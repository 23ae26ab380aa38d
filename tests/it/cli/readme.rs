//! The steps of `README.md`, with simulated recordings in the layout that its asset file names.

use std::fmt::Write;

use super::fixture::CliFixture;
use crate::support::fenced::{blocks, document};

#[test]
fn the_steps_for_a_rig_of_ones_own_work_as_written() {
    let readme = document("README.md");
    let (_, steps) = readme.split_once("## Your own rig in five steps").unwrap();
    let (steps, _) = steps.split_once("\n## ").unwrap();
    let steps = blocks(steps);
    let cli = CliFixture::new();
    let asset = &steps.iter().find(|block| block.language == "json").unwrap().text;
    record(&cli, asset);
    cli.write("rig.json", asset);

    let (mut printed, mut done) = (String::new(), Vec::new());
    let lines = steps.iter().filter(|block| block.language == "sh");
    for line in lines.flat_map(|block| block.text.lines()) {
        // The fifth step streams a real rig.
        let Some(arguments) = line.strip_prefix("offbd ").filter(|line| !line.ends_with('&'))
        else {
            break;
        };
        printed += &cli.ok(arguments).stdout;
        done.push(arguments.split(' ').next().unwrap());
    }
    assert_eq!(done, ["inspect", "calibrate", "replay"]);
    let asset: serde_json::Value = serde_json::from_str(asset).unwrap();
    let columns = asset["columns"].as_str().unwrap();
    assert!(printed.contains(columns), "`inspect` proposes other columns\n{printed}");
    // Its kind is only probable so soon after the onset.
    assert!(printed.contains("x_servo (probably dead, "), "{printed}");
}

/// Writes the recordings of the steps: the x servo dies on Tuesday.
fn record(cli: &CliFixture, asset: &str) {
    cli.write("described.json", asset);
    for (name, motion) in [
        ("healthy.csv", "--reference lissajous --seconds 90 --seed 7"),
        ("monday.csv", "--seed 8"),
        ("tuesday.csv", "--seed 9 --fault x_servo:dead@20"),
    ] {
        cli.ok(&format!("simulate --asset described.json {motion} -o session.csv"));
        cli.write(name, &in_other_units(&cli.read("session.csv")));
    }
    cli.write("log.csv", &cli.read("healthy.csv"));
}

/// A session file in milliseconds, degrees and millimetres, with the names of some logger.
fn in_other_units(session: &str) -> String {
    let mut lines = session.lines();
    assert_eq!(lines.next(), Some("t_s,cmd_qx_rad,cmd_qy_rad,x_m,y_m"));
    let factors = [1e3, 180.0 / std::f64::consts::PI, 180.0 / std::f64::consts::PI, 1e3, 1e3];
    let mut text = "time,servo_1,servo_2,x,y\n".to_owned();
    for line in lines {
        for (i, (field, factor)) in line.split(',').zip(factors).enumerate() {
            let separator = if i == 0 { "" } else { "," };
            text += separator;
            if let Ok(value) = field.parse::<f64>() {
                write!(text, "{:.2}", value * factor).unwrap();
            }
        }
        text.push('\n');
    }
    text
}
