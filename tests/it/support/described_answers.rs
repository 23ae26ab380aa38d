//! The responses that `openapi.yaml` describes, and whether a response is one of them.

use std::collections::{BTreeMap, BTreeSet};
use std::sync::OnceLock;

use boon::{Compiler, SchemaIndex, Schemas};
use reqwest::Method;
use reqwest::header::CONTENT_TYPE;
use serde_json::{Map, Value, json};

use super::described::{closed, definitions};
use super::{Answer, described};

/// Where the schemas are while they are compiled; nothing is read from there.
const PLACE: &str = "https://offbd.example/answers.json";

/// Headers that are described wherever they are sent.
const DESCRIBED_HEADERS: [&str; 8] = [
    "accept-encoding",
    "x-request-id",
    "retry-after",
    "www-authenticate",
    "etag",
    "location",
    "content-disposition",
    "set-cookie",
];

/// A described response of an operation.
struct DescribedResponse {
    /// The schema of the body, by media type; JSON alone is checked.
    bodies: BTreeMap<String, Option<SchemaIndex>>,
    headers: BTreeSet<String>,
}

/// An operation with the segments of its path, of which those in braces stand for anything.
struct DescribedOperation {
    method: String,
    path: Vec<String>,
    responses: BTreeMap<String, DescribedResponse>,
}

/// The operations of the description.
pub struct DescribedAnswers {
    schemas: Schemas,
    operations: Vec<DescribedOperation>,
}

/// Returns the description as JSON.
pub fn openapi() -> Value {
    let path = concat!(env!("CARGO_MANIFEST_DIR"), "/openapi.yaml");
    yaml_serde::from_str(&std::fs::read_to_string(path).unwrap()).unwrap()
}

/// Returns the methods and paths of a description with their operations.
pub fn operations(document: &Value) -> impl Iterator<Item = (&String, &String, &Value)> {
    let paths = document["paths"].as_object().unwrap().iter();
    paths.flat_map(|(path, item)| {
        let methods = item.as_object().unwrap().iter();
        methods.map(move |(method, operation)| (method, path, operation))
    })
}

/// Schemas with their own names, to be compiled together with those of the description.
pub struct SchemaTable {
    definitions: Map<String, Value>,
    n: usize,
}

impl SchemaTable {
    pub fn of(document: &Value) -> Self {
        Self { definitions: definitions(document), n: 0 }
    }

    /// Adds a schema; returns its place.
    pub fn add(&mut self, schema: &Value) -> String {
        self.n += 1;
        let name = format!("answer+{}", self.n);
        self.definitions.insert(name.clone(), closed(schema, false));
        format!("{PLACE}#/$defs/{name}")
    }

    /// Returns the compiler of the schemas at all places.
    pub fn compiler(self) -> Compiler {
        let mut compiler = Compiler::new();
        compiler.add_resource(PLACE, json!({ "$defs": self.definitions })).unwrap();
        compiler
    }
}

impl DescribedAnswers {
    /// Returns the description, which is read once.
    fn get() -> &'static Self {
        static ANSWERS: OnceLock<DescribedAnswers> = OnceLock::new();
        ANSWERS.get_or_init(|| Self::of(&openapi()))
    }

    fn of(document: &Value) -> Self {
        let mut table = SchemaTable::of(document);
        let mut places = Vec::new();
        for (method, path, operation) in operations(document) {
            for (status, response) in operation["responses"].as_object().unwrap() {
                let response = described::resolved(response, document);
                let contents = response["content"].as_object().into_iter().flatten();
                let bodies = contents.map(|(kind, content)| {
                    let place = kind.ends_with("json").then(|| table.add(&content["schema"]));
                    (kind.clone(), place)
                });
                let bodies: Vec<_> = bodies.collect();
                let headers = response["headers"].as_object().into_iter().flatten();
                let headers = headers.map(|(name, _)| name.to_ascii_lowercase()).collect();
                places.push((method, path, status.clone(), bodies, headers));
            }
        }
        let (mut compiler, mut schemas) = (table.compiler(), Schemas::new());
        let mut operations: BTreeMap<_, BTreeMap<_, _>> = BTreeMap::new();
        for (method, path, status, bodies, headers) in places {
            let compiled = bodies.into_iter().map(|(kind, place)| {
                let compile = |place: String| compiler.compile(&place, &mut schemas).unwrap();
                (kind, place.map(compile))
            });
            let response = DescribedResponse { bodies: compiled.collect(), headers };
            operations.entry((method, path)).or_default().insert(status, response);
        }
        let operations = operations.into_iter().map(|((method, path), responses)| {
            let path = path.split('/').map(str::to_owned).collect();
            DescribedOperation { method: method.to_ascii_uppercase(), path, responses }
        });
        let operations = operations.collect();
        Self { schemas, operations }
    }

    fn operation(&self, method: &Method, path: &str) -> Option<&DescribedOperation> {
        let path: Vec<&str> = path.split('/').collect();
        let fits = |operation: &&DescribedOperation| {
            operation.method == method.as_str()
                && operation.path.len() == path.len()
                && operation.path.iter().zip(&path).all(|(a, b)| a.starts_with('{') || a == b)
        };
        // The path with the fewest parameters, as in the service.
        let n_parameters = |operation: &&DescribedOperation| {
            operation.path.iter().filter(|segment| segment.starts_with('{')).count()
        };
        self.operations.iter().filter(fits).min_by_key(n_parameters)
    }
}

/// Checks that a response is one of those that the description names for the operation: its
/// status, its media type, each field of a JSON body, and the headers that clients read.
#[track_caller]
pub fn check(method: &Method, path: &str, answer: &Answer) {
    let described = DescribedAnswers::get();
    let Some(operation) = described.operation(method, path) else { return };
    let what = format!("{method} {path}: {} {}", answer.status, answer.text);
    let response = operation.responses.get(answer.status.as_str());
    let response = response.unwrap_or_else(|| panic!("the status is not described: {what}"));
    for name in DESCRIBED_HEADERS {
        let is_sent = answer.headers.contains_key(name);
        assert!(!is_sent || response.headers.contains(name), "{name} is not described: {what}");
    }
    let Some(kind) = answer.headers.get(CONTENT_TYPE) else { return };
    let kind = kind.to_str().unwrap().split(';').next().unwrap();
    let schema = response.bodies.get(kind);
    let schema = schema.unwrap_or_else(|| panic!("{kind} is not described: {what}"));
    if let (Some(schema), false) = (schema, answer.text.is_empty())
        && let Err(error) = described.schemas.validate(&answer.json(), *schema)
    {
        panic!("{what}\nis not as described: {error:#}");
    }
}
