//! An MQTT broker: batches of devices in, acknowledgements and faults out.
//!
//! A message of QoS 1 is acknowledged to the broker (PUBACK) once its batch is durable or
//! refused for good, in the order of arrival. If a batch cannot be taken at present, the
//! connection is made again, and the broker repeats what was not acknowledged. Each connection
//! has a client of its own, so that no acknowledgement of one is sent on another.

use std::future::pending;
use std::path::PathBuf;
use std::sync::{Arc, Mutex, PoisonError};
use std::time::Duration;

use hyper::body::Bytes;
use rumqttc::{
    AsyncClient, ConnectionError, EventLoop, MqttOptions, Outgoing, Packet, Publish, QoS,
    SubscribeFilter, TlsConfiguration, Transport,
};
use tokio::sync::{mpsc, watch};
use tokio::task::JoinHandle;
use tokio::time::timeout;
use tokio_rustls::rustls::crypto::ring;
use tokio_rustls::rustls::pki_types::CertificateDer;
use tokio_rustls::rustls::pki_types::pem::PemObject;
use tokio_rustls::rustls::{ClientConfig, RootCertStore};
use tokio_util::sync::CancellationToken;

use super::faults::publish_faults;
use super::intake::{
    Answering, BatchAnswer, BusMessage, Delivery, Form, Intake, MessageReply, queue,
};
use super::mqtt_publisher::{BrokerLink, Connected, MqttPublisher};
use super::puback::PubackQueue;
use super::{RETRY_INTERVAL, SEND_TIMEOUT};
use offbd_http::MessageOutcome;
use offbd_net::Reasons;
use offbd_service::Service;
use offbd_wire::bus::{DeviceTopic, TopicStyle};
use offbd_wire::mapping::Mapping;

const BUS: &str = "mqtt";

/// Interval of MQTT's own signs of life.
const KEEP_ALIVE: Duration = Duration::from_secs(20);

/// Longest packet from the broker, bytes; at a longer one the connection is lost. The broker
/// must have a lower limit.
const MAX_PACKET: usize = 32 << 20;

/// Packets that wait to be sent to the broker; at the limit the sender waits.
const MAX_OUTGOING: usize = 1024;

/// How to connect to a broker, and what to do there.
#[derive(Clone, Debug, Default)]
pub struct MqttSettings {
    pub host: String,
    pub port: u16,
    /// Whether the connection is encrypted.
    pub encrypted: bool,
    /// Certificates that the broker's must come from, a PEM file; without it those of the
    /// machine.
    pub ca: Option<PathBuf>,
    pub client_id: String,
    pub user: Option<(String, String)>,
    /// Whether batches are taken.
    pub telemetry: bool,
    /// Whether faults are published.
    pub faults: bool,
    /// Topics of devices with formats of their own.
    pub mapping: Mapping,
}

/// Why the settings cannot be used.
#[derive(Debug, thiserror::Error)]
pub enum MqttError {
    #[error("`mqtt.ca`: {path}: {reason}", path = path.display())]
    Certificates { path: PathBuf, reason: String },
    #[error("no root certificates of the machine can be used: {reason}")]
    Roots { reason: String },
}

/// Connects, and stays connected until the service stops.
///
/// # Errors
/// [`MqttError`] if the certificates cannot be read. A broker that cannot be reached is no
/// error: the connection is tried again.
pub fn start(
    service: Service,
    settings: MqttSettings,
    closing: CancellationToken,
) -> Result<JoinHandle<()>, MqttError> {
    let options = options(&settings)?;
    metrics::gauge!("offbd_bus_connected", "bus" => BUS).set(0.0);
    Ok(tokio::spawn(run(service, settings, options, closing)))
}

async fn run(
    service: Service,
    settings: MqttSettings,
    options: MqttOptions,
    closing: CancellationToken,
) {
    let (connected, clients) = watch::channel(None);
    let publisher = || MqttPublisher::new(clients.clone());
    let publishing = async {
        if settings.faults {
            publish_faults(BUS, service.clone(), publisher, closing.clone()).await;
        }
    };
    let broker = Broker { service: service.clone(), settings: &settings, connected };
    tokio::join!(publishing, broker.stay_connected(options, &closing));
}

fn options(settings: &MqttSettings) -> Result<MqttOptions, MqttError> {
    let MqttSettings { host, port, client_id, .. } = settings;
    let mut options = MqttOptions::new(client_id, host, *port);
    options.set_keep_alive(KEEP_ALIVE);
    // The broker keeps messages of QoS 1 while the service is away.
    options.set_clean_session(false);
    options.set_manual_acks(true);
    options.set_max_packet_size(MAX_PACKET, MAX_PACKET);
    if let Some((user, password)) = &settings.user {
        options.set_credentials(user, password);
    }
    if settings.encrypted {
        let tls = TlsConfiguration::Rustls(Arc::new(tls(settings)?));
        options.set_transport(Transport::tls_with_config(tls));
    }
    Ok(options)
}

/// Returns the settings of TLS, with the broker's root certificates.
fn tls(settings: &MqttSettings) -> Result<ClientConfig, MqttError> {
    let mut roots = RootCertStore::empty();
    if let Some(path) = &settings.ca {
        let invalid = |reason: String| MqttError::Certificates { path: path.clone(), reason };
        let certificates =
            CertificateDer::pem_file_iter(path).map_err(|error| invalid(error.to_string()))?;
        for certificate in certificates {
            let certificate = certificate.map_err(|error| invalid(error.to_string()))?;
            roots.add(certificate).map_err(|error| invalid(error.to_string()))?;
        }
    } else {
        let found = rustls_native_certs::load_native_certs();
        roots.add_parsable_certificates(found.certs);
    }
    let unusable =
        |error: tokio_rustls::rustls::Error| MqttError::Roots { reason: error.to_string() };
    if roots.is_empty() {
        return Err(MqttError::Roots { reason: "there is none".to_owned() });
    }
    let config = ClientConfig::builder_with_provider(ring::default_provider().into());
    let config = config.with_safe_default_protocol_versions().map_err(unusable)?;
    Ok(config.with_root_certificates(roots).with_no_client_auth())
}

struct Broker<'a> {
    service: Service,
    settings: &'a MqttSettings,
    connected: watch::Sender<Connected>,
}

impl Broker<'_> {
    async fn stay_connected(self, options: MqttOptions, closing: &CancellationToken) {
        let intake = Intake::new(BUS, self.service.clone());
        let reasons = Reasons::default();
        while !closing.is_cancelled() {
            let (client, events) = AsyncClient::new(options.clone(), MAX_OUTGOING);
            let connection = Arc::new(MqttConnection::new(client));
            let (sender, receiver) = queue();
            let answering = intake.clone().run(&connection, receiver);
            let reading = self.read(&intake, &connection, events, sender, closing);
            let (reason, ()) = tokio::join!(reading, answering);
            if self.connected.send_replace(None).is_some() {
                reasons.clear();
            }
            connection.link.ended.cancel();
            metrics::gauge!("offbd_bus_connected", "bus" => BUS).set(0.0);
            if let Some(error) = reason.filter(|error| reasons.is_new(error)) {
                tracing::warn!(%error, "the connection to the MQTT broker is lost");
            }
            closing.run_until_cancelled(tokio::time::sleep(RETRY_INTERVAL)).await;
        }
    }

    /// Reads packets until the connection is lost or the service stops. While it stops, the
    /// answers of batches that are submitted are still sent.
    async fn read(
        &self,
        intake: &Intake,
        connection: &Arc<MqttConnection>,
        mut events: EventLoop,
        sender: mpsc::Sender<Delivery<MqttReceipt>>,
        closing: &CancellationToken,
    ) -> Option<ConnectionError> {
        let (mut sender, marker_topic) = (Some(sender), TopicStyle::Mqtt.marker());
        loop {
            let stopping = async {
                match &sender {
                    Some(_) => closing.cancelled().await,
                    None => pending().await,
                }
            };
            let event = tokio::select! {
                event = events.poll() => event,
                () = connection.renew.cancelled() => return None,
                () = stopping => {
                    // Closes the queue; `answering` ends with a disconnection.
                    sender = None;
                    continue;
                }
            };
            match event {
                Ok(rumqttc::Event::Incoming(Packet::ConnAck(_))) => self.greet(connection),
                Ok(rumqttc::Event::Incoming(Packet::PubAck(_))) => {
                    connection.link.confirmed.notify_one()
                }
                Ok(rumqttc::Event::Incoming(Packet::Publish(publish)))
                    if publish.topic == marker_topic =>
                {
                    connection.link.markers.arrive(&publish.payload);
                    // A topic of a mapping may be the same, at QoS 1.
                    connection.acknowledge(connection.arrive(&publish));
                }
                Ok(rumqttc::Event::Incoming(Packet::Publish(publish))) => {
                    if let Some(sender) = &sender {
                        self.receive(intake, connection, publish, sender);
                    }
                }
                Ok(rumqttc::Event::Outgoing(Outgoing::Disconnect)) => return None,
                Ok(_) => {}
                Err(error) if closing.is_cancelled() => {
                    tracing::debug!(%error, "disconnected");
                    return None;
                }
                Err(error) => return Some(error),
            }
        }
    }

    /// Subscribes, and tells the publisher that there is a connection.
    fn greet(&self, connection: &MqttConnection) {
        tracing::info!(host = self.settings.host, "connected to the MQTT broker");
        metrics::gauge!("offbd_bus_connected", "bus" => BUS).set(1.0);
        if self.settings.telemetry {
            let topics =
                DeviceTopic::ALL.map(|topic| TopicStyle::Mqtt.topic(&["+", topic.as_str()]));
            let filters = topics.into_iter().chain(self.settings.mapping.filters());
            let filters = filters.map(|path| SubscribeFilter { path, qos: QoS::AtLeastOnce });
            if connection.client.try_subscribe_many(filters).is_err() {
                connection.renew.cancel();
            }
        }
        self.connected.send_replace(Some(connection.link.clone()));
    }

    /// Queues a message of a device. One that is no batch, or cannot be read, is answered at
    /// once.
    fn receive(
        &self,
        intake: &Intake,
        connection: &Arc<MqttConnection>,
        publish: Publish,
        sender: &mpsc::Sender<Delivery<MqttReceipt>>,
    ) {
        let receipt = connection.arrive(&publish);
        let addressed = match self.address(&publish) {
            Ok(addressed) => addressed,
            Err(outcome) => {
                intake.count(outcome);
                return connection.acknowledge(receipt);
            }
        };
        let waits = receipt.is_some();
        let queued = intake.queue(sender, addressed, publish.payload, receipt, waits);
        if let Err((asset, receipt, reply)) = queued {
            match *reply {
                MessageReply::Answer(answer) => connection.send_now(&asset, receipt, &answer),
                MessageReply::Nothing => connection.acknowledge(receipt),
                MessageReply::Again => connection.end(),
            }
        }
    }

    /// Returns the asset of a message and its content, or the outcome of one that is left out.
    fn address(&self, publish: &Publish) -> Result<(String, BusMessage), MessageOutcome> {
        let topic = publish.topic.as_str();
        if let Some((entry, asset)) = self.settings.mapping.find(topic) {
            let asset = asset.map_err(|error| refused(topic, &error))?;
            let batch = BusMessage::Batch(Form::Mapped(entry));
            return if publish.retain { Err(MessageOutcome::Retained) } else { Ok((asset, batch)) };
        }
        let (asset, kind) =
            TopicStyle::Mqtt.parse(topic).map_err(|error| refused(topic, &error))?;
        if publish.retain && kind == DeviceTopic::Telemetry {
            tracing::warn!(topic, "a retained message is no new telemetry; it is ignored");
            return Err(MessageOutcome::Retained);
        }
        Ok((asset, kind.into()))
    }
}

fn refused(topic: &str, error: &offbd_wire::bus::TopicError) -> MessageOutcome {
    tracing::warn!(topic, %error, "a message is refused");
    MessageOutcome::Topic
}

/// The number of a message of QoS 1 among those of its connection; `None` for QoS 0.
type MqttReceipt = Option<u64>;

/// One connection to a broker.
struct MqttConnection {
    client: AsyncClient,
    pubacks: Mutex<PubackQueue<Publish>>,
    link: Arc<BrokerLink>,
    /// Cancelled if the connection is to be made again at once.
    renew: CancellationToken,
}

impl MqttConnection {
    fn new(client: AsyncClient) -> Self {
        let link = Arc::new(BrokerLink::new(client.clone()));
        Self { client, pubacks: Mutex::default(), link, renew: CancellationToken::new() }
    }

    fn arrive(&self, publish: &Publish) -> MqttReceipt {
        let without_payload =
            Publish { payload: Bytes::new(), topic: String::new(), ..publish.clone() };
        let mut pubacks = self.pubacks.lock().unwrap_or_else(PoisonError::into_inner);
        (publish.qos == QoS::AtLeastOnce).then(|| pubacks.arrive(without_payload))
    }

    /// Acknowledges a message to the broker, and those that have waited for it.
    fn acknowledge(&self, receipt: MqttReceipt) {
        let Some(number) = receipt else { return };
        let mut pubacks = self.pubacks.lock().unwrap_or_else(PoisonError::into_inner);
        for publish in pubacks.complete(number) {
            if self.client.try_ack(&publish).is_err() {
                // The broker repeats what was not acknowledged.
                self.renew.cancel();
            }
        }
    }

    fn send_now(&self, asset: &str, receipt: MqttReceipt, answer: &BatchAnswer) {
        let topic = TopicStyle::Mqtt.ack(asset);
        // If there is no room, the device gets no answer and sends its batch again.
        let _ = self.client.try_publish(topic, QoS::AtMostOnce, false, answer.document());
        self.conclude(receipt, answer);
    }

    /// Ends the connection after what is to be sent already, so that it is made again.
    fn end(&self) {
        if self.client.try_disconnect().is_err() {
            self.renew.cancel();
        }
    }

    fn conclude(&self, receipt: MqttReceipt, answer: &BatchAnswer) {
        match (receipt, answer.retry_after_s()) {
            (Some(_), Some(_)) => self.end(),
            _ => self.acknowledge(receipt),
        }
    }
}

impl Answering for Arc<MqttConnection> {
    type Receipt = MqttReceipt;

    async fn answer(&self, asset: &str, receipt: MqttReceipt, reply: MessageReply) {
        let answer = match reply {
            MessageReply::Answer(answer) => answer,
            MessageReply::Nothing => return self.acknowledge(receipt),
            MessageReply::Again => return self.end(),
        };
        let topic = TopicStyle::Mqtt.ack(asset);
        let sent = self.client.publish(topic, QoS::AtMostOnce, false, answer.document());
        if self.renew.run_until_cancelled(timeout(SEND_TIMEOUT, sent)).await.is_none() {
            return;
        }
        self.conclude(receipt, &answer);
    }

    async fn finish(&self) {
        let _ = timeout(SEND_TIMEOUT, self.client.disconnect()).await;
    }
}
