//! Traces for OpenTelemetry: each request with what was done for it, sent to a
//! collector by OTLP over HTTP. Nothing of it runs without an endpoint.
//!
//! Spans wait in memory, 2048 at most, and are sent by a thread of their own;
//! while the collector is away, those beyond are dropped: nothing waits for it.

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

/// What sends traces.
pub struct Traces {
    provider: SdkTracerProvider,
}

impl Traces {
    /// Begins to send them, if there is an endpoint. Outside a runtime: its
    /// sender brings its own.
    ///
    /// # Errors
    /// If the endpoint cannot be.
    pub fn start(config: &TracesConfig) -> Result<Option<Self>> {
        let Some(endpoint) = &config.endpoint else { return Ok(None) };
        let endpoint = format!("{}/v1/traces", endpoint.trim_end_matches('/'));
        let exporter = SpanExporter::builder().with_http().with_endpoint(endpoint).build();
        let exporter = exporter.context("`traces.endpoint`: cannot be used")?;
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

    /// What takes the service's own spans, however much is logged.
    #[must_use]
    pub fn layer<S>(&self) -> impl Layer<S> + use<S>
    where
        S: Subscriber + for<'span> LookupSpan<'span>,
    {
        let own = Targets::new().with_target("offbd", LevelFilter::DEBUG);
        let tracer = self.provider.tracer("offbd");
        tracing_opentelemetry::layer().with_tracer(tracer).with_filter(own)
    }

    /// Sends what waits.
    pub fn stop(&self) {
        if let Err(error) = self.provider.shutdown() {
            tracing::warn!(%error, "the last traces were not sent");
        }
    }
}
