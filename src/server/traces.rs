//! Traces for OpenTelemetry: the spans of each request, sent to a collector by OTLP over
//! HTTP. Inactive without an endpoint.
//!
//! At most 2048 spans are queued in memory; a separate thread sends them. While the
//! collector is unavailable, further spans are dropped, so that the service never waits
//! for it.

use anyhow::{Context, Result};
use opentelemetry::KeyValue;
use opentelemetry::trace::TracerProvider;
use opentelemetry_otlp::{SpanExporter, WithExportConfig};
use opentelemetry_sdk::Resource;
use opentelemetry_sdk::trace::{Sampler, SdkTracerProvider};
use tracing::Subscriber;
use tracing::level_filters::LevelFilter;
use tracing_subscriber::Layer;
use tracing_subscriber::filter::Targets;
use tracing_subscriber::registry::LookupSpan;

use super::conventions::ConventionalExporter;
use crate::config::{Config, TracesConfig};

/// The variables that name an endpoint.
const ENDPOINTS: [&str; 2] = ["OTEL_EXPORTER_OTLP_ENDPOINT", "OTEL_EXPORTER_OTLP_TRACES_ENDPOINT"];

fn is_set(variable: &str) -> bool {
    std::env::var_os(variable).is_some_and(|value| !value.is_empty())
}

/// What the spans are of: name and version of the service, and what the variables say.
fn resource() -> Resource {
    let version = KeyValue::new("service.version", env!("CARGO_PKG_VERSION"));
    let resource = Resource::builder().with_attribute(version);
    let is_named = is_set("OTEL_SERVICE_NAME")
        || std::env::var("OTEL_RESOURCE_ATTRIBUTES")
            .is_ok_and(|text| text.contains("service.name="));
    match is_named {
        true => resource.build(),
        false => resource.with_service_name("offbd").build(),
    }
}

/// The sender of traces.
pub struct Traces {
    provider: SdkTracerProvider,
}

impl Traces {
    /// Starts to send traces; returns `None` without an endpoint. Where a key is not set, the
    /// variables of OpenTelemetry apply. Must be called outside of an asynchronous runtime,
    /// because the exporter starts its own.
    ///
    /// # Errors
    /// If the endpoint is invalid.
    pub fn start(config: &Config) -> Result<Option<Self>> {
        let TracesConfig { endpoint, share } = &config.traces;
        if endpoint.is_none() && !ENDPOINTS.into_iter().any(is_set) {
            return Ok(None);
        }
        let exporter = SpanExporter::builder().with_http();
        let exporter = match endpoint {
            Some(endpoint) => {
                exporter.with_endpoint(format!("{}/v1/traces", endpoint.trim_end_matches('/')))
            }
            None => exporter,
        };
        let exporter = exporter.build().context("the endpoint of traces is invalid")?;
        let scheme = if config.tls.is_some() { "https" } else { "http" };
        let mut provider = SdkTracerProvider::builder()
            .with_batch_exporter(ConventionalExporter { exporter, scheme })
            .with_resource(resource());
        // By default the provider follows `OTEL_TRACES_SAMPLER`.
        if *share < 1.0 || !is_set("OTEL_TRACES_SAMPLER") {
            let share = Box::new(Sampler::TraceIdRatioBased(*share));
            provider = provider.with_sampler(Sampler::ParentBased(share));
        }
        Ok(Some(Self { provider: provider.build() }))
    }

    /// A layer that receives the service's own spans, independent of the log level.
    #[must_use]
    pub fn layer<S>(&self) -> impl Layer<S> + use<S>
    where
        S: Subscriber + for<'span> LookupSpan<'span>,
    {
        let own = Targets::new().with_target("offbd", LevelFilter::DEBUG);
        let tracer = self.provider.tracer("offbd");
        tracing_opentelemetry::layer().with_tracer(tracer).with_filter(own)
    }

    /// Sends the queued spans.
    pub fn stop(&self) {
        if let Err(error) = self.provider.shutdown() {
            tracing::warn!(%error, "the last traces were not sent");
        }
    }
}
