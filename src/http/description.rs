//! Responses that are added to the description of every operation because middleware
//! may send them before or instead of the handler.

use axum::http::StatusCode;
use utoipa::openapi::path::Operation;
use utoipa::openapi::{Content, ContentBuilder, OpenApi as Document, Ref, RefOr, Response};

use super::routes::operations_mut;

const PROBLEM: &str = "application/problem+json";

/// A response that operations share: its status, its component name, its description.
type SharedResponse = (StatusCode, &'static str, &'static str);

/// Responses of every operation.
const ALWAYS: [SharedResponse; 3] = [
    (
        StatusCode::MISDIRECTED_REQUEST,
        "MisdirectedRequest",
        "Unknown host name in `Host`, while authentication is off",
    ),
    (StatusCode::TOO_MANY_REQUESTS, "TooManyRequests", "Too many requests; see `Retry-After`"),
    (
        StatusCode::SERVICE_UNAVAILABLE,
        "ServiceUnavailable",
        "Temporarily unavailable; see `Retry-After`",
    ),
];

/// Responses of operations that require a token.
const GUARDED: [SharedResponse; 2] = [
    (StatusCode::UNAUTHORIZED, "Unauthorized", "No token, or an invalid one"),
    (
        StatusCode::FORBIDDEN,
        "Forbidden",
        "The token has no such right, or the request comes from a page of another site",
    ),
];

/// Responses of operations with parameters in path or query.
const WITH_PARAMETERS: [SharedResponse; 1] =
    [(StatusCode::BAD_REQUEST, "InvalidParameter", "Invalid path or query parameter")];

/// Responses of operations with a body.
const WITH_BODY: [SharedResponse; 3] = [
    (StatusCode::BAD_REQUEST, "MalformedBody", "Malformed body; `pointer` names the element"),
    (StatusCode::REQUEST_TIMEOUT, "RequestTimeout", "The body was not received in time"),
    (StatusCode::PAYLOAD_TOO_LARGE, "ContentTooLarge", "The body is too long"),
];

/// Returns `document` with the shared responses added to every operation.
pub(super) fn complete(mut document: Document) -> Document {
    for operation in document.paths.paths.values_mut().flat_map(operations_mut) {
        add_responses(operation);
        for (code, response) in &mut operation.responses.responses {
            if let RefOr::T(response) = response {
                complete_response(code, response);
            }
        }
    }
    let shared = [&ALWAYS[..], &GUARDED, &WITH_PARAMETERS, &WITH_BODY].concat();
    let components = document.components.get_or_insert_default();
    for (_, name, description) in shared {
        components.responses.insert(name.to_owned(), problem(description).into());
    }
    document
}

fn add_responses(operation: &mut Operation) {
    let with_parameters =
        operation.parameters.as_ref().is_some_and(|parameters| !parameters.is_empty());
    let sets: [(bool, &[SharedResponse]); 4] = [
        (true, &ALWAYS),
        (operation.security.is_some(), &GUARDED),
        (operation.request_body.is_some(), &WITH_BODY),
        (with_parameters, &WITH_PARAMETERS),
    ];
    let sets = sets.into_iter().filter_map(|(applies, set)| applies.then_some(set));
    for (status, name, _) in sets.flatten() {
        let shared = || Ref::from_response_name(*name).into();
        operation.responses.responses.entry(status.as_str().to_owned()).or_insert_with(shared);
    }
}

fn problem(description: &str) -> Response {
    let content = ContentBuilder::new().schema(Some(Ref::from_schema_name("Problem"))).build();
    let mut response = Response::new(description);
    response.content.insert(PROBLEM.to_owned(), content.into());
    response
}

/// Sets the description that OpenAPI requires, and the media type of problems.
fn complete_response(code: &str, response: &mut Response) {
    if response.description.is_empty() {
        let status = code.parse::<StatusCode>().ok();
        let reason = status.and_then(|status| status.canonical_reason());
        reason.unwrap_or_default().clone_into(&mut response.description);
    }
    let is_problem = |content: &RefOr<Content>| {
        let RefOr::T(Content { schema: Some(RefOr::Ref(schema)), .. }) = content else {
            return false;
        };
        schema.ref_location.ends_with("/Problem")
    };
    if response.content.get("application/json").is_some_and(is_problem)
        && let Some(content) = response.content.swap_remove("application/json")
    {
        response.content.insert(PROBLEM.to_owned(), content);
    }
}
