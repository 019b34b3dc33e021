//! What every handler can reach.

use super::metrics;
use super::series::RecentSeries;
use super::upload::resumable::Transfers;
use crate::config::Config;
use crate::queue::Queue;
use crate::recording::decode::Limits;
use crate::storage::Store;
use metrics_exporter_prometheus::{BuildError, PrometheusHandle};
use std::sync::Arc;
use tokio::sync::Semaphore;
use tokio_util::sync::CancellationToken;

/// JSON recordings that are held in memory at the same time. With the limit of each in the configuration this bounds
/// the memory of uploads; the rest wait at their connection.
const JSON_UPLOADS_AT_ONCE: usize = 4;

/// Shared by all requests; a clone is cheap.
#[derive(Debug, Clone)]
pub struct AppState {
    /// Rows and blobs.
    pub store: Store,
    /// Jobs.
    pub queue: Queue,
    /// What the operator set.
    pub config: Arc<Config>,
    /// How much of a recording is accepted.
    pub limits: Limits,
    /// One permit for each JSON recording in memory.
    pub json_uploads: Arc<Semaphore>,
    /// Resumable uploads under way.
    pub transfers: Transfers,
    /// Series that were read a moment ago.
    pub recent_series: RecentSeries,
    /// The numbers for the operator.
    pub metrics: PrometheusHandle,
    /// Fires when the service shuts down, so that endless answers end.
    pub shutdown: CancellationToken,
}

impl AppState {
    /// The state of one service.
    ///
    /// # Errors
    /// When the process has another metrics recorder already.
    pub fn new(queue: Queue, config: Config, limits: Limits) -> Result<Self, BuildError> {
        let transfers = Transfers::new(&config);
        Ok(Self {
            store: queue.store().clone(),
            queue,
            config: Arc::new(config),
            limits,
            json_uploads: Arc::new(Semaphore::new(JSON_UPLOADS_AT_ONCE)),
            transfers,
            recent_series: RecentSeries::default(),
            metrics: metrics::recorder()?,
            shutdown: CancellationToken::new(),
        })
    }
}
