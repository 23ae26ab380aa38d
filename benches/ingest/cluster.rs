//! Nodes of a cluster against a service that works alone, all on one PostgreSQL server: what
//! partitions cost, and what a batch costs that is sent to a node that does not own its asset.

use std::net::SocketAddr;
use std::path::Path;

use anyhow::{Result, bail};
use offbd::config::{ClusterConfig, Config};
use offbd::server::{self, Server};

use crate::client::Client;
use crate::load::{DEVICES, Load, loads};
use crate::{Rate, Target, median, register, stream};

/// Most questions for the owner of an asset, while nodes divide the partitions.
const MAX_QUESTIONS: usize = 10_000;

/// Measures all ways in each of `rounds` rounds. `databases` are empty: one for the service that
/// works alone, one for the cluster of one node, one for that of two.
pub(crate) async fn measure(
    databases: [&str; 3],
    samples: &[offbd_core::vocabulary::Sample],
    rounds: usize,
) -> Result<()> {
    let directory = tempfile::tempdir()?;
    let [alone, one, two] = databases;
    let data = |name: &str| directory.path().join(name);
    let alone = start(&data("alone"), alone, None).await?;
    let one = start(&data("one"), one, Some("one")).await?;
    let nodes =
        [start(&data("a"), two, Some("a")).await?, start(&data("b"), two, Some("b")).await?];
    let addresses = [nodes[0].address, nodes[1].address];
    println!("{DEVICES} devices; medians of {rounds} rounds, samples per second");
    println!("{:24}{:>12}{:>12}{:>12}{:>12}", "", "alone", "one node", "to owners", "to others");
    for (n_load, load) in
        loads(samples).iter().filter(|load| load.name.starts_with("MessagePack")).enumerate()
    {
        let mut rates: [Vec<Rate>; 4] = Default::default();
        for round in 0..rounds {
            let first = (n_load * rounds + round) * 2 * DEVICES;
            rates[0].push(send(load, first, alone.address).await?);
            rates[1].push(send(load, first, one.address).await?);
            register(addresses[0], first..first + 2 * DEVICES).await?;
            for (way, rates) in rates.iter_mut().skip(2).enumerate() {
                let first = first + way * DEVICES;
                let owners = owners(addresses, first).await?;
                // The first way is to the owner, the second one to the other node.
                let to = |n: usize| Target::telemetry(addresses[owners[n] ^ way], first + n);
                rates.push(stream(load, &to).await?);
            }
        }
        show(load.name, rates);
    }
    for server in [alone, one].into_iter().chain(nodes) {
        server.shutdown().await?;
    }
    Ok(())
}

fn show(name: &str, mut rates: [Vec<Rate>; 4]) {
    let medians = rates.each_mut().map(|rates| median(rates).map_or(f64::NAN, |rate| rate.rate));
    let [alone, one, owners, others] = medians;
    println!("{name:24}{alone:>12.0}{one:>12.0}{owners:>12.0}{others:>12.0}");
    println!(
        "  one node / alone: {:.3}; to others / to owners: {:.3}",
        one / alone,
        others / owners
    );
}

async fn start(data: &Path, database: &str, node: Option<&str>) -> Result<Server> {
    let free = SocketAddr::from(([127, 0, 0, 1], 0));
    let cluster = node.map(|name| ClusterConfig {
        name: name.to_owned(),
        listen: free,
        advertise: None,
        partitions: 64,
    });
    let database = Some(database.to_owned());
    server::start(Config {
        data: data.to_owned(),
        listen: free,
        database,
        cluster,
        ..Config::default()
    })
    .await
}

/// Sends the load for [`DEVICES`] new assets, from the one with number `first` on.
async fn send(load: &Load, first: usize, to: SocketAddr) -> Result<Rate> {
    register(to, first..first + DEVICES).await?;
    stream(load, &|n| Target::telemetry(to, first + n)).await
}

/// Which of two nodes owns each of [`DEVICES`] assets. Both own some.
async fn owners(addresses: [SocketAddr; 2], first: usize) -> Result<Vec<usize>> {
    let mut client = Client::connect(addresses[0]).await?;
    for _ in 0..MAX_QUESTIONS {
        let mut owners = Vec::new();
        for device in first..first + DEVICES {
            let path = format!("/api/v1/cluster?asset=device-{device}");
            let place: serde_json::Value = serde_json::from_str(&client.get(&path).await?)?;
            let owner = place["asset"]["owner"].as_str();
            owners.extend(owner.map(|owner| usize::from(owner == "b")));
        }
        if owners.len() == DEVICES && owners.contains(&0) && owners.contains(&1) {
            return Ok(owners);
        }
    }
    bail!("the nodes do not divide the partitions")
}
