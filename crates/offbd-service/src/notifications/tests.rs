//! Notifications over simulated time: reminders, silence, and a target that is away for long.

use std::sync::Arc;
use std::sync::atomic::{AtomicI64, Ordering};

use super::*;
use crate::{Clock, Limits, Service};
use offbd_store::{
    AlarmWrite, AssetRow, CommunicationChange, Location, Micros, MuteRow, SessionRow, Store,
    TransitionRow, Write,
};
use offbd_wire::notification::{NewChannelView, NewRuleView, NewWebhookView};
use offbd_wire::words::AlarmCodeWord;
use serde_json::json;

const SECOND: Micros = 1_000_000;
const HOUR: Micros = 3600 * SECOND;

/// Where messages arrive, with the time of each attempt.
#[derive(Default)]
struct Inbox {
    attempts: Mutex<Vec<(Micros, NotificationView)>>,
    /// Time until which nothing is taken.
    away_until: AtomicI64,
    clock: Arc<AtomicI64>,
}

impl NotificationTransport for Arc<Inbox> {
    async fn send(&self, _: &StoredChannel, message: &NotificationView) -> SendOutcome {
        let now = self.clock.load(Ordering::SeqCst);
        self.attempts.lock().unwrap().push((now, message.clone()));
        match now < self.away_until.load(Ordering::SeqCst) {
            true => SendOutcome::Failed { reason: "away".to_owned(), retry_after: None },
            false => SendOutcome::Delivered,
        }
    }
}

/// A service without its threads but the writer, with the asset `a`, a channel and a rule.
struct NotifierFixture {
    service: Service,
    notifier: Notifier<Arc<Inbox>>,
    inbox: Arc<Inbox>,
    _data: tempfile::TempDir,
}

impl NotifierFixture {
    async fn new(rule: serde_json::Value) -> Self {
        let data = tempfile::tempdir().unwrap();
        let location = Location::File(data.path().join("store.sqlite"));
        let (store, writer) = Store::open(&location).await.unwrap();
        let inbox = Arc::<Inbox>::default();
        let clock = Clock::Simulated(inbox.clock.clone());
        let (service, parts) =
            Service::assemble(store, writer, Limits::default(), None, None, clock);
        parts.committer.spawn().unwrap();
        let asset = AssetRow { name: "a".into(), document: "{}".into(), ..AssetRow::default() };
        service.inner.handles.write("a", vec![Write::CreateAsset(asset)]).await.unwrap();
        let webhook =
            NewWebhookView { url: "https://hooks.example/".into(), ..NewWebhookView::default() };
        let channel = NewChannelView { name: "hook".into(), webhook: Some(webhook), email: None };
        let channel = service.create_channel(channel).await.unwrap().channel.id;
        let mut whole = json!({ "name": "r", "channel": channel });
        whole.as_object_mut().unwrap().extend(rule.as_object().unwrap().clone());
        let rule: NewRuleView = serde_json::from_value(whole).unwrap();
        service.create_rule(rule).await.unwrap();
        let notifier = service.notifier(inbox.clone());
        Self { service, notifier, inbox, _data: data }
    }

    /// Data of the asset stay away, or come back.
    async fn change(&self, is_lost: bool) {
        let status = if is_lost { "confirmed" } else { "passed" };
        let document = json!({ "type": "communication", "code": "communication_lost",
            "status": status, "summary": "it happened" });
        self.write(Write::Communication(CommunicationChange {
            id: 0,
            asset: "a".into(),
            session: None,
            is_lost,
            since: 0,
            at: self.inbox.clock.load(Ordering::SeqCst),
            document: document.to_string(),
        }))
        .await;
    }

    /// The servo along x is confirmed as failing, with or without a kind, as the transition
    /// `ordinal` of a session.
    async fn confirm(&self, ordinal: i64, kind: Option<&str>) {
        if ordinal == 0 {
            let session = SessionRow { id: "s".into(), asset: "a".into(), ..SessionRow::default() };
            self.write(Write::OpenSession(session)).await;
        }
        let document = json!({ "type": "fault", "code": "x_servo", "status": "confirmed",
            "status_byte": "2F", "onset_s": 1.5, "kind": kind });
        self.write(Write::Transition(TransitionRow {
            id: 0,
            asset: "a".into(),
            session: "s".into(),
            ordinal,
            t_s: 2.0,
            code: "x_servo".into(),
            status: "confirmed".into(),
            at: self.inbox.clock.load(Ordering::SeqCst),
            document: document.to_string(),
        }))
        .await;
    }

    async fn write(&self, write: Write) {
        self.service.inner.handles.write("a", vec![write]).await.unwrap();
    }

    /// Lets time pass up to `until`, with a turn every `step`, in each of which all that is due
    /// is sent. Returns times in seconds, types and ids of the attempts.
    async fn pass(&self, until: Micros, step: Micros) -> Vec<(i64, String, String)> {
        let context = &self.notifier.context;
        self.inbox.attempts.lock().unwrap().clear();
        loop {
            let channels = context.handles.store.channels().await.unwrap();
            let rules = context.rules().await.unwrap();
            context.plan(&channels[0], &rules).await.unwrap();
            context.remind(&rules).await.unwrap();
            context.deliver(&channels[0]).await.unwrap();
            if self.inbox.clock.load(Ordering::SeqCst) >= until {
                break;
            }
            self.inbox.clock.fetch_add(step, Ordering::SeqCst);
        }
        let attempts = self.inbox.attempts.lock().unwrap();
        let short = |kind: &str| kind.trim_start_matches("org.offbd.fault.").to_owned();
        attempts.iter().map(|(at, m)| (at / SECOND, short(&m.kind), m.id.clone())).collect()
    }
}

fn attempts(expected: &[(i64, &str, &str)]) -> Vec<(i64, String, String)> {
    expected.iter().map(|(at, kind, id)| (*at, (*kind).to_owned(), (*id).to_owned())).collect()
}

#[tokio::test(flavor = "multi_thread")]
async fn reminders_come_until_somebody_acknowledges() {
    let fixture = NotifierFixture::new(json!({ "repeat_s": 3600 })).await;
    fixture.change(true).await;
    let sent = fixture.pass(2 * HOUR, 600 * SECOND).await;
    let expected = [
        (0, "confirmed.v1", "evt_1"),
        (3600, "reminder.v1", "evt_1.1"),
        (7200, "reminder.v1", "evt_1.2"),
    ];
    assert_eq!(sent, attempts(&expected));
    let (asset, actor) = ("a".to_owned(), "ann".to_owned());
    let acknowledge = AlarmWrite::AcknowledgeCommunication { asset, actor, at: 2 * HOUR };
    fixture.write(Write::Alarm(acknowledge)).await;
    assert_eq!(fixture.pass(5 * HOUR, 600 * SECOND).await, []);
    // The next occurrence is told again, and nothing after its end.
    fixture.change(false).await;
    fixture.change(true).await;
    fixture.change(false).await;
    let sent = fixture.pass(8 * HOUR, 600 * SECOND).await;
    let at = 5 * 3600;
    let expected =
        [(at, "passed.v1", "evt_2"), (at, "confirmed.v1", "evt_3"), (at, "passed.v1", "evt_4")];
    assert_eq!(sent, attempts(&expected));
}

#[tokio::test(flavor = "multi_thread")]
async fn a_fault_in_a_silence_is_told_at_its_end_if_the_rule_repeats() {
    let silent = |rule: serde_json::Value| async move {
        let fixture = NotifierFixture::new(rule).await;
        fixture.change(true).await;
        fixture.pass(3 * HOUR, 1200 * SECOND).await
    };
    let until = "1970-01-01T02:00:00Z";
    let once = silent(json!({ "silent_until": until })).await;
    assert_eq!(once, [], "without reminders, what happens in a silence is not told");
    let sent = silent(json!({ "silent_until": until, "repeat_s": 3600 })).await;
    let expected = [(7200, "reminder.v1", "evt_1.1"), (10_800, "reminder.v1", "evt_1.2")];
    assert_eq!(sent, attempts(&expected));
}

#[tokio::test(flavor = "multi_thread")]
async fn a_fault_is_told_once_it_has_failed_for_as_long_as_the_rule_waits() {
    let fixture = NotifierFixture::new(json!({ "delay_s": 600 })).await;
    // A loss that ends earlier is not told, nor is its end, whether both are planned together or not.
    fixture.change(true).await;
    assert_eq!(fixture.pass(300 * SECOND, 100 * SECOND).await, []);
    fixture.change(false).await;
    fixture.change(true).await;
    fixture.change(false).await;
    assert_eq!(fixture.pass(2000 * SECOND, 100 * SECOND).await, []);
    fixture.change(true).await;
    let sent = fixture.pass(4000 * SECOND, 100 * SECOND).await;
    assert_eq!(sent, attempts(&[(2600, "confirmed.v1", "evt_5")]));
    fixture.change(false).await;
    let sent = fixture.pass(4100 * SECOND, 100 * SECOND).await;
    assert_eq!(sent, attempts(&[(4000, "passed.v1", "evt_6")]));
}

#[tokio::test(flavor = "multi_thread")]
async fn a_fault_of_quiet_hours_is_told_at_their_end_if_it_still_fails() {
    let hours = json!({ "from": "01:00", "to": "02:00" });
    let fixture = NotifierFixture::new(json!({ "quiet_hours": hours })).await;
    fixture.pass(HOUR + 60 * SECOND, 600 * SECOND).await;
    // A loss that ends within them is not told, nor is its end.
    fixture.change(true).await;
    fixture.change(false).await;
    fixture.change(true).await;
    let sent = fixture.pass(3 * HOUR, 600 * SECOND).await;
    assert_eq!(sent.len(), 1, "{sent:?}");
    assert!((7200..7860).contains(&sent[0].0), "{sent:?}");
    assert_eq!((sent[0].1.as_str(), sent[0].2.as_str()), ("confirmed.v1", "evt_3"));
    fixture.change(false).await;
    assert_eq!(fixture.pass(3 * HOUR + 60 * SECOND, 60 * SECOND).await.len(), 1);
    // A loss outside the quiet hours is sent immediately.
    fixture.pass(24 * HOUR, HOUR).await;
    fixture.change(true).await;
    assert_eq!(fixture.pass(24 * HOUR + 60 * SECOND, 60 * SECOND).await.len(), 1);
}

#[tokio::test(flavor = "multi_thread")]
async fn a_fault_that_is_told_late_is_repeated_from_then_on() {
    let rule = json!({ "delay_s": 600, "repeat_s": 3600 });
    let fixture = NotifierFixture::new(rule).await;
    fixture.change(true).await;
    let sent = fixture.pass(2 * HOUR, 600 * SECOND).await;
    let expected = [(600, "confirmed.v1", "evt_1"), (4200, "reminder.v1", "evt_1.1")];
    assert_eq!(sent, attempts(&expected));
}

#[tokio::test(flavor = "multi_thread")]
async fn a_muted_fault_is_neither_told_nor_reminded_of() {
    let fixture = NotifierFixture::new(json!({ "repeat_s": 3600 })).await;
    fixture.change(true).await;
    assert_eq!(fixture.pass(0, SECOND).await.len(), 1);
    fixture.service.inner.mutes.set(
        AlarmCodeWord::CommunicationLost,
        MuteRow {
            asset: "a".into(),
            code: "communication_lost".into(),
            actor: "ann".into(),
            reason: "moving".into(),
            at: 0,
            until: 5 * HOUR,
        },
    );
    fixture.change(false).await;
    fixture.change(true).await;
    assert_eq!(fixture.pass(5 * HOUR - SECOND, 1800 * SECOND).await, []);
}

/// Nothing is lost and nothing overtakes while the target is away; after a day it is given up.
#[tokio::test(flavor = "multi_thread")]
async fn a_target_that_is_away_gets_all_in_order_or_they_are_given_up() {
    let fixture = NotifierFixture::new(json!({})).await;
    fixture.inbox.away_until.store(20 * HOUR, Ordering::SeqCst);
    fixture.change(true).await;
    fixture.change(false).await;
    let sent = fixture.pass(21 * HOUR, 5 * SECOND * 60).await;
    let ids: Vec<_> = sent.iter().map(|(.., id)| id.as_str()).collect();
    let n = ids.iter().filter(|id| **id == "evt_1").count();
    assert!((20..40).contains(&n), "{n} attempts in 21 hours");
    assert_eq!(ids[n..], ["evt_2"], "the second waits for the first");

    fixture.inbox.away_until.store(Micros::MAX, Ordering::SeqCst);
    fixture.change(true).await;
    let sent = fixture.pass(46 * HOUR, 300 * SECOND).await;
    assert!(sent.iter().all(|(.., id)| id == "evt_3"), "{sent:?}");
    let page = fixture.service.deliveries(Default::default(), 10).await.unwrap();
    let newest = &page.items[0];
    assert_eq!((newest.message_id.as_str(), newest.state.as_str()), ("evt_3", "given_up"));
    assert_eq!(newest.error.as_deref(), Some("away"));
    assert_eq!(fixture.pass(50 * HOUR, 300 * SECOND).await, [], "given up for good");
}

#[tokio::test(flavor = "multi_thread")]
async fn a_kind_that_follows_soon_is_in_the_first_message_and_a_late_one_updates_it() {
    let fixture = NotifierFixture::new(json!({})).await;
    fixture.confirm(0, None).await;
    assert_eq!(fixture.pass(SECOND, SECOND).await, [], "it waits for its kind");
    fixture.confirm(1, Some("dead")).await;
    let sent = fixture.pass(5 * SECOND, SECOND).await;
    assert_eq!(sent, attempts(&[(1, "confirmed.v1", "evt_2")]));

    let fixture = NotifierFixture::new(json!({})).await;
    fixture.confirm(0, None).await;
    let sent = fixture.pass(8 * SECOND, SECOND).await;
    assert_eq!(sent, attempts(&[(5, "confirmed.v1", "evt_1")]));
    fixture.confirm(1, Some("dead")).await;
    let sent = fixture.pass(9 * SECOND, SECOND).await;
    assert_eq!(sent, attempts(&[(8, "updated.v1", "evt_2")]));
    let updates = || {
        let last = fixture.inbox.attempts.lock().unwrap().pop().unwrap();
        last.1.data.updates
    };
    assert_eq!(updates().as_deref(), Some("evt_1"));
    // Two more, of which the last one has the message.
    fixture.confirm(2, Some("dead")).await;
    fixture.confirm(3, Some("held")).await;
    let sent = fixture.pass(11 * SECOND, SECOND).await;
    assert_eq!(sent, attempts(&[(9, "updated.v1", "evt_4")]));
    assert_eq!(updates().as_deref(), Some("evt_2"));
}
