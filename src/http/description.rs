//! What is added to the description of every operation: the answers that any
//! request may get before its handler, or instead of it.

use axum::http::StatusCode;
use utoipa::openapi::path::Operation;
use utoipa::openapi::{Content, ContentBuilder, OpenApi as Document, Ref, RefOr, Response};

use super::routes::operations_mut;

const PROBLEM: &str = "application/problem+json";

/// An answer that operations share: its status, its name among the components of
/// the description, and what it means.
type Shared = (StatusCode, &'static str, &'static str);

/// Whatever is asked.
const ALWAYS: [Shared; 3] = [
    (
        StatusCode::MISDIRECTED_REQUEST,
        "Misdirected",
        "Asked by another host's name, where no token is asked for",
    ),
    (StatusCode::TOO_MANY_REQUESTS, "TooMuch", "Too much at once; `Retry-After` says when"),
    (StatusCode::SERVICE_UNAVAILABLE, "NotNow", "Not done now; `Retry-After` says when"),
];

/// Where a token is asked for.
const GUARDED: [Shared; 2] = [
    (StatusCode::UNAUTHORIZED, "NoToken", "No token, or none that is in force"),
    (StatusCode::FORBIDDEN, "NotAllowed", "Not for this token, or from another site's page"),
];

/// Where something is named in the address.
const NAMED: [Shared; 1] = [(StatusCode::BAD_REQUEST, "BadAddress", "The address cannot be read")];

/// Where there is a body.
const WITH_BODY: [Shared; 3] = [
    (StatusCode::BAD_REQUEST, "BadBody", "It cannot be read; `pointer` names the place"),
    (StatusCode::REQUEST_TIMEOUT, "SlowBody", "The body did not end in time"),
    (StatusCode::PAYLOAD_TOO_LARGE, "TooLarge", "The body is too long"),
];

/// The document with the answers of every operation.
pub(super) fn complete(mut document: Document) -> Document {
    for operation in document.paths.paths.values_mut().flat_map(operations_mut) {
        add_answers(operation);
        for (code, response) in &mut operation.responses.responses {
            if let RefOr::T(response) = response {
                put_right(code, response);
            }
        }
    }
    let shared = [&ALWAYS[..], &GUARDED, &NAMED, &WITH_BODY].concat();
    let components = document.components.get_or_insert_default();
    for (_, name, words) in shared {
        components.responses.insert(name.to_owned(), problem(words).into());
    }
    document
}

fn add_answers(operation: &mut Operation) {
    let named = operation.parameters.as_ref().is_some_and(|parameters| !parameters.is_empty());
    let sets: [(bool, &[Shared]); 4] = [
        (true, &ALWAYS),
        (operation.security.is_some(), &GUARDED),
        (operation.request_body.is_some(), &WITH_BODY),
        (named, &NAMED),
    ];
    let sets = sets.into_iter().filter_map(|(applies, set)| applies.then_some(set));
    for (status, name, _) in sets.flatten() {
        let shared = || Ref::from_response_name(*name).into();
        operation.responses.responses.entry(status.as_str().to_owned()).or_insert_with(shared);
    }
}

fn problem(words: &str) -> Response {
    let content = ContentBuilder::new().schema(Some(Ref::from_schema_name("Problem"))).build();
    let mut response = Response::new(words);
    response.content.insert(PROBLEM.to_owned(), content.into());
    response
}

/// Gives `response` the words that OpenAPI asks for, and problems their media
/// type.
fn put_right(code: &str, response: &mut Response) {
    if response.description.is_empty() {
        let status = code.parse::<StatusCode>().ok();
        let words = status.and_then(|status| status.canonical_reason());
        words.unwrap_or_default().clone_into(&mut response.description);
    }
    let of_problem = |content: &RefOr<Content>| {
        let RefOr::T(Content { schema: Some(RefOr::Ref(schema)), .. }) = content else {
            return false;
        };
        schema.ref_location.ends_with("/Problem")
    };
    if response.content.get("application/json").is_some_and(of_problem)
        && let Some(content) = response.content.swap_remove("application/json")
    {
        response.content.insert(PROBLEM.to_owned(), content);
    }
}
