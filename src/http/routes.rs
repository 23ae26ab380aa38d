//! Routes, each with the right that it takes.
//!
//! The right is an argument of [`Guarded::routes`], and stands in the
//! interface's description as `x-right`; from there the guard knows it. A path
//! without one is refused.

use std::collections::BTreeMap;

use axum::Router;
use axum::http::Method;
use axum::routing::MethodRouter;
use utoipa::openapi::extensions::ExtensionsBuilder;
use utoipa::openapi::path::{Operation, PathItem};
use utoipa::openapi::security::{
    ApiKey, ApiKeyValue, HttpAuthScheme, HttpBuilder, SecurityRequirement, SecurityScheme,
};
use utoipa::openapi::{ComponentsBuilder, OpenApi as Document};
use utoipa_axum::router::{OpenApiRouter, UtoipaMethodRouter};

use super::App;
use super::login::COOKIE;
use crate::service::access::Right;

/// The name of the right in the description of an operation.
const X_RIGHT: &str = "x-right";

/// The routes of the interface; there is no way in without a right.
pub(super) struct Guarded {
    router: OpenApiRouter<App>,
}

impl Guarded {
    pub(super) fn new(document: Document) -> Self {
        Self { router: OpenApiRouter::with_openapi(document) }
    }

    /// Adds routes, all of which take `right`.
    pub(super) fn routes(self, right: Right, mut routes: UtoipaMethodRouter<App>) -> Self {
        for operation in routes.1.paths.values_mut().flat_map(operations_mut) {
            state(operation, right);
        }
        Self { router: self.router.routes(routes) }
    }

    /// Puts `other` below `path`.
    pub(super) fn nest(self, path: &str, other: Self) -> Self {
        Self { router: self.router.nest(path, other.router) }
    }

    /// The router, and the description with the ways to show a token.
    pub(super) fn split(self) -> (Router<App>, Document) {
        let (router, mut document) = self.router.split_for_parts();
        let bearer =
            HttpBuilder::new().scheme(HttpAuthScheme::Bearer).bearer_format("offbd_… or JWT");
        let cookie = SecurityScheme::ApiKey(ApiKey::Cookie(ApiKeyValue::new(COOKIE)));
        let components = document.components.take().unwrap_or_default();
        let components = ComponentsBuilder::from(components)
            .security_scheme("token", SecurityScheme::Http(bearer.build()))
            .security_scheme("login", cookie);
        document.components = Some(components.build());
        (router, document)
    }
}

/// Writes into an operation what it takes.
fn state(operation: &mut Operation, right: Right) {
    let stated = ExtensionsBuilder::new().add(X_RIGHT, right.as_str()).build();
    operation.extensions.get_or_insert_default().merge(stated);
    if right != Right::Open {
        let scheme = |name: &str| SecurityRequirement::new::<_, [&str; 0], &str>(name, []);
        operation.security = Some(vec![scheme("token"), scheme("login")]);
    }
}

/// The operations of a path that the interface has.
pub(super) fn operations_mut(item: &mut PathItem) -> impl Iterator<Item = &mut Operation> {
    [&mut item.get, &mut item.put, &mut item.post, &mut item.delete].into_iter().flatten()
}

/// What an operation takes, and what it is called in the audit log.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Rule {
    pub(super) right: Right,
    pub(super) act: String,
}

/// Routes beside the interface, each with the right that it takes.
#[derive(Clone, Default)]
pub struct More {
    pub(super) router: Router,
    rules: Vec<(&'static str, Method, Right)>,
}

impl More {
    /// Adds a route for `method`, which takes `right`.
    #[must_use]
    pub fn route(
        self,
        path: &'static str,
        method: Method,
        right: Right,
        handler: MethodRouter,
    ) -> Self {
        let Self { router, mut rules } = self;
        rules.push((path, method, right));
        Self { router: router.route(path, handler), rules }
    }
}

/// What every operation takes.
#[derive(Clone, Debug, Default)]
pub(super) struct Rules {
    paths: BTreeMap<String, Vec<(Method, Rule)>>,
}

impl Rules {
    /// The rules that `document` states, and those of `more`.
    pub(super) fn new(document: &Document, more: &More) -> Self {
        let mut rules = Self::default();
        for (path, item) in &document.paths.paths {
            let methods = [
                (Method::GET, &item.get),
                (Method::PUT, &item.put),
                (Method::POST, &item.post),
                (Method::DELETE, &item.delete),
            ];
            for (method, operation) in methods {
                if let Some(rule) = operation.as_ref().and_then(rule) {
                    rules.add(path, method, rule);
                }
            }
        }
        for (path, method, right) in &more.rules {
            rules.add(path, method.clone(), Rule { right: *right, act: (*path).to_owned() });
        }
        rules
    }

    /// Opens `path` to everyone.
    pub(super) fn open(&mut self, path: &str) {
        self.add(path, Method::GET, Rule { right: Right::Open, act: path.to_owned() });
    }

    fn add(&mut self, path: &str, method: Method, rule: Rule) {
        self.paths.entry(path.to_owned()).or_default().push((method, rule));
    }

    /// The methods of `path` with what they take; none if nothing is stated.
    pub(super) fn of(&self, path: &str) -> Option<&[(Method, Rule)]> {
        self.paths.get(path).map(Vec::as_slice)
    }
}

/// The rule that the description of an operation states.
fn rule(operation: &Operation) -> Option<Rule> {
    let word = operation.extensions.as_ref()?.get(X_RIGHT)?.as_str()?;
    let right = Right::ALL.into_iter().find(|right| right.as_str() == word)?;
    Some(Rule { right, act: operation.operation_id.clone().unwrap_or_default() })
}
