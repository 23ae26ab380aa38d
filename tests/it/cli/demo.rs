use super::bench::Bench;

/// Real sockets, real store, fifty times faster than real time: the rows' own
/// clock decides the verdict, whatever the speed.
const FAST: &str = "--speed 50 --port 0";

#[test]
fn what_is_injected_is_found_over_the_interface() {
    let bench = Bench::new();
    let done = bench.ok(&format!("demo --seconds 60 {FAST}"));
    assert!(done.stdout.starts_with("dashboard  http://127.0.0.1:"), "{}", done.stdout);
    let table = done.stdout.split("\n\n").last().unwrap();
    let rows: Vec<Vec<&str>> =
        table.lines().skip(1).map(|row| row.split_whitespace().collect()).collect();
    assert_eq!(rows.len(), 2, "{table}");
    assert_eq!((rows[0][0], rows[0][3]), ("x_servo:dead", "x_servo"));
    assert_eq!((rows[1][0], rows[1][3]), ("stuck_ball:glued", "stuck_ball"));
    for transport in ["over WebSocket", "over HTTP batches"] {
        assert!(done.stdout.contains(transport), "nothing went {transport}");
    }
    assert!(done.stdout.lines().all(|line| line.chars().count() <= 80));
    let left: Vec<_> = std::fs::read_dir(bench.path(".")).unwrap().collect();
    assert!(left.is_empty(), "left behind: {left:?}");
}

#[test]
fn a_fault_that_is_not_found_is_told_and_fails() {
    let bench = Bench::new();
    let done = bench.run(1, &format!("demo --seconds 20 {FAST} --fault x_servo:gain=0.99@5"));
    assert!(done.stdout.contains("not found"), "{}", done.stdout);
    assert!(done.stderr.contains("do not agree"), "{}", done.stderr);
}

#[test]
fn a_store_that_is_kept_serves_the_next_demo() {
    let bench = Bench::new();
    let line = format!("demo --seconds 20 {FAST} --data kept --fault sensor:dropout@5");
    for _ in 0..2 {
        assert!(bench.ok(&line).stdout.contains("sensor (dropout)"));
    }
    assert!(bench.path("kept").is_dir());
}
