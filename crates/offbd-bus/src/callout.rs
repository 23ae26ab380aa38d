//! The rights of devices on a NATS server: it asks offbd for them when a device connects (auth
//! callout), and the password of a device is its offbd token. A device may publish and receive
//! what belongs to its own asset, and nothing else. This holds for MQTT through the server too.
//!
//! Question and answer are JSON Web Tokens, signed by nkeys (NATS ADR-26): the answer with the
//! key of `issuer` in the server's configuration.

use std::time::Duration;

use data_encoding::BASE64URL_NOPAD;
use nkeys::KeyPair;
use serde::Deserialize;
use serde_json::{Value, json};
use uuid::Uuid;

use offbd_service::access::{AccessScope, Credential, PREFIX, Principal, Right};
use offbd_service::{Clock, Service, ServiceError};
use offbd_wire::bus::{DeviceTopic, TopicStyle, encoded, inbox};

/// The subject of the server's questions.
pub(super) const SUBJECT: &str = "$SYS.REQ.USER.AUTH";

/// Below it the server receives the answers.
pub(super) const SERVER_INBOX: &str = "$SYS._INBOX";

/// How long a device stays connected; then the server disconnects it, and it connects again. A
/// revoked token is refused after this time at the latest.
const CONNECTION_TIME: Duration = Duration::from_secs(15 * 60);

/// What signs the answers.
pub(super) struct Issuer {
    key: KeyPair,
    /// The account of the NATS server to which devices belong.
    account: String,
}

/// Why a question gets no answer, or the wrong key is configured.
#[derive(Debug, thiserror::Error)]
pub(super) enum CalloutError {
    #[error("`nats.issuer_seed`: {0}")]
    Seed(String),
    #[error("the question is not signed by the server: {0}")]
    Question(String),
    #[error("the answer cannot be signed: {0}")]
    Signature(String),
}

/// The claims of a question.
#[derive(Debug, Deserialize)]
struct Question {
    iss: String,
    nats: QuestionDetails,
}

#[derive(Debug, Deserialize)]
struct QuestionDetails {
    user_nkey: String,
    server_id: ServerId,
    #[serde(default)]
    client_info: ClientInfo,
    #[serde(default)]
    connect_opts: ConnectOptions,
}

#[derive(Debug, Deserialize)]
struct ServerId {
    id: String,
}

#[derive(Debug, Default, Deserialize)]
struct ClientInfo {
    /// `nats`, `mqtt` or `websocket`.
    #[serde(rename = "type", default)]
    kind: String,
    #[serde(default)]
    host: String,
}

#[derive(Debug, Default, Deserialize)]
struct ConnectOptions {
    #[serde(default)]
    pass: String,
    #[serde(default)]
    auth_token: String,
}

impl Issuer {
    pub(super) fn new(seed: &str, account: String) -> Result<Self, CalloutError> {
        let key = KeyPair::from_seed(seed.trim());
        let key = key.map_err(|error| CalloutError::Seed(error.to_string()))?;
        if !key.public_key().starts_with('A') {
            return Err(CalloutError::Seed("is not the seed of an account key".to_owned()));
        }
        Ok(Self { key, account })
    }

    /// Returns the answer to a question.
    ///
    /// # Errors
    /// [`CalloutError`] if the question is none of a server.
    pub(super) async fn answer(
        &self,
        service: &Service,
        question: &[u8],
    ) -> Result<String, CalloutError> {
        let Question { nats, .. } = verified(question)?;
        let secret = match nats.connect_opts.pass.as_str() {
            "" => nats.connect_opts.auth_token.as_str(),
            password => password,
        };
        let principal = principal(service, secret).await;
        let outcome = if matches!(principal, Ok(Some(_))) { "accepted" } else { "refused" };
        metrics::counter!("offbd_bus_logins_total", "outcome" => outcome).increment(1);
        let host = nats.client_info.host.as_str();
        let result = match principal {
            Ok(Some(principal)) => {
                tracing::info!(host, token = principal.name, "a device may use the NATS server");
                let user = self.user(&principal, &nats)?;
                json!({ "jwt": user })
            }
            Ok(None) => {
                tracing::info!(
                    host,
                    "a device with an unknown, revoked or expired token is refused"
                );
                json!({ "error": "the password is not a valid offbd token" })
            }
            Err(error) => {
                tracing::warn!(host, %error, "a device is refused because its token cannot be read");
                json!({ "error": "tokens cannot be checked at present" })
            }
        };
        let mut details = result;
        details["type"] = json!("authorization_response");
        details["version"] = json!(2);
        self.sign(json!({
            "aud": nats.server_id.id,
            "sub": nats.user_nkey,
            "nats": details,
        }))
    }

    /// Returns the rights of a caller as a token for the server.
    fn user(
        &self,
        principal: &Principal,
        question: &QuestionDetails,
    ) -> Result<String, CalloutError> {
        let (publish, subscribe) = permissions(principal, question.client_info.kind == "mqtt");
        let limit = seconds(Clock::System.now()) + CONNECTION_TIME.as_secs().cast_signed();
        let expires_at = principal.expires_at.map_or(limit, |end| seconds(end).min(limit));
        self.sign(json!({
            "aud": self.account,
            "sub": question.user_nkey,
            "name": principal.name,
            "exp": expires_at,
            "nats": {
                "pub": rule(&publish), "sub": rule(&subscribe),
                "subs": -1, "data": -1, "payload": -1,
                "type": "user", "version": 2,
            },
        }))
    }

    fn sign(&self, mut claims: Value) -> Result<String, CalloutError> {
        claims["iss"] = json!(self.key.public_key());
        claims["iat"] = json!(seconds(Clock::System.now()));
        claims["jti"] = json!(Uuid::now_v7().to_string());
        let header = json!({ "typ": "JWT", "alg": "ed25519-nkey" });
        let part = |value: &Value| BASE64URL_NOPAD.encode(value.to_string().as_bytes());
        let message = format!("{}.{}", part(&header), part(&claims));
        let signature = self.key.sign(message.as_bytes());
        let signature = signature.map_err(|error| CalloutError::Signature(error.to_string()))?;
        Ok(format!("{message}.{}", BASE64URL_NOPAD.encode(&signature)))
    }
}

const fn seconds(micros: i64) -> i64 {
    micros / 1_000_000
}

/// A list of subjects; an empty one denies all.
fn rule(subjects: &[String]) -> Value {
    if subjects.is_empty() { json!({ "deny": [">"] }) } else { json!({ "allow": subjects }) }
}

/// Returns the subjects that a caller may publish on, and those that it may subscribe to.
fn permissions(principal: &Principal, by_mqtt: bool) -> (Vec<String>, Vec<String>) {
    let token = |scope| match (scope, &principal.asset) {
        (AccessScope::All, _) => Some("*".to_owned()),
        (AccessScope::OwnAsset, Some(asset)) => Some(encoded(asset)),
        _ => None,
    };
    let subject = |level: &str, kind: &str| TopicStyle::Nats.topic(&[level, kind]);
    let sends = token(Right::SendTelemetry.scope(principal.role));
    let publish =
        sends.iter().flat_map(|level| DeviceTopic::ALL.map(|topic| subject(level, topic.as_str())));
    let mut subscribe = Vec::new();
    if let Some(level) = token(Right::ReadAsset.scope(principal.role)) {
        for kind in ["ack", "hello", "state", "fault.*"] {
            subscribe.push(subject(&level, kind));
        }
        // Answers to requests, apart from those of others.
        subscribe.push(format!("{}.>", inbox(&level)));
        if by_mqtt {
            // By which the server delivers what the client has subscribed to at QoS 1.
            subscribe.push("$MQTT.sub.>".to_owned());
        }
    }
    (publish.collect(), subscribe)
}

async fn principal(
    service: &Service,
    secret: &str,
) -> Result<Option<std::sync::Arc<Principal>>, ServiceError> {
    if secret.is_empty() {
        return Ok(None);
    }
    if secret.starts_with(PREFIX) {
        return service.authenticate(&Credential::token(secret)).await;
    }
    Ok(service.verify(secret).await)
}

/// Returns the claims of a question whose signature is that of the server that it names.
fn verified(question: &[u8]) -> Result<Question, CalloutError> {
    let invalid = |reason: &str| CalloutError::Question(reason.to_owned());
    let text = str::from_utf8(question).map_err(|_| invalid("it is not text"))?;
    let (message, signature) = text.rsplit_once('.').ok_or_else(|| invalid("it is not a token"))?;
    let (_, claims) = message.split_once('.').ok_or_else(|| invalid("it is not a token"))?;
    let decoded = |part: &str| {
        BASE64URL_NOPAD.decode(part.as_bytes()).map_err(|_| invalid("it is not base64url"))
    };
    let question: Question = serde_json::from_slice(&decoded(claims)?)
        .map_err(|error| CalloutError::Question(error.to_string()))?;
    let by_server = question.iss.starts_with('N') && question.iss == question.nats.server_id.id;
    let key = by_server.then(|| KeyPair::from_public_key(&question.iss));
    let key = key.and_then(Result::ok).ok_or_else(|| invalid("its issuer is not a server"))?;
    key.verify(message.as_bytes(), &decoded(signature)?)
        .map_err(|error| CalloutError::Question(error.to_string()))?;
    Ok(question)
}
