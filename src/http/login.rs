//! `/login`: a browser shows a token once and has a cookie from then on.
//!
//! The cookie is out of reach of scripts, goes to this site alone, and is not
//! sent along by other sites' pages; the guard looks at the origin besides.

use axum::body::Body;
use axum::extract::{Request, State};
use axum::http::header::SET_COOKIE;
use axum::http::{HeaderMap, HeaderValue, StatusCode};
use axum::response::{IntoResponse, Response};
use axum::{Extension, Json};
use serde::Deserialize;
use utoipa::ToSchema;

use super::sessions::small;
use super::{App, Problem, guard};
use crate::service::access::{Caller, Credential, Deed, Role};
use crate::wire::access::CallerView;

/// Where a login is.
const ADDRESS: &str = "/api/v1/login";

/// The cookie's name.
pub(super) const COOKIE: &str = "offbd_login";

/// Its name where connections are encrypted: with this prefix browsers take it
/// from this host alone, and over TLS alone.
const SECURE_COOKIE: &str = "__Host-offbd_login";

pub(super) const fn cookie_name(encrypted: bool) -> &'static str {
    if encrypted { SECURE_COOKIE } else { COOKIE }
}

/// A token, shown once to log in.
#[derive(Default, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub(super) struct NewLogin {
    /// The secret, as it was shown when the token was made.
    token: String,
}

fn cookie(secret: &str, seconds: u64, encrypted: bool) -> HeaderMap {
    let secure = if encrypted { "; Secure" } else { "" };
    let name = cookie_name(encrypted);
    let rest = format!("Path=/; Max-Age={seconds}; HttpOnly; SameSite=Strict{secure}");
    let value = HeaderValue::from_str(&format!("{name}={secret}; {rest}"));
    value.into_iter().map(|value| (SET_COOKIE, value)).collect()
}

fn view(caller: &Caller) -> CallerView {
    let pass = caller.pass();
    CallerView {
        authentication: if pass.is_some() { "required" } else { "off" }.to_owned(),
        name: caller.name().map(str::to_owned),
        role: pass.map_or(Role::Admin, |pass| pass.role).to_string(),
        asset: pass.and_then(|pass| pass.asset.clone()),
    }
}

/// Logs a browser in: the answer sets a cookie that stands for the token for a
/// week, or until the token ends.
#[utoipa::path(post, path = "/login", tag = "access", operation_id = "log_in",
    request_body = NewLogin,
    responses((status = 200, body = CallerView), (status = 400, body = Problem),
        (status = 401, body = Problem, description = "The token is not in force"),
        (status = 422, body = Problem)))]
pub(super) async fn log_in(
    State(app): State<App>,
    request: Request<Body>,
) -> Result<Response, Problem> {
    let (parts, body) = request.into_parts();
    let shown: NewLogin = small(&app, body).await?;
    if !app.policy.required {
        return Ok(Json(view(&Caller::Anyone)).into_response());
    }
    let Some(pass) = app.service.authenticate(&Credential::token(shown.token.trim())).await? else {
        let detail = "the token is none of this service, revoked or expired";
        let title = "Not authenticated";
        return Err(Problem::new(StatusCode::UNAUTHORIZED, "unauthenticated", title, detail));
    };
    let (secret, lasts) = app.service.log_in(&pass).await?;
    let caller = Caller::Known(pass);
    let address = guard::address(&parts).map(|address| address.to_string());
    let deed = Deed { act: "log_in".to_owned(), target: ADDRESS.to_owned(), address };
    app.service.note(&caller, deed).await?;
    let cookie = cookie(&secret, lasts.as_secs(), app.policy.encrypted);
    Ok((cookie, Json(view(&caller))).into_response())
}

/// Who asks, and what for.
#[utoipa::path(get, path = "/login", tag = "access", operation_id = "get_login",
    responses((status = 200, body = CallerView)))]
pub(super) async fn get(Extension(caller): Extension<Caller>) -> Json<CallerView> {
    Json(view(&caller))
}

/// Logs a browser out; its cookie is worth nothing from then on.
#[utoipa::path(delete, path = "/login", tag = "access", operation_id = "log_out",
    responses((status = 204)))]
pub(super) async fn log_out(
    State(app): State<App>,
    Extension(caller): Extension<Caller>,
) -> Result<impl IntoResponse, Problem> {
    if let Some(pass) = caller.pass() {
        app.service.log_out(pass).await?;
    }
    Ok((StatusCode::NO_CONTENT, cookie("", 0, app.policy.encrypted)))
}
