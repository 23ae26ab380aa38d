//! The types of problems (RFC 9457): all that the service and the edge agent answer with.

/// The start of the type of every problem of offbd; those of other servers differ.
pub const PROBLEM_TYPE: &str = "urn:offbd:problem:";

/// A type of problems. It is written as its URI.
#[derive(Debug, PartialEq, Eq)]
pub struct ProblemType {
    /// What its URI ends with.
    pub slug: &'static str,
    /// The status of a response with it.
    pub status: u16,
    pub title: &'static str,
    /// When it occurs and what to do, for the manual.
    pub advice: &'static str,
}

impl ProblemType {
    /// Returns the URI, `urn:offbd:problem:{slug}`.
    #[must_use]
    pub fn uri(&self) -> String {
        format!("{PROBLEM_TYPE}{}", self.slug)
    }
}

/// Defines a constant for each type, and the list of all.
macro_rules! problem_types {
    ($($name:ident = $status:literal $slug:literal $title:literal $advice:literal)+) => {
        $(#[doc = $advice]
        pub const $name: &ProblemType =
            &ProblemType { slug: $slug, status: $status, title: $title, advice: $advice };)+

        /// All types, in the order of their statuses.
        pub const PROBLEM_TYPES: &[&ProblemType] = &[$($name),+];
    };
}

problem_types! {
    MALFORMED = 400 "malformed" "Malformed body"
        "The body cannot be parsed, or was not received completely. Correct the element that `pointer` names."
    MALFORMED_QUERY = 400 "query" "Invalid query parameter"
        "A query parameter is unknown, given twice or not permitted. Correct the one that `parameter` names."
    MALFORMED_PATH = 400 "path" "Invalid path"
        "The path is not valid UTF-8. Encode it as UTF-8, then with percent signs."
    MALFORMED_CONDITION = 400 "if-match" "Malformed condition"
        "`If-Match` or `If-None-Match` is neither `*` nor a list of entity tags. Copy the tag with its quotes."
    UNAUTHENTICATED = 401 "unauthenticated" "Unauthorized"
        "The request has no token, or one that is unknown, revoked or expired. Send a valid token."
    FORBIDDEN = 403 "forbidden" "Forbidden"
        "The token has no right to do this, or a page of another site has sent the request. Use another token, or list the site in `origins`."
    UNKNOWN_PATH = 404 "unknown-path" "No such path"
        "No operation has this path. Look it up in `/openapi.yaml`."
    UNKNOWN_ASSET = 404 "unknown-asset" "No such asset"
        "There is no asset of this name. Register it first."
    UNKNOWN_SESSION = 404 "unknown-session" "No such session"
        "There is no session with this id, or it has been deleted. List the sessions."
    UNKNOWN_REPLAY = 404 "unknown-replay" "No such replay"
        "There is no replay with this id, or its result is no longer kept. Start it again."
    UNKNOWN_REMARK = 404 "unknown-remark" "No such remark"
        "The session has no remark with this id. List its remarks."
    UNKNOWN_CALIBRATION = 404 "unknown-calibration" "No such calibration"
        "The asset has no calibration with this id. List its calibrations."
    UNKNOWN_TOKEN = 404 "unknown-token" "No such token"
        "There is no token with this id. List the tokens."
    UNKNOWN_CHANNEL = 404 "unknown-channel" "No such channel"
        "There is no channel with this id. List the channels."
    UNKNOWN_RULE = 404 "unknown-rule" "No such rule"
        "There is no rule with this id. List the rules."
    UNKNOWN_DELIVERY = 404 "unknown-delivery" "No such delivery"
        "There is no delivery with this id, or it is no longer kept. List the deliveries."
    UNKNOWN_CODE = 404 "unknown-code" "No such fault code"
        "There is no such fault code; `detail` lists them."
    UNKNOWN_DATA = 404 "unknown-data" "No such value"
        "A component of SOVD has no such value. List its data."
    NO_RECORDING = 404 "no-recording" "No recording"
        "The code never failed, or the session of its last failure has been deleted. Nothing can be done."
    METHOD_NOT_ALLOWED = 405 "method" "Method not allowed"
        "The path does not support this method. Use one of those in `Allow`."
    NOT_ACCEPTABLE = 406 "not-acceptable" "Not acceptable"
        "No format in `Accept` is available. Ask for one that `detail` lists."
    SLOW_BODY = 408 "slow-body" "Request timeout"
        "The body was not complete in time. Send it again, in smaller parts or over a faster link."
    ASSET_EXISTS = 409 "asset-exists" "Asset already exists"
        "An asset of this name exists. Choose another name, or replace the asset with `PUT`."
    SESSION_EXISTS = 409 "session-exists" "Session already exists"
        "The asset has a session of this name. Choose another name."
    SESSION_ENDED = 409 "session-ended" "Session has ended"
        "The samples are for a session that accepts no more. Send them to another session."
    TOKEN_EXISTS = 409 "token-exists" "Token name already in use"
        "A valid token of this name exists. Revoke it, or choose another name."
    CHANNEL_EXISTS = 409 "channel-exists" "Channel already exists"
        "A channel of this name exists. Choose another name."
    CHANNEL_IN_USE = 409 "channel-in-use" "Channel is in use"
        "A rule uses the channel. Delete the rule first."
    TOO_MANY_SETTINGS = 409 "too-many" "Limit reached"
        "There are as many of these as are permitted. Delete one first."
    NOTHING_TO_ACKNOWLEDGE = 409 "nothing-to-acknowledge" "No current occurrence"
        "The code has no occurrence that could be acknowledged. Nothing needs to be done."
    NO_DRIVE_CYCLE = 409 "no-drive-cycle" "No drive cycle"
        "There is no drive cycle for this rig; `detail` has the reason. Calibrate the rig first."
    JOB_ENDED = 409 "job-ended" "Job neither waits nor runs"
        "The job cannot be cancelled any more. Read its result."
    NOT_DONE = 409 "not-done" "Calibration not done"
        "Only a calibration that has succeeded can be activated. Wait for it, or choose another one."
    NOTHING_OFFERED = 409 "nothing-offered" "No calibration offered"
        "The asset offers no calibration. Read its progress in `/assets/{asset}/learning`."
    ALREADY_LEARNT = 409 "already-learnt" "Rig already calibrated"
        "The rig is calibrated. Remove the calibration from its asset file to calibrate it again."
    CHANGED = 412 "changed" "Changed meanwhile"
        "Somebody has changed it since it was read. Read it again, and send the change with the tag in `etag`."
    TOO_LARGE = 413 "too-large" "Content too large"
        "The body, the range or the answer is longer than the limit in `detail`. Divide it."
    MEDIA_TYPE = 415 "media-type" "Unsupported media type"
        "`Content-Type` is missing or not supported here. Use one that `detail` lists."
    CONTENT_CODING = 415 "content-encoding" "Unsupported content coding"
        "`Content-Encoding` is not supported. Use one of those in `Accept-Encoding`, or none."
    MISDIRECTED = 421 "misdirected" "Misdirected request"
        "Without authentication, `Host` must be an IP address or `localhost`. List the page's origin in `origins`, or set `auth`."
    INVALID = 422 "invalid" "Invalid value"
        "The body is well formed, but a value is not permitted. Correct the element that `pointer` names."
    UPGRADE_REQUIRED = 426 "websocket" "Upgrade required"
        "The path is that of a WebSocket. Connect with a client of WebSocket."
    BUSY = 429 "busy" "Too many requests"
        "A queue is full, and the request had no effect. Send it again after `Retry-After`."
    RATE = 429 "rate" "Rate limit exceeded"
        "The caller has sent too many requests. Send them again after `Retry-After`, and fewer."
    SPOOL_FULL = 429 "spool-full" "Spool full"
        "Only from the edge agent: its disk space is used up. Send the batch again after `Retry-After`."
    FAILED = 500 "failed" "Internal error"
        "The service has an error. Report it with the lines of the log that have the id in `instance`."
    CORRUPT = 500 "corrupt" "Corrupt data in the store"
        "The database contains data that this version cannot read. Run `offbd check`; see [Damage](backup.md#damage)."
    UNAVAILABLE = 503 "unavailable" "Service unavailable"
        "The database or a part of the service is away. Send the request again after `Retry-After`."
    STORE = 503 "store" "Store error"
        "The database has failed or rejects the change; see the log. Send the request again after `Retry-After`."
    REBUILDING = 503 "rebuilding" "Engine is being rebuilt"
        "The asset is being loaded from a long recording. Send the request again after `Retry-After`."
    MOVING = 503 "moving" "Asset is moving"
        "The asset moves to another node. Send the request again after `Retry-After`."
    SLOW = 503 "slow" "Request timed out"
        "There was no response in time; the request may have had an effect. Send it again after `Retry-After`."
    SPOOL = 503 "spool" "Not stored"
        "Only from the edge agent: its disk does not accept the batch. Send it again after `Retry-After`."
    REGISTRY_FULL = 507 "registry-full" "Asset limit reached"
        "There are as many assets as the configuration permits. Delete one, or raise the limit."
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_type_is_named_once_in_the_order_of_the_statuses() {
        let slugs: std::collections::BTreeSet<_> =
            PROBLEM_TYPES.iter().map(|kind| kind.slug).collect();
        assert_eq!(slugs.len(), PROBLEM_TYPES.len());
        assert!(PROBLEM_TYPES.is_sorted_by_key(|kind| kind.status));
    }
}
