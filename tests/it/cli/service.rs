use super::fixture::CliFixture;

#[test]
fn check_prints_the_effective_configuration() {
    let cli = CliFixture::new();
    cli.write("offbd.toml", "listen = '127.0.0.1:9'\n");
    let stdout = cli.ok("check --config offbd.toml --data elsewhere").stdout;
    assert!(stdout.contains("127.0.0.1:9") && stdout.contains("elsewhere"), "{stdout}");
}

#[test]
fn check_prints_each_value_with_its_source() {
    let cli = CliFixture::new();
    cli.write("offbd.toml", "listen = '127.0.0.1:9'\n[limits]\nassets = 7\n");
    let stdout = cli.ok("check --config offbd.toml --data elsewhere --print").stdout;
    for line in ["assets = 7", "data = \"elsewhere\"", "# database ="] {
        assert!(stdout.lines().any(|told| told.starts_with(line)), "{stdout}");
    }
    cli.write("again.toml", &stdout);
    let again = cli.ok("check --config again.toml --print --format json").stdout;
    let again: serde_json::Value = serde_json::from_str(&again).unwrap();
    let keys = again["keys"].as_array().unwrap();
    let data = keys.iter().find(|key| key["name"] == "data").unwrap();
    assert_eq!((&data["value"], &data["source"]), (&"elsewhere".into(), &"again.toml".into()));
}

#[cfg(unix)]
#[test]
fn check_warns_of_a_password_that_everybody_can_read() {
    use std::os::unix::fs::PermissionsExt;
    let cli = CliFixture::new();
    cli.write("offbd.toml", "database = 'postgres://u:hunter2@h/d'\n");
    for (mode, is_told) in [(0o644, true), (0o640, false)] {
        std::fs::set_permissions(cli.path("offbd.toml"), std::fs::Permissions::from_mode(mode))
            .unwrap();
        let stdout = cli.ok("check --config offbd.toml").stdout;
        let told = stdout.contains("every user of this machine can read offbd.toml");
        assert!(told == is_told && !stdout.contains("hunter2"), "{mode:o}: {stdout}");
    }
}

#[test]
fn an_invalid_configuration_is_rejected_with_the_key() {
    let cli = CliFixture::new();
    cli.write("unknown.toml", "[limits]\nnope = 1\n");
    cli.write("wrong.toml", "[limits]\nbatch_samples = 0\n");
    for (file, key) in
        [("unknown.toml", "nope"), ("wrong.toml", "limits.batch_samples"), ("none.toml", "none")]
    {
        for command in ["check", "migrate", "serve"] {
            let done = cli.run(3, &format!("{command} --config {file}"));
            assert!(done.stderr.contains(key), "{command} {file}: {}", done.stderr);
        }
    }
}

#[test]
fn migrating_twice_changes_nothing() {
    let cli = CliFixture::new();
    let first = cli.ok("migrate --data store").stdout;
    assert!(first.contains("offbd.sqlite"), "{first}");
    assert_eq!(cli.ok("migrate --data store").stdout, first);
}

#[test]
fn watch_reports_a_missing_service() {
    let done = CliFixture::new().run(1, "watch bench-1 --url 127.0.0.1:1");
    for expected in ["no service answers at 127.0.0.1:1", "offbd serve", "--url"] {
        assert!(done.stderr.contains(expected), "{}", done.stderr);
    }
    assert_eq!(done.stderr.matches("refused").count(), 1, "{}", done.stderr);
}
