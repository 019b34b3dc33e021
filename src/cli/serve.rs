//! `surefoot serve`: the service on one machine.

use super::housekeeping;
use super::place::Place;
use crate::api::AppState;
use crate::api::upload::resumable;
use crate::config::Config;
use crate::pages;
use crate::queue::{Messenger, Queue, QueueSettings};
use crate::recording::decode::Limits;
use crate::storage::audit::AuditTrail;
use crate::storage::retention::RetentionRules;
use crate::storage::{Places, Store, SystemClock};
use crate::worker;
use anyhow::Context;
use std::collections::HashMap;
use std::net::SocketAddr;
use std::path::Path;
use std::sync::Arc;
use std::time::Duration;
use tokio::net::TcpListener;
use tokio::task::{JoinHandle, JoinSet};
use tokio_util::sync::CancellationToken;

/// Read when it exists and no other file is named.
const DEFAULT_FILE: &str = "surefoot.toml";
/// Time for requests under way to end after a signal.
const GRACE: Duration = Duration::from_secs(20);
/// How often the recorder of metrics folds its samples; without it they would pile up until somebody scrapes.
const METRICS_UPKEEP: Duration = Duration::from_secs(5);

/// Run the service
///
/// Serves the REST API and runs the workers in one process, on one data directory (SQLite and a folder of blobs).
/// Settings come from, later ones winning: defaults, the configuration file, environment variables `SUREFOOT_…` (for
/// example SUREFOOT_DATA_DIR), flags. The first start with an empty database prints an admin key, once. Ctrl-C ends it
/// in an orderly way; jobs that run are taken up again by the next start.
#[derive(Debug, Clone, Default, clap::Args)]
pub struct Args {
    #[command(flatten)]
    place: Place,
    /// Address to listen on; port 0 chooses a free one.
    #[arg(long, value_name = "ADDRESS:PORT")]
    pub listen: Option<SocketAddr>,
    /// Jobs that run at the same time; 0 serves the API only and leaves jobs to another process.
    #[arg(long, value_name = "N")]
    pub workers: Option<usize>,
    /// Largest accepted recording, bytes.
    #[arg(long, value_name = "BYTES")]
    pub max_recording_bytes: Option<u64>,
    /// Print one line of JSON with the address and, on the first start, the admin key; for programs.
    #[arg(long)]
    pub json: bool,
}

impl Args {
    /// The configuration of all sources, the flags last.
    ///
    /// # Errors
    /// When a source cannot be read or holds a value that does not fit.
    pub fn config(&self) -> anyhow::Result<Config> {
        let mut config = self.place.configuration()?;
        config.listen = self.listen.unwrap_or(config.listen);
        config.workers = self.workers.unwrap_or(config.workers);
        config.max_recording_bytes = self.max_recording_bytes.unwrap_or(config.max_recording_bytes);
        Ok(config)
    }
}

/// The configuration of file and environment.
///
/// # Errors
/// When a source cannot be read or holds a value that does not fit.
pub fn load_config(file: Option<&Path>) -> anyhow::Result<Config> {
    config_of_sources(file, std::env::vars().collect())
}

fn config_of_sources(file: Option<&Path>, environment: HashMap<String, String>) -> anyhow::Result<Config> {
    let defaults = config::Config::try_from(&Config::default())?;
    // Other programs of this project read variables with the same prefix; only names of settings are taken.
    let mut names = Vec::new();
    names_of_settings("SUREFOOT_", &serde_json::to_value(Config::default())?, &mut names);
    let known = environment.into_iter().filter(|(name, _)| names.contains(&name.to_uppercase())).collect();
    let file = match file {
        Some(path) => config::File::from(path).format(config::FileFormat::Toml).required(true),
        None => config::File::from(Path::new(DEFAULT_FILE)).format(config::FileFormat::Toml).required(false),
    };
    config::Config::builder()
        .add_source(defaults)
        .add_source(file)
        .add_source(
            config::Environment::with_prefix("SUREFOOT")
                .prefix_separator("_")
                .separator("__")
                .try_parsing(true)
                .list_separator(",")
                .with_list_parse_key("trusted_proxies")
                .with_list_parse_key("oidc.algorithms")
                .source(Some(known)),
        )
        .build()
        .and_then(config::Config::try_deserialize)
        .context("the configuration cannot be used")
}

/// Variables of all settings; those within a section have two underscores between section and name.
fn names_of_settings(before: &str, settings: &serde_json::Value, names: &mut Vec<String>) {
    for (name, value) in settings.as_object().into_iter().flatten() {
        let name = format!("{before}{}", name.to_uppercase());
        if value.is_object() {
            names_of_settings(&format!("{name}__"), value, names);
        } else {
            names.push(name);
        }
    }
}

/// A service that runs in this process.
#[derive(Debug)]
pub struct Running {
    /// Where it listens.
    pub addr: SocketAddr,
    /// The first admin key, when this start made one. It cannot be shown again.
    pub admin_key: Option<String>,
    store: Store,
    audit: AuditTrail,
    stop: CancellationToken,
    server: JoinHandle<std::io::Result<()>>,
    workers: JoinSet<()>,
}

impl Running {
    /// Ends it: no new requests, those under way are answered, jobs under way go back to the queue.
    ///
    /// # Errors
    /// When the server had failed before.
    pub async fn stop(mut self) -> anyhow::Result<()> {
        self.stop.cancel();
        let mut server = self.server;
        let served = match tokio::time::timeout(GRACE, &mut server).await {
            Ok(served) => served.context("the server panicked")?.context("the server failed"),
            Err(_) => {
                tracing::warn!("some requests did not end in time and were cut off");
                server.abort();
                Ok(())
            }
        };
        let at_rest = async { while self.workers.join_next().await.is_some() {} };
        if tokio::time::timeout(GRACE, at_rest).await.is_err() {
            tracing::warn!("some jobs did not stop in time; their lease expires and they run again");
            self.workers.abort_all();
        }
        if !self.audit.flush().await {
            tracing::error!("the last entries of the audit log could not be written");
        }
        self.store.close().await;
        served
    }
}

/// Opens the data directory, starts workers and server, and returns once requests are accepted.
///
/// # Errors
/// When the data directory cannot be used or the address is taken.
pub async fn start(config: Config) -> anyhow::Result<Running> {
    if !config.require_consent {
        tracing::warn!(
            "REQUIRE_CONSENT IS OFF: recordings are stored and assessed without any patient's consent. This is for a test stand \
             without people; with people, remove `require_consent = false`"
        );
    }
    let store = open_store(&config).await?;
    let admin_key = store.ensure_first_admin().await?.map(|key| key.reveal().to_owned());
    let stop = CancellationToken::new();
    let queue = open_queue(&store, &config, &stop).await?;
    let listener =
        TcpListener::bind(config.listen).await.with_context(|| format!("cannot listen on {}", config.listen))?;
    let addr = listener.local_addr()?;
    let limits = recording_limits(&config);
    let (n_workers, has_canary) = (config.workers, config.canary);
    let rules = RetentionRules::from(&config);
    let state = AppState { shutdown: stop.clone(), ..AppState::new(queue.clone(), config, limits.clone())? };
    let audit = state.audit.clone();

    let mut workers = worker::spawn(&queue, n_workers, &limits, has_canary, &stop);
    let (metrics, rates) = (state.metrics.clone(), state.rates.clone());
    let upkeep = stop.clone();
    workers.spawn(async move {
        let mut ticks = tokio::time::interval(METRICS_UPKEEP);
        while upkeep.run_until_cancelled(ticks.tick()).await.is_some() {
            metrics.run_upkeep();
            rates.tidy();
        }
    });
    workers.spawn(housekeeping::run(state.store.clone(), rules, stop.clone()));
    let uploads = state.clone();
    workers.spawn(async move { resumable::keep_in_order(&uploads).await });
    let router = pages::router(state).into_make_service_with_connect_info::<SocketAddr>();
    let serving = axum::serve(listener, router).with_graceful_shutdown(stop.clone().cancelled_owned());
    let server = tokio::spawn(serving.into_future());
    Ok(Running { addr, admin_key, store, audit, stop, server, workers })
}

/// Opens the store that the configuration names.
///
/// # Errors
/// When a place cannot be reached or used.
pub async fn open_store(config: &Config) -> anyhow::Result<Store> {
    let opened = Store::open_at(&Places::from(config), Arc::new(SystemClock)).await;
    opened.with_context(|| match &config.database_url {
        // Without the address: it may hold a password.
        Some(_) => "cannot open the database or the blobs".to_owned(),
        None => format!("cannot open the data directory {}", config.data_dir.display()),
    })
}

/// The queue of a store, with the messenger that the configuration names.
///
/// # Errors
/// When the messenger cannot be used.
pub async fn open_queue(store: &Store, config: &Config, stop: &CancellationToken) -> anyhow::Result<Queue> {
    let queue = Queue::new(store.clone(), QueueSettings::from(config));
    let Some(url) = &config.nats_url else { return Ok(queue) };
    let messenger = Messenger::connect(url, &config.nats_subject).await.map_err(anyhow::Error::msg)?;
    Ok(queue.with_messenger(messenger, stop))
}

/// How much of a recording is accepted.
pub fn recording_limits(config: &Config) -> Limits {
    let max_json_bytes = usize::try_from(config.max_json_recording_bytes).unwrap_or(usize::MAX);
    Limits { max_json_bytes, ..Limits::default() }
}

/// Runs the service until it is told to end.
///
/// # Errors
/// When it cannot start, or fails while it runs.
pub async fn run(args: &Args) -> anyhow::Result<()> {
    let running = start(args.config()?).await?;
    announce(&running, args.json);
    until_told_to_end(running).await
}

/// Serves until the process is told to end, then ends in order.
///
/// # Errors
/// When the server had failed before.
pub async fn until_told_to_end(running: Running) -> anyhow::Result<()> {
    ended().await?;
    tracing::info!("ending: requests under way are answered, jobs go back to the queue");
    running.stop().await
}

fn announce(running: &Running, json: bool) {
    let address = format!("http://{}", running.addr);
    if json {
        println!("{}", serde_json::json!({"address": address, "admin_key": running.admin_key}));
        return;
    }
    println!("Surefoot listens on {address}");
    println!("Clinician's pages:  {address}/app");
    println!("API documentation:  {address}/docs");
    if let Some(key) = &running.admin_key {
        println!();
        println!("Admin key, shown this once: {key}");
    }
}

/// Waits for the signal to end.
pub(super) async fn ended() -> anyhow::Result<()> {
    #[cfg(unix)]
    {
        use tokio::signal::unix::{SignalKind, signal};
        let mut terminate = signal(SignalKind::terminate())?;
        tokio::select! {
            interrupted = tokio::signal::ctrl_c() => interrupted?,
            _ = terminate.recv() => {}
        }
    }
    #[cfg(not(unix))]
    tokio::signal::ctrl_c().await?;
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn environment(pairs: &[(&str, &str)]) -> HashMap<String, String> {
        pairs.iter().map(|(name, value)| ((*name).to_owned(), (*value).to_owned())).collect()
    }

    #[test]
    fn without_any_source_the_defaults_hold() {
        assert_eq!(config_of_sources(None, HashMap::new()).unwrap(), Config::default());
    }

    #[test]
    fn the_environment_wins_over_the_file_and_foreign_variables_are_left_alone() {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("any.toml");
        std::fs::write(&file, "workers = 7\nlisten = \"0.0.0.0:9000\"\n").unwrap();
        let set = environment(&[
            ("SUREFOOT_WORKERS", "3"),
            ("SUREFOOT_TRUSTED_PROXIES", "127.0.0.1,10.0.0.0/8"),
            ("SUREFOOT_OIDC__ISSUER", "https://id.example"),
            ("SUREFOOT_OIDC__ALGORITHMS", "ES256"),
            ("SUREFOOT_DATA", "/elsewhere"),
            ("PATH", "/bin"),
        ]);
        let config = config_of_sources(Some(&file), set).unwrap();
        assert!(config.trusted_proxies[1].contains([10, 2, 3, 4].into()) && config.trusted_proxies.len() == 2);
        assert_eq!((config.workers, config.listen.port()), (3, 9000));
        assert_eq!(config.data_dir, Config::default().data_dir);
        assert_eq!(config.oidc.issuer, "https://id.example");
        assert_eq!(config.oidc.algorithms, [crate::config::OidcAlgorithm::Es256]);
    }

    #[test]
    fn an_algorithm_with_a_shared_secret_cannot_be_configured() {
        for algorithm in ["HS256", "none", "RS512"] {
            let set = environment(&[("SUREFOOT_OIDC__ALGORITHMS", algorithm)]);
            assert!(config_of_sources(None, set).is_err(), "{algorithm}");
        }
    }

    #[test]
    fn a_misspelt_setting_in_the_file_is_refused_by_name() {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("any.toml");
        std::fs::write(&file, "wrokers = 7\n").unwrap();
        let error = format!("{:#}", config_of_sources(Some(&file), HashMap::new()).unwrap_err());
        assert!(error.contains("wrokers"), "{error}");
    }
}
