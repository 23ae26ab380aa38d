//! Notifications: channels, rules and deliveries as the API shows and the store keeps them,
//! and the message itself, a CloudEvent (CNCF, version 1.0, structured JSON).

use std::fmt;

use serde::{Deserialize, Serialize};
use serde_json::{Value, json};
use utoipa::ToSchema;

use super::alarm::CommunicationEventView;
use super::service::{ClearedEventView, FaultEventView};
use super::words::{
    AlarmChangeWord, AlarmCodeWord, ChannelKind, DeliveryState, MailSecurity, WebhookFormat,
};

/// Settings of a channel: exactly one of `webhook` and `email`.
#[derive(Clone, Debug, Default, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct NewChannelView {
    /// Name, 1 to 100 bytes, different from those of other channels.
    #[schema(min_length = 1, max_length = 100)]
    pub name: String,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub webhook: Option<NewWebhookView>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub email: Option<NewEmailView>,
}

/// A webhook: messages are posted to a URL, signed per Standard Webhooks.
#[derive(Clone, Default, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct NewWebhookView {
    /// `https://` or `http://`, without user and password.
    #[schema(max_length = 2000)]
    pub url: String,
    /// Key of the signature: `whsec_` and 24 to 64 bytes in Base64. If absent, that of the
    /// channel before or, for a new channel, a new one.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub secret: Option<String>,
    #[serde(default)]
    pub format: WebhookFormat,
}

impl fmt::Debug for NewWebhookView {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("NewWebhookView")
    }
}

/// An e-mail by a mail server (SMTP).
#[derive(Clone, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct NewEmailView {
    /// Name or address of the mail server.
    pub host: String,
    pub port: u16,
    #[serde(default = "tls")]
    pub security: MailSecurity,
    /// User name; if absent, the server is used without authentication.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub user: Option<String>,
    /// Password of the user; if absent, that of the channel before.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub password: Option<String>,
    /// Address of the sender.
    pub from: String,
    /// Addresses of 1 to 20 recipients.
    #[schema(min_items = 1, max_items = 20)]
    pub to: Vec<String>,
}

const fn tls() -> MailSecurity {
    MailSecurity::Tls
}

impl fmt::Debug for NewEmailView {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("NewEmailView")
    }
}

/// A channel, without its secrets.
#[derive(Clone, Debug, Serialize, Deserialize, ToSchema)]
pub struct ChannelView {
    pub id: String,
    /// Entity tag of name and settings, for `If-Match`.
    pub etag: String,
    pub name: String,
    pub kind: ChannelKind,
    /// URL of a webhook; null for e-mail.
    pub url: Option<String>,
    /// Format of a webhook; null for e-mail.
    pub format: Option<WebhookFormat>,
    /// Settings of an e-mail; null for a webhook.
    pub email: Option<EmailView>,
    /// Time of creation, RFC 3339.
    pub created_at: String,
    /// Deliveries that wait for their turn or their next attempt.
    pub pending: u64,
    /// Failed deliveries, which are not retried any more, of the last 1000.
    pub given_up: u64,
}

/// The settings of an e-mail, without the password.
#[derive(Clone, Debug, Serialize, Deserialize, ToSchema)]
pub struct EmailView {
    pub host: String,
    pub port: u16,
    pub security: MailSecurity,
    pub user: Option<String>,
    /// Whether a password is stored.
    pub has_password: bool,
    pub from: String,
    pub to: Vec<String>,
}

/// A channel as it was stored, with the secret of a webhook, which is returned only here.
#[derive(Clone, Serialize, Deserialize, ToSchema)]
pub struct MadeChannelView {
    #[serde(flatten)]
    pub channel: ChannelView,
    /// The key of the signature, if it is new; null otherwise.
    pub secret: Option<String>,
}

/// The stored settings of a channel, with their secrets.
#[derive(Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum StoredChannel {
    Webhook {
        url: String,
        secret: String,
        #[serde(default)]
        format: WebhookFormat,
    },
    Email(StoredEmail),
}

/// The stored settings of an e-mail.
#[derive(Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct StoredEmail {
    pub host: String,
    pub port: u16,
    pub security: MailSecurity,
    pub user: Option<String>,
    pub password: Option<String>,
    pub from: String,
    pub to: Vec<String>,
}

impl StoredChannel {
    #[must_use]
    pub const fn kind(&self) -> ChannelKind {
        match self {
            Self::Webhook { .. } => ChannelKind::Webhook,
            Self::Email(_) => ChannelKind::Email,
        }
    }
}

/// Without the settings, which contain secrets.
impl fmt::Debug for StoredChannel {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "StoredChannel({})", self.kind())
    }
}

/// A rule: which changes of which faults are sent to a channel.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct NewRuleView {
    /// Name, 1 to 100 bytes.
    #[schema(min_length = 1, max_length = 100)]
    pub name: String,
    /// Id of the channel.
    pub channel: String,
    /// Names of the assets: `*` stands for any characters, `?` for one.
    #[serde(default = "any")]
    #[schema(min_length = 1, max_length = 200)]
    pub asset: String,
    /// Only assets with this tag; null or absent for all.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(min_length = 1, max_length = 50)]
    pub tag: Option<String>,
    /// The codes; all if empty.
    #[serde(default)]
    pub codes: Vec<AlarmCodeWord>,
    /// The changes; by default `confirmed` and `passed`.
    #[serde(default = "told")]
    #[schema(min_items = 1)]
    pub changes: Vec<AlarmChangeWord>,
    /// Nothing is sent before this time, RFC 3339; null or absent for no silence.
    #[serde(default)]
    #[schema(format = DateTime)]
    pub silent_until: Option<String>,
    /// Seconds after which a message is repeated as long as the fault fails and nobody has
    /// acknowledged it, 60 to 604 800; null or absent for no reminders.
    #[serde(default)]
    #[schema(minimum = 60, maximum = 604_800)]
    pub repeat_s: Option<u32>,
    /// Seconds for which the fault must fail without an acknowledgement before the first message
    /// is sent, 1 to 86 400; null or absent for no delay. A fault that passes earlier has no
    /// message.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(minimum = 1, maximum = 86_400)]
    pub delay_s: Option<u32>,
    /// Hours of each day in which nothing is sent; null or absent for none. A fault that begins in
    /// them has its first message at their end, if it still fails and nobody has acknowledged it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub quiet_hours: Option<QuietHoursView>,
    #[serde(default = "yes")]
    pub enabled: bool,
}

/// Hours of each day, which may contain midnight.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct QuietHoursView {
    /// Beginning, `hh:mm`.
    #[schema(example = "22:00")]
    pub from: String,
    /// End, `hh:mm`, other than the beginning.
    #[schema(example = "06:30")]
    pub to: String,
    /// Time zone, as in the IANA database.
    #[serde(default = "utc")]
    #[schema(example = "Europe/Berlin")]
    pub time_zone: String,
}

fn utc() -> String {
    "UTC".to_owned()
}

fn any() -> String {
    "*".to_owned()
}

fn told() -> Vec<AlarmChangeWord> {
    vec![AlarmChangeWord::Confirmed, AlarmChangeWord::Passed]
}

const fn yes() -> bool {
    true
}

/// A rule with its id.
#[derive(Clone, Debug, Serialize, Deserialize, ToSchema)]
pub struct RuleView {
    pub id: String,
    /// Entity tag of the rule, for `If-Match`.
    pub etag: String,
    /// Name of the channel.
    pub channel_name: String,
    /// Time of creation, RFC 3339.
    pub created_at: String,
    #[serde(flatten)]
    pub rule: NewRuleView,
}

/// A delivery of a message to a channel.
#[derive(Clone, Debug, Serialize, Deserialize, ToSchema)]
pub struct DeliveryView {
    pub id: String,
    /// Id of the channel.
    pub channel: String,
    /// Name of the channel; null if it has been deleted.
    pub channel_name: Option<String>,
    /// Id of the message, the same in every attempt.
    pub message_id: String,
    /// The asset; null for a test.
    pub asset: Option<String>,
    /// The message in one sentence.
    pub summary: String,
    pub state: DeliveryState,
    /// Attempts so far.
    pub attempts: u32,
    /// Time at which it was put into the queue, RFC 3339.
    pub created_at: String,
    /// Time of the next attempt, RFC 3339; null if it is finished.
    pub next_attempt_at: Option<String>,
    /// Time at which it was delivered or failed for good, RFC 3339; null before.
    pub finished_at: Option<String>,
    /// Why the last attempt failed; null if it did not.
    pub error: Option<String>,
}

/// The message: a CloudEvent.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct NotificationView {
    /// Always `1.0`.
    pub specversion: String,
    /// Unique for each change and reminder, the same in every attempt.
    pub id: String,
    /// The asset.
    pub source: String,
    /// `org.offbd.fault.CHANGE.v1` with a change such as `confirmed`,
    /// `org.offbd.fault.updated.v1` for a kind that is known later,
    /// `org.offbd.fault.reminder.v1`, or `org.offbd.test.v1`.
    #[serde(rename = "type")]
    pub kind: String,
    /// The code.
    pub subject: String,
    /// Time of the change, RFC 3339.
    pub time: String,
    /// Always `application/json`.
    pub datacontenttype: String,
    pub data: NotificationDataView,
}

/// The data of a message.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct NotificationDataView {
    pub asset: String,
    /// The change in one sentence.
    pub summary: String,
    /// Address of the fault in the dashboard; null if `notifications.public_url` is not set.
    pub link: Option<String>,
    /// Checks to make.
    pub advice: Vec<String>,
    /// Id of the message of which this one is an update: it adds the kind of the fault; null for
    /// others.
    #[serde(default)]
    pub updates: Option<String>,
    /// The event; null for a test.
    #[schema(value_type = Option<NotifiedEventView>)]
    pub event: Value,
}

/// The event of which a message tells.
#[derive(Clone, Debug, Serialize, ToSchema)]
#[serde(untagged)]
pub enum NotifiedEventView {
    Fault(FaultEventView),
    Cleared(ClearedEventView),
    Communication(CommunicationEventView),
}

impl NotificationView {
    /// Returns the same message as its reminder number `n`, at `time`.
    #[must_use]
    pub fn reminder(&self, n: i64, time: String) -> Self {
        let base = self.id.split('.').next().unwrap_or_default();
        let kind = "org.offbd.fault.reminder.v1".to_owned();
        Self { id: format!("{base}.{n}"), kind, time, ..self.clone() }
    }

    /// Returns the subject line of an e-mail, without line breaks.
    #[must_use]
    pub fn title(&self) -> String {
        let change = self.kind.trim_start_matches("org.offbd.").trim_end_matches(".v1");
        let change = match change.trim_start_matches("fault.") {
            "pending" => "suspected",
            change => change,
        };
        match self.data.asset.as_str() {
            "" => "[offbd] test".to_owned(),
            asset => format!("[offbd] {asset}: {} {change}", self.subject.replace('_', " ")),
        }
    }

    /// Returns the media type and the body of a webhook's request.
    #[must_use]
    pub fn posted(&self, format: WebhookFormat) -> (&'static str, String) {
        const JSON: &str = "application/json";
        match format {
            WebhookFormat::CloudEvents => {
                let body = serde_json::to_string(self).unwrap_or_default();
                ("application/cloudevents+json", body)
            }
            WebhookFormat::Slack => {
                (JSON, json!({ "text": escaped_for_slack(&self.text()) }).to_string())
            }
            WebhookFormat::Teams => (JSON, self.card().to_string()),
            WebhookFormat::Text => ("text/plain; charset=utf-8", self.text()),
        }
    }

    /// The message as an adaptive card in the envelope that a workflow of Teams takes.
    fn card(&self) -> Value {
        let block = |text: &str| json!({ "type": "TextBlock", "text": text, "wrap": true });
        let mut blocks = vec![
            json!({ "type": "TextBlock", "text": self.title(), "wrap": true, "weight": "bolder" }),
            block(&self.data.summary),
        ];
        blocks.extend(self.data.advice.iter().map(|check| block(&format!("- {check}"))));
        let open = |url: &String| json!({ "type": "Action.OpenUrl", "title": "Open", "url": url });
        let actions: Vec<Value> = self.data.link.iter().map(open).collect();
        json!({ "type": "message", "attachments": [{
            "contentType": "application/vnd.microsoft.card.adaptive",
            "content": { "$schema": "http://adaptivecards.io/schemas/adaptive-card.json",
                "type": "AdaptiveCard", "version": "1.4", "body": blocks, "actions": actions },
        }] })
    }

    /// Returns the text for people: of an e-mail, and of a webhook in the formats for people.
    #[must_use]
    pub fn text(&self) -> String {
        let mut lines = vec![self.data.summary.clone(), String::new()];
        if !self.data.advice.is_empty() {
            lines.push("What to do:".to_owned());
            lines.extend(self.data.advice.iter().map(|check| format!("- {check}")));
            lines.push(String::new());
        }
        lines.extend(self.data.link.clone());
        lines.push(format!("Time: {}", self.time));
        lines.push(format!("Message: {}", self.id));
        lines.join("\n")
    }
}

/// Replaces the characters that begin and end markup in Slack.
fn escaped_for_slack(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_message_is_posted_in_the_format_of_the_channel() {
        let message = NotificationView {
            specversion: "1.0".to_owned(),
            id: "evt_7".to_owned(),
            source: String::new(),
            kind: "org.offbd.fault.confirmed.v1".to_owned(),
            subject: "x_servo".to_owned(),
            time: "2026-05-04T12:00:00Z".to_owned(),
            datacontenttype: "application/json".to_owned(),
            data: NotificationDataView {
                asset: "rig-7".to_owned(),
                summary: "rig-7: 0.2 < 0.3 & so on".to_owned(),
                link: Some("https://offbd.example/rigs/rig-7/faults/x_servo".to_owned()),
                advice: vec!["Does the servo have power?".to_owned()],
                updates: None,
                event: Value::Null,
            },
        };
        let posted = |format| message.posted(format);
        let json = |format| serde_json::from_str::<Value>(&posted(format).1).unwrap();
        let (media_type, _) = posted(WebhookFormat::CloudEvents);
        assert_eq!(media_type, "application/cloudevents+json");
        assert_eq!(json(WebhookFormat::CloudEvents)["id"], "evt_7");
        let slack = json(WebhookFormat::Slack);
        let text = slack["text"].as_str().unwrap();
        assert!(text.starts_with("rig-7: 0.2 &lt; 0.3 &amp; so on\n"), "{text}");
        let card = &json(WebhookFormat::Teams)["attachments"][0]["content"];
        assert_eq!(card["body"][0]["text"], "[offbd] rig-7: x servo confirmed");
        assert_eq!(card["body"][2]["text"], "- Does the servo have power?");
        assert_eq!(card["actions"][0]["url"], "https://offbd.example/rigs/rig-7/faults/x_servo");
        let (media_type, plain) = posted(WebhookFormat::Text);
        assert_eq!(media_type, "text/plain; charset=utf-8");
        assert_eq!(plain, message.text());
    }
}
