//! What every handler can reach.

use super::metrics;
use super::oidc::{Oidc, OidcError};
use super::rates::Rates;
use super::series::RecentSeries;
use super::upload::resumable::Transfers;
use crate::config::Config;
use crate::queue::Queue;
use crate::recording::decode::Limits;
use crate::storage::Store;
use crate::storage::audit::AuditTrail;
use metrics_exporter_prometheus::{BuildError, PrometheusHandle};
use std::sync::Arc;
use tokio::sync::Semaphore;
use tokio_util::sync::CancellationToken;

/// JSON recordings that are held in memory at the same time. With the limit of each in the configuration this bounds
/// the memory of uploads; the rest wait at their connection.
const JSON_UPLOADS_AT_ONCE: usize = 4;

/// Why a service has no state.
#[derive(Debug, thiserror::Error)]
pub enum StateError {
    /// There is another metrics recorder.
    #[error("the metrics cannot be recorded: {0}")]
    Metrics(#[from] BuildError),
    /// The settings of the identity provider do not fit.
    #[error(transparent)]
    Oidc(#[from] OidcError),
}

/// Shared by all requests; a clone is cheap.
#[derive(Debug, Clone)]
pub struct AppState {
    /// Rows and blobs.
    pub store: Store,
    /// Jobs.
    pub queue: Queue,
    /// The way into the audit log.
    pub audit: AuditTrail,
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
    /// How many requests of whom are served.
    pub rates: Rates,
    /// Whose tokens are taken besides keys; none when nobody's are.
    pub oidc: Option<Arc<Oidc>>,
    /// The numbers for the operator.
    pub metrics: PrometheusHandle,
    /// Fires when the service shuts down, so that endless answers end.
    pub shutdown: CancellationToken,
}

impl AppState {
    /// The state of one service. Inside a runtime: the audit log is written by a task.
    ///
    /// # Errors
    /// When the process has another metrics recorder already, or the identity provider's settings do not fit.
    pub fn new(queue: Queue, config: Config, limits: Limits) -> Result<Self, StateError> {
        let transfers = Transfers::new(&config);
        Ok(Self {
            oidc: Oidc::of(&config.oidc)?.map(Arc::new),
            store: queue.store().clone(),
            audit: AuditTrail::start(queue.store().clone()),
            queue,
            rates: Rates::new(&config),
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
