//! Every operation with the right that it requires.

use utoipa::OpenApi as _;
use utoipa::openapi::OpenApi as Document;
use utoipa_axum::routes;

use super::routes::GuardedRouter;
use super::{
    Api, alarms, assets, calibrations, cluster, drive_cycles, events, faults, fleet, jobs,
    learning, login, metrics, notifications, operations, remarks, replays, series, sessions, sovd,
    stream, tags, telemetry, tokens, traces, trials,
};
use offbd_service::access::Right::{
    Administer, Authenticated, ControlSessions, Operate, Public, Read, ReadAsset, SendTelemetry,
};

/// Returns every operation with the right that it requires.
pub(super) fn api() -> GuardedRouter {
    let v1 = GuardedRouter::new(Document::default());
    let v1 = with_access(with_sessions(with_diagnosis(with_assets(v1))));
    GuardedRouter::new(Api::openapi())
        .routes(Public, routes!(operations::healthz))
        .routes(Public, routes!(operations::readyz))
        .routes(Read, routes!(metrics::metrics))
        .nest("/api/v1", v1)
        .nest("/sovd", sovd::routes())
}

/// Adds assets, their series and drive cycles.
fn with_assets(router: GuardedRouter) -> GuardedRouter {
    router
        .routes(Read, routes!(assets::list))
        .routes(Operate, routes!(assets::create))
        .routes(ReadAsset, routes!(assets::get))
        .routes(Operate, routes!(assets::put))
        .routes(Administer, routes!(assets::delete))
        .routes(ReadAsset, routes!(assets::state))
        .routes(ReadAsset, routes!(assets::link))
        .routes(Read, routes!(assets::trends))
        .routes(Read, routes!(series::series))
        .routes(Read, routes!(series::annotations))
        .routes(Read, routes!(tags::list))
        .routes(ReadAsset, routes!(tags::get))
        .routes(Operate, routes!(tags::put))
        .routes(ReadAsset, routes!(drive_cycles::get))
        .routes(Read, routes!(fleet::get))
        .routes(Read, routes!(cluster::get))
        .routes(Read, routes!(jobs::list))
        .routes(Read, routes!(calibrations::list))
        .routes(Operate, routes!(calibrations::create))
        .routes(Read, routes!(calibrations::get))
        .routes(Operate, routes!(calibrations::activate))
        .routes(Operate, routes!(calibrations::cancel))
        .routes(ReadAsset, routes!(learning::get))
        .routes(Operate, routes!(learning::accept))
        .routes(Operate, routes!(learning::discard))
}

/// Adds faults, alarms and what follows from them.
fn with_diagnosis(router: GuardedRouter) -> GuardedRouter {
    router
        .routes(ReadAsset, routes!(faults::of_asset))
        .routes(ReadAsset, routes!(faults::get))
        .routes(Operate, routes!(faults::clear))
        .routes(Operate, routes!(faults::acknowledge))
        .routes(Read, routes!(faults::recording))
        .routes(Read, routes!(faults::history))
        .routes(Read, routes!(faults::of_fleet))
        .routes(Read, routes!(alarms::list))
        .routes(Operate, routes!(alarms::acknowledge))
        .routes(Read, routes!(alarms::advice))
        .routes(Operate, routes!(alarms::put_note))
        .routes(ReadAsset, routes!(alarms::mutes))
        .routes(Operate, routes!(alarms::mute, alarms::unmute))
        .routes(Administer, routes!(notifications::channels, notifications::create_channel))
        .routes(Administer, routes!(notifications::channel, notifications::put_channel))
        .routes(Administer, routes!(notifications::delete_channel))
        .routes(Administer, routes!(notifications::test))
        .routes(Read, routes!(notifications::rules))
        .routes(Read, routes!(notifications::rule))
        .routes(Administer, routes!(notifications::create_rule))
        .routes(Administer, routes!(notifications::put_rule, notifications::delete_rule))
        .routes(Read, routes!(notifications::deliveries))
        .routes(Read, routes!(notifications::delivery))
        .routes(ReadAsset, routes!(events::events))
}

/// Adds telemetry and sessions.
fn with_sessions(router: GuardedRouter) -> GuardedRouter {
    router
        .routes(SendTelemetry, routes!(telemetry::post))
        .routes(ReadAsset, routes!(stream::stream))
        .routes(ControlSessions, routes!(sessions::open))
        .routes(Operate, routes!(sessions::import))
        .routes(ReadAsset, routes!(sessions::list))
        .routes(ReadAsset, routes!(sessions::get))
        .routes(Read, routes!(sessions::calibration))
        .routes(Administer, routes!(sessions::delete))
        .routes(ControlSessions, routes!(sessions::end))
        .routes(Read, routes!(sessions::telemetry))
        .routes(ReadAsset, routes!(sessions::faults))
        .routes(Read, routes!(traces::trace))
        .routes(Read, routes!(trials::try_out))
        .routes(Operate, routes!(replays::create))
        .routes(Read, routes!(remarks::list))
        .routes(Operate, routes!(remarks::add))
        .routes(Operate, routes!(remarks::remove))
        .routes(Read, routes!(replays::get))
        .routes(Operate, routes!(replays::cancel))
}

/// Adds tokens and logins.
fn with_access(router: GuardedRouter) -> GuardedRouter {
    router
        .routes(Administer, routes!(tokens::list, tokens::create))
        .routes(Administer, routes!(tokens::get, tokens::revoke))
        .routes(Administer, routes!(tokens::audit))
        .routes(Public, routes!(login::log_in))
        .routes(Authenticated, routes!(login::get, login::log_out))
}
