//! `/assets/{asset}/drive-cycle`: the motion that lets every monitor complete.

use axum::Json;
use axum::extract::State;
use axum::http::HeaderMap;
use axum::http::header::{CONTENT_DISPOSITION, CONTENT_TYPE};
use axum::response::{IntoResponse, Response};

use super::{AssetPath, Problem, session_format};
use offbd_service::Service;
use offbd_wire::drive_cycle::{DriveCycleView, view, write_csv};
use offbd_wire::session_file::SessionFormat;

/// Returns the drive cycle of a calibrated rig: the shortest motion, within the plate and
/// the servo limits, in which every monitor completes and every detectable fault is
/// detected. JSON, or only its rows as CSV if `Accept` prefers `text/csv`. Its computation
/// takes up to several seconds; the last one is kept.
#[utoipa::path(get, path = "/assets/{asset}/drive-cycle", tag = "assets",
    operation_id = "get_drive_cycle",
    params(("asset" = String, description = "Name of the asset")),
    responses((status = 200, content((DriveCycleView = "application/json"),
            (String = "text/csv")), headers(("Content-Disposition"))),
        (status = 404, body = Problem), (status = 406, body = Problem),
        (status = 409, body = Problem, description = "Not available; `detail` has the reason"),
        (status = 429, body = Problem)))]
pub(super) async fn get(
    State(service): State<Service>,
    AssetPath(asset): AssetPath,
    headers: HeaderMap,
) -> Result<Response, Problem> {
    let format = session_format::negotiate(&headers, &session_format::TABLES, SessionFormat::Json)?;
    let cycle = service.drive_cycle(&asset).await?;
    if format == SessionFormat::Json {
        return Ok(Json(view(&asset, &cycle)).into_response());
    }
    let mut text = Vec::new();
    // Writing to a vector cannot fail.
    let _ = write_csv(&mut text, &cycle);
    let file = format!("attachment; filename=\"{asset}-drive-cycle.csv\"");
    Ok((
        [
            (CONTENT_TYPE, session_format::content_type(format).to_owned()),
            (CONTENT_DISPOSITION, file),
        ],
        text,
    )
        .into_response())
}
