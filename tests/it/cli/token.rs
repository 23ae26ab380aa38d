use super::fixture::CliFixture;

#[test]
fn a_store_that_is_not_there_is_named_and_not_created() {
    let cli = CliFixture::new();
    for line in ["token list --data nowhere", "token revoke ada --data nowhere"] {
        let refused = cli.run(1, line).stderr;
        assert!(refused.contains("no store nowhere"), "{refused}");
        assert!(!cli.path("nowhere").exists(), "{line}");
    }
}

#[test]
fn a_token_can_be_created_listed_and_revoked() {
    let cli = CliFixture::new();
    let made = cli.ok("token create --name ann --role admin --data store");
    let secret = made.stdout.trim().to_owned();
    assert!(secret.starts_with("offbd_") && secret.len() == 70, "{secret}");
    assert!(!made.stderr.contains(&secret), "{}", made.stderr);
    let device = "token create --name rig --role device --asset bench-1 --days 30 --data store";
    let made = cli.ok(device);
    assert!(made.stderr.contains("there is no such asset yet"), "{}", made.stderr);
    let again = cli.run(1, device);
    assert!(again.stderr.contains("a token `rig` exists already"), "{}", again.stderr);
    cli.ok("token revoke ann --data store");
    let gone = cli.run(1, "token revoke ann --data store");
    assert!(gone.stderr.contains("no valid token `ann`"), "{}", gone.stderr);
    let tokens = cli.ok("token list --format json --data store").json();
    let names: Vec<_> = tokens.iter().map(|token| token["name"].as_str().unwrap()).collect();
    assert_eq!(names, ["rig", "ann"]);
    assert_eq!(tokens[0]["asset"], "bench-1");
    assert!(tokens[0]["expires_at"].is_string() && tokens[1]["revoked_at"].is_string());
    let table = cli.ok("token list --data store").stdout;
    assert!(table.contains("device") && table.contains("revoked 2"), "{table}");
    assert!(!table.contains(&secret[6..]) && !tokens[1].to_string().contains(&secret[6..]));
}

#[cfg(feature = "nats")]
#[test]
fn the_key_for_a_nats_server_is_made_once() {
    let cli = CliFixture::new();
    let public = cli.ok("token nats-issuer issuer.seed").stdout;
    let seed = std::fs::read_to_string(cli.path("issuer.seed")).unwrap();
    let pair = nkeys::KeyPair::from_seed(seed.trim()).unwrap();
    assert_eq!(public.trim(), pair.public_key());
    assert!(public.starts_with('A') && seed.starts_with("SA"), "{public}");
    #[cfg(unix)]
    {
        use std::os::unix::fs::PermissionsExt;
        let metadata = cli.path("issuer.seed").metadata().unwrap();
        assert_eq!(metadata.permissions().mode() & 0o777, 0o600);
    }
    let refused = cli.run(1, "token nats-issuer issuer.seed").stderr;
    assert!(refused.contains("issuer.seed"), "{refused}");
    assert_eq!(std::fs::read_to_string(cli.path("issuer.seed")).unwrap(), seed);
}

#[test]
fn invalid_token_options_are_rejected() {
    let cli = CliFixture::new();
    for (line, expected) in [
        ("token create --name x --role god", "god"),
        ("token create --name x --role device", "--asset"),
        ("token create --name x --role viewer --asset a", "/asset"),
        ("token create --name x --role viewer --days 0", "--days"),
    ] {
        let done = cli.run(2, line);
        assert!(done.stderr.contains(expected), "{line}: {}", done.stderr);
        assert_eq!(done.stdout, "", "{line}");
    }
}

#[test]
fn without_authentication_the_service_does_not_listen_to_other_machines() {
    let cli = CliFixture::new();
    cli.write("open.toml", "auth = 'off'\nlisten = '0.0.0.0:0'\n");
    let done = cli.run(3, "serve --config open.toml");
    for expected in ["`auth`", "offbd token create", "127.0.0.1"] {
        assert!(done.stderr.contains(expected), "{}", done.stderr);
    }
    let stdout = cli.ok("check --listen 0.0.0.0:0").stdout;
    assert!(stdout.contains("with a token, not encrypted"), "{stdout}");
    assert!(cli.ok("check").stdout.contains("for everyone on this machine"));
    cli.write("tls.toml", "[tls]\ncertificate = 'none.pem'\nkey = 'none.pem'\n");
    let done = cli.run(1, "serve --config tls.toml");
    assert!(done.stderr.contains("`tls.certificate`"), "{}", done.stderr);
}
