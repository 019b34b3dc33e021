//! `surefoot worker`: the workers alone, beside the service or on another machine.

use super::place::Place;
use super::serve::{self, ended};
use crate::api::metrics;
use crate::worker;
use anyhow::{Context, bail};
use axum::Router;
use axum::routing::get;
use std::net::SocketAddr;
use std::time::Duration;
use tokio::net::TcpListener;
use tokio::task::JoinSet;
use tokio_util::sync::CancellationToken;

/// Time for jobs to go back to the queue after a signal.
const GRACE: Duration = Duration::from_secs(20);

/// Run workers without the API
///
/// Takes jobs from the queue that the configuration names and assesses them. On one machine it shares the data directory with
/// `surefoot serve --workers 0`; on many, rows are in PostgreSQL (`database_url`), recordings in a bucket (`blob_url`), and
/// news of jobs come over NATS (`nats_url`). Any number may run, of this version or the one before. Ctrl-C ends it in an
/// orderly way: what it holds goes back to the queue.
#[derive(Debug, Clone, Default, clap::Args)]
pub struct Args {
    #[command(flatten)]
    place: Place,
    /// Jobs that run at the same time.
    #[arg(long, value_name = "N")]
    pub workers: Option<usize>,
    /// Serve `/health/live` and `/metrics` at this address.
    #[arg(long, value_name = "ADDRESS:PORT")]
    pub metrics_listen: Option<SocketAddr>,
}

/// Works until the process is told to end.
///
/// # Errors
/// When the queue cannot be reached, or the address is taken.
pub async fn run(args: &Args) -> anyhow::Result<()> {
    let mut config = args.place.configuration()?;
    config.workers = args.workers.unwrap_or(config.workers).max(1);
    let stop = CancellationToken::new();
    let store = serve::open_store(&config).await?;
    let queue = serve::open_queue(&store, &config, &stop).await?;
    let recorder = metrics::recorder()?;
    if let Some(address) = args.metrics_listen {
        let listener = TcpListener::bind(address).await.with_context(|| format!("cannot listen on {address}"))?;
        println!("Metrics: http://{}/metrics", listener.local_addr()?);
        let router = Router::new()
            .route("/health/live", get(async || "ok"))
            .route("/metrics", get(async move || recorder.render()));
        tokio::spawn(
            axum::serve(listener, router).with_graceful_shutdown(stop.clone().cancelled_owned()).into_future(),
        );
    }
    let limits = serve::recording_limits(&config);
    let mut workers = worker::spawn(&queue, config.workers, &limits, config.canary, &stop);
    println!("workers: {}", config.workers);
    tokio::select! {
        ended = ended() => ended?,
        () = at_rest(&mut workers) => bail!("no worker takes jobs; the log says why"),
    }
    tracing::info!("ending: jobs go back to the queue");
    stop.cancel();
    if tokio::time::timeout(GRACE, at_rest(&mut workers)).await.is_err() {
        tracing::warn!("some jobs did not stop in time; their lease expires and they run again");
        workers.abort_all();
    }
    store.close().await;
    Ok(())
}

async fn at_rest(workers: &mut JoinSet<()>) {
    while workers.join_next().await.is_some() {}
}
