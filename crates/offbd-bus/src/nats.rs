//! A NATS server: batches of devices in, acknowledgements and faults out. Devices that speak
//! MQTT reach the same subjects through the server.

use std::path::PathBuf;
use std::sync::Arc;
use std::time::Duration;

use async_nats::connection::State;
use async_nats::{Client, ConnectOptions, Event as ClientEvent, Message, Subject};
use futures_util::StreamExt;
use futures_util::stream::{SelectAll, select_all};
use tokio::sync::{Notify, Semaphore, mpsc};
use tokio::task::JoinHandle;
use tokio::time::timeout;
use tokio_util::sync::CancellationToken;

use super::callout::{self, Issuer};
use super::faults::{FaultMessage, Publishing, publish_faults};
use super::intake::{Answering, Delivery, Intake, MessageReply, queue};
use super::settings::{UnsafeServer, check_streams, check_version, doubts};
use super::{RETRY_INTERVAL, SEND_TIMEOUT, count};
use offbd_http::MessageOutcome;
use offbd_net::Reasons;
use offbd_service::Service;
use offbd_wire::bus::{DeviceTopic, INBOX, TopicStyle, encoded, inbox, is_below, service_inbox};

const BUS: &str = "nats";

/// Longest time of one attempt to connect.
const CONNECT_TIMEOUT: Duration = Duration::from_secs(5);

/// Pause between two messages to itself.
const ECHO_INTERVAL: Duration = Duration::from_secs(2);

/// Longest wait for a message to itself; then the connection is made again. Chosen: much longer
/// than a message takes.
const ECHO_TIMEOUT: Duration = Duration::from_secs(4);

/// How often the connection is made again although no message to itself has ever arrived: the
/// server may not permit them.
const ECHO_TRIES: u32 = 3;

/// Messages of one subject that the client holds; when there are more, they are dropped, and
/// devices send them again.
const MAX_UNREAD: usize = 1024;

/// Questions for the rights of devices that are answered at a time; further ones wait.
const MAX_QUESTIONS: usize = 64;

/// How to connect to a NATS server, and what to do there.
#[derive(Clone, Debug, Default)]
pub struct NatsSettings {
    /// `nats://HOST:PORT` or `tls://HOST:PORT`, several of one cluster.
    pub servers: Vec<String>,
    pub user: Option<(String, String)>,
    /// A file with credentials (a JSON Web Token and a seed).
    pub credentials: Option<PathBuf>,
    /// Certificates that the server's must come from, a PEM file; without it those of the
    /// machine.
    pub ca: Option<PathBuf>,
    /// The monitoring ports of the servers, `http://HOST:PORT` with `,` between, to check their
    /// settings.
    pub monitor: Option<String>,
    /// Whether faults are published.
    pub faults: bool,
    /// The seed of the key that signs the rights of devices; without it the server does not
    /// ask for them.
    pub issuer_seed: Option<String>,
    /// The account that devices are in.
    pub account: String,
}

/// Why the settings, or the server, cannot be used.
#[derive(Debug, thiserror::Error)]
pub enum NatsError {
    #[error("`nats.url`: {0}")]
    Url(String),
    #[error("`nats.credentials`: {0}")]
    Credentials(std::io::Error),
    #[error("{0}")]
    Key(String),
    #[error(transparent)]
    Unsafe(#[from] UnsafeServer),
}

/// Connects, and takes batches until the service stops.
///
/// # Errors
/// [`NatsError`] if the settings are invalid, or the server's are unsafe. A server that cannot
/// be reached is not an error: the connection is tried again.
pub async fn start(
    service: Service,
    settings: NatsSettings,
    closing: CancellationToken,
) -> Result<JoinHandle<()>, NatsError> {
    let issuer = settings.issuer_seed.as_ref().map(|seed| {
        let issuer = Issuer::new(seed, settings.account.clone());
        issuer.map(Arc::new).map_err(|error| NatsError::Key(error.to_string()))
    });
    for gauge in ["offbd_bus_connected", "offbd_bus_unsafe"] {
        metrics::gauge!(gauge, "bus" => BUS).set(0.0);
    }
    let bus = NatsBus {
        service,
        issuer: issuer.transpose()?,
        settings,
        closing,
        connected: Arc::default(),
        reasons: Arc::default(),
    };
    let client = match bus.connect().await? {
        Some(client) => {
            bus.check(&client).await?;
            Some(client)
        }
        None => None,
    };
    Ok(tokio::spawn(bus.run(client)))
}

struct NatsBus {
    service: Service,
    settings: NatsSettings,
    issuer: Option<Arc<Issuer>>,
    closing: CancellationToken,
    /// Told after each connection.
    connected: Arc<Notify>,
    /// What has been logged since the last connection.
    reasons: Arc<Reasons>,
}

impl NatsBus {
    /// Returns a client; `None` if no server can be reached.
    async fn connect(&self) -> Result<Option<Client>, NatsError> {
        let NatsSettings { servers, user, credentials, ca, .. } = &self.settings;
        let (connected, reasons) = (self.connected.clone(), self.reasons.clone());
        let mut options = ConnectOptions::new()
            .name("offbd")
            .connection_timeout(CONNECT_TIMEOUT)
            .subscription_capacity(MAX_UNREAD)
            .custom_inbox_prefix(service_inbox())
            .event_callback(move |event| noted(event, connected.clone(), reasons.clone()));
        if let Some((user, password)) = user {
            options = options.user_and_password(user.clone(), password.clone());
        }
        if let Some(path) = credentials {
            options = options.credentials_file(path).await.map_err(NatsError::Credentials)?;
        }
        if let Some(path) = ca {
            options = options.add_root_certificates(path.clone());
        }
        let addresses: Result<Vec<async_nats::ServerAddr>, _> =
            servers.iter().map(|server| server.parse()).collect();
        let addresses =
            addresses.map_err(|error: std::io::Error| NatsError::Url(error.to_string()))?;
        match options.connect(addresses).await {
            Ok(client) => Ok(Some(client)),
            Err(error) => {
                if self.reasons.is_new(&error) {
                    tracing::warn!(%error, "cannot connect to the NATS server; trying again");
                }
                Ok(None)
            }
        }
    }

    /// Checks the server, and those whose monitoring ports are known. Returns their ids.
    async fn check(&self, client: &Client) -> Result<Vec<String>, UnsafeServer> {
        check_version(&client.server_info().version)?;
        match &self.settings.monitor {
            Some(monitors) => check_streams(monitors).await,
            None => Ok(Vec::new()),
        }
    }

    /// Checks again after each connection, and tells what is found.
    async fn check_connections(&self, client: &Client) {
        loop {
            self.connected.notified().await;
            // The client knows the new server once this is sent.
            if !matches!(timeout(SEND_TIMEOUT, client.flush()).await, Ok(Ok(()))) {
                continue;
            }
            let is_unsafe = metrics::gauge!("offbd_bus_unsafe", "bus" => BUS);
            match self.check(client).await {
                Ok(checked) => {
                    is_unsafe.set(0.0);
                    let batch_bytes = self.service.limits().requests.batch_bytes;
                    for doubt in doubts(&client.server_info(), batch_bytes, &checked) {
                        tracing::warn!("about the NATS server: {doubt}");
                    }
                }
                Err(error @ UnsafeServer::Unreadable { .. }) => {
                    tracing::warn!(%error, "not checked")
                }
                Err(error) => {
                    is_unsafe.set(1.0);
                    tracing::error!(%error, "the NATS server may lose messages; it is used");
                }
            }
        }
    }

    /// Connects if there is no client yet, then takes messages.
    async fn run(self, client: Option<Client>) {
        let closing = self.closing.clone();
        let client = match client {
            Some(client) => client,
            None => match closing.run_until_cancelled(self.connect_later()).await {
                Some(client) => client,
                None => return,
            },
        };
        if let Err(error) = self.serve(client).await {
            tracing::error!(%error, "cannot subscribe at the NATS server");
        }
    }

    async fn connect_later(&self) -> Client {
        // Apart: each connection to a server that is not used succeeds.
        let refused = Reasons::default();
        loop {
            tokio::time::sleep(RETRY_INTERVAL).await;
            let Ok(Some(client)) = self.connect().await else { continue };
            match self.check(&client).await {
                Ok(_) => return client,
                Err(error) if refused.is_new(&error) => {
                    tracing::error!(%error, "the NATS server is not used");
                }
                Err(_) => {}
            }
        }
    }

    async fn serve(&self, client: Client) -> Result<(), async_nats::SubscribeError> {
        let intake = Intake::new(BUS, self.service.clone());
        let answers = NatsAnswers {
            client: client.clone(),
            own_inboxes: self.issuer.is_some(),
            reasons: self.reasons.clone(),
        };
        let mut subscriptions = Vec::new();
        for topic in DeviceTopic::ALL {
            let subject = TopicStyle::Nats.topic(&["*", topic.as_str()]);
            subscriptions.push(client.subscribe(subject).await?);
        }
        let questions = match &self.issuer {
            Some(issuer) => {
                let asked = client.queue_subscribe(callout::SUBJECT, "offbd".to_owned()).await?;
                Some((issuer.clone(), asked))
            }
            None => None,
        };
        let publishing = async {
            if self.settings.faults {
                let (service, closing) = (self.service.clone(), self.closing.clone());
                publish_faults(BUS, service, || client.clone(), closing).await;
            }
        };
        let answering_questions = async {
            if let Some((issuer, asked)) = questions {
                self.closing.run_until_cancelled(self.answer(&answers, issuer, asked)).await;
            }
        };
        let checking = self.closing.run_until_cancelled(self.check_connections(&client));
        let listening = self.closing.run_until_cancelled(listen_to_itself(&client));
        let (sender, receiver) = queue();
        let reading = self.read(&intake, &answers, select_all(subscriptions), sender);
        let answering = intake.clone().run(&answers, receiver);
        tokio::join!(publishing, answering_questions, checking, listening, reading, answering);
        Ok(())
    }

    /// Queues the messages of devices until the service stops.
    async fn read(
        &self,
        intake: &Intake,
        answers: &NatsAnswers,
        mut messages: SelectAll<async_nats::Subscriber>,
        sender: mpsc::Sender<Delivery<Option<Subject>>>,
    ) {
        while let Some(Some(message)) = self.closing.run_until_cancelled(messages.next()).await {
            let Message { subject, reply, payload, .. } = message;
            let (asset, kind) = match TopicStyle::Nats.parse(&subject) {
                Ok(topic) => topic,
                Err(error) => {
                    tracing::warn!(%error, "a message is refused");
                    intake.count(MessageOutcome::Topic);
                    continue;
                }
            };
            let addressed = (asset, kind.into());
            if let Err((asset, receipt, reply)) =
                intake.queue(&sender, addressed, payload, reply, false)
            {
                answers.answer(&asset, receipt, *reply).await;
            }
        }
    }

    /// Answers the questions of the server for the rights of devices.
    async fn answer(
        &self,
        answers: &NatsAnswers,
        issuer: Arc<Issuer>,
        mut asked: async_nats::Subscriber,
    ) {
        let permits = Arc::new(Semaphore::new(MAX_QUESTIONS));
        while let Some(message) = asked.next().await {
            let Some(reply) = message.reply else { continue };
            if !answers.may_reply(callout::SUBJECT, &reply, callout::SERVER_INBOX) {
                continue;
            }
            let Ok(permit) = permits.clone().acquire_owned().await else { return };
            let (service, issuer) = (self.service.clone(), issuer.clone());
            let client = answers.client.clone();
            let answering = async move {
                match issuer.answer(&service, &message.payload).await {
                    Ok(answer) => send(&client, reply, answer.into_bytes()).await,
                    Err(error) => {
                        tracing::warn!(%error, "a login request of the NATS server is not valid; it is ignored")
                    }
                }
                drop(permit);
            };
            let closing = self.closing.clone();
            tokio::spawn(async move { closing.run_until_cancelled_owned(answering).await });
        }
    }
}

async fn noted(event: ClientEvent, connected: Arc<Notify>, reasons: Arc<Reasons>) {
    match event {
        ClientEvent::Connected => {
            tracing::info!("connected to the NATS server");
            reasons.clear();
            connected.notify_one();
            metrics::gauge!("offbd_bus_connected", "bus" => BUS).set(1.0);
        }
        ClientEvent::Disconnected | ClientEvent::Closed => {
            tracing::warn!("the connection to the NATS server is lost");
            metrics::gauge!("offbd_bus_connected", "bus" => BUS).set(0.0);
        }
        ClientEvent::SlowConsumer(_) => {
            count(BUS, MessageOutcome::Dropped, 1);
            if reasons.is_new(&"dropped messages") {
                tracing::warn!("more messages arrive over NATS than are read; some are dropped");
            }
        }
        event if reasons.is_new(&event) => {
            tracing::warn!(%event, "the NATS server reports");
        }
        _ => {}
    }
}

/// Sends a message; one that cannot be sent in time is dropped.
async fn send(client: &Client, subject: impl async_nats::subject::ToSubject, document: Vec<u8>) {
    if !matches!(timeout(SEND_TIMEOUT, client.publish(subject, document.into())).await, Ok(Ok(())))
    {
        tracing::warn!("a message to the NATS server is dropped");
    }
}

/// Answers devices with the service's own rights, and so only where they may receive.
struct NatsAnswers {
    client: Client,
    /// Whether the devices of each asset receive replies below their own subject.
    own_inboxes: bool,
    reasons: Arc<Reasons>,
}

impl NatsAnswers {
    /// Returns whether a message to `subject` may be answered on `reply`, which must be below
    /// `parent`; counts and logs it if not.
    fn may_reply(&self, subject: &str, reply: &str, parent: &str) -> bool {
        if is_below(reply, parent) {
            return true;
        }
        metrics::counter!("offbd_bus_replies_refused_total").increment(1);
        // Any number of devices may do this, each with any number of subjects.
        if self.reasons.is_new(&"a reply subject") {
            tracing::warn!(
                subject,
                reply,
                "not answered there: the reply subject is not below {parent}."
            );
        }
        false
    }
}

impl Answering for NatsAnswers {
    type Receipt = Option<Subject>;

    async fn answer(&self, asset: &str, reply_to: Option<Subject>, reply: MessageReply) {
        let MessageReply::Answer(answer) = reply else { return };
        let document = answer.document();
        let ack = TopicStyle::Nats.ack(asset);
        if let Some(reply_to) = reply_to {
            let parent = if self.own_inboxes { inbox(&encoded(asset)) } else { INBOX.to_owned() };
            if self.may_reply(&ack, &reply_to, &parent) {
                send(&self.client, reply_to, document.clone()).await;
            }
        }
        send(&self.client, ack, document).await;
    }

    async fn finish(&self) {
        let _ = timeout(SEND_TIMEOUT, self.client.flush()).await;
    }
}

impl Publishing for Client {
    async fn publish(&self, message: FaultMessage<'_>) {
        let FaultMessage { asset, code, document, .. } = message;
        let subject = TopicStyle::Nats.fault(asset, code);
        loop {
            let sent = Self::publish(self, subject.clone(), document.clone().into()).await;
            // While the server is away, the flush fails or waits for it.
            if sent.is_ok() && self.flush().await.is_ok() {
                return;
            }
            tokio::time::sleep(RETRY_INTERVAL).await;
        }
    }
}

/// Sends messages to itself, and makes the connection again if one does not arrive: a link may
/// lose messages silently. The client itself asks the server for a sign of life only while
/// nothing arrives, so it does not notice that what it sends is lost.
async fn listen_to_itself(client: &Client) {
    let inbox = client.new_inbox();
    let Ok(mut echoes) = client.subscribe(inbox.clone()).await else { return };
    let mut trust = EchoTrust::default();
    loop {
        // The client has closed if this fails.
        if client.publish(inbox.clone(), "".into()).await.is_err() {
            return;
        }
        match timeout(ECHO_TIMEOUT, echoes.next()).await {
            Ok(None) => return,
            Ok(Some(_)) => trust.has_arrived = true,
            Err(_) if client.connection_state() != State::Connected => {}
            Err(_) if trust.missed() => {
                tracing::warn!("messages to the NATS server or from it are lost; connecting again");
                let _ = client.force_reconnect().await;
            }
            Err(_) => {}
        }
        tokio::time::sleep(ECHO_INTERVAL).await;
    }
}

/// Whether a missing message to itself means that the connection loses messages.
#[derive(Default)]
struct EchoTrust {
    /// Whether one has ever arrived: then the server permits them.
    has_arrived: bool,
    n_missed: u32,
}

impl EchoTrust {
    /// Counts a message that has not arrived. Returns whether the connection is to be made again.
    fn missed(&mut self) -> bool {
        self.n_missed = self.n_missed.saturating_add(1);
        self.has_arrived || self.n_missed <= ECHO_TRIES
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_connection_is_made_again_some_times_if_no_message_to_itself_ever_arrives() {
        let mut trust = EchoTrust::default();
        let n = (0..100).filter(|_| trust.missed()).count();
        assert_eq!(n, ECHO_TRIES as usize);
    }

    #[test]
    fn the_connection_is_always_made_again_once_a_message_to_itself_has_arrived() {
        let mut trust = EchoTrust::default();
        assert!((0..100).filter(|_| trust.missed()).count() < 100);
        trust.has_arrived = true;
        assert!((0..100).all(|_| trust.missed()));
    }
}
