//! `/tokens` and `/audit`: API tokens and the audit log.

use axum::extract::State;
use axum::http::StatusCode;
use axum::http::header::LOCATION;
use axum::response::IntoResponse;
use axum::{Extension, Json};

use super::json_body::JsonBody;
use super::{App, PageQuery, Path, Problem, Query, page_limit};
use offbd_core::vocabulary::Invalid;
use offbd_service::Service;
use offbd_service::access::{Caller, NewToken};
use offbd_service::parse_timestamp;
use offbd_wire::access::{AuditView, MadeTokenView, NewTokenView, TokenView};
use offbd_wire::service::Page;

fn new_token(view: NewTokenView) -> Result<NewToken, Invalid> {
    let NewTokenView { name, role, asset, expires_at } = view;
    let expires_at = expires_at.as_deref().map(parse_timestamp).transpose();
    let expires_at = expires_at.map_err(|reason| Invalid::new("/expires_at", reason))?;
    Ok(NewToken { name, role, asset, expires_at })
}

/// Creates a token. Its `secret` is returned only in this response.
#[utoipa::path(post, path = "/tokens", tag = "access", operation_id = "create_token",
    request_body = NewTokenView,
    responses(
        (status = 201, body = MadeTokenView,
            description = "Created; the secret cannot be retrieved later",
            headers(("Location"))),
        (status = 400, body = Problem),
        (status = 404, body = Problem, description = "No such asset"),
        (status = 409, body = Problem, description = "A valid token of this name exists"),
        (status = 422, body = Problem)))]
pub(super) async fn create(
    State(app): State<App>,
    Extension(caller): Extension<Caller>,
    JsonBody(view): JsonBody<Option<NewTokenView>>,
) -> Result<impl IntoResponse, Problem> {
    let view = view.ok_or_else(|| Invalid::new("", "the body is empty"))?;
    let by = caller.name().unwrap_or("anyone");
    let created = app.service.create_token(new_token(view)?, by).await?;
    let location = format!("/api/v1/tokens/{}", created.token.id);
    Ok((StatusCode::CREATED, [(LOCATION, location)], Json(created)))
}

/// Lists the tokens, newest first, including revoked ones, without their secrets. The store keeps
/// only hashes of secrets.
#[utoipa::path(get, path = "/tokens", tag = "access", operation_id = "list_tokens",
    params(PageQuery),
    responses((status = 200, body = Page<TokenView>), (status = 400, body = Problem)))]
pub(super) async fn list(
    State(service): State<Service>,
    Query(page): Query<PageQuery>,
) -> Result<Json<Page<TokenView>>, Problem> {
    Ok(Json(service.tokens(page.cursor.as_deref(), page_limit(page.limit)).await?))
}

/// Returns a token, without its secret. It has the role, the asset, who created it, and when it
/// was last used, expires or was revoked.
#[utoipa::path(get, path = "/tokens/{token}", tag = "access", operation_id = "get_token",
    params(("token" = String, description = "Id of the token")),
    responses((status = 200, body = TokenView), (status = 404, body = Problem)))]
pub(super) async fn get(
    State(service): State<Service>,
    Path(token): Path<String>,
) -> Result<Json<TokenView>, Problem> {
    Ok(Json(service.token(&token).await?))
}

/// Revokes a token and ends its logins and streams. It stays in the list. A revoked token is not
/// changed.
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

/// Returns the audit log, newest first: who created and revoked tokens, logged in,
/// acknowledged and cleared faults, calibrated, imported, edited and deleted. Denied
/// requests are in the service's log instead.
#[utoipa::path(get, path = "/audit", tag = "access", operation_id = "list_audit",
    params(PageQuery),
    responses((status = 200, body = Page<AuditView>), (status = 400, body = Problem)))]
pub(super) async fn audit(
    State(service): State<Service>,
    Query(page): Query<PageQuery>,
) -> Result<Json<Page<AuditView>>, Problem> {
    Ok(Json(service.audit(page.cursor.as_deref(), page_limit(page.limit)).await?))
}
