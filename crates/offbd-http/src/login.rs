//! `/login`: exchanges a token for a session cookie, for browsers.
//!
//! The cookie is `HttpOnly` and `SameSite=Strict`; in addition the guard checks the
//! `Origin` of every request that is not safe.

use axum::extract::{FromRequest, Request, State};
use axum::http::StatusCode;
use axum::response::{IntoResponse, Response};
use axum::{Extension, Json};
use serde::Deserialize;
use utoipa::ToSchema;

use super::credential::{client_address, set_cookie};
use super::json_body::JsonBody;
use super::{App, Problem};
use offbd_service::access::{AuditEntry, Caller, Credential, Role};
use offbd_wire::access::CallerView;
use offbd_wire::problem::UNAUTHENTICATED;
use offbd_wire::words::AuthenticationWord;

/// Path of the login resource.
const PATH: &str = "/api/v1/login";

/// The token to log in with.
#[derive(Default, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub(super) struct NewLogin {
    /// The secret, as returned when the token was created.
    token: String,
}

fn view(caller: &Caller) -> CallerView {
    let principal = caller.principal();
    CallerView {
        authentication: match principal {
            Some(_) => AuthenticationWord::Required,
            None => AuthenticationWord::Off,
        },
        name: caller.name().map(str::to_owned),
        role: principal.map_or(Role::Admin, |principal| principal.role),
        asset: principal.and_then(|principal| principal.asset.clone()),
    }
}

/// Logs a browser in: the response sets a cookie that authenticates as the token for one week, or
/// until the token expires or is revoked. Programs need no login: they send their token in
/// `Authorization`.
#[utoipa::path(post, path = "/login", tag = "access", operation_id = "log_in",
    request_body = NewLogin,
    responses((status = 200, body = CallerView, headers(("Set-Cookie"))), (status = 400, body = Problem),
        (status = 401, body = Problem, description = "Invalid, expired or revoked token"),
        (status = 403, body = Problem, description = "The request comes from a page of another site"),
        (status = 422, body = Problem)))]
pub(super) async fn log_in(State(app): State<App>, request: Request) -> Result<Response, Problem> {
    let address = client_address(request.extensions()).map(|address| address.to_string());
    let JsonBody(login) = JsonBody::<NewLogin>::from_request(request, &app).await?;
    if !app.policy.required {
        return Ok(Json(view(&Caller::Anonymous)).into_response());
    }
    let Some(principal) = app.service.authenticate(&Credential::token(login.token.trim())).await?
    else {
        let detail = "unknown, revoked or expired token";
        return Err(Problem::new(UNAUTHENTICATED, detail));
    };
    let (secret, duration) = app.service.log_in(&principal).await?;
    let caller = Caller::Authenticated(principal);
    let (action, target) = ("log_in".to_owned(), PATH.to_owned());
    let entry = AuditEntry { action, target, address, by: None };
    app.service.audit_action(&caller, entry).await?;
    let cookie = set_cookie(&secret, duration.as_secs(), app.policy.encrypted);
    Ok((cookie, Json(view(&caller))).into_response())
}

/// Returns the identity of the caller: token name, role and asset. Without authentication
/// everybody has the role `admin`.
#[utoipa::path(get, path = "/login", tag = "access", operation_id = "get_login",
    responses((status = 200, body = CallerView)))]
pub(super) async fn get(Extension(caller): Extension<Caller>) -> Json<CallerView> {
    Json(view(&caller))
}

/// Logs a browser out and invalidates its cookie. The token stays valid.
#[utoipa::path(delete, path = "/login", tag = "access", operation_id = "log_out",
    responses((status = 204, headers(("Set-Cookie")))))]
pub(super) async fn log_out(
    State(app): State<App>,
    Extension(caller): Extension<Caller>,
) -> Result<impl IntoResponse, Problem> {
    if let Some(principal) = caller.principal() {
        app.service.log_out(principal).await?;
    }
    Ok((StatusCode::NO_CONTENT, set_cookie("", 0, app.policy.encrypted)))
}
