use super::fixture::CliFixture;

/// Options for fifty times real time. The verdict depends on the times in the samples, not on
/// the speed.
const FAST: &str = "--speed 50 --port 0";

#[test]
fn a_demo_finds_the_injected_faults_over_http_and_websocket() {
    let cli = CliFixture::new();
    let done = cli.ok(&format!("demo --seconds 60 {FAST}"));
    assert!(done.stdout.starts_with("dashboard  http://127.0.0.1:"), "{}", done.stdout);
    let table = done.stdout.split("\n\n").last().unwrap();
    let rows: Vec<Vec<&str>> =
        table.lines().skip(1).map(|row| row.split_whitespace().collect()).collect();
    assert_eq!(rows.len(), 2, "{table}");
    assert_eq!((rows[0][0], rows[0][3]), ("x_servo:dead", "x_servo"));
    assert_eq!((rows[1][0], rows[1][3]), ("stuck_ball:glued", "stuck_ball"));
    for transport in ["over WebSocket", "over HTTP batches"] {
        assert!(done.stdout.contains(transport), "nothing was sent {transport}");
    }
    assert!(done.stdout.lines().all(|line| line.chars().count() <= 80));
    let left: Vec<_> = std::fs::read_dir(cli.path(".")).unwrap().collect();
    assert!(left.is_empty(), "left behind: {left:?}");
}

#[test]
fn a_demo_that_misses_a_fault_reports_it_and_fails() {
    let cli = CliFixture::new();
    let done = cli.run(1, &format!("demo --seconds 20 {FAST} --fault x_servo:gain=0.99@5"));
    assert!(done.stdout.contains("not found"), "{}", done.stdout);
    assert!(done.stderr.contains("do not agree"), "{}", done.stderr);
}

#[test]
fn a_demo_can_reuse_a_kept_store() {
    let cli = CliFixture::new();
    let line = format!("demo --seconds 20 {FAST} --data kept --fault sensor:dropout@5");
    for _ in 0..2 {
        assert!(cli.ok(&line).stdout.contains("sensor (dropout)"));
    }
    assert!(cli.path("kept").is_dir());
}
