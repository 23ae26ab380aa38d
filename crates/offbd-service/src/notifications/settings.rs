//! Checks the settings of channels and rules, and converts them between what the API shows
//! and what the store keeps.

use data_encoding::BASE64;

use super::TargetPolicy;
use super::quiet_hours::QuietHours;
use crate::clock::parse_timestamp;
use crate::{ServiceError, tags};
use offbd_core::vocabulary::Invalid;
use offbd_wire::notification::{
    EmailView, NewChannelView, NewEmailView, NewRuleView, NewWebhookView, StoredChannel,
    StoredEmail,
};

/// Longest name of a channel or a rule, bytes.
const MAX_NAME: usize = 100;

/// Longest URL, bytes.
const MAX_URL: usize = 2000;

/// Longest name of a mail server, user, password or address, bytes.
const MAX_MAIL_WORD: usize = 254;

/// Recipients of an e-mail.
const MAX_RECIPIENTS: usize = 20;

/// Longest pattern of assets, bytes.
const MAX_PATTERN: usize = 200;

/// Range of the interval of reminders, s.
const REPEAT_S: std::ops::RangeInclusive<u32> = 60..=604_800;

/// Range of the time for which a fault must fail before its first message is sent, s. Chosen.
const DELAY_S: std::ops::RangeInclusive<u32> = 1..=86_400;

/// Start of a secret, as Standard Webhooks say.
const SECRET_PREFIX: &str = "whsec_";

/// Random bytes of a new secret, and the permitted lengths of a given one.
const SECRET_BYTES: usize = 32;
const GIVEN_SECRET_BYTES: std::ops::RangeInclusive<usize> = 24..=64;

fn text(pointer: &str, text: &str, most: usize) -> Result<(), Invalid> {
    if (1..=most).contains(&text.len()) && !text.chars().any(char::is_control) {
        return Ok(());
    }
    let reason = format!("must be 1 to {most} bytes without control characters");
    Err(Invalid::new(pointer, reason))
}

/// Checks the settings of a channel, of which `before` are the present ones. Returns what is to
/// be stored, and the secret if it is new.
///
/// # Errors
/// [`ServiceError::Invalid`] with the invalid element; [`ServiceError::Unavailable`] if the
/// system provides no random numbers.
pub(crate) fn channel(
    new: NewChannelView,
    before: Option<&StoredChannel>,
    targets: &TargetPolicy,
) -> Result<(StoredChannel, Option<String>), ServiceError> {
    text("/name", &new.name, MAX_NAME)?;
    match (new.webhook, new.email) {
        (Some(webhook), None) => self::webhook(webhook, before, targets),
        (None, Some(email)) => Ok((self::email(email, before, targets)?, None)),
        _ => Err(Invalid::new("/webhook", "give either `webhook` or `email`").into()),
    }
}

fn webhook(
    new: NewWebhookView,
    before: Option<&StoredChannel>,
    targets: &TargetPolicy,
) -> Result<(StoredChannel, Option<String>), ServiceError> {
    let NewWebhookView { url, secret, format } = new;
    text("/webhook/url", &url, MAX_URL)?;
    check_url(&url, targets).map_err(|reason| Invalid::new("/webhook/url", reason))?;
    let (secret, made) = match (secret, before) {
        (Some(secret), _) => {
            check_secret(&secret)?;
            (secret, None)
        }
        (None, Some(StoredChannel::Webhook { secret, .. })) => (secret.clone(), None),
        (None, _) => {
            let secret = new_secret()?;
            (secret.clone(), Some(secret))
        }
    };
    Ok((StoredChannel::Webhook { url, secret, format }, made))
}

/// Checks the URL of a webhook.
fn check_url(url: &str, targets: &TargetPolicy) -> Result<(), String> {
    let parsed: hyper::Uri = url.parse().map_err(|_| "is not a valid URL".to_owned())?;
    if !matches!(parsed.scheme_str(), Some("https" | "http")) {
        return Err("must begin with `https://` or `http://`".to_owned());
    }
    if parsed.authority().is_some_and(|authority| authority.as_str().contains('@')) {
        return Err("contains a user or password, which is not supported".to_owned());
    }
    let host = parsed.host().filter(|host| !host.is_empty()).ok_or("has no host")?;
    let is_port_given = parsed.authority().is_some_and(|authority| authority.as_str() != host);
    if is_port_given && parsed.port_u16().is_none_or(|port| port == 0) {
        return Err("has a port that is not from 1 to 65535".to_owned());
    }
    targets.check_host(host).map_err(|reason| format!("the host {reason}"))
}

fn check_secret(secret: &str) -> Result<(), Invalid> {
    let key = key(secret).filter(|key| GIVEN_SECRET_BYTES.contains(&key.len()));
    let reason = "must be `whsec_` and 24 to 64 bytes in Base64";
    key.map(drop).ok_or_else(|| Invalid::new("/webhook/secret", reason))
}

/// Returns the key in a secret.
#[must_use]
pub fn key(secret: &str) -> Option<Vec<u8>> {
    BASE64.decode(secret.strip_prefix(SECRET_PREFIX)?.as_bytes()).ok()
}

fn new_secret() -> Result<String, ServiceError> {
    let mut bytes = [0; SECRET_BYTES];
    let unavailable = |_| ServiceError::Unavailable { what: "no random numbers" };
    getrandom::fill(&mut bytes).map_err(unavailable)?;
    Ok(format!("{SECRET_PREFIX}{}", BASE64.encode(&bytes)))
}

fn email(
    new: NewEmailView,
    before: Option<&StoredChannel>,
    targets: &TargetPolicy,
) -> Result<StoredChannel, ServiceError> {
    if !cfg!(feature = "email") {
        let reason = "needs a build with e-mail: cargo build --features email";
        return Err(Invalid::new("/email", reason).into());
    }
    let NewEmailView { host, port, security, user, password, from, to } = new;
    text("/email/host", &host, MAX_MAIL_WORD)?;
    let refused = |reason| Invalid::new("/email/host", reason);
    targets.check_host(&host).map_err(refused)?;
    if port == 0 {
        return Err(Invalid::new("/email/port", "must be from 1 to 65535").into());
    }
    address("/email/from", &from)?;
    if !(1..=MAX_RECIPIENTS).contains(&to.len()) {
        let reason = format!("must have 1 to {MAX_RECIPIENTS} addresses");
        return Err(Invalid::new("/email/to", reason).into());
    }
    for (i, to) in to.iter().enumerate() {
        address(&format!("/email/to/{i}"), to)?;
    }
    let known = match before {
        Some(StoredChannel::Email(before)) if before.user == user => before.password.as_ref(),
        _ => None,
    };
    let is_same_server = matches!(before, Some(StoredChannel::Email(before))
        if (&before.host, before.port, before.security) == (&host, port, security));
    if known.is_some() && password.is_none() && !is_same_server {
        // It is for the server that it was given for.
        let reason = "give it again: the stored one is for another host, port or security";
        return Err(Invalid::new("/email/password", reason).into());
    }
    let password = password.or(known.cloned());
    for (pointer, word) in [("/email/user", &user), ("/email/password", &password)] {
        word.as_deref().map_or(Ok(()), |word| text(pointer, word, MAX_MAIL_WORD))?;
    }
    if user.is_some() != password.is_some() {
        return Err(Invalid::new("/email/password", "give both user and password or none").into());
    }
    Ok(StoredChannel::Email(StoredEmail { host, port, security, user, password, from, to }))
}

/// Checks the form of a mail address.
fn address(pointer: &str, address: &str) -> Result<(), Invalid> {
    text(pointer, address, MAX_MAIL_WORD)?;
    let parts = address.rsplit_once('@');
    let whole = |part: &str| {
        !part.is_empty() && part.is_ascii() && !part.contains([' ', '<', '>', ',', ';', '"'])
    };
    if parts.is_some_and(|(local, domain)| whole(local) && whole(domain) && !local.contains('@')) {
        return Ok(());
    }
    Err(Invalid::new(pointer, "is not an address like ann@example.org"))
}

/// Returns the settings of an e-mail without the password.
pub(crate) fn email_view(stored: StoredEmail) -> EmailView {
    let StoredEmail { host, port, security, user, password, from, to } = stored;
    EmailView { host, port, security, user, has_password: password.is_some(), from, to }
}

/// Checks a rule.
///
/// # Errors
/// [`Invalid`] with the invalid element.
pub(crate) fn check_rule(rule: &NewRuleView) -> Result<(), Invalid> {
    text("/name", &rule.name, MAX_NAME)?;
    text("/asset", &rule.asset, MAX_PATTERN)?;
    if let Some(tag) = &rule.tag {
        tags::check("/tag", tag)?;
    }
    if rule.changes.is_empty() {
        return Err(Invalid::new("/changes", "must have at least one change"));
    }
    if let Some(until) = &rule.silent_until {
        parse_timestamp(until).map_err(|reason| Invalid::new("/silent_until", reason))?;
    }
    if rule.repeat_s.is_some_and(|s| !REPEAT_S.contains(&s)) {
        let (least, most) = REPEAT_S.into_inner();
        return Err(Invalid::new("/repeat_s", format!("must be from {least} to {most} s")));
    }
    if rule.delay_s.is_some_and(|s| !DELAY_S.contains(&s)) {
        let (least, most) = DELAY_S.into_inner();
        return Err(Invalid::new("/delay_s", format!("must be from {least} to {most} s")));
    }
    rule.quiet_hours.as_ref().map_or(Ok(()), |view| QuietHours::new(view).map(drop))
}
