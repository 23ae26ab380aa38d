//! What scripts and shells use: completion, manual pages, `--quiet`, exit codes, JSON.

use std::process::Command;

use super::fixture::CliFixture;

/// Bash itself completes a word with the script.
#[test]
fn validate_bash_completes_commands_options_and_words() {
    let cli = CliFixture::new();
    cli.write("offbd.bash", &cli.ok("completions bash").stdout);
    for (words, expected) in [
        ("offbd repl", "replay"),
        ("offbd replay --fail", "--fail-on-fault"),
        ("offbd token cr", "create"),
        ("offbd replay --format j", "json"),
    ] {
        let n = words.split(' ').count() - 1;
        let last = words.rsplit(' ').next().unwrap();
        let before = words.split(' ').nth(n - 1).unwrap();
        let script = format!(
            "source offbd.bash; COMP_WORDS=({words}); COMP_CWORD={n}; \
             _offbd offbd '{last}' '{before}'; echo \"${{COMPREPLY[*]}}\""
        );
        let output = Command::new("bash")
            .args(["--norc", "-c", &script])
            .current_dir(cli.path("."))
            .output()
            .unwrap();
        let found = String::from_utf8(output.stdout).unwrap();
        assert_eq!(found.trim(), expected, "{words}");
    }
    for shell in ["zsh", "fish", "powershell", "elvish"] {
        assert!(cli.ok(&format!("completions {shell}")).stdout.contains("fail-on-fault"));
    }
    assert!(cli.run(2, "completions cmd").stderr.contains("bash"));
}

#[test]
fn there_is_a_manual_page_for_each_command() {
    let cli = CliFixture::new();
    let done = cli.ok("man -o manual/man1");
    assert_eq!(done.stdout, "");
    for page in ["offbd", "offbd-replay", "offbd-token", "offbd-token-create", "offbd-man"] {
        let text = cli.read(&format!("manual/man1/{page}.1"));
        assert!(text.contains(&format!(".TH {page} 1")), "{page}: {text}");
    }
    assert!(cli.read("manual/man1/offbd-replay.1").contains("fail\\-on\\-fault"));
    cli.write("file", "");
    assert!(cli.run(1, "man -o file").stderr.contains("cannot create file"));
}

#[test]
fn quiet_leaves_out_everything_but_results_and_errors() {
    let cli = CliFixture::new();
    cli.ok("simulate --rig rig.json --reference lissajous --seconds 60 -o healthy.csv");
    let text = cli.read("healthy.csv");
    cli.write("odd.csv", &format!("{text}1,2,oops,4,5\n"));
    assert!(cli.ok("replay odd.csv").stderr.contains("row rejected"));
    let quiet = cli.ok("--quiet replay odd.csv");
    assert_eq!(quiet.stderr, "");
    assert_eq!(quiet.stdout, cli.ok("replay odd.csv").stdout);
    assert_eq!(cli.ok("calibrate --asset rig.json healthy.csv -o calibrated.json -q").stderr, "");
    assert_eq!(cli.ok("-q man -o pages").stderr, "");
    assert!(cli.run(3, "-q replay nowhere.csv").stderr.contains("nowhere.csv"));
}

#[test]
fn a_fault_can_be_told_by_the_exit_status() {
    let cli = CliFixture::new();
    cli.calibrated();
    cli.ok("simulate --asset rig.json --fault x_servo:dead@10 --seconds 20 -o sick.csv");
    cli.ok("replay --asset calibrated.json sick.csv");
    let done = cli.run(4, "replay --asset calibrated.json --fail-on-fault sick.csv healthy.csv");
    assert!(done.stderr.contains("a fault was found in 1 of 2 sessions"), "{}", done.stderr);
    assert!(done.stdout.contains("x_servo"), "the verdict is printed all the same");
    cli.ok("replay --asset calibrated.json --fail-on-fault healthy.csv");
    // A file that could not be judged might have had one as well.
    cli.run(3, "replay --asset calibrated.json --fail-on-fault sick.csv nowhere.csv");
}

#[test]
fn results_are_printed_as_json_on_request() {
    let cli = CliFixture::new();
    cli.ok("simulate --rig rig.json --reference lissajous --seconds 90 -o healthy.csv");
    let learnt = cli.ok("calibrate --asset rig.json healthy.csv -o calibrated.json --format json");
    assert_eq!(learnt.stderr, "");
    let learnt = learnt.json().remove(0);
    let file: serde_json::Value = serde_json::from_str(&cli.read("calibrated.json")).unwrap();
    assert_eq!(learnt["calibration"], file["calibration"]);
    let both = cli.run(2, "calibrate --asset rig.json healthy.csv -o - --format json");
    assert!(both.stderr.contains("-o -"), "{}", both.stderr);

    let migrated = cli.ok("migrate --data store --format json").json().remove(0);
    assert!(migrated["migrations"].as_u64().unwrap() > 10, "{migrated}");
    let checked = cli.ok("check --data store --format json").json().remove(0);
    assert_eq!(checked["checked"]["findings"], serde_json::json!([]), "{checked}");
    assert_eq!(
        (&checked["requires_token"], &checked["log_format"]),
        (&false.into(), &"text".into())
    );
    let unasked = cli.ok("check --format json").json().remove(0);
    assert!(unasked["checked"].is_null(), "{unasked}");
    let copied = cli.ok("backup --data store -o copy.sqlite --format json").json().remove(0);
    assert_eq!(copied["file"], "copy.sqlite");
    let restored = cli.ok("restore --data other copy.sqlite --format json").json().remove(0);
    assert!(restored["store"].as_str().unwrap().contains("other"), "{restored}");
}

#[test]
fn a_mistyped_command_gets_a_suggestion_if_one_is_near() {
    let cli = CliFixture::new();
    let near = cli.run(2, "replya a.csv").stderr;
    assert!(near.contains("'replay'"), "{near}");
    let far = cli.run(2, "frobnicate").stderr;
    assert!(far.contains("frobnicate") && !far.contains("calibrate"), "{far}");
    assert!(!far.contains("tip:"), "a tip without a text: {far}");
    let json = cli.run(2, "replay --json a.csv").stderr;
    assert!(json.contains("--format json") && !json.contains("-- --json"), "{json}");
}
