//! Traces over OTLP (HTTP, protobuf): one span a request, one a job.

use opentelemetry::trace::TracerProvider;
use opentelemetry_otlp::SpanExporter;
use opentelemetry_sdk::Resource;
use opentelemetry_sdk::trace::{SdkTracer, SdkTracerProvider};
use tracing::Subscriber;
use tracing_opentelemetry::OpenTelemetryLayer;
use tracing_subscriber::Layer;
use tracing_subscriber::filter::{Filtered, LevelFilter};
use tracing_subscriber::registry::LookupSpan;

/// Where traces go, as OpenTelemetry names it; without it there are none.
const ENDPOINT: &str = "OTEL_EXPORTER_OTLP_ENDPOINT";

/// Sends what waits when it is dropped.
#[derive(Debug)]
pub(super) struct Traces(SdkTracerProvider);

impl Drop for Traces {
    fn drop(&mut self) {
        if let Err(error) = self.0.shutdown() {
            eprintln!("surefoot: the last traces were not sent: {error}");
        }
    }
}

type Traced<S> = Filtered<OpenTelemetryLayer<S, SdkTracer>, LevelFilter, S>;

/// The layer that sends spans; none when the environment names no endpoint, or one that cannot be used.
pub(super) fn start<S: Subscriber + for<'s> LookupSpan<'s>>() -> Option<(Traced<S>, Traces)> {
    std::env::var_os(ENDPOINT)?;
    let exporter = match SpanExporter::builder().with_http().build() {
        Ok(exporter) => exporter,
        Err(error) => {
            eprintln!("surefoot: no traces: {error}");
            return None;
        }
    };
    let resource = Resource::builder().with_service_name("surefoot").build();
    let provider = SdkTracerProvider::builder().with_batch_exporter(exporter).with_resource(resource).build();
    let layer = tracing_opentelemetry::layer().with_tracer(provider.tracer("surefoot"));
    Some((layer.with_filter(LevelFilter::INFO), Traces(provider)))
}
