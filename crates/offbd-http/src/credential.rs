//! The credential of a request (a bearer token or a login cookie) and the client's
//! address.
//!
//! The cookie is parsed and written by hand: one name, one value without characters that
//! need escaping. The cookie crates depend on a second date library.

use std::net::{IpAddr, SocketAddr};

use axum::extract::ConnectInfo;
use axum::http::header::{self, AUTHORIZATION, SET_COOKIE};
use axum::http::{Extensions, HeaderMap, HeaderValue};

use offbd_service::access::Credential;

/// Name of the login cookie.
pub(super) const COOKIE: &str = "offbd_login";

/// Name of the login cookie over TLS: browsers accept a cookie with this prefix only from
/// this host and only over TLS.
const SECURE_COOKIE: &str = "__Host-offbd_login";

const fn cookie_name(encrypted: bool) -> &'static str {
    if encrypted { SECURE_COOKIE } else { COOKIE }
}

/// Returns the header that sets the login cookie, or deletes it if `seconds` is 0.
pub(super) fn set_cookie(secret: &str, seconds: u64, encrypted: bool) -> HeaderMap {
    let secure = if encrypted { "; Secure" } else { "" };
    let name = cookie_name(encrypted);
    let rest = format!("Path=/; Max-Age={seconds}; HttpOnly; SameSite=Strict{secure}");
    let value = HeaderValue::from_str(&format!("{name}={secret}; {rest}"));
    value.into_iter().map(|value| (SET_COOKIE, value)).collect()
}

/// The address of the client of a request that another node has forwarded.
#[derive(Clone, Copy)]
pub(super) struct OriginalClient(pub(super) IpAddr);

/// Returns the address of the client.
pub(super) fn client_address(extensions: &Extensions) -> Option<IpAddr> {
    if let Some(OriginalClient(address)) = extensions.get() {
        return Some(*address);
    }
    let peer = extensions.get::<ConnectInfo<SocketAddr>>();
    peer.map(|peer| peer.0.ip().to_canonical())
}

/// Returns the credential of a request: `None` without one, `Some(None)` if it is
/// malformed. A header takes precedence over a cookie.
pub(super) fn credential(headers: &HeaderMap, encrypted: bool) -> Option<Option<Credential>> {
    if let Some(authorization) = headers.get(AUTHORIZATION) {
        return Some(bearer(authorization).map(Credential::bearer));
    }
    let cookies =
        headers.get_all(header::COOKIE).iter().filter_map(|cookies| cookies.to_str().ok());
    let mut cookies = cookies.flat_map(|cookies| cookies.split(';'));
    let name = cookie_name(encrypted);
    let login = cookies.find_map(|cookie| cookie.trim().strip_prefix(name)?.strip_prefix('='));
    login.map(|login| Some(Credential::login(login)))
}

/// Returns the secret of `Authorization: Bearer SECRET`.
pub(super) fn bearer(authorization: &HeaderValue) -> Option<&str> {
    let (scheme, secret) = authorization.to_str().ok()?.split_once(' ')?;
    scheme.eq_ignore_ascii_case("bearer").then(|| secret.trim())
}
