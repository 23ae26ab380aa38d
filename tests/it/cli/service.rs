use super::bench::Bench;

#[test]
fn check_says_what_the_configuration_comes_to() {
    let bench = Bench::new();
    bench.write("offbd.toml", "listen = '127.0.0.1:9'\n");
    let told = bench.ok("check --config offbd.toml --data elsewhere").stdout;
    assert!(told.contains("127.0.0.1:9") && told.contains("elsewhere"), "{told}");
}

#[test]
fn a_configuration_that_cannot_be_names_its_key() {
    let bench = Bench::new();
    bench.write("unknown.toml", "[limits]\nnope = 1\n");
    bench.write("wrong.toml", "[limits]\nbatch_samples = 0\n");
    for (file, key) in
        [("unknown.toml", "nope"), ("wrong.toml", "limits.batch_samples"), ("none.toml", "none")]
    {
        for command in ["check", "migrate", "serve"] {
            let done = bench.run(3, &format!("{command} --config {file}"));
            assert!(done.stderr.contains(key), "{command} {file}: {}", done.stderr);
        }
    }
}

#[test]
fn migrating_twice_changes_nothing() {
    let bench = Bench::new();
    let first = bench.ok("migrate --data store").stdout;
    assert!(first.contains("offbd.sqlite"), "{first}");
    assert_eq!(bench.ok("migrate --data store").stdout, first);
}

#[test]
fn watching_where_nobody_serves_says_so() {
    let done = Bench::new().run(1, "watch bench-1 --address 127.0.0.1:1");
    assert!(done.stderr.contains("no stream of bench-1 at 127.0.0.1:1"), "{}", done.stderr);
}
