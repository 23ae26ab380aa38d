//! `/`: the fleet on one page.

use axum::response::Html;

/// One file, nothing from elsewhere; it asks the interface for the rest.
const FLEET: &str = include_str!("fleet.html");

pub(super) async fn fleet() -> Html<&'static str> {
    Html(FLEET)
}
