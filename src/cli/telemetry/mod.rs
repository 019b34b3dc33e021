//! The log: for people as lines of text, for machines as lines of JSON; and traces over OTLP where the build has them.
//!
//! A line names request and job, never what a recording or a patient says.

#[cfg(feature = "otel")]
mod otlp;

use tracing_subscriber::layer::SubscriberExt;
use tracing_subscriber::util::SubscriberInitExt;
use tracing_subscriber::{EnvFilter, Layer};

/// What is logged, as `tracing` filters are written: `info`, `surefoot=debug,warn`.
const FILTER: &str = "SUREFOOT_LOG";
/// `json` for one object a line.
const FORMAT: &str = "SUREFOOT_LOG_FORMAT";

/// Keeps the log and the traces going; what waits to be sent is sent when it is dropped.
#[derive(Debug)]
pub struct Telemetry {
    #[cfg(feature = "otel")]
    _traces: Option<otlp::Traces>,
}

/// Starts the log on the standard error output.
pub fn start() -> Telemetry {
    let filter = EnvFilter::try_from_env(FILTER).unwrap_or_else(|_| EnvFilter::new("info"));
    let lines = tracing_subscriber::fmt::layer().with_writer(std::io::stderr);
    let lines = match std::env::var(FORMAT).is_ok_and(|format| format == "json") {
        true => lines.json().flatten_event(true).boxed(),
        false => lines.boxed(),
    };
    let log = tracing_subscriber::registry().with(lines.with_filter(filter));
    #[cfg(feature = "otel")]
    {
        let (layer, traces) = otlp::start().unzip();
        log.with(layer).init();
        Telemetry { _traces: traces }
    }
    #[cfg(not(feature = "otel"))]
    {
        log.init();
        Telemetry {}
    }
}
