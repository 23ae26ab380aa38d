//! Sends messages by a mail server.

use std::error::Error as _;

use lettre::message::{Mailbox, Message};
use lettre::transport::smtp::authentication::Credentials;
use lettre::transport::smtp::client::{Tls, TlsParameters};
use lettre::{AsyncSmtpTransport, AsyncTransport, Tokio1Executor};

use super::{addresses, failed};
use offbd_service::{SendOutcome, TargetPolicy};
use offbd_wire::notification::{NotificationView, StoredEmail};
use offbd_wire::words::MailSecurity;

/// Sends `message` to all recipients.
pub(super) async fn send(
    mail: &StoredEmail,
    message: &NotificationView,
    targets: &TargetPolicy,
) -> SendOutcome {
    let letter = match letter(mail, message) {
        Ok(letter) => letter,
        Err(reason) => return SendOutcome::Refused { reason },
    };
    let address = match addresses(&mail.host, mail.port, targets).await {
        Ok(addresses) => addresses[0],
        Err(reason) => return failed(reason),
    };
    let tls = match tls(mail) {
        Ok(tls) => tls,
        Err(reason) => return failed(reason),
    };
    let mut builder =
        AsyncSmtpTransport::<Tokio1Executor>::builder_dangerous(address.ip().to_string())
            .port(mail.port)
            .tls(tls);
    if let (Some(user), Some(password)) = (&mail.user, &mail.password) {
        builder = builder.credentials(Credentials::new(user.clone(), password.clone()));
    }
    match builder.build().send(letter).await {
        Ok(_) => SendOutcome::Delivered,
        Err(error) => failed(match error.source() {
            Some(cause) => format!("{error}: {cause}"),
            None => error.to_string(),
        }),
    }
}

/// The certificate must be that of the configured name, whatever the address.
fn tls(mail: &StoredEmail) -> Result<Tls, String> {
    let parameters = || TlsParameters::new(mail.host.clone()).map_err(|error| error.to_string());
    Ok(match mail.security {
        MailSecurity::Tls => Tls::Wrapper(parameters()?),
        MailSecurity::StartTls => Tls::Required(parameters()?),
        MailSecurity::None => Tls::None,
    })
}

fn letter(mail: &StoredEmail, message: &NotificationView) -> Result<Message, String> {
    let mailbox = |address: &str| {
        let parsed: Result<Mailbox, _> = address.parse();
        parsed.map_err(|error| format!("{address}: {error}"))
    };
    let domain = mail.from.rsplit_once('@').map_or("offbd", |(_, domain)| domain);
    let mut builder = Message::builder()
        .from(mailbox(&mail.from)?)
        .subject(message.title())
        .message_id(Some(format!("<{}@{domain}>", message.id)));
    for to in &mail.to {
        builder = builder.to(mailbox(to)?);
    }
    builder.body(message.text()).map_err(|error| error.to_string())
}
