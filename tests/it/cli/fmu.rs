//! `offbd export fmu`: what the archive holds, and what is refused. `scripts/fmu` runs one.

use std::io::{Cursor, Read};

use super::fixture::CliFixture;

/// The first bytes of a shared library of Linux for x86_64.
fn library() -> Vec<u8> {
    let mut bytes = b"\x7fELF\x02\x01\x01".to_vec();
    bytes.resize(64, 0);
    bytes[18] = 0x3e;
    bytes
}

#[test]
fn an_fmu_has_the_values_of_the_rig_and_the_given_library() {
    let cli = CliFixture::new();
    std::fs::write(cli.path("twin.so"), library()).unwrap();
    cli.write("rig.json", r#"{"name":"lab-3","servo":{"lag_s":0.085}}"#);
    cli.ok("export fmu --asset rig.json --library twin.so -o twin.fmu");
    let fmu = std::fs::read(cli.path("twin.fmu")).unwrap();
    let mut files = zip::ZipArchive::new(Cursor::new(fmu)).unwrap();
    let mut read = |name: &str| {
        let mut content = Vec::new();
        files.by_name(name).unwrap().read_to_end(&mut content).unwrap();
        content
    };
    assert_eq!(read("binaries/x86_64-linux/ball_on_plate.so"), library());
    let values = String::from_utf8(read("resources/start-values.txt")).unwrap();
    assert!(values.contains("x_servo.lag 0.085\n"), "{values}");
    let description = String::from_utf8(read("modelDescription.xml")).unwrap();
    assert!(description.contains("modelName=\"lab-3\""), "{description}");
    assert!(description.contains("fmiVersion=\"3.0\""), "{description}");
    let licence = String::from_utf8(read("documentation/licenses/LICENSE-MIT.txt")).unwrap();
    assert!(licence.contains("Permission is hereby granted"), "{licence}");
}

#[test]
fn an_fmu_can_be_for_importers_of_fmi_2() {
    let cli = CliFixture::new();
    std::fs::write(cli.path("twin.so"), library()).unwrap();
    cli.ok("export fmu --fmi 2.0 --library twin.so -o twin.fmu");
    let fmu = std::fs::read(cli.path("twin.fmu")).unwrap();
    let mut files = zip::ZipArchive::new(Cursor::new(fmu)).unwrap();
    files.by_name("binaries/linux64/ball_on_plate.so").unwrap();
    let description = std::io::read_to_string(files.by_name("modelDescription.xml").unwrap());
    assert!(description.unwrap().contains("fmiVersion=\"2.0\""));
    let other = cli.run(2, "export fmu --fmi 1.0 --library twin.so -o one.fmu").stderr;
    assert!(other.contains("the versions are 2.0 and 3.0"), "{other}");
}

#[test]
fn without_a_usable_library_there_is_no_fmu() {
    let cli = CliFixture::new();
    let missing = cli.run(3, "export fmu --library none.so -o twin.fmu").stderr;
    assert!(missing.contains("none.so: "), "{missing}");
    cli.write("script.so", "#!/bin/sh\n");
    let other = cli.run(3, "export fmu --library script.so -o twin.fmu").stderr;
    assert!(other.contains("script.so: is not a shared library"), "{other}");
    assert!(!cli.path("twin.fmu").exists());
    cli.run(2, "export fmu");
}

#[test]
fn the_help_has_an_example_and_fits_in_eighty_columns() {
    let cli = CliFixture::new();
    for command in ["export", "export fmu"] {
        let help = cli.ok(&format!("{command} --help")).stdout;
        assert!(help.contains("offbd export fmu "), "{help}");
        assert!(help.lines().all(|line| line.chars().count() <= 80), "{help}");
    }
}
