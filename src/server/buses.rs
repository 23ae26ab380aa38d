//! Starts what serves devices over NATS and MQTT.

use anyhow::Result;
use tokio::task::JoinHandle;
use tokio_util::sync::CancellationToken;

use crate::config::Config;
use offbd_service::Service;

/// Starts the buses of the configuration. The tasks end when the service stops, after they have
/// answered all that was submitted.
///
/// # Errors
/// If a key is invalid, a file cannot be read, or the NATS server is not safe to use.
pub(super) async fn start(
    config: &Config,
    service: &Service,
    closing: &CancellationToken,
) -> Result<Vec<JoinHandle<()>>> {
    #[allow(unused_mut, reason = "without these features there is no bus")]
    let mut buses = Vec::new();
    if config.nats.is_some() && config.mqtt.as_ref().is_some_and(|mqtt| !mqtt.telemetry) {
        tracing::warn!(
            "a NATS server keeps nothing for offbd that devices publish over its MQTT port at \
             QoS 1: each must send a batch again until offbd's own acknowledgement"
        );
    }
    #[cfg(feature = "mqtt")]
    if let Some(mqtt) = &config.mqtt {
        let settings = mqtt::settings(mqtt, config.cluster.as_ref())?;
        let bus = offbd_bus::mqtt::start(service.clone(), settings, closing.clone())?;
        buses.push(bus);
    }
    #[cfg(feature = "nats")]
    if let Some(nats) = &config.nats {
        let settings = nats::settings(nats)?;
        buses.push(offbd_bus::nats::start(service.clone(), settings, closing.clone()).await?);
    }
    let _ = (config, service, closing);
    Ok(buses)
}

/// Checks the files that the configuration of the buses names.
///
/// # Errors
/// Names the key and the file.
pub(super) fn check(config: &Config) -> Result<()> {
    #[cfg(feature = "mqtt")]
    if let Some(mqtt) = &config.mqtt {
        mqtt::settings(mqtt, config.cluster.as_ref())?;
    }
    #[cfg(feature = "nats")]
    config.nats.as_ref().map(nats::settings).transpose()?;
    let _ = config;
    Ok(())
}

#[cfg(feature = "nats")]
mod nats {
    use anyhow::{Context, Result};

    use crate::config::NatsConfig;
    use offbd_bus::nats::NatsSettings;

    pub(super) fn settings(config: &NatsConfig) -> Result<NatsSettings> {
        let issuer_seed = config.issuer_seed.as_ref().map(|path| {
            let seed = std::fs::read_to_string(path);
            seed.with_context(|| format!("`nats.issuer_seed`: cannot read {}", path.display()))
        });
        Ok(NatsSettings {
            servers: config.url.split(',').map(str::to_owned).collect(),
            user: config.login()?,
            credentials: config.credentials.clone(),
            ca: config.ca.clone(),
            monitor: config.monitor.clone(),
            faults: config.faults,
            issuer_seed: issuer_seed.transpose()?,
            account: config.account.clone(),
        })
    }
}

#[cfg(feature = "mqtt")]
mod mqtt {
    use std::path::Path;

    use anyhow::{Context, Result, anyhow};

    use crate::config::{ClusterConfig, MqttConfig};
    use offbd_bus::mqtt::MqttSettings;
    use offbd_wire::mapping::{Mapping, MappingView};

    pub(super) fn settings(
        config: &MqttConfig,
        cluster: Option<&ClusterConfig>,
    ) -> Result<MqttSettings> {
        let address = config.address()?;
        Ok(MqttSettings {
            host: address.host,
            port: address.port,
            encrypted: address.encrypted,
            ca: config.ca.clone(),
            identity: config.certificate.clone().zip(config.key.clone()),
            client_id: config.client_id(cluster),
            user: config.login()?,
            telemetry: config.telemetry,
            faults: config.faults,
            state: config.state,
            mapping: config.mapping.as_deref().map(mapping).transpose()?.unwrap_or_default(),
        })
    }

    fn mapping(path: &Path) -> Result<Mapping> {
        let file = config::File::from(path).format(config::FileFormat::Toml);
        let read = || config::Config::builder().add_source(file).build()?.try_deserialize();
        let context = || format!("`mqtt.mapping`: {}", path.display());
        let view: MappingView = read().with_context(context)?;
        Mapping::new(view)
            .map_err(|invalid| anyhow!("`{}` {}", invalid.element, invalid.reason))
            .with_context(context)
    }
}
