//! Routes, each with the right that it requires.
//!
//! The right is an argument of [`GuardedRouter::routes`] and is written to the OpenAPI
//! document as `x-right`, from which [`RouteRules`] are built for the guard. A path
//! without a right is denied to every caller.

use std::collections::BTreeMap;

use axum::Router;
use axum::http::Method;
use utoipa::openapi::extensions::ExtensionsBuilder;
use utoipa::openapi::path::{Operation, PathItem};
use utoipa::openapi::security::{
    ApiKey, ApiKeyValue, HttpAuthScheme, HttpBuilder, SecurityRequirement, SecurityScheme,
};
use utoipa::openapi::{ComponentsBuilder, OpenApi as Document};
use utoipa_axum::router::{OpenApiRouter, UtoipaMethodRouter};

use super::App;
use super::credential::COOKIE;
use super::parameters::ParameterRules;
use offbd_service::access::Right;

/// The OpenAPI extension that holds the right of an operation.
const X_RIGHT: &str = "x-right";

/// The routes of the API; none can be added without a right.
pub(super) struct GuardedRouter<S = App> {
    router: OpenApiRouter<S>,
}

impl<S: Clone + Send + Sync + 'static> GuardedRouter<S> {
    pub(super) fn new(document: Document) -> Self {
        Self { router: OpenApiRouter::with_openapi(document) }
    }

    /// Adds routes, all of which require `right`.
    pub(super) fn routes(self, right: Right, mut routes: UtoipaMethodRouter<S>) -> Self {
        for operation in routes.1.paths.values_mut().flat_map(operations_mut) {
            set_right(operation, right);
        }
        Self { router: self.router.routes(routes) }
    }

    /// Adds the routes of `other` below `path`.
    pub(super) fn nest(self, path: &str, other: Self) -> Self {
        Self { router: self.router.nest(path, other.router) }
    }

    /// Returns the router, and the OpenAPI document with the security schemes.
    pub(super) fn split(self) -> (Router<S>, Document) {
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

/// Writes the right and the security schemes of an operation to its description.
fn set_right(operation: &mut Operation, right: Right) {
    let extension = ExtensionsBuilder::new().add(X_RIGHT, right.as_str()).build();
    operation.extensions.get_or_insert_default().merge(extension);
    if right != Right::Public {
        let scheme = |name: &str| SecurityRequirement::new::<_, [&str; 0], &str>(name, []);
        operation.security = Some(vec![scheme("token"), scheme("login")]);
    }
}

/// Returns the operations of a path.
pub(super) fn operations_mut(item: &mut PathItem) -> impl Iterator<Item = &mut Operation> {
    [&mut item.get, &mut item.put, &mut item.post, &mut item.delete].into_iter().flatten()
}

/// The right that an operation requires, its name in the audit log, and its query parameters.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct RouteRule {
    pub(super) right: Right,
    pub(super) action: String,
    /// `None` if the query is not checked.
    pub(super) parameters: Option<ParameterRules>,
}

/// Routes that a caller of [`router`](super::router) adds to the API, each with its
/// description and the right that it requires. The description that is served has them too.
#[derive(Clone, Default)]
pub struct ExtraRoutes {
    router: Router,
    document: Document,
}

impl ExtraRoutes {
    /// Adds described routes, all of which require `right`.
    #[must_use]
    pub fn routes<S: Clone + Send + Sync + 'static>(
        self,
        right: Right,
        routes: UtoipaMethodRouter<S>,
        state: S,
    ) -> Self {
        let Self { router, mut document } = self;
        let added = GuardedRouter::new(Document::default()).routes(right, routes);
        let (added, described) = added.router.with_state(state).split_for_parts();
        document.merge(described);
        Self { router: router.merge(added), document }
    }

    /// Returns the router and the description.
    pub(super) fn split(self) -> (Router, Document) {
        (self.router, self.document)
    }
}

/// The rules of all routes, by path and method.
#[derive(Clone, Debug, Default)]
pub(super) struct RouteRules {
    paths: BTreeMap<String, Vec<(Method, RouteRule)>>,
}

impl RouteRules {
    /// Collects the rules in `document`.
    pub(super) fn new(document: &Document) -> Self {
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
        rules
    }

    /// Makes `GET` of `path` public.
    pub(super) fn open(&mut self, path: &str) {
        let (right, action) = (Right::Public, path.to_owned());
        self.add(path, Method::GET, RouteRule { right, action, parameters: None });
    }

    fn add(&mut self, path: &str, method: Method, rule: RouteRule) {
        self.paths.entry(path.to_owned()).or_default().push((method, rule));
    }

    /// Returns the methods of `path` with their rules; `None` if it has no rule.
    pub(super) fn of(&self, path: &str) -> Option<&[(Method, RouteRule)]> {
        self.paths.get(path).map(Vec::as_slice)
    }
}

/// Returns the rule in the description of an operation; `None` without a valid right.
fn rule(operation: &Operation) -> Option<RouteRule> {
    let word = operation.extensions.as_ref()?.get(X_RIGHT)?.as_str()?;
    let right = Right::ALL.into_iter().find(|right| right.as_str() == word)?;
    let action = operation.operation_id.clone().unwrap_or_default();
    Some(RouteRule { right, action, parameters: Some(ParameterRules::of(operation)) })
}
