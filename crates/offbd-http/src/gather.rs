//! Questions to all other nodes of a cluster: the same request, for what only they know.

use std::time::Duration;

use axum::Extension;
use axum::body::{Body, to_bytes};
use axum::extract::rejection::ExtensionRejection;
use axum::extract::{FromRef, FromRequestParts, OriginalUri};
use axum::http::header::{AUTHORIZATION, COOKIE};
use axum::http::request::Parts;
use axum::http::{HeaderMap, Request, StatusCode, Uri};
use futures_util::future::join_all;
use serde::de::DeserializeOwned;
use tokio::time::timeout;

use super::forward::{Forwarder, is_forwarded};
use offbd_service::Service;

/// Longest wait for the other nodes. Chosen: the page asks every few seconds.
const GATHER_TIMEOUT: Duration = Duration::from_secs(1);

/// Longest answer of another node, bytes: 500 entries, all with faults.
const MAX_ANSWER_BYTES: usize = 16 << 20;

/// A request that can be passed on to all other nodes.
pub(super) struct Gathering {
    service: Service,
    forwarder: Forwarder,
    uri: Uri,
    /// The headers of the request, with the caller's credentials.
    headers: HeaderMap,
}

impl<S: Send + Sync> FromRequestParts<S> for Gathering
where
    Service: FromRef<S>,
{
    type Rejection = ExtensionRejection;

    async fn from_request_parts(parts: &mut Parts, state: &S) -> Result<Self, Self::Rejection> {
        let Ok(OriginalUri(uri)) = OriginalUri::from_request_parts(parts, state).await;
        let Extension(forwarder) = Extension::from_request_parts(parts, state).await?;
        let (service, headers) = (Service::from_ref(state), parts.headers.clone());
        Ok(Self { service, forwarder, uri, headers })
    }
}

impl Gathering {
    /// Whether there may be other nodes that are to be asked. One that is asked by another node
    /// asks no further.
    pub(super) fn is_needed(&self) -> bool {
        self.service.is_node() && !is_forwarded(&self.service, &self.headers)
    }

    /// The name of each other node with its answer to the same request; `None` if it does not
    /// answer in time or as it should.
    pub(super) async fn ask_all<T: DeserializeOwned>(&self) -> Vec<(String, Option<T>)> {
        let others = self.service.other_nodes().into_iter();
        let asked = others.map(async |(name, address)| {
            let answer = timeout(GATHER_TIMEOUT, self.ask(&address)).await;
            (name, answer.ok().flatten())
        });
        join_all(asked).await
    }

    async fn ask<T: DeserializeOwned>(&self, address: &str) -> Option<T> {
        let mut request = Request::get(self.uri.clone()).body(Body::empty()).ok()?;
        for name in [AUTHORIZATION, COOKIE] {
            if let Some(value) = self.headers.get(&name) {
                request.headers_mut().insert(name, value.clone());
            }
        }
        let answer = self.forwarder.send(&self.service, address, request).await.ok()?;
        if answer.status() != StatusCode::OK {
            return None;
        }
        let bytes = to_bytes(answer.into_body(), MAX_ANSWER_BYTES).await.ok()?;
        serde_json::from_slice(&bytes).ok()
    }
}
