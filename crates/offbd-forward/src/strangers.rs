//! Refuses requests that pages of other sites make in a browser beside the rig. The agent has no
//! access control, and a browser reaches what listens on its own machine.

use std::net::IpAddr;
use std::sync::Arc;

use axum::extract::{Request, State};
use axum::http::Uri;
use axum::http::header::{HOST, HeaderMap, ORIGIN};
use axum::http::uri::Authority;
use axum::middleware::Next;
use axum::response::Response;

use super::refusal::Refusal;

/// Requires an IP address, `localhost` or one of `names` in `Host`, as a defence against DNS
/// rebinding, and that a page which sends something is of this host.
pub(super) async fn refuse(
    State(names): State<Arc<[String]>>,
    request: Request,
    next: Next,
) -> Result<Response, Refusal> {
    let host = host(request.headers()).filter(|host| is_known(host, &names));
    let Some(host) = host else { return Err(Refusal::Host) };
    let origin = request.headers().get(ORIGIN);
    let origin = origin.map(|origin| origin.to_str().unwrap_or_default().parse::<Uri>().ok());
    let is_of_host = |origin: Option<Uri>| origin.is_some_and(|o| o.authority() == Some(&host));
    if !request.method().is_safe() && origin.is_some_and(|origin| !is_of_host(origin)) {
        return Err(Refusal::Origin);
    }
    Ok(next.run(request).await)
}

fn host(headers: &HeaderMap) -> Option<Authority> {
    headers.get(HOST)?.to_str().ok()?.parse().ok()
}

fn is_known(host: &Authority, names: &[String]) -> bool {
    let name = host.host();
    let address = name.strip_prefix('[').and_then(|name| name.strip_suffix(']')).unwrap_or(name);
    let is_named = || names.iter().any(|known| known.eq_ignore_ascii_case(name));
    let is_local = name.eq_ignore_ascii_case("localhost") || address.parse::<IpAddr>().is_ok();
    !host.as_str().contains('@') && (is_local || is_named())
}
