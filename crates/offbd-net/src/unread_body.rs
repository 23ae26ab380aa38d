//! Request bodies that a handler refuses without reading them to their end.
//!
//! A server that answers and closes a connection on which data still arrive resets it, and the
//! client may lose the answer (RFC 9112, 9.6). So what is left of a body is received and
//! discarded before the answer is sent, up to a bound.

use std::pin::Pin;
use std::task::{Context, Poll};
use std::time::Duration;

use axum::body::{Body, Bytes, HttpBody};
use axum::extract::Request;
use axum::http::Version;
use axum::http::header::{CONNECTION, EXPECT, HeaderValue};
use axum::middleware::Next;
use axum::response::Response;
use futures_util::StreamExt;
use hyper::body::{Frame, SizeHint};
use tokio::sync::oneshot;
use tokio::time::timeout;

/// Most bytes of a refused body that are received and discarded.
const MAX_DISCARDED_BYTES: usize = 16 << 20;
/// Longest time for that.
const DISCARD_TIMEOUT: Duration = Duration::from_secs(30);
/// Longest pause of the client meanwhile: it may wait for the answer before it sends more.
const DISCARD_IDLE_TIMEOUT: Duration = Duration::from_secs(1);

/// Receives what the handler left of the request's body. If that is too much, the response
/// announces that the connection is closed, as the server cannot find the next request then.
pub async fn discard(request: Request, next: Next) -> Response {
    if request.body().is_end_stream() || request.version() > Version::HTTP_11 {
        return next.run(request).await;
    }
    // Such a client sends the body only if it is asked to.
    let is_expected = !request.headers().contains_key(EXPECT);
    let (back, mut rest) = oneshot::channel();
    let observed = |body| Body::new(ObservedBody { body: Some(body), back: Some(back) });
    let mut response = next.run(request.map(observed)).await;
    let is_received = match rest.try_recv() {
        Ok(rest) => is_expected && is_discarded(rest).await,
        Err(oneshot::error::TryRecvError::Closed) => true,
        Err(oneshot::error::TryRecvError::Empty) => false,
    };
    if !is_received {
        response.headers_mut().insert(CONNECTION, HeaderValue::from_static("close"));
    }
    response
}

/// Receives the body; returns whether its end was reached.
async fn is_discarded(body: Body) -> bool {
    let all = async {
        let mut frames = body.into_data_stream();
        let mut n_bytes = 0;
        while n_bytes <= MAX_DISCARDED_BYTES {
            match timeout(DISCARD_IDLE_TIMEOUT, frames.next()).await {
                Ok(Some(Ok(frame))) => n_bytes += frame.len(),
                Ok(None) => return true,
                Ok(Some(Err(_))) | Err(_) => return false,
            }
        }
        false
    };
    timeout(DISCARD_TIMEOUT, all).await.unwrap_or(false)
}

/// A body that is sent back if it is dropped before its end.
struct ObservedBody {
    /// Until its end or an error.
    body: Option<Body>,
    back: Option<oneshot::Sender<Body>>,
}

impl HttpBody for ObservedBody {
    type Data = Bytes;
    type Error = axum::Error;

    fn poll_frame(
        mut self: Pin<&mut Self>,
        context: &mut Context<'_>,
    ) -> Poll<Option<Result<Frame<Bytes>, axum::Error>>> {
        let Some(body) = &mut self.body else { return Poll::Ready(None) };
        let frame = Pin::new(body).poll_frame(context);
        if matches!(frame, Poll::Ready(None)) {
            self.body = None;
            self.back = None;
        }
        frame
    }

    fn is_end_stream(&self) -> bool {
        self.body.as_ref().is_none_or(HttpBody::is_end_stream)
    }

    fn size_hint(&self) -> SizeHint {
        self.body.as_ref().map_or_else(|| SizeHint::with_exact(0), HttpBody::size_hint)
    }
}

impl Drop for ObservedBody {
    fn drop(&mut self) {
        if let (Some(body), Some(back)) = (self.body.take(), self.back.take())
            && !body.is_end_stream()
        {
            // Nobody waits for it if the request was cancelled.
            drop(back.send(body));
        }
    }
}
