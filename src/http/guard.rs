//! Before every handler: who asks, how often, from which page, and whether the
//! caller may; after it: a line in the audit log.
//!
//! A route that states no right is refused, whoever asks.

use std::net::{IpAddr, SocketAddr};
use std::sync::Arc;
use std::time::Duration;

use axum::extract::{ConnectInfo, MatchedPath, RawPathParams, Request, State};
use axum::http::header::{
    ALLOW, AUTHORIZATION, COOKIE, HOST, HeaderName, HeaderValue, LOCATION, ORIGIN, RETRY_AFTER,
    UPGRADE, WWW_AUTHENTICATE,
};
use axum::http::request::Parts;
use axum::http::uri::Authority;
use axum::http::{HeaderMap, Method, StatusCode, Uri};
use axum::middleware::Next;
use axum::response::{IntoResponse, Response};
use axum::{RequestPartsExt, extract};
use serde::Deserialize;

use super::rates::Rates;
use super::routes::{Rule, Rules};
use super::{App, Problem, login, problem};
use crate::service::access::{Caller, Credential, Deed, Pass, Reach, Right};

/// How callers are told apart, and what is asked of them.
pub struct Policy {
    /// Whether a token is asked for.
    pub required: bool,
    /// Pages elsewhere that may use the interface: `https://HOST[:PORT]`.
    pub origins: Vec<String>,
    /// Whether connections are encrypted.
    pub encrypted: bool,
    pub rates: Rates,
}

/// What the guard knows.
pub(super) struct Guard {
    pub(super) app: App,
    pub(super) rules: Rules,
}

/// Why a request does not come through, with a header that belongs to it.
struct Refusal {
    problem: Problem,
    header: Option<Box<(HeaderName, HeaderValue)>>,
}

impl From<Problem> for Refusal {
    fn from(problem: Problem) -> Self {
        Self { problem, header: None }
    }
}

impl IntoResponse for Refusal {
    fn into_response(self) -> Response {
        let mut response = self.problem.into_response();
        if let Some((name, value)) = self.header.map(|header| *header) {
            response.headers_mut().insert(name, value);
        }
        response
    }
}

pub(super) async fn guard(
    State(guard): State<Arc<Guard>>,
    request: Request,
    next: Next,
) -> Response {
    guard.through(request, next).await.unwrap_or_else(|refusal| {
        let status = refusal.problem.status.to_string();
        metrics::counter!("offbd_refused_total", "status" => status).increment(1);
        refusal.into_response()
    })
}

impl Guard {
    async fn through(&self, request: Request, next: Next) -> Result<Response, Refusal> {
        let (mut parts, body) = request.into_parts();
        let path = parts.extensions.get::<MatchedPath>().map(MatchedPath::as_str);
        let rule = rule(&self.rules, path, &parts.method, &parts.uri)?;
        self.check_host(&parts)?;
        self.check_origin(&parts)?;
        let caller = self.caller(&parts, rule.right).await?;
        if let Some(caller) = &caller {
            self.check_right(caller, rule.right, &mut parts).await?;
            parts.extensions.insert(caller.clone());
        }
        let deed = is_audited(rule.right, &parts.method).then(|| deed(rule.act, &parts));
        let response = next.run(Request::from_parts(parts, body)).await;
        // What was done is in the audit log before the answer goes out.
        if let (Some(caller), Some(deed)) = (caller, deed.and_then(|deed| done(deed, &response))) {
            self.app.service.note(&caller, deed).await.map_err(Problem::from)?;
        }
        Ok(response)
    }

    /// Where nobody is asked for a token, whoever can name this machine could
    /// make a visitor's browser ask (DNS rebinding): it must be named by number.
    fn check_host(&self, parts: &Parts) -> Result<(), Refusal> {
        let Some(host) = host(&parts.headers) else { return Ok(()) };
        let policy = &self.app.policy;
        let name = host.host().trim_matches(['[', ']']);
        let by_number = name == "localhost" || name.parse::<IpAddr>().is_ok();
        if policy.required || by_number || policy.origins.iter().any(|o| is_of(o, &host)) {
            return Ok(());
        }
        let detail = "without authentication the service answers to a number or to localhost; \
            list the page's origin in `origins`, or set `auth = \"required\"`";
        let status = StatusCode::MISDIRECTED_REQUEST;
        Err(Problem::new(status, "misdirected", "Another host's name", detail).into())
    }

    /// What changes something must not come from another site's page. Browsers
    /// say where a page is from; what says nothing is no page.
    fn check_origin(&self, parts: &Parts) -> Result<(), Refusal> {
        if is_safe(&parts.method) && !parts.headers.contains_key(UPGRADE) {
            return Ok(());
        }
        let foreign = || forbidden("the request comes from another site's page").into();
        let Some(origin) = parts.headers.get(ORIGIN) else {
            // A cookie is a browser's, and a browser says where from.
            let by_cookie = credential(&parts.headers, self.app.policy.encrypted)
                .is_some_and(|shown| matches!(shown, Some(Credential::Login(_))));
            return if by_cookie { Err(foreign()) } else { Ok(()) };
        };
        let origin = origin.to_str().unwrap_or_default();
        let own = host(&parts.headers).is_some_and(|host| is_of(origin, &host));
        let known = self.app.policy.origins.iter().any(|known| known == origin);
        if own || known { Ok(()) } else { Err(foreign()) }
    }

    /// Who asks; nobody where nobody is asked.
    async fn caller(&self, parts: &Parts, right: Right) -> Result<Option<Caller>, Refusal> {
        let policy = &self.app.policy;
        if !policy.required {
            return Ok((right != Right::Open).then_some(Caller::Anyone));
        }
        if right == Right::Open {
            self.take_address(parts)?;
            return Ok(None);
        }
        let Some(shown) = credential(&parts.headers, policy.encrypted) else {
            self.take_address(parts)?;
            let detail = "this takes a token: `Authorization: Bearer offbd_…`";
            return Err(unauthenticated(detail, None));
        };
        let known = shown.and_then(|shown| self.app.service.recall(&shown));
        let pass = match known {
            Some(pass) => Some(pass),
            None => {
                self.take_address(parts)?;
                self.find(&parts.headers, shown).await?
            }
        };
        let Some(pass) = pass else {
            let detail = "the token is none of this service, revoked or expired";
            return Err(unauthenticated(detail, Some("invalid_token")));
        };
        policy.rates.take_token(&pass.id).map_err(too_often)?;
        Ok(Some(Caller::Known(pass)))
    }

    /// Whom something belongs to that is not known yet.
    async fn find(
        &self,
        headers: &HeaderMap,
        shown: Option<Credential>,
    ) -> Result<Option<Arc<Pass>>, Problem> {
        let service = &self.app.service;
        match (shown, headers.get(AUTHORIZATION).and_then(bearer)) {
            (Some(Credential::Jwt(_)), Some(token)) => Ok(service.verify(token).await),
            (Some(shown), _) => Ok(service.authenticate(&shown).await?),
            (None, _) => Ok(None),
        }
    }

    fn take_address(&self, parts: &Parts) -> Result<(), Refusal> {
        let Some(address) = address(parts) else { return Ok(()) };
        self.app.policy.rates.take_address(address).map_err(too_often)
    }

    async fn check_right(
        &self,
        caller: &Caller,
        right: Right,
        parts: &mut Parts,
    ) -> Result<(), Refusal> {
        let allowed = match caller.reach(right) {
            Reach::Everything => true,
            Reach::Nothing => false,
            Reach::Own => {
                let asset = self.asset_of(parts).await?;
                asset.is_some_and(|asset| caller.may(right, &asset))
            }
        };
        if allowed {
            return Ok(());
        }
        let role = caller.pass().map_or("", |pass| pass.role.as_str());
        let detail = match caller.reach(right) {
            Reach::Own => "the token of a device is for its own asset, named in the address",
            _ => "the token's role is not allowed to do this",
        };
        tracing::info!(caller = caller.name(), role, right = right.as_str(), "refused");
        let scope =
            HeaderValue::from_static("Bearer realm=\"offbd\", error=\"insufficient_scope\"");
        Err(Refusal {
            problem: forbidden(detail),
            header: Some(Box::new((WWW_AUTHENTICATE, scope))),
        })
    }

    /// The asset that a request is about: in its path, that of the session in
    /// its path, or in its query.
    async fn asset_of(&self, parts: &mut Parts) -> Result<Option<String>, Problem> {
        let params: Vec<(String, String)> = match parts.extract::<RawPathParams>().await {
            Ok(raw) => raw.iter().map(|(k, v)| (k.to_owned(), v.to_owned())).collect(),
            Err(_) => return Ok(None),
        };
        if let Some((_, asset)) = params.iter().find(|(name, _)| name == "asset") {
            return Ok(Some(asset.clone()));
        }
        let path = parts.extensions.get::<MatchedPath>().map(MatchedPath::as_str);
        match (path, params.as_slice()) {
            (Some(path), [(_, id)]) if path.starts_with("/api/v1/sessions/{id}") => {
                Ok(self.app.service.asset_of_session(id).await?)
            }
            (_, []) => {
                let query = parts.extract::<extract::Query<AssetQuery>>().await;
                Ok(query.ok().and_then(|query| query.0.asset))
            }
            _ => Ok(None),
        }
    }
}

/// The deed if it was done, with the address of what came of it.
fn done(deed: Deed, response: &Response) -> Option<Deed> {
    let made = response.headers().get(LOCATION).and_then(|at| at.to_str().ok());
    let target = made.map_or_else(|| deed.target.clone(), str::to_owned);
    response.status().is_success().then_some(Deed { target, ..deed })
}

/// What a request for the route `path` takes. What no route has is the page's, or
/// not there.
fn rule(rules: &Rules, path: Option<&str>, method: &Method, uri: &Uri) -> Result<Rule, Refusal> {
    let Some(path) = path else { return Ok(Rule { right: Right::Open, act: String::new() }) };
    let Some(methods) = rules.of(path) else {
        tracing::error!(path, "the route states no right");
        return Err(forbidden("this path is not open to anybody").into());
    };
    let wanted = if *method == Method::HEAD { &Method::GET } else { method };
    let known = methods.iter().find(|(method, _)| method == wanted);
    known.map(|(_, rule)| rule.clone()).ok_or_else(|| {
        let allowed: Vec<_> = methods.iter().map(|(method, _)| method.as_str()).collect();
        let header = HeaderValue::from_str(&allowed.join(",")).ok();
        let header = header.map(|value| Box::new((ALLOW, value)));
        Refusal { problem: problem::not_allowed(method, uri), header }
    })
}

#[derive(Deserialize)]
struct AssetQuery {
    asset: Option<String>,
}

fn is_safe(method: &Method) -> bool {
    matches!(*method, Method::GET | Method::HEAD | Method::OPTIONS)
}

fn is_audited(right: Right, method: &Method) -> bool {
    matches!(right, Right::Operate | Right::Administer) && !is_safe(method)
}

fn deed(act: String, parts: &Parts) -> Deed {
    let address = address(parts).map(|address| address.to_string());
    Deed { act, target: parts.uri.path().to_owned(), address }
}

/// From where a request comes.
pub(super) fn address(parts: &Parts) -> Option<IpAddr> {
    let peer = parts.extensions.get::<ConnectInfo<SocketAddr>>();
    peer.map(|peer| peer.0.ip().to_canonical())
}

fn host(headers: &HeaderMap) -> Option<Authority> {
    headers.get(HOST)?.to_str().ok()?.parse().ok()
}

/// Whether a page of `origin` comes from `host`.
fn is_of(origin: &str, host: &Authority) -> bool {
    let origin: Option<Uri> = origin.parse().ok();
    let authority = origin.as_ref().and_then(Uri::authority);
    authority.is_some_and(|authority| authority == host)
}

/// What a request shows of its caller: nothing, something that cannot be, or a
/// credential. A header goes before a cookie.
fn credential(headers: &HeaderMap, encrypted: bool) -> Option<Option<Credential>> {
    if let Some(shown) = headers.get(AUTHORIZATION) {
        return Some(bearer(shown).map(Credential::bearer));
    }
    let cookies = headers.get_all(COOKIE).iter().filter_map(|cookies| cookies.to_str().ok());
    let mut cookies = cookies.flat_map(|cookies| cookies.split(';'));
    let name = login::cookie_name(encrypted);
    let login = cookies.find_map(|cookie| cookie.trim().strip_prefix(name)?.strip_prefix('='));
    login.map(|login| Some(Credential::login(login)))
}

/// The secret of `Authorization: Bearer SECRET`.
fn bearer(shown: &HeaderValue) -> Option<&str> {
    let (scheme, secret) = shown.to_str().ok()?.split_once(' ')?;
    scheme.eq_ignore_ascii_case("bearer").then(|| secret.trim())
}

fn forbidden(detail: &str) -> Problem {
    Problem::new(StatusCode::FORBIDDEN, "forbidden", "Not allowed", detail)
}

fn unauthenticated(detail: &str, error: Option<&str>) -> Refusal {
    let problem =
        Problem::new(StatusCode::UNAUTHORIZED, "unauthenticated", "Not authenticated", detail);
    let error = error.map(|error| format!(", error=\"{error}\"")).unwrap_or_default();
    let challenge = HeaderValue::from_str(&format!("Bearer realm=\"offbd\"{error}")).ok();
    Refusal { problem, header: challenge.map(|challenge| Box::new((WWW_AUTHENTICATE, challenge))) }
}

fn too_often(wait: Duration) -> Refusal {
    let seconds = wait.as_secs() + 1;
    let detail = format!("too many requests; come again in {seconds} s");
    let problem = Problem::new(StatusCode::TOO_MANY_REQUESTS, "rate", "Too often", detail);
    Refusal { problem, header: Some(Box::new((RETRY_AFTER, HeaderValue::from(seconds)))) }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::http::routes::More;

    #[test]
    fn what_states_no_right_is_refused() {
        let mut document = crate::http::openapi();
        let item = document.paths.paths.get_mut("/api/v1/assets").unwrap();
        item.get.as_mut().unwrap().extensions = None;
        let item = document.paths.paths.get_mut("/metrics").unwrap();
        item.get.as_mut().unwrap().extensions = None;
        let rules = Rules::new(&document, &More::default());
        let uri = Uri::from_static("/");
        let found = |path, method: Method| {
            let rule = rule(&rules, Some(path), &method, &uri);
            rule.map(|rule| rule.right).map_err(|refusal| refusal.problem.status)
        };
        assert_eq!(found("/metrics", Method::GET), Err(403));
        assert_eq!(found("/nowhere", Method::GET), Err(403));
        assert_eq!(found("/api/v1/assets", Method::GET), Err(405));
        assert_eq!(found("/api/v1/assets", Method::POST), Ok(Right::Operate));
        assert_eq!(found("/api/v1/fleet", Method::HEAD), Ok(Right::Read));
        assert_eq!(found("/api/v1/fleet", Method::OPTIONS), Err(405));
    }

    #[test]
    fn an_origin_is_its_host_and_port() {
        let host: Authority = "rig.example:8087".parse().unwrap();
        assert!(is_of("http://rig.example:8087", &host));
        for other in ["http://rig.example", "http://rig.example:80", "null", "", "http://x@y:1"] {
            assert!(!is_of(other, &host), "{other}");
        }
    }
}
