//! Traces for OpenTelemetry: the spans of each request, sent to a collector by OTLP over
//! HTTP. Inactive without an endpoint.
//!
//! At most 2048 spans are queued in memory; a thread of its own sends them. While the
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

use crate::config::TracesConfig;

/// The sender of traces.
pub struct Traces {
    provider: SdkTracerProvider,
}

impl Traces {
    /// Starts to send traces; returns `None` without an endpoint. Must be called outside
    /// of an asynchronous runtime, because the exporter starts its own.
    ///
    /// # Errors
    /// If the endpoint is invalid.
    pub fn start(config: &TracesConfig) -> Result<Option<Self>> {
        let Some(endpoint) = &config.endpoint else { return Ok(None) };
        let endpoint = format!("{}/v1/traces", endpoint.trim_end_matches('/'));
        let exporter = SpanExporter::builder().with_http().with_endpoint(endpoint).build();
        let exporter = exporter.context("`traces.endpoint` is invalid")?;
        let version = KeyValue::new("service.version", env!("CARGO_PKG_VERSION"));
        let resource = Resource::builder().with_service_name("offbd").with_attribute(version);
        let sampler = Sampler::ParentBased(Box::new(Sampler::TraceIdRatioBased(config.share)));
        let provider = SdkTracerProvider::builder()
            .with_batch_exporter(exporter)
            .with_resource(resource.build())
            .with_sampler(sampler)
            .build();
        Ok(Some(Self { provider }))
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
