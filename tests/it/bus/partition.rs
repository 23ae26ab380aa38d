//! The partition of an asset, as a real NATS server computes it.

use std::collections::BTreeSet;

use futures_util::StreamExt;
use offbd::store::{Partitions, subject_token};
use tokio::time::timeout;

use crate::support::DEADLINE;
use crate::support::broker::{NATS_PASSWORD, Nats};
use crate::support::bus_device::nats;
use crate::support::device::Random;

const N_NAMES: usize = 1000;
const N_PARTITIONS: u32 = 64;

/// Names of up to 64 permitted characters.
fn names() -> BTreeSet<String> {
    const CHARACTERS: &[u8] = b"abcxyzABCXYZ0189._-";
    let mut random = Random(3);
    let mut names = BTreeSet::new();
    while names.len() < N_NAMES {
        let length = 1 + random.below(64);
        let name = (0..length).map(|_| char::from(CHARACTERS[random.below(CHARACTERS.len())]));
        names.insert(name.collect());
    }
    names
}

#[tokio::test]
async fn validate_partitions_against_those_of_a_nats_server() {
    let server = Nats::start_with(|configuration| {
        let account = "    OFFBD {\n";
        assert!(configuration.contains(account));
        let mapping = format!(
            "mappings = {{ \"asset.*\": \
             \"partition.{{{{partition({N_PARTITIONS},1)}}}}.{{{{wildcard(1)}}}}\" }}"
        );
        configuration.replace(account, &format!("{account}        {mapping}\n"))
    });
    let client = nats(server.port, "test", ("offbd", NATS_PASSWORD)).await.unwrap();
    let mut mapped = client.subscribe("partition.*.*").await.unwrap();
    let (partitions, names) = (Partitions::new(N_PARTITIONS), names());
    for name in &names {
        let subject = format!("asset.{}", subject_token(name));
        client.publish(subject, "".into()).await.unwrap();
        let found = timeout(DEADLINE, mapped.next()).await.expect("a message in time");
        let found = found.unwrap().subject.to_string();
        let expected = format!("partition.{}.{}", partitions.of(name), subject_token(name));
        assert_eq!(found, expected, "{name}");
    }
    let used: BTreeSet<_> = names.iter().map(|name| partitions.of(name)).collect();
    assert_eq!(used.len(), N_PARTITIONS as usize);
}
