//! Completes the description that the handlers give of themselves.
//!
//! Middleware may send responses before or instead of the handler: they are added to every
//! operation. Schemas get the names that users of a generated client read: those of the
//! program without `View`, and `SessionPage` for a page of `Session`s, which refers to its
//! items instead of repeating them.

mod examples;
mod flattened;
mod sent_headers;

use axum::http::StatusCode;
use utoipa::openapi::path::{Operation, Parameter, ParameterBuilder, ParameterIn};
use utoipa::openapi::schema::{AdditionalProperties, ArrayItems, ObjectBuilder, Schema, Type};
use utoipa::openapi::{
    Components, Content, ContentBuilder, OpenApi as Document, Ref, RefOr, Required, Response,
};

use serde_json::json;

use self::examples::Examples;
use super::routes::operations_mut;
use offbd_wire::problem::{
    BUSY, CHANGED, FAILED, FORBIDDEN, MALFORMED, MALFORMED_QUERY, MEDIA_TYPE, MISDIRECTED,
    ProblemType, SLOW_BODY, TOO_LARGE, UNAUTHENTICATED, UNAVAILABLE,
};

const PROBLEM: &str = "application/problem+json";

/// A response that operations share: a problem, its component name, its description.
type SharedResponse = (&'static ProblemType, &'static str, &'static str);

/// Responses of every operation; the query is checked also where it has no parameters.
const ALWAYS: [SharedResponse; 5] = [
    (MALFORMED_QUERY, "InvalidParameter", "Invalid path or query parameter"),
    (MISDIRECTED, "MisdirectedRequest", "Unknown host name in `Host`, while authentication is off"),
    (BUSY, "TooManyRequests", "Too many requests; see `Retry-After`"),
    (FAILED, "InternalError", "An error of the service, or a damaged store"),
    (UNAVAILABLE, "ServiceUnavailable", "Temporarily unavailable; see `Retry-After`"),
];

/// Responses of operations that require a token.
const GUARDED: [SharedResponse; 2] = [
    (UNAUTHENTICATED, "Unauthorized", "No token, or an invalid one"),
    (
        FORBIDDEN,
        "Forbidden",
        "The token has no such right, or the request comes from a page of another site",
    ),
];

/// Responses of operations that replace or delete what has an entity tag.
const CONDITIONAL: [SharedResponse; 1] = [(
    CHANGED,
    "PreconditionFailed",
    "Another edition than `If-Match` names; `etag` is the present one, if there is one",
)];

/// Responses of operations with a body.
const WITH_BODY: [SharedResponse; 4] = [
    (MALFORMED, "MalformedBody", "Malformed body; `pointer` names the element"),
    (SLOW_BODY, "RequestTimeout", "The body was not received in time"),
    (TOO_LARGE, "ContentTooLarge", "The body is too long"),
    (
        MEDIA_TYPE,
        "UnsupportedMediaType",
        "Unsupported `Content-Type` or, with `Accept-Encoding`, `Content-Encoding`",
    ),
];

/// Returns `document` with the shared responses added to every operation, and with the public
/// names of the schemas.
pub(super) fn complete(mut document: Document) -> Document {
    for operation in document.paths.paths.values_mut().flat_map(operations_mut) {
        shorten_summary(operation);
        describe_conditions(operation);
        add_responses(operation);
        for (code, response) in &mut operation.responses.responses {
            if let RefOr::T(response) = response {
                complete_response(code, response);
            }
        }
    }
    let components = document.components.get_or_insert_default();
    add_shared(components);
    use_public_names(&mut document);
    flattened::join_closed(&mut document.components.get_or_insert_default().schemas);
    add_examples(&mut document);
    document
}

fn add_examples(document: &mut Document) {
    let components = document.components.get_or_insert_default();
    let examples = Examples::new(&components.schemas);
    document.paths.paths.values_mut().flat_map(operations_mut).for_each(|o| examples.attach(o));
    examples.add_to(components);
}

/// Leaves the first sentence in the summary of an operation, and moves the others to its
/// description.
fn shorten_summary(operation: &mut Operation) {
    let Some(summary) = operation.summary.take() else { return };
    let summary = summary.replace('\n', " ");
    let Some((first, rest)) = summary.split_once(". ") else {
        operation.summary = Some(summary);
        return;
    };
    operation.summary = Some(format!("{first}."));
    let further = operation.description.take().map(|text| format!("\n\n{text}"));
    operation.description = Some(format!("{rest}{}", further.unwrap_or_default()));
}

/// Adds the responses and headers to which operations refer.
fn add_shared(components: &mut Components) {
    sent_headers::add_to(components);
    let shared = [&ALWAYS[..], &GUARDED, &CONDITIONAL, &WITH_BODY].concat();
    for (kind, name, description) in shared {
        let mut response = problem(kind, description);
        sent_headers::describe(&kind.status.to_string(), &mut response);
        components.responses.insert(name.to_owned(), response.into());
    }
}

/// Gives the schemas their public names, and lets pages refer to their items.
fn use_public_names(document: &mut Document) {
    let paths = document.paths.paths.values_mut();
    for operation in paths.flat_map(operations_mut) {
        operation_schemas(operation).for_each(rename);
    }
    let schemas = &mut document.components.get_or_insert_default().schemas;
    for (name, mut schema) in std::mem::take(schemas) {
        if let Some(item) = name.strip_prefix(PAGE) {
            refer_to_items(&mut schema, item);
        }
        rename(&mut schema);
        schemas.insert(public_name(&name), schema);
    }
}

/// Returns the schemas of the parameters, the body and the responses of an operation.
fn operation_schemas(operation: &mut Operation) -> impl Iterator<Item = &mut RefOr<Schema>> {
    let parameters = operation.parameters.iter_mut().flatten().filter_map(|parameter| {
        let RefOr::T(parameter) = parameter else { return None };
        parameter.schema.as_mut()
    });
    let body = operation.request_body.iter_mut().filter_map(|body| match body {
        RefOr::T(body) => Some(body.content.values_mut()),
        RefOr::Ref(_) => None,
    });
    let responses = operation.responses.responses.values_mut().filter_map(|response| {
        let RefOr::T(response) = response else { return None };
        Some(response.content.values_mut())
    });
    let contents = body.flatten().chain(responses.flatten()).filter_map(|content| {
        let RefOr::T(content) = content else { return None };
        content.schema.as_mut()
    });
    parameters.chain(contents)
}

/// Replaces the items of a page, which are repeated in it, by a reference.
fn refer_to_items(page: &mut RefOr<Schema>, item: &str) {
    if let RefOr::T(Schema::Object(page)) = page
        && let Some(RefOr::T(Schema::Array(array))) = page.properties.get_mut("items")
    {
        let reference = RefOr::Ref(Ref::from_schema_name(item));
        array.items = ArrayItems::RefOrSchema(Box::new(reference));
    }
}

/// Renames the references in a schema.
fn rename(schema: &mut RefOr<Schema>) {
    let schema = match schema {
        RefOr::T(schema) => schema,
        RefOr::Ref(reference) => {
            if let Some(name) = reference.ref_location.strip_prefix(SCHEMAS) {
                reference.ref_location = format!("{SCHEMAS}{}", public_name(name));
            }
            return;
        }
    };
    match schema {
        Schema::Array(array) => {
            if let ArrayItems::RefOrSchema(items) = &mut array.items {
                rename(items);
            }
        }
        Schema::Object(object) => {
            object.properties.values_mut().for_each(rename);
            if let Some(AdditionalProperties::RefOr(values)) =
                object.additional_properties.as_deref_mut()
            {
                rename(values);
            }
        }
        Schema::OneOf(one) => one.items.iter_mut().for_each(rename),
        Schema::AllOf(all) => all.items.iter_mut().for_each(rename),
        Schema::AnyOf(any) => any.items.iter_mut().for_each(rename),
        _ => {}
    }
}

/// The values of `If-Match` and `If-None-Match`: any edition, or entity tags (RFC 9110, sections
/// 13.1.1 and 13.1.2).
const CONDITION: &str = r#"^(\*|(W/)?"[!#-~]*"(, ?(W/)?"[!#-~]*")*)$"#;

/// How the name of a page of items begins in the program.
const PAGE: &str = "Page_";

/// What the public name of a page of items ends with.
const PAGE_SUFFIX: &str = "Page";

/// How a reference to a schema begins.
const SCHEMAS: &str = "#/components/schemas/";

fn public_name(name: &str) -> String {
    let without_view = |name: &str| name.strip_suffix("View").unwrap_or(name).to_owned();
    match name.strip_prefix(PAGE) {
        Some(item) => format!("{}{PAGE_SUFFIX}", without_view(item)),
        None => without_view(name),
    }
}

fn add_responses(operation: &mut Operation) {
    // Of two responses with the same status the first one is described.
    let sets: [(bool, &[SharedResponse]); 4] = [
        (operation.request_body.is_some(), &WITH_BODY),
        (operation.security.is_some(), &GUARDED),
        (header(operation, "If-Match").is_some(), &CONDITIONAL),
        (true, &ALWAYS),
    ];
    let sets = sets.into_iter().filter_map(|(applies, set)| applies.then_some(set));
    for (kind, name, _) in sets.flatten() {
        let shared = || Ref::from_response_name(*name).into();
        operation.responses.responses.entry(kind.status.to_string()).or_insert_with(shared);
    }
}

/// Describes the headers by which a request depends on the edition, and lets every response with
/// an entity tag be left out if the client has it.
fn describe_conditions(operation: &mut Operation) {
    if let Some(parameter) = header(operation, "If-Match") {
        *parameter = condition("If-Match", "Entity tag of the edition to replace; any without it");
    }
    if let Some(parameter) = header(operation, "If-None-Match") {
        let schema = ObjectBuilder::new().schema_type(Type::String).enum_values(Some(["*"]));
        *parameter =
            condition("If-None-Match", "`*` creates what does not exist, and replaces nothing");
        parameter.schema = Some(schema.into());
    }
    let responses = &mut operation.responses.responses;
    let is_tagged = responses.get("200").is_some_and(|response| match response {
        RefOr::T(response) => response.headers.contains_key("ETag"),
        RefOr::Ref(_) => false,
    });
    if is_tagged && operation.request_body.is_none() {
        let unchanged = Response::new("The client has this edition");
        responses.insert(StatusCode::NOT_MODIFIED.as_str().to_owned(), unchanged.into());
        let description = "Entity tags of the editions that the client has";
        let parameter = condition("If-None-Match", description);
        operation.parameters.get_or_insert_default().push(parameter.into());
    }
}

/// Returns the description of a header that an operation has.
fn header<'a>(operation: &'a mut Operation, name: &str) -> Option<&'a mut Parameter> {
    operation.parameters.iter_mut().flatten().find_map(|parameter| match parameter {
        RefOr::T(parameter) if parameter.name == name => Some(parameter),
        _ => None,
    })
}

/// Describes a header of a request with entity tags, without null: it is a text or is absent.
fn condition(name: &str, description: &str) -> Parameter {
    let schema = ObjectBuilder::new().schema_type(Type::String).pattern(Some(CONDITION));
    let header = ParameterBuilder::new().name(name).parameter_in(ParameterIn::Header);
    let header = header.required(Required::False).description(Some(description));
    header.schema(Some(schema)).build()
}

/// Returns the description of a response with a problem, of which `kind` is an example.
fn problem(kind: &ProblemType, description: &str) -> Response {
    let example = json!({
        "type": kind.uri(), "title": kind.title, "status": kind.status, "detail": description,
        "instance": "urn:uuid:01a22327-7024-709a-a9fb-8a9966023fc9",
    });
    let content = ContentBuilder::new().schema(Some(Ref::from_schema_name("Problem")));
    let mut response = Response::new(description);
    response.content.insert(PROBLEM.to_owned(), content.example(Some(example)).build().into());
    response
}

/// Sets the description that OpenAPI requires, the media type of problems, and the headers.
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
    sent_headers::describe(code, response);
}

#[cfg(test)]
mod tests {
    use serde_json::Value;

    use super::*;

    #[test]
    fn every_reference_is_to_a_schema_with_a_public_name() {
        let document = crate::openapi();
        let json = serde_json::to_value(&document).unwrap();
        let schemas = json["components"]["schemas"].as_object().unwrap();
        for name in schemas.keys() {
            assert!(!name.ends_with("View") && !name.contains('_'), "{name}");
        }
        let mut references = Vec::new();
        collect(&json, &mut references);
        assert!(references.len() > 100);
        for reference in references.iter().filter_map(|name| name.strip_prefix(SCHEMAS)) {
            assert!(schemas.contains_key(reference), "{reference}");
        }
        let items = &schemas["SessionPage"]["properties"]["items"]["items"];
        assert_eq!(*items, json!({ "$ref": "#/components/schemas/Session" }));
    }

    fn collect(json: &Value, references: &mut Vec<String>) {
        match json {
            Value::Object(fields) => {
                references.extend(fields.get("$ref").and_then(Value::as_str).map(str::to_owned));
                fields.values().for_each(|value| collect(value, references));
            }
            Value::Array(items) => items.iter().for_each(|item| collect(item, references)),
            _ => {}
        }
    }

    /// Two names of the program must not become one.
    #[test]
    fn no_public_name_occurs_twice() {
        let document = crate::api().split().1;
        let names: Vec<_> = document.components.unwrap().schemas.into_keys().collect();
        let public: std::collections::BTreeSet<_> = names.iter().map(|n| public_name(n)).collect();
        assert_eq!(public.len(), names.len());
    }
}
