//! `/assets/{asset}/drive-cycle`: the motion in which every monitor comes to a result.

use axum::Json;
use axum::extract::State;
use axum::http::HeaderMap;
use axum::http::header::{CONTENT_DISPOSITION, CONTENT_TYPE};
use axum::response::{IntoResponse, Response};

use super::sessions::Form;
use super::{Asset, Problem};
use crate::service::Service;
use crate::wire::drive_cycle::{DriveCycleView, view, write_csv};

/// The drive cycle of a learnt rig: the shortest motion, within its plate and its servos'
/// limits, in which every monitor comes to a result and every fault that can be found is
/// found. JSON, or its rows alone as CSV if `Accept` asks for `text/csv`. It is computed
/// anew, which takes up to some seconds.
#[utoipa::path(get, path = "/assets/{asset}/drive-cycle", tag = "assets",
    operation_id = "get_drive_cycle",
    params(("asset" = String, description = "Name of the asset")),
    responses((status = 200, content((DriveCycleView = "application/json"),
            (String = "text/csv"))),
        (status = 404, body = Problem), (status = 406, body = Problem),
        (status = 409, body = Problem, description = "There is none; the detail says why"),
        (status = 429, body = Problem)))]
pub(super) async fn get(
    State(service): State<Service>,
    Asset(asset): Asset,
    headers: HeaderMap,
) -> Result<Response, Problem> {
    let form = Form::wanted(&headers, Form::Json)?;
    let cycle = service.drive_cycle(&asset).await?;
    if form == Form::Json {
        return Ok(Json(view(&asset, &cycle)).into_response());
    }
    let mut text = Vec::new();
    // A vector takes everything that is written to it.
    let _ = write_csv(&mut text, &cycle);
    let file = format!("attachment; filename=\"{asset}-drive-cycle.csv\"");
    Ok(([(CONTENT_TYPE, form.kind().to_owned()), (CONTENT_DISPOSITION, file)], text)
        .into_response())
}
