//! What the service acknowledges to a broker at QoS 1, seen by a broker that speaks only as much
//! MQTT 3.1.1 as this needs.

use tokio::io::{AsyncReadExt, AsyncWriteExt};
use tokio::net::{TcpListener, TcpStream};
use tokio::time::timeout;

use crate::bus::{BusService, count, metric};
use crate::support::broker::mqtt_config;
use crate::support::bus_device::numbered;
use crate::support::{DEADLINE, rig};
use offbd_core::vocabulary::Sample;

const CONNECT: u8 = 1;
const PUBLISH: u8 = 3;
const PUBACK: u8 = 4;
const SUBSCRIBE: u8 = 8;

/// A connection of the service.
struct Connection {
    socket: TcpStream,
}

impl Connection {
    /// Accepts the service, and confirms its subscriptions.
    async fn accept(listener: &TcpListener) -> Self {
        let (socket, _) = timeout(DEADLINE, listener.accept()).await.unwrap().unwrap();
        let mut connection = Self { socket };
        assert_eq!(connection.packet().await.0, CONNECT);
        connection.socket.write_all(&[0x20, 2, 0, 0]).await.unwrap();
        let (kind, body) = connection.packet().await;
        assert_eq!(kind, SUBSCRIBE);
        connection.socket.write_all(&[0x90, 5, body[0], body[1], 1, 1, 1]).await.unwrap();
        connection
    }

    /// Returns type and content of the next packet.
    async fn packet(&mut self) -> (u8, Vec<u8>) {
        let read = async {
            let kind = self.socket.read_u8().await.unwrap() >> 4;
            let (mut length, mut shift) = (0, 0);
            loop {
                let byte = usize::from(self.socket.read_u8().await.unwrap());
                length |= (byte & 0x7f) << shift;
                shift += 7;
                if byte < 0x80 {
                    break;
                }
            }
            let mut body = vec![0; length];
            self.socket.read_exact(&mut body).await.unwrap();
            (kind, body)
        };
        timeout(DEADLINE, read).await.expect("a packet in time")
    }

    /// Returns the number in the next packet that acknowledges, and skips the answers for the
    /// device.
    async fn puback(&mut self) -> u16 {
        loop {
            let (kind, body) = self.packet().await;
            if kind == PUBACK {
                return u16::from_be_bytes([body[0], body[1]]);
            }
            assert_eq!(kind, PUBLISH);
        }
    }

    /// Sends a batch at QoS 1.
    async fn publish(&mut self, number: u16, topic: &str, payload: &[u8]) {
        let mut body = u16::try_from(topic.len()).unwrap().to_be_bytes().to_vec();
        body.extend(topic.as_bytes());
        body.extend(number.to_be_bytes());
        body.extend(payload);
        let mut packet = vec![0x32];
        let mut length = body.len();
        while length >= 0x80 {
            packet.push(u8::try_from(length & 0x7f).unwrap() | 0x80);
            length >>= 7;
        }
        packet.push(u8::try_from(length).unwrap());
        packet.extend(body);
        self.socket.write_all(&packet).await.unwrap();
    }

    /// Returns whether nothing has been received. Call it when what must not cause a packet is
    /// known to have happened.
    fn is_silent(&self) -> bool {
        let mut byte = [0];
        self.socket.try_read(&mut byte).is_err_and(|e| e.kind() == std::io::ErrorKind::WouldBlock)
    }
}

async fn service(listener: &TcpListener) -> BusService {
    let port = listener.local_addr().unwrap().port();
    let fixture = crate::bus::start_with(|config| {
        let mqtt = offbd::config::MqttConfig { faults: false, ..mqtt_config(port) };
        config.mqtt = Some(mqtt);
    })
    .await;
    fixture.client.asset("a").await;
    fixture.client.asset("b").await;
    fixture
}

fn part(samples: &[Sample], i: usize) -> Vec<u8> {
    numbered(&i.to_string(), &samples[10 * i..10 * i + 10])
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_message_is_acknowledged_to_the_broker_after_the_commit_and_in_order() {
    let listener = TcpListener::bind("127.0.0.1:0").await.unwrap();
    let fixture = service(&listener).await;
    let mut broker = Connection::accept(&listener).await;
    let samples = rig(100, 100);
    // The first batch opens the session.
    broker.publish(1, "offbd/v1/a/telemetry", &part(&samples, 0)).await;
    assert_eq!(broker.puback().await, 1);

    // The counter is that of the whole process, in which other tests run too.
    let topic = "offbd_bus_messages_total{bus=\"mqtt\",outcome=\"topic\"}";
    let before = count(&fixture.client, topic).await;
    let lock = fixture.lock_store().await;
    broker.publish(2, "offbd/v1/a/telemetry", &part(&samples, 1)).await;
    broker.publish(3, "offbd/v1/nobody/telemetry", &part(&samples, 1)).await;
    broker.publish(4, "offbd/v1/b/x", b"junk").await;
    broker.publish(5, "offbd/v1/a/telemetry", &part(&samples, 2)).await;
    // What is refused is known before the batch is durable, and waits for it.
    metric(&fixture.client, "offbd_samples_in_flight", |n| n >= 20.0).await;
    metric(&fixture.client, topic, |n| n > before).await;
    assert!(broker.is_silent());
    lock.release().await;
    for number in 2..=5 {
        assert_eq!(broker.puback().await, number);
    }
    assert_eq!(fixture.client.recording("a", "s").await, samples[..30]);
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_new_connection_gets_no_acknowledgement_of_the_previous_one() {
    let listener = TcpListener::bind("127.0.0.1:0").await.unwrap();
    let fixture = service(&listener).await;
    let mut broker = Connection::accept(&listener).await;
    let samples = rig(100, 100);
    broker.publish(1, "offbd/v1/a/telemetry", &part(&samples, 0)).await;
    assert_eq!(broker.puback().await, 1);
    let lock = fixture.lock_store().await;
    broker.publish(2, "offbd/v1/a/telemetry", &part(&samples, 1)).await;
    metric(&fixture.client, "offbd_samples_in_flight", |n| n >= 10.0).await;
    drop(broker);
    lock.release().await;
    // The same number is another message now.
    let mut broker = Connection::accept(&listener).await;
    metric(&fixture.client, "offbd_samples_in_flight", |n| n == 0.0).await;
    broker.publish(7, "offbd/v1/a/telemetry", &part(&samples, 2)).await;
    assert_eq!(broker.puback().await, 7);
    broker.publish(2, "offbd/v1/a/telemetry", &part(&samples, 1)).await;
    assert_eq!(broker.puback().await, 2);
    assert_eq!(fixture.client.recording("a", "s").await, samples[..30]);
}

/// A batch that cannot be taken at present is tried again, before those that follow it, and not
/// acknowledged until then. Other rigs go on over the same connection.
#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_batch_that_cannot_be_taken_at_present_is_tried_again() {
    let listener = TcpListener::bind("127.0.0.1:0").await.unwrap();
    let fixture = service(&listener).await;
    let mut broker = Connection::accept(&listener).await;
    let samples = rig(10, 10);
    // Sessions begin at a limited rate: 429.
    let mut refused = None;
    for number in 1..=300_u16 {
        let mut document = crate::support::batch(Some(&format!("s{number}")), &samples[..5]);
        document["id"] = serde_json::json!("x");
        broker.publish(number, "offbd/v1/a/telemetry", document.to_string().as_bytes()).await;
        let (kind, body) = broker.packet().await;
        assert_eq!(kind, PUBLISH);
        if String::from_utf8_lossy(&body).contains("\"retry_after_s\"") {
            refused = Some(document);
            break;
        }
        assert_eq!(broker.puback().await, number);
    }
    let refused = refused.expect("a limit of new sessions");
    // One that follows it in its session, and one of another rig.
    let mut next = crate::support::batch(refused["session"].as_str(), &samples[5..]);
    next["id"] = serde_json::json!("next");
    broker.publish(301, "offbd/v1/a/telemetry", next.to_string().as_bytes()).await;
    broker.publish(302, "offbd/v1/b/telemetry", &part(&samples, 0)).await;
    let (mut numbers, mut answers) = (Vec::new(), Vec::new());
    while numbers.last() != Some(&302) {
        match broker.packet().await {
            (PUBACK, body) => numbers.push(u16::from_be_bytes([body[0], body[1]])),
            (_, body) => answers.push(String::from_utf8_lossy(&body).into_owned()),
        }
    }
    assert!(numbers.is_sorted() && numbers.len() == 3, "{numbers:?}");
    assert!(answers.iter().all(|answer| answer.contains("\"accepted\":")), "{answers:?}");
    let of = |asset: &str| answers.iter().filter(|a| a.contains(&format!("/{asset}/"))).count();
    assert_eq!((of("a"), of("b")), (2, 1), "{answers:?}");
    let session = refused["session"].as_str().unwrap();
    assert_eq!(fixture.client.recording("a", session).await, samples);
}
