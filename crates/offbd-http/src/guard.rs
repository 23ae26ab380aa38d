//! Access control around every handler: host and origin checks, authentication, rate
//! limits and authorization before it, the audit log entry after it.
//!
//! A route without a right is denied to every caller.

use std::net::IpAddr;
use std::sync::Arc;
use std::time::Duration;

use axum::body::Body;
use axum::extract::{MatchedPath, RawPathParams, Request, State};
use axum::http::header::{
    ALLOW, AUTHORIZATION, HOST, HeaderName, HeaderValue, LOCATION, ORIGIN, RETRY_AFTER, UPGRADE,
    WWW_AUTHENTICATE,
};
use axum::http::request::Parts;
use axum::http::uri::Authority;
use axum::http::{HeaderMap, Method, Uri};
use axum::middleware::Next;
use axum::response::{IntoResponse, Response};
use axum::{RequestPartsExt, extract};
use serde::Deserialize;

use super::body::BodyShare;
use super::credential::{OriginalClient, bearer, client_address, credential};
use super::faults::ActorQuery;
use super::forward::{self, Forwarder};
use super::rates::RateLimits;
use super::routes::{RouteRule, RouteRules};
use super::{App, Problem, problem};
use offbd_service::access::{AccessScope, AuditEntry, Caller, Credential, Principal, Right};
use offbd_wire::problem::{FORBIDDEN, MISDIRECTED, RATE, UNAUTHENTICATED};

/// The configured access policy.
pub struct AccessPolicy {
    /// Whether a token is required.
    pub required: bool,
    /// Origins of other sites that may use the API: `https://HOST[:PORT]`.
    pub origins: Vec<String>,
    /// Whether connections use TLS.
    pub encrypted: bool,
    pub rates: RateLimits,
}

/// The route of the events, which every node of a cluster has.
const EVENTS: &str = "/api/v1/events";

/// The route of the nodes. Each of them knows who owns an asset, also if it cannot reach it.
const CLUSTER: &str = "/api/v1/cluster";

/// The route on which assets are registered.
const ASSETS: &str = "/api/v1/assets";

/// The access control of all routes.
pub(super) struct Guard {
    pub(super) app: App,
    pub(super) rules: RouteRules,
    pub(super) forwarder: Forwarder,
}

/// The response to a denied request, with an additional header.
struct Denial {
    problem: Box<Problem>,
    header: Option<Box<(HeaderName, HeaderValue)>>,
}

impl From<Problem> for Denial {
    fn from(problem: Problem) -> Self {
        Self { problem: Box::new(problem), header: None }
    }
}

impl IntoResponse for Denial {
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
    guard.handle(request, next).await.unwrap_or_else(|denial| {
        let status = denial.problem.status.to_string();
        metrics::counter!("offbd_refused_total", "status" => status).increment(1);
        denial.into_response()
    })
}

impl Guard {
    async fn handle(&self, request: Request, next: Next) -> Result<Response, Denial> {
        let (mut parts, body) = request.into_parts();
        let is_forwarded = forward::is_forwarded(&self.app.service, &parts.headers);
        if let Some(client) = forward::original_client(&parts.headers).filter(|_| is_forwarded) {
            parts.extensions.insert(OriginalClient(client));
        }
        let path = parts.extensions.get::<MatchedPath>().map(MatchedPath::as_str);
        let rule = rule(&self.rules, path, &parts.method, &parts.uri)?;
        self.check_host(&parts)?;
        self.check_origin(&parts)?;
        let caller = self.caller(&parts, rule.right, is_forwarded).await?;
        if let Some(caller) = &caller {
            self.check_right(caller, rule.right, &mut parts).await?;
            parts.extensions.insert(caller.clone());
        }
        if let Some(parameters) = &rule.parameters {
            parameters.check(parts.uri.query()).map_err(Problem::from)?;
        }
        if !is_safe(&parts.method) || parts.headers.contains_key(UPGRADE) {
            parts.extensions.insert(self.body_share(caller.as_ref(), &parts));
        }
        let entry = is_audited(rule.right, &parts.method).then(|| audit_entry(rule.action, &parts));
        let request = match self.forward(parts, body).await? {
            // The owner has recorded what was done.
            Ok(response) => return Ok(response),
            Err(request) => request,
        };
        let response = next.run(request).await;
        // The audit entry is durable before the response is sent.
        if let (Some(caller), Some(entry)) =
            (caller, entry.and_then(|entry| completed(entry, &response)))
        {
            self.app.service.audit_action(&caller, entry).await.map_err(Problem::from)?;
        }
        Ok(response)
    }

    /// In a cluster, sends the request to the node that owns its asset, if that is another.
    async fn forward(
        &self,
        mut parts: Parts,
        body: Body,
    ) -> Result<Result<Response, Request>, Problem> {
        let service = &self.app.service;
        if !service.is_node() {
            return Ok(Err(Request::from_parts(parts, body)));
        }
        let path = parts.extensions.get::<MatchedPath>().map(MatchedPath::as_str);
        let is_anywhere = matches!(path, None | Some(EVENTS | CLUSTER));
        let is_registration = path == Some(ASSETS) && parts.method == Method::POST;
        let named = if is_anywhere { None } else { self.asset_of(&mut parts).await? };
        let mut request = Request::from_parts(parts, body);
        let mut asset = named;
        if is_registration {
            (asset, request) = forward::name_in_body(request).await?;
        }
        match asset {
            Some(asset) => self.forwarder.forward(service, &asset, request).await,
            None => Ok(Err(request)),
        }
    }

    /// Without authentication, requires an IP address or `localhost` in `Host`, as a
    /// defence against DNS rebinding.
    fn check_host(&self, parts: &Parts) -> Result<(), Denial> {
        let policy = &self.app.policy;
        // HTTP/2 has the host in the URI.
        let host = parts.uri.authority().cloned().or_else(|| host(&parts.headers));
        let is_permitted = host.is_some_and(|host| {
            is_local(&host) || policy.origins.iter().any(|origin| has_host(origin, &host))
        });
        if policy.required || is_permitted {
            return Ok(());
        }
        let detail = "without authentication `Host` must be an IP address or localhost; \
            list the page's origin in `origins`, or set `auth = \"required\"`";
        Err(Problem::new(MISDIRECTED, detail).into())
    }

    /// Denies unsafe requests from pages of other sites (cross-site request forgery), by
    /// the header `Origin`. A request without it does not come from a browser, unless it
    /// has a cookie.
    fn check_origin(&self, parts: &Parts) -> Result<(), Denial> {
        if is_safe(&parts.method) && !parts.headers.contains_key(UPGRADE) {
            return Ok(());
        }
        let cross_site = || forbidden("the request comes from a page of another site").into();
        let Some(origin) = parts.headers.get(ORIGIN) else {
            // A cookie is sent by a browser, which also sends `Origin`.
            let by_cookie = credential(&parts.headers, self.app.policy.encrypted)
                .is_some_and(|credential| matches!(credential, Some(Credential::Login(_))));
            return if by_cookie { Err(cross_site()) } else { Ok(()) };
        };
        let origin = origin.to_str().unwrap_or_default();
        let same_origin = host(&parts.headers).is_some_and(|host| has_host(origin, &host));
        let permitted = self.app.policy.origins.iter().any(|permitted| permitted == origin);
        if same_origin || permitted { Ok(()) } else { Err(cross_site()) }
    }

    /// Authenticates the caller and applies the rate limits; `None` for a public route.
    /// The node that has forwarded a request has applied them already.
    async fn caller(
        &self,
        parts: &Parts,
        right: Right,
        is_forwarded: bool,
    ) -> Result<Option<Caller>, Denial> {
        let policy = &self.app.policy;
        if !policy.required {
            return Ok((right != Right::Public).then_some(Caller::Anonymous));
        }
        if right == Right::Public {
            self.check_address_rate(parts)?;
            return Ok(None);
        }
        let is_from_bus = is_forwarded && forward::is_from_bus(&parts.headers);
        if is_from_bus && right == Right::SendTelemetry {
            return Ok(Some(Caller::Anonymous));
        }
        let Some(credential) = credential(&parts.headers, policy.encrypted) else {
            self.check_address_rate(parts)?;
            let detail = "a token is required: `Authorization: Bearer offbd_…`";
            return Err(unauthenticated(detail, None));
        };
        let cached = credential.and_then(|given| self.app.service.cached_principal(&given));
        let principal = match cached {
            Some(principal) => Some(principal),
            None => {
                self.check_address_rate(parts)?;
                self.authenticate(&parts.headers, credential).await?
            }
        };
        let Some(principal) = principal else {
            let detail = "unknown, revoked or expired token";
            return Err(unauthenticated(detail, Some("invalid_token")));
        };
        if !is_forwarded {
            policy.rates.check_token(&principal.id).map_err(rate_limited)?;
        }
        Ok(Some(Caller::Authenticated(principal)))
    }

    /// Returns the principal of a credential that is not cached; `None` if it is invalid.
    async fn authenticate(
        &self,
        headers: &HeaderMap,
        credential: Option<Credential>,
    ) -> Result<Option<Arc<Principal>>, Problem> {
        let service = &self.app.service;
        match (credential, headers.get(AUTHORIZATION).and_then(bearer)) {
            (Some(Credential::Jwt(_)), Some(token)) => Ok(service.verify(token).await),
            (Some(credential), _) => Ok(service.authenticate(&credential).await?),
            (None, _) => Ok(None),
        }
    }

    /// The memory for the body of a request: a share for each token, and without tokens for
    /// each address of another machine.
    fn body_share(&self, caller: Option<&Caller>, parts: &Parts) -> BodyShare {
        let budget = &self.app.budget;
        if let Some(principal) = caller.and_then(Caller::principal) {
            return budget.share_of(&principal.id);
        }
        match client_address(&parts.extensions).filter(|address| !address.is_loopback()) {
            Some(address) => budget.share_of(&address.to_string()),
            None => budget.whole(),
        }
    }

    fn check_address_rate(&self, parts: &Parts) -> Result<(), Denial> {
        let Some(address) = client_address(&parts.extensions) else { return Ok(()) };
        self.app.policy.rates.check_address(address).map_err(rate_limited)
    }

    async fn check_right(
        &self,
        caller: &Caller,
        right: Right,
        parts: &mut Parts,
    ) -> Result<(), Denial> {
        let allowed = match caller.scope(right) {
            AccessScope::All => true,
            AccessScope::None => false,
            AccessScope::OwnAsset => {
                let asset = self.asset_of(parts).await?;
                asset.is_some_and(|asset| caller.may(right, &asset))
            }
        };
        if allowed {
            return Ok(());
        }
        let role = caller.principal().map_or("", |principal| principal.role.as_str());
        let detail = match caller.scope(right) {
            AccessScope::OwnAsset => "the token of a device is limited to its own asset",
            _ => "the role of the token does not have the required right",
        };
        tracing::info!(caller = caller.name(), role, right = right.as_str(), "access denied");
        let scope =
            HeaderValue::from_static("Bearer realm=\"offbd\", error=\"insufficient_scope\"");
        Err(Denial {
            problem: Box::new(forbidden(detail)),
            header: Some(Box::new((WWW_AUTHENTICATE, scope))),
        })
    }

    /// Returns the asset that a request is about: the one in its path, that of the session
    /// in its path, or the one in its query.
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
            (Some(path), [(_, id), ..]) if path.starts_with("/api/v1/sessions/{id}") => {
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

/// Returns the entry if the request succeeded; its target is the created resource if the
/// response has a `Location`.
fn completed(entry: AuditEntry, response: &Response) -> Option<AuditEntry> {
    let created = response.headers().get(LOCATION).and_then(|at| at.to_str().ok());
    let target = created.map_or_else(|| entry.target.clone(), str::to_owned);
    response.status().is_success().then_some(AuditEntry { target, ..entry })
}

/// Returns the rule of a request for the route `path`. A request without a route is
/// public: it gets the page or 404.
fn rule(
    rules: &RouteRules,
    path: Option<&str>,
    method: &Method,
    uri: &Uri,
) -> Result<RouteRule, Denial> {
    let Some(path) = path else {
        let (right, action) = (Right::Public, String::new());
        return Ok(RouteRule { right, action, parameters: None });
    };
    let Some(methods) = rules.of(path) else {
        tracing::error!(path, "the route has no right");
        return Err(forbidden("access to this path is not permitted").into());
    };
    let lookup = if *method == Method::HEAD { &Method::GET } else { method };
    let found = methods.iter().find(|(method, _)| method == lookup);
    found.map(|(_, rule)| rule.clone()).ok_or_else(|| {
        let allowed: Vec<_> = methods.iter().map(|(method, _)| method.as_str()).collect();
        let header = HeaderValue::from_str(&allowed.join(",")).ok();
        let header = header.map(|value| Box::new((ALLOW, value)));
        Denial { problem: Box::new(problem::not_allowed(method, uri)), header }
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

fn audit_entry(action: String, parts: &Parts) -> AuditEntry {
    let address = client_address(&parts.extensions).map(|address| address.to_string());
    let by = extract::Query::<ActorQuery>::try_from_uri(&parts.uri).ok();
    let by = by.and_then(|by| by.0.known_actor(&Caller::Anonymous));
    AuditEntry { action, target: parts.uri.path().to_owned(), address, by }
}

fn host(headers: &HeaderMap) -> Option<Authority> {
    headers.get(HOST)?.to_str().ok()?.parse().ok()
}

/// Whether `host` is an IP address or `localhost`, with or without a port, and nothing else.
fn is_local(host: &Authority) -> bool {
    let (name, text) = (host.host(), host.as_str());
    let rest = text.strip_prefix(name).unwrap_or(text);
    let is_port = |port: &str| !port.is_empty() && port.bytes().all(|byte| byte.is_ascii_digit());
    let address = name.strip_prefix('[').and_then(|name| name.strip_suffix(']')).unwrap_or(name);
    (name == "localhost" || address.parse::<IpAddr>().is_ok())
        && (rest.is_empty() || rest.strip_prefix(':').is_some_and(is_port))
}

/// Whether `origin` has the host and port `host`.
fn has_host(origin: &str, host: &Authority) -> bool {
    let origin: Option<Uri> = origin.parse().ok();
    let authority = origin.as_ref().and_then(Uri::authority);
    authority.is_some_and(|authority| authority == host)
}

fn forbidden(detail: &str) -> Problem {
    Problem::new(FORBIDDEN, detail)
}

fn unauthenticated(detail: &str, error: Option<&str>) -> Denial {
    let problem = Problem::new(UNAUTHENTICATED, detail);
    let error = error.map(|error| format!(", error=\"{error}\"")).unwrap_or_default();
    let challenge = HeaderValue::from_str(&format!("Bearer realm=\"offbd\"{error}")).ok();
    let problem = Box::new(problem);
    Denial { problem, header: challenge.map(|challenge| Box::new((WWW_AUTHENTICATE, challenge))) }
}

fn rate_limited(wait: Duration) -> Denial {
    let seconds = wait.as_secs() + 1;
    let detail = format!("too many requests; retry after {seconds} s");
    let problem = Problem::new(RATE, detail);
    let problem = Box::new(problem);
    Denial { problem, header: Some(Box::new((RETRY_AFTER, HeaderValue::from(seconds)))) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_route_without_a_right_is_denied() {
        let mut document = crate::openapi();
        let item = document.paths.paths.get_mut("/api/v1/assets").unwrap();
        item.get.as_mut().unwrap().extensions = None;
        let item = document.paths.paths.get_mut("/metrics").unwrap();
        item.get.as_mut().unwrap().extensions = None;
        let rules = RouteRules::new(&document);
        let uri = Uri::from_static("/");
        let found = |path, method: Method| {
            let rule = rule(&rules, Some(path), &method, &uri);
            rule.map(|rule| rule.right).map_err(|denial| denial.problem.status)
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
        assert!(has_host("http://rig.example:8087", &host));
        for other in ["http://rig.example", "http://rig.example:80", "null", "", "http://x@y:1"] {
            assert!(!has_host(other, &host), "{other}");
        }
    }
}
