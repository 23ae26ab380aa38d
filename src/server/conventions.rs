//! Spans by the conventions of OpenTelemetry for HTTP servers:
//! <https://opentelemetry.io/docs/specs/semconv/http/http-spans/>.
//!
//! In the log the span of a request has short names; what a collector gets is renamed here.

use opentelemetry::trace::{SpanKind, Status};
use opentelemetry::{Key, KeyValue, Value};
use opentelemetry_otlp::SpanExporter;
use opentelemetry_sdk::Resource;
use opentelemetry_sdk::error::OTelSdkResult;
use opentelemetry_sdk::trace::{SpanData, SpanExporter as Export};
use std::time::Duration;

/// The name of a request's span in the log.
const REQUEST: &str = "request";

/// Names in the log, and those of the conventions or below `offbd.`.
const NAMES: [(&str, &str); 5] = [
    ("method", "http.request.method"),
    ("path", "url.path"),
    ("status", STATUS),
    ("asset", "offbd.asset"),
    ("request_id", "offbd.request_id"),
];

const STATUS: &str = "http.response.status_code";

/// Sends spans by the conventions.
#[derive(Debug)]
pub(super) struct ConventionalExporter {
    pub(super) exporter: SpanExporter,
    /// `http` or `https`.
    pub(super) scheme: &'static str,
}

impl Export for ConventionalExporter {
    async fn export(&self, mut batch: Vec<SpanData>) -> OTelSdkResult {
        batch.iter_mut().for_each(|span| conventional(span, self.scheme));
        self.exporter.export(batch).await
    }

    fn shutdown_with_timeout(&self, timeout: Duration) -> OTelSdkResult {
        self.exporter.shutdown_with_timeout(timeout)
    }

    fn force_flush(&self) -> OTelSdkResult {
        self.exporter.force_flush()
    }

    fn set_resource(&mut self, resource: &Resource) {
        self.exporter.set_resource(resource);
    }
}

fn conventional(span: &mut SpanData, scheme: &'static str) {
    for attribute in &mut span.attributes {
        let name = NAMES.iter().find(|(own, _)| *own == attribute.key.as_str());
        if let Some((_, name)) = name {
            attribute.key = Key::from_static_str(name);
        }
    }
    if span.name != REQUEST {
        return;
    }
    span.span_kind = SpanKind::Server;
    span.attributes.push(KeyValue::new("url.scheme", scheme));
    let method = text(span, "http.request.method").unwrap_or_default();
    span.name = match text(span, "http.route") {
        Some(route) => format!("{method} {route}").into(),
        None => method.into(),
    };
    let status = text(span, STATUS).and_then(|status| status.parse::<i64>().ok());
    if let Some(status) = status {
        span.attributes.retain(|attribute| attribute.key.as_str() != STATUS);
        span.attributes.push(KeyValue::new(STATUS, status));
        if status >= 500 {
            span.attributes.push(KeyValue::new("error.type", status.to_string()));
            span.status = Status::error("");
        }
    }
}

fn text(span: &SpanData, key: &str) -> Option<String> {
    let attribute = span.attributes.iter().find(|attribute| attribute.key.as_str() == key)?;
    match &attribute.value {
        Value::String(text) => Some(text.as_str().to_owned()),
        value => Some(value.to_string()),
    }
}

#[cfg(test)]
mod tests {
    use opentelemetry::InstrumentationScope;
    use opentelemetry::trace::{SpanContext, SpanId};
    use std::time::SystemTime;

    use super::*;

    fn span(name: &'static str, attributes: &[(&'static str, &'static str)]) -> SpanData {
        SpanData {
            span_context: SpanContext::empty_context(),
            parent_span_id: SpanId::INVALID,
            parent_span_is_remote: false,
            span_kind: SpanKind::Internal,
            name: name.into(),
            start_time: SystemTime::UNIX_EPOCH,
            end_time: SystemTime::UNIX_EPOCH,
            attributes: attributes.iter().map(|(key, value)| KeyValue::new(*key, *value)).collect(),
            dropped_attributes_count: 0,
            events: opentelemetry_sdk::trace::SpanEvents::default(),
            links: opentelemetry_sdk::trace::SpanLinks::default(),
            status: Status::Unset,
            instrumentation_scope: InstrumentationScope::default(),
        }
    }

    #[test]
    fn a_request_follows_the_conventions() {
        let attributes = [
            ("method", "GET"),
            ("path", "/api/v1/assets/a"),
            ("http.route", "/api/v1/assets/{asset}"),
            ("status", "503"),
            ("asset", "a"),
        ];
        let mut request = span("request", &attributes);
        conventional(&mut request, "https");
        assert_eq!(request.name, "GET /api/v1/assets/{asset}");
        assert_eq!((request.span_kind, &request.status), (SpanKind::Server, &Status::error("")));
        let expected = [
            KeyValue::new("http.request.method", "GET"),
            KeyValue::new("url.path", "/api/v1/assets/a"),
            KeyValue::new("http.route", "/api/v1/assets/{asset}"),
            KeyValue::new("offbd.asset", "a"),
            KeyValue::new("url.scheme", "https"),
            KeyValue::new("http.response.status_code", 503),
            KeyValue::new("error.type", "503"),
        ];
        assert_eq!(request.attributes, expected);
    }

    #[test]
    fn without_a_route_a_request_has_the_name_of_its_method() {
        let mut request = span("request", &[("method", "GET"), ("status", "404")]);
        conventional(&mut request, "http");
        assert_eq!((request.name.as_ref(), &request.status), ("GET", &Status::Unset));
        let mut commit = span("commit", &[("sets", "3")]);
        let before = commit.clone();
        conventional(&mut commit, "http");
        assert_eq!(commit, before);
    }
}
