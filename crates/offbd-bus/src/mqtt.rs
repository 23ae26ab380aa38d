//! An MQTT broker: batches of devices in, acknowledgements and faults out.
//!
//! A message of QoS 1 is acknowledged to the broker (PUBACK) once its batch is durable or
//! refused for good, in the order of arrival. If a batch cannot be taken at present, the
//! connection is made again, and the broker repeats what was not acknowledged. Each connection
//! has its own client, so that no acknowledgement of one is sent on another.

use std::fmt;
use std::future::pending;
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, PoisonError};

use hyper::body::Bytes;
use rumqttc::{
    AckMode, AsyncClient, ConnectionError, EventLoop, LastWill, MqttOptions, Outgoing, Packet,
    Publish, PublishOptions, QoS, SubscribeFilter,
};
use tokio::sync::{mpsc, watch};
use tokio::task::JoinHandle;
use tokio::time::timeout;
use tokio_rustls::TlsConnector;
use tokio_rustls::rustls::crypto::ring;
use tokio_rustls::rustls::pki_types::pem::PemObject;
use tokio_rustls::rustls::pki_types::{CertificateDer, PrivateKeyDer};
use tokio_rustls::rustls::{ClientConfig, RootCertStore};
use tokio_util::sync::CancellationToken;

use super::dialer::{Dialer, PROTOCOL_LENGTH, Shortened};
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
use offbd_wire::bus::{DeviceTopic, PresenceWord, TopicStyle};
use offbd_wire::mapping::Mapping;

const BUS: &str = "mqtt";

/// Interval of MQTT's own signs of life, seconds.
const KEEP_ALIVE_S: u16 = 20;

/// Bytes of a message before its batch, at most: the topic with its length, and a number.
const BEFORE_BATCH: usize = 2 + 65_535 + 2;

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
    /// Certificate of the service and its private key, PEM files, for a broker that demands them.
    pub identity: Option<(PathBuf, PathBuf)>,
    pub client_id: String,
    pub user: Option<(String, String)>,
    /// Whether batches are taken.
    pub telemetry: bool,
    /// Whether faults are published.
    pub faults: bool,
    /// Whether the service says whether it is connected.
    pub state: bool,
    /// Topics of devices with their own formats.
    pub mapping: Mapping,
}

/// Why the settings cannot be used.
#[derive(Debug, thiserror::Error)]
pub enum MqttError {
    #[error("`mqtt.{key}`: {path}: {reason}", path = path.display())]
    Certificates { key: &'static str, path: PathBuf, reason: String },
    #[error("`mqtt.certificate` and `mqtt.key` cannot be used: {reason}")]
    Identity { reason: String },
    #[error("no root certificates of the machine can be used: {reason}")]
    Roots { reason: String },
}

/// Connects, and stays connected until the service stops.
///
/// # Errors
/// [`MqttError`] if the certificates cannot be read. A broker that cannot be reached is not
/// an error: the connection is tried again.
pub fn start(
    service: Service,
    settings: MqttSettings,
    closing: CancellationToken,
) -> Result<JoinHandle<()>, MqttError> {
    // One byte more than a batch may have, so that what is shortened is refused.
    let batch_bytes = service.limits().requests.batch_bytes;
    let shortened = Shortened::to(BEFORE_BATCH + batch_bytes + 1);
    let options = options(&settings, shortened.clone())?;
    metrics::gauge!("offbd_bus_connected", "bus" => BUS).set(0.0);
    Ok(tokio::spawn(run(service, settings, options, shortened, closing)))
}

async fn run(
    service: Service,
    settings: MqttSettings,
    options: MqttOptions,
    shortened: Shortened,
    closing: CancellationToken,
) {
    let (connected, clients) = watch::channel(None);
    let publisher = || MqttPublisher::new(clients.clone());
    let publishing = async {
        if settings.faults {
            publish_faults(BUS, service.clone(), publisher, closing.clone()).await;
        }
    };
    let broker = Broker {
        service: service.clone(),
        settings: &settings,
        connected,
        shortened,
        long_topics: Reasons::default(),
    };
    tokio::join!(publishing, broker.stay_connected(options, &closing));
}

fn options(settings: &MqttSettings, shortened: Shortened) -> Result<MqttOptions, MqttError> {
    let MqttSettings { host, port, client_id, encrypted, .. } = settings;
    let mut options = MqttOptions::new(client_id, (host.as_str(), *port));
    options.set_keep_alive(KEEP_ALIVE_S);
    // The broker keeps messages of QoS 1 while the service is away.
    options.set_clean_session(false);
    if settings.state {
        let state = TopicStyle::Mqtt.service_state(client_id);
        options.set_last_will(LastWill::new(
            state,
            PresenceWord::Offline.as_str(),
            QoS::AtLeastOnce,
            true,
        ));
    }
    options.set_ack_mode(AckMode::Manual);
    options.set_max_packet_size(shortened.limit(), PROTOCOL_LENGTH);
    if let Some((user, password)) = &settings.user {
        options.set_credentials(user, password.clone());
    }
    let tls = encrypted.then(|| tls(settings)).transpose()?;
    let tls = tls.map(|tls| TlsConnector::from(Arc::new(tls)));
    let dialer = Dialer { host: host.clone(), port: *port, tls, shortened };
    options.set_socket_connector(move |_, _| dialer.clone().connect());
    Ok(options)
}

/// Returns the settings of TLS, with the broker's root certificates.
fn tls(settings: &MqttSettings) -> Result<ClientConfig, MqttError> {
    let mut roots = RootCertStore::empty();
    if let Some(path) = &settings.ca {
        for certificate in certificates("ca", path)? {
            roots.add(certificate).map_err(|error| unreadable("ca", path, &error))?;
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
    let config = config.with_root_certificates(roots);
    let Some((certificate, key)) = &settings.identity else {
        return Ok(config.with_no_client_auth());
    };
    let own = certificates("certificate", certificate)?;
    let key = PrivateKeyDer::from_pem_file(key).map_err(|error| unreadable("key", key, &error))?;
    let identity = config.with_client_auth_cert(own, key);
    identity.map_err(|error| MqttError::Identity { reason: error.to_string() })
}

/// Reads the certificates of a PEM file, at least one.
fn certificates(key: &'static str, path: &Path) -> Result<Vec<CertificateDer<'static>>, MqttError> {
    let read = || CertificateDer::pem_file_iter(path)?.collect::<Result<Vec<_>, _>>();
    let certificates = read().map_err(|error| unreadable(key, path, &error))?;
    match certificates.is_empty() {
        true => Err(unreadable(key, path, &"it has no certificate")),
        false => Ok(certificates),
    }
}

fn unreadable(key: &'static str, path: &Path, reason: &dyn fmt::Display) -> MqttError {
    MqttError::Certificates { key, path: path.to_owned(), reason: reason.to_string() }
}

struct Broker<'a> {
    service: Service,
    settings: &'a MqttSettings,
    connected: watch::Sender<Connected>,
    shortened: Shortened,
    /// The topics of messages that were too long.
    long_topics: Reasons,
}

impl Broker<'_> {
    async fn stay_connected(self, options: MqttOptions, closing: &CancellationToken) {
        let intake = Intake::new(BUS, self.service.clone());
        let reasons = Reasons::default();
        while !closing.is_cancelled() {
            let client = AsyncClient::builder(options.clone()).capacity(MAX_OUTGOING);
            let (client, events) = client.build();
            let MqttSettings { state, client_id, .. } = self.settings;
            let state = state.then(|| TopicStyle::Mqtt.service_state(client_id));
            let (connection, controls) = MqttConnection::new(client, state);
            let (sender, receiver) = queue();
            let answering = intake.clone().run(&connection, receiver);
            let reading = self.read(&intake, &connection, events, sender, closing);
            let reason = tokio::select! {
                (reason, ()) = async { tokio::join!(reading, answering) } => reason,
                () = send_controls(&connection.client, controls) => None,
            };
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
                Ok(rumqttc::Event::Incoming(Packet::Publish(publish))) => {
                    self.note_if_long(&publish);
                    if publish.topic == marker_topic.as_bytes() {
                        connection.link.markers.arrive(&publish.payload);
                        // A topic of a mapping may be the same, at QoS 1.
                        connection.acknowledge(connection.arrive(&publish));
                    } else if let Some(sender) = &sender {
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

    /// Subscribes, says that the service is there, and tells the publisher that there is a
    /// connection.
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
        connection.say(PresenceWord::Online);
        self.connected.send_replace(Some(connection.link.clone()));
    }

    /// Queues a message of a device. One that is not a batch, or cannot be read, is answered at
    /// once.
    fn receive(
        &self,
        intake: &Intake,
        connection: &Arc<MqttConnection>,
        publish: Publish,
        sender: &mpsc::Sender<Delivery<MqttReceipt>>,
    ) {
        let receipt = connection.arrive(&publish);
        let topic = String::from_utf8_lossy(&publish.topic);
        let addressed = match self.address(&topic, publish.retain) {
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
                MessageReply::Answer(answer) => connection.refuse_now(&asset, receipt, &answer),
                MessageReply::Nothing => connection.acknowledge(receipt),
                MessageReply::Again => connection.end(),
            }
        }
    }

    /// Logs a message that was too long, one for each topic.
    fn note_if_long(&self, publish: &Publish) {
        let Some(bytes) = self.shortened.original(publish) else { return };
        let topic = String::from_utf8_lossy(&publish.topic);
        if self.long_topics.is_new(&topic) {
            tracing::error!(
                %topic,
                bytes,
                "a message over MQTT is longer than `limits.batch_bytes` and is refused; let the \
                 broker refuse such messages: `message_size_limit` of Mosquitto, \
                 `max_packet_size` of others"
            );
        }
    }

    /// Returns the asset of a message and its content, or the outcome of one that is left out.
    fn address(
        &self,
        topic: &str,
        is_retained: bool,
    ) -> Result<(String, BusMessage), MessageOutcome> {
        if let Some((entry, asset)) = self.settings.mapping.find(topic) {
            let asset = asset.map_err(|error| refused(topic, &error))?;
            let batch = BusMessage::Batch(Form::Mapped(entry));
            return if is_retained { Err(MessageOutcome::Retained) } else { Ok((asset, batch)) };
        }
        let (asset, kind) =
            TopicStyle::Mqtt.parse(topic).map_err(|error| refused(topic, &error))?;
        if is_retained && kind == DeviceTopic::Telemetry {
            tracing::warn!(topic, "a retained message is not new telemetry; it is ignored");
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

/// What is sent to the broker in this order, and must not be left out.
enum Control {
    PubAck(Publish),
    Disconnect,
}

/// One connection to a broker.
struct MqttConnection {
    client: AsyncClient,
    /// The topic on which the service says whether it is connected, if it does.
    state: Option<String>,
    pubacks: Mutex<PubackQueue<Publish>>,
    link: Arc<BrokerLink>,
    /// No longer than the messages that the broker sends without waiting for acknowledgements,
    /// of which MQTT can number 65 535.
    controls: mpsc::UnboundedSender<Control>,
    /// Cancelled if the connection is to be made again at once.
    renew: CancellationToken,
}

impl MqttConnection {
    fn new(
        client: AsyncClient,
        state: Option<String>,
    ) -> (Arc<Self>, mpsc::UnboundedReceiver<Control>) {
        let link = Arc::new(BrokerLink::new(client.clone()));
        let (controls, receiver) = mpsc::unbounded_channel();
        let (pubacks, renew) = (Mutex::default(), CancellationToken::new());
        (Arc::new(Self { client, state, pubacks, link, controls, renew }), receiver)
    }

    /// Says whether the service is connected. At QoS 0: an acknowledgement of QoS 1 is that of a
    /// fault.
    fn say(&self, state: PresenceWord) {
        if let Some(topic) = &self.state {
            let options = PublishOptions::at_most_once().retained();
            // It fails only when the connection has ended, or much waits to be sent.
            let _ = self.client.try_publish(topic.as_str(), state.as_str(), options);
        }
    }

    fn arrive(&self, publish: &Publish) -> MqttReceipt {
        let without_payload =
            Publish { payload: Bytes::new(), topic: Bytes::new(), ..publish.clone() };
        let mut pubacks = self.pubacks.lock().unwrap_or_else(PoisonError::into_inner);
        (publish.qos == QoS::AtLeastOnce).then(|| pubacks.arrive(without_payload))
    }

    /// Acknowledges a message to the broker, and those that have waited for it.
    fn acknowledge(&self, receipt: MqttReceipt) {
        let Some(number) = receipt else { return };
        let mut pubacks = self.pubacks.lock().unwrap_or_else(PoisonError::into_inner);
        for publish in pubacks.complete(number) {
            self.control(Control::PubAck(publish));
        }
    }

    fn control(&self, control: Control) {
        // It fails only when the connection has ended.
        let _ = self.controls.send(control);
    }

    /// Refuses a batch that is not queued. The broker repeats it over the next connection if that
    /// can help.
    fn refuse_now(&self, asset: &str, receipt: MqttReceipt, answer: &BatchAnswer) {
        let topic = TopicStyle::Mqtt.ack(asset);
        // If there is no room, the device gets no answer and sends its batch again.
        let _ = self.client.try_publish(topic, answer.document(), PublishOptions::at_most_once());
        match (receipt, answer.retry_after_s()) {
            (Some(_), Some(_)) => self.end(),
            _ => self.acknowledge(receipt),
        }
    }

    /// Ends the connection after what is to be sent already, so that it is made again.
    fn end(&self) {
        self.control(Control::Disconnect);
    }
}

async fn send_controls(client: &AsyncClient, mut controls: mpsc::UnboundedReceiver<Control>) {
    while let Some(control) = controls.recv().await {
        // It fails only when the connection has ended.
        let _ = match control {
            Control::PubAck(publish) => client.ack(&publish).await,
            Control::Disconnect => client.disconnect_with_timeout(SEND_TIMEOUT).await,
        };
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
        let (topic, options) = (TopicStyle::Mqtt.ack(asset), PublishOptions::at_most_once());
        let sent = self.client.publish(topic, answer.document(), options);
        if self.renew.run_until_cancelled(timeout(SEND_TIMEOUT, sent)).await.is_none() {
            return;
        }
        if answer.retry_after_s().is_none() {
            self.acknowledge(receipt);
        }
    }

    async fn finish(&self) {
        self.say(PresenceWord::Offline);
        self.end();
    }
}
