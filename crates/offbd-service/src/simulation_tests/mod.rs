//! The whole service in a simulation: devices, network, shards, writer and database take
//! their steps in an order that a random number generator chooses, with lost and repeated
//! requests, failing transactions and reads, kills at every point of a transaction, commits of
//! which a power cut leaves any part, deletions, and clocks that are set. What the devices were told is compared with what is stored.
//!
//! The code of the service is the real one. Only its threads are missing: the simulation
//! calls what they would do. A scenario that fails is shrunk, printed and kept by `proptest`.

mod check;
mod device;
mod disk;
mod scenario;
mod world;

use proptest::prelude::*;
use proptest::test_runner::RngSeed;

use self::scenario::{Scenario, scenario};
use self::world::World;

/// Number of scenarios, each time the same; with the variable `PROPTEST_CASES`, so many new ones
/// are tried.
const SCENARIOS: u32 = 200;

fn simulate(scenario: &Scenario) -> Result<(), String> {
    let mut world = World::new(&scenario.devices);
    world.run(scenario)?;
    world.finish()?;
    world.kill();
    check::check(&world)
}

fn config() -> ProptestConfig {
    let cases = std::env::var("PROPTEST_CASES").ok().and_then(|n| n.parse().ok());
    let rng_seed = if cases.is_some() { RngSeed::Random } else { RngSeed::Fixed(1) };
    ProptestConfig { cases: cases.unwrap_or(SCENARIOS), rng_seed, ..ProptestConfig::default() }
}

proptest! {
    #![proptest_config(config())]

    #[test]
    fn what_devices_are_told_is_so(scenario in scenario()) {
        simulate(&scenario).map_err(TestCaseError::fail)?;
    }
}
