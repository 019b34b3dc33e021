//! The worker: claim a job, load its recording, assess, save; or load several, train a noise model, save.
//!
//! The computation runs on a blocking thread, so a panic in it is a failed job and not a lost worker. Meanwhile the
//! async side renews the lease, writes the progress, and passes on the request to stop: from a client, from the
//! operator who shuts the process down, or because the job has become somebody else's.

mod assessing;
pub mod canary;

pub use assessing::{AttemptError, assess_recording};

use assessing::{TrainingRecordings, train_noise_model};

use crate::assessment::noise_model::find_shipped;
use crate::assessment::{Assessment, CalibrationChoice, JointAngleSettings, NoiseModel, NoiseModelSettings, Settings};
use crate::pipeline::{Inputs, PatientCalibration, PipelineError};
use crate::progress::{Monitor, Step};
use crate::protocol;
use crate::queue::{Delivery, Failure, Finish, Job, JobError, Queue, Renewal, Trained};
use crate::recording::decode::Limits;
use crate::storage::{BlobReader, JobId, RecordingId, StorageError, StoredRecording};
use std::fmt;
use std::pin::pin;
use std::sync::Arc;
use std::time::Duration;
use tokio::sync::OnceCell;
use tokio::task::{JoinHandle, JoinSet, spawn_blocking};
use tokio::time::MissedTickBehavior;
use tokio_util::sync::CancellationToken;
use tracing::Instrument;

/// How often progress is written and the request to stop is seen.
const HEARTBEAT: Duration = Duration::from_millis(250);
/// How often an idle worker looks without being woken: for the end of back-offs and expired leases, and for jobs that
/// another process has stored.
const POLL: Duration = Duration::from_secs(1);

/// Metric: time from the request for a job to the beginning of an attempt, seconds.
const JOB_WAIT: &str = "surefoot_job_wait_seconds";

/// Metric: attempts that ended, by pipeline and whether there was a result.
const ATTEMPTS: &str = "surefoot_job_attempts_total";
/// Metric: time of each step of an attempt, seconds, by pipeline.
const STEP: &str = "surefoot_job_step_seconds";
/// Metric: 1 when this process got a canary wrong and takes no jobs.
const CANARY_FAILED: &str = "surefoot_canary_failed";

/// The computation of one assessment, on a blocking thread.
pub type Assess = dyn Fn(BlobReader, &StoredRecording, &Settings, &Inputs, &Monitor) -> Result<Assessment, AttemptError>
    + Send
    + Sync;

/// What an attempt came to.
enum Outcome {
    Assessment(Box<Assessment>),
    NoiseModel(Box<NoiseModel>),
}

/// What one look at the queue came to.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Ran {
    /// One attempt of this job was run, whatever its outcome.
    Job(JobId),
    /// No job was due.
    QueueEmpty,
}

/// One worker: runs one job at a time.
#[derive(Clone)]
pub struct Worker {
    queue: Queue,
    name: String,
    assess: Arc<Assess>,
    limits: Limits,
    heartbeat: Duration,
    shutdown: CancellationToken,
}

impl fmt::Debug for Worker {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Worker").field("name", &self.name).finish_non_exhaustive()
    }
}

/// Starts `count` workers. Each ends after `shutdown`; a job that is under way then goes back to the queue. With `has_canary` they
/// first see whether this build gets recordings right whose truth is known, and end when it does not.
pub fn spawn(
    queue: &Queue,
    count: usize,
    limits: &Limits,
    has_canary: bool,
    shutdown: &CancellationToken,
) -> JoinSet<()> {
    let is_fit = Arc::new(OnceCell::new());
    let mut workers = JoinSet::new();
    for number in 1..=count {
        let name = format!("{}-{number}", std::process::id());
        let worker = Worker::new(queue.clone(), name, limits.clone(), shutdown.clone());
        let is_fit = is_fit.clone();
        workers.spawn(async move {
            if !has_canary || *is_fit.get_or_init(passes_canaries).await {
                worker.run().await;
            }
        });
    }
    workers
}

async fn passes_canaries() -> bool {
    let sung = spawn_blocking(canary::sing).await.unwrap_or_else(|panic| Err(format!("a canary panicked: {panic}")));
    metrics::gauge!(CANARY_FAILED).set(f64::from(u8::from(sung.is_err())));
    match sung {
        Ok(()) => true,
        Err(why) => {
            tracing::error!(why, "this process gets a recording wrong whose truth is known; it takes no jobs");
            false
        }
    }
}

impl Worker {
    /// A worker that decodes recordings and runs the pipelines.
    pub fn new(queue: Queue, name: impl Into<String>, limits: Limits, shutdown: CancellationToken) -> Self {
        let heartbeat = HEARTBEAT.min(queue.settings().lease.unsigned_abs() / 4);
        let for_assessments = limits.clone();
        let assess = Arc::new(
            move |reader: BlobReader,
                  recording: &StoredRecording,
                  settings: &Settings,
                  inputs: &Inputs,
                  monitor: &Monitor| {
                assess_recording(reader, recording, settings, inputs, &for_assessments, monitor)
            },
        );
        Self { queue, name: name.into(), assess, limits, heartbeat, shutdown }
    }

    /// The same worker with another computation.
    #[must_use]
    pub fn with_assess(mut self, assess: Arc<Assess>) -> Self {
        self.assess = assess;
        self
    }

    /// The same worker with another time between heartbeats.
    #[must_use]
    pub fn with_heartbeat(mut self, heartbeat: Duration) -> Self {
        self.heartbeat = heartbeat;
        self
    }

    /// Runs jobs until the shutdown.
    pub async fn run(&self) {
        let mut deliveries = self.queue.deliveries();
        let mut delivery = None;
        while !self.shutdown.is_cancelled() {
            // Registered before the look: a job that comes in between wakes this worker at once.
            let mut woken = pin!(self.queue.woken());
            woken.as_mut().enable();
            let ran = self.run_next().await;
            if let Some(delivery) = delivery.take() {
                Delivery::done(delivery).await;
            }
            match ran {
                Ok(Ran::Job(_)) => continue,
                Ok(Ran::QueueEmpty) => {}
                Err(error) => tracing::error!(worker = %self.name, %error, "the queue could not be asked for a job"),
            }
            tokio::select! {
                () = woken => {}
                news = deliveries.next() => delivery = Some(news),
                () = tokio::time::sleep(POLL) => {}
                () = self.shutdown.cancelled() => {}
            }
        }
    }

    /// Claims one job and runs one attempt of it to its end.
    ///
    /// # Errors
    /// When the database fails; a claimed job runs again then, after its lease.
    pub async fn run_next(&self) -> Result<Ran, StorageError> {
        let Some(job) = self.queue.claim(&self.name).await? else { return Ok(Ran::QueueEmpty) };
        if let Some(started_at) = job.started_at {
            metrics::histogram!(JOB_WAIT).record((started_at - job.queued_at).as_seconds_f64());
        }
        let pipeline = job.settings.pipeline();
        let span = tracing::info_span!("job", job = %job.id, attempt = job.attempt, pipeline);
        self.run_claimed(&job, pipeline).instrument(span).await?;
        Ok(Ran::Job(job.id))
    }

    async fn run_claimed(&self, job: &Job, pipeline: &'static str) -> Result<(), StorageError> {
        let monitor = Monitor::default();
        let outcome = self.attempt(job, &monitor).await;
        let result = if outcome.is_ok() { "result" } else { "none" };
        match outcome {
            Ok(outcome) => self.save(job, outcome, &monitor).await?,
            Err(error) => self.give_up(job, error).await?,
        }
        // The end of the last step.
        let _ = monitor.begin(Step::Saving, 1);
        metrics::counter!(ATTEMPTS, "pipeline" => pipeline, "outcome" => result).increment(1);
        for (step, seconds) in monitor.durations() {
            metrics::histogram!(STEP, "pipeline" => pipeline, "step" => step.name()).record(seconds);
        }
        Ok(())
    }

    async fn attempt(&self, job: &Job, monitor: &Monitor) -> Result<Outcome, AttemptError> {
        match &job.settings {
            Settings::JointAngles(settings) => {
                let inputs = self.inputs(job, settings).await?;
                let assessment = self.assessment(job, inputs, monitor).await?;
                Ok(Outcome::Assessment(Box::new(assessment)))
            }
            Settings::SkeletonFusion(_) | Settings::LegPose(_) => {
                let assessment = self.assessment(job, Inputs::default(), monitor).await?;
                Ok(Outcome::Assessment(Box::new(assessment)))
            }
            Settings::NoiseModel(settings) => {
                let model = self.noise_model(job, settings, monitor).await?;
                Ok(Outcome::NoiseModel(Box::new(model)))
            }
        }
    }

    async fn assessment(&self, job: &Job, inputs: Inputs, monitor: &Monitor) -> Result<Assessment, AttemptError> {
        let (reader, recording) = self.open(job.recording_id).await?;
        let declared = self.queue.store().declared_protocols(job.recording_id).await?;
        // A name of the catalogue counts before one that only the recording's maker knows.
        let is_known = |name: &&String| protocol::find(name).is_some();
        let named = || declared.iter().flatten();
        let declared = named().find(is_known).or_else(|| named().next()).cloned();
        let (assess, settings, view) = (self.assess.clone(), job.settings.clone(), monitor.clone());
        let sha256 = recording.blob.sha256.clone();
        let computing = spawn_blocking(move || {
            let assessment = assess(reader, &recording, &settings, &inputs, &view)?;
            let performance = protocol::perform(declared.as_deref(), &assessment);
            Ok(Assessment { performance: Some(performance), ..assessment })
        });
        let mut assessment = self.watch(job, monitor, computing).await?;
        assessment.provenance.recording_sha256 = sha256;
        Ok(assessment)
    }

    async fn noise_model(
        &self,
        job: &Job,
        settings: &NoiseModelSettings,
        monitor: &Monitor,
    ) -> Result<NoiseModel, AttemptError> {
        let mut recordings = TrainingRecordings::default();
        for id in &settings.static_recordings {
            recordings.still.push(self.open(RecordingId(*id)).await?);
        }
        for id in &settings.movement_recordings {
            recordings.movement.push(self.open(RecordingId(*id)).await?);
        }
        let (settings, limits, view) = (settings.clone(), self.limits.clone(), monitor.clone());
        let computing = spawn_blocking(move || train_noise_model(recordings, &settings, &limits, &view));
        self.watch(job, monitor, computing).await
    }

    async fn open(&self, id: RecordingId) -> Result<(BlobReader, StoredRecording), AttemptError> {
        let recording = self.queue.store().recording_to_assess(id).await?;
        let reader = self.queue.store().blobs().reader(&recording.blob).await?;
        Ok((reader, recording))
    }

    /// What the settings name: a noise model that does not come with the software, the patient's calibration.
    async fn inputs(&self, job: &Job, settings: &JointAngleSettings) -> Result<Inputs, AttemptError> {
        Ok(Inputs {
            noise_model: self.named_noise_model(job, settings).await?,
            patient_calibration: match settings.calibration {
                CalibrationChoice::Recording => None,
                CalibrationChoice::Patient => self.patient_calibration(job).await?,
            },
        })
    }

    async fn named_noise_model(
        &self,
        job: &Job,
        settings: &JointAngleSettings,
    ) -> Result<Option<NoiseModel>, AttemptError> {
        let unusable = |error: &dyn fmt::Display| PipelineError::unsuitable("unusable_noise_model", error.to_string());
        let name = settings.chosen_noise_model().map_err(|error| unusable(&error))?;
        let Some(name) = name.filter(|name| !name.is_adaptive() && find_shipped(name).is_none()) else {
            return Ok(None);
        };
        match self.queue.store().noise_model_of_job(job.id, &name).await {
            Ok(model) => Ok(Some(model)),
            // The pipeline says which model is missing.
            Err(StorageError::NotFound { .. }) => Ok(None),
            Err(error) => Err(error.into()),
        }
    }

    async fn patient_calibration(&self, job: &Job) -> Result<Option<PatientCalibration>, AttemptError> {
        let found = self.queue.store().patient_calibration_of_job(job.id).await?;
        Ok(found.map(|(id, quality)| PatientCalibration { assessment_id: id.into(), quality }))
    }

    /// Waits for the computation, renews the lease, and passes on the request to stop.
    async fn watch<T>(
        &self,
        job: &Job,
        monitor: &Monitor,
        mut computing: JoinHandle<Result<T, AttemptError>>,
    ) -> Result<T, AttemptError> {
        let mut heartbeat = tokio::time::interval(self.heartbeat);
        heartbeat.set_missed_tick_behavior(MissedTickBehavior::Delay);
        heartbeat.reset();
        loop {
            tokio::select! {
                result = &mut computing => return result.unwrap_or_else(|panic| {
                    tracing::error!(job = %job.id, attempt = job.attempt, %panic, "the computation panicked");
                    Err(AttemptError::panicked())
                }),
                _ = heartbeat.tick() => match self.queue.renew(job.id, job.attempt, monitor.progress()).await {
                    Ok(Renewal::Held) => {}
                    Ok(Renewal::Lost | Renewal::CancelRequested) => monitor.cancel(),
                    // The lease outlives a few silent heartbeats; if it does run out, the fence keeps order.
                    Err(error) => tracing::warn!(job = %job.id, %error, "a lease could not be renewed"),
                },
                () = self.shutdown.cancelled(), if monitor.check().is_ok() => monitor.cancel(),
            }
        }
    }

    async fn save(&self, job: &Job, outcome: Outcome, monitor: &Monitor) -> Result<(), StorageError> {
        // A request to stop that comes now is too late: the result is there.
        let _ = monitor.begin(Step::Saving, 1);
        let saved = match outcome {
            Outcome::Assessment(assessment) => match self.queue.finish(job.id, job.attempt, *assessment).await {
                Ok(Finish::Saved(assessment)) => Ok(Some(assessment.0)),
                Ok(Finish::Lost) => Ok(None),
                Err(error) => Err(error),
            },
            Outcome::NoiseModel(model) => match self.queue.finish_training(job.id, job.attempt, *model).await {
                Ok(Trained::Saved(model)) => Ok(Some(model.0)),
                Ok(Trained::Lost) => Ok(None),
                Err(error) => Err(error),
            },
        };
        match saved {
            Ok(Some(result)) => {
                tracing::info!(job = %job.id, attempt = job.attempt, %result, "job done");
                Ok(())
            }
            Ok(None) => {
                tracing::warn!(job = %job.id, attempt = job.attempt, "a result came after its lease, and was left");
                Ok(())
            }
            Err(error) => self.give_up(job, error.into()).await,
        }
    }

    async fn give_up(&self, job: &Job, error: AttemptError) -> Result<(), StorageError> {
        let (id, attempt) = (job.id, job.attempt);
        let (error, retryable) = match error {
            AttemptError::Cancelled if self.shutdown.is_cancelled() => {
                tracing::info!(job = %id, attempt, "job goes back to the queue: shutting down");
                return self.queue.release(id, attempt).await;
            }
            AttemptError::Cancelled => {
                let ended = self.queue.end_cancelled(id, attempt).await?;
                tracing::info!(job = %id, attempt, ended, "job stopped on request");
                return Ok(());
            }
            AttemptError::Refused(error) => (error, false),
            AttemptError::Failed(error) => (error, true),
        };
        let outcome = self.queue.fail(id, attempt, &error, retryable).await?;
        log_failure(id, attempt, &error, outcome);
        Ok(())
    }
}

fn log_failure(id: JobId, attempt: u32, error: &JobError, outcome: Failure) {
    let JobError { code, place, sentence } = error;
    match outcome {
        Failure::WillRetry => tracing::warn!(job = %id, attempt, code, ?place, sentence, "attempt failed, will retry"),
        Failure::GivenUp => tracing::warn!(job = %id, attempt, code, ?place, sentence, "job failed"),
        Failure::Cancelled => tracing::info!(job = %id, attempt, code, "attempt failed; the job was to be stopped"),
        Failure::Lost => tracing::warn!(job = %id, attempt, code, "attempt failed after its lease"),
    }
}
