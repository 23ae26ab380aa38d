//! `/tokens` and `/audit`: who may do what, and who did what.

use axum::body::Body;
use axum::extract::State;
use axum::http::StatusCode;
use axum::http::header::LOCATION;
use axum::response::IntoResponse;
use axum::{Extension, Json};

use super::sessions::small;
use super::{App, PageQuery, Path, Problem, Query, page_limit};
use crate::service::Service;
use crate::service::access::{Caller, NewToken};
use crate::service::moment;
use crate::wire::access::{AuditView, MadeTokenView, NewTokenView, TokenView};
use crate::wire::service::Page;
use offbd_core::vocabulary::Invalid;

fn wanted(view: NewTokenView) -> Result<NewToken, Invalid> {
    let NewTokenView { name, role, asset, expires_at } = view;
    let role = role.parse().map_err(|reason: String| Invalid::new("/role", reason))?;
    let expires_at = expires_at.as_deref().map(moment).transpose();
    let expires_at = expires_at.map_err(|reason| Invalid::new("/expires_at", reason))?;
    Ok(NewToken { name, role, asset, expires_at })
}

/// Makes a token. Its `secret` is in this answer and nowhere else.
#[utoipa::path(post, path = "/tokens", tag = "access", operation_id = "create_token",
    request_body = NewTokenView,
    responses((status = 201, body = MadeTokenView, description = "The secret is shown this once"),
        (status = 400, body = Problem), (status = 404, body = Problem, description = "No such asset"),
        (status = 409, body = Problem, description = "The name is taken"),
        (status = 422, body = Problem)))]
pub(super) async fn create(
    State(app): State<App>,
    Extension(caller): Extension<Caller>,
    body: Body,
) -> Result<impl IntoResponse, Problem> {
    let view: Option<NewTokenView> = small(&app, body).await?;
    let view = view.ok_or_else(|| Invalid::new("", "says nothing of the token"))?;
    let by = caller.name().unwrap_or("anyone");
    let made = app.service.create_token(wanted(view)?, by).await?;
    let location = format!("/api/v1/tokens/{}", made.token.id);
    Ok((StatusCode::CREATED, [(LOCATION, location)], Json(made)))
}

/// Lists the tokens, the latest first, revoked ones too, without their secrets.
#[utoipa::path(get, path = "/tokens", tag = "access", operation_id = "list_tokens",
    params(PageQuery), responses((status = 200, body = Page<TokenView>), (status = 400, body = Problem)))]
pub(super) async fn list(
    State(service): State<Service>,
    Query(page): Query<PageQuery>,
) -> Result<Json<Page<TokenView>>, Problem> {
    Ok(Json(service.tokens(page.cursor.as_deref(), page_limit(page.limit)).await?))
}

/// A token, without its secret.
#[utoipa::path(get, path = "/tokens/{token}", tag = "access", operation_id = "get_token",
    params(("token" = String, description = "Id of the token")),
    responses((status = 200, body = TokenView), (status = 404, body = Problem)))]
pub(super) async fn get(
    State(service): State<Service>,
    Path(token): Path<String>,
) -> Result<Json<TokenView>, Problem> {
    Ok(Json(service.token(&token).await?))
}

/// Revokes a token, with the logins and streams that it began.
#[utoipa::path(delete, path = "/tokens/{token}", tag = "access", operation_id = "revoke_token",
    params(("token" = String, description = "Id of the token")),
    responses((status = 204), (status = 404, body = Problem)))]
pub(super) async fn revoke(
    State(service): State<Service>,
    Path(token): Path<String>,
) -> Result<StatusCode, Problem> {
    service.revoke_token(&token).await?;
    Ok(StatusCode::NO_CONTENT)
}

/// The audit log, the latest first: who made and revoked tokens, logged in,
/// acknowledged, cleared, calibrated, imported, edited and deleted. What was
/// refused is in the service's log.
#[utoipa::path(get, path = "/audit", tag = "access", operation_id = "list_audit",
    params(PageQuery), responses((status = 200, body = Page<AuditView>), (status = 400, body = Problem)))]
pub(super) async fn audit(
    State(service): State<Service>,
    Query(page): Query<PageQuery>,
) -> Result<Json<Page<AuditView>>, Problem> {
    Ok(Json(service.audit(page.cursor.as_deref(), page_limit(page.limit)).await?))
}
