//! News over NATS: JetStream keeps the ids of waiting jobs until a worker has looked for one, plain messages tell of changes.

use crate::storage::JobId;
use async_nats::jetstream::consumer::{AckPolicy, PullConsumer, pull};
use async_nats::jetstream::stream::{self, RetentionPolicy};
use async_nats::jetstream::{self, AckKind, Message};
use async_nats::{Client, ConnectOptions};
use futures::StreamExt;
use std::sync::Arc;
use std::time::Duration;
use tokio::sync::broadcast;
use tokio::time::{sleep, timeout};
use tokio_util::sync::CancellationToken;
use tokio_util::task::AbortOnDropHandle;

/// Time after which news whose holder fell silent comes again.
const ACK_WAIT: Duration = Duration::from_secs(30);
/// How often a holder says that it is still at work.
const SIGN_OF_LIFE: Duration = Duration::from_secs(10);
/// Time for the server to answer; the table of jobs serves when it does not.
const ANSWER: Duration = Duration::from_secs(2);
/// Pause after a failure of the server.
const PAUSE: Duration = Duration::from_secs(1);
/// News older than this are of jobs that were found without them.
const OLDEST: Duration = Duration::from_secs(24 * 3600);
/// Name of the consumer that all workers share: each piece of news goes to one of them.
const CONSUMER: &str = "workers";

/// A connection to a server; it comes back by itself.
#[derive(Debug, Clone)]
pub(super) struct Nats {
    client: Client,
    subject: Arc<str>,
}

impl Nats {
    pub(super) async fn connect(url: &str, subject: &str) -> Result<Self, String> {
        let is_subject =
            !subject.is_empty() && subject.bytes().all(|b| b.is_ascii_alphanumeric() || b == b'_' || b == b'-');
        if !is_subject {
            return Err(format!("`{subject}` is no name for NATS: letters, digits, `_` and `-` alone"));
        }
        let options = ConnectOptions::new().name("surefoot").retry_on_initial_connect();
        let client = options.connect(url).await.map_err(|error| format!("cannot connect to NATS: {error}"))?;
        Ok(Self { client, subject: subject.into() })
    }

    fn waiting(&self) -> String {
        format!("{}.waiting", self.subject)
    }

    fn changed(&self) -> String {
        format!("{}.changed", self.subject)
    }

    /// The stream of waiting jobs and the consumer of the workers, made when absent.
    async fn consumer(&self) -> Result<PullConsumer, String> {
        let context = jetstream::new(self.client.clone());
        let stream = stream::Config {
            name: self.subject.to_string(),
            subjects: vec![self.waiting()],
            retention: RetentionPolicy::WorkQueue,
            max_age: OLDEST,
            ..stream::Config::default()
        };
        let stream = context.get_or_create_stream(stream).await.map_err(|error| error.to_string())?;
        let consumer = pull::Config {
            durable_name: Some(CONSUMER.to_owned()),
            ack_policy: AckPolicy::Explicit,
            ack_wait: ACK_WAIT,
            ..pull::Config::default()
        };
        stream.get_or_create_consumer(CONSUMER, consumer).await.map_err(|error| error.to_string())
    }

    pub(super) fn tell_waiting(&self, id: JobId) {
        let nats = self.clone();
        tokio::spawn(async move {
            let context = jetstream::new(nats.client.clone());
            let publish = async {
                let sent =
                    context.publish(nats.waiting(), id.to_string().into()).await.map_err(|error| error.to_string())?;
                sent.await.map_err(|error| error.to_string())
            };
            let failure = match timeout(ANSWER, publish).await {
                Ok(Ok(_)) => return,
                Ok(Err(error)) => error,
                Err(_) => "no answer in time".to_owned(),
            };
            tracing::debug!(job = %id, failure, "NATS did not take the news of a job; workers find it by themselves");
        });
    }

    pub(super) fn tell_changed(&self, id: JobId) {
        let nats = self.clone();
        // Whether anybody hears it or not: watchers also look by themselves.
        tokio::spawn(async move { nats.client.publish(nats.changed(), id.to_string().into()).await });
    }

    pub(super) fn listen(&self, changes: broadcast::Sender<JobId>, shutdown: CancellationToken) {
        let nats = self.clone();
        let listening = async move {
            loop {
                match nats.client.subscribe(nats.changed()).await {
                    Ok(mut messages) => {
                        while let Some(message) = messages.next().await {
                            let id = std::str::from_utf8(&message.payload).ok().and_then(|text| text.parse().ok());
                            if let Some(id) = id {
                                let _ = changes.send(id);
                            }
                        }
                    }
                    Err(error) => tracing::warn!(%error, "changes that other machines make cannot be heard"),
                }
                sleep(PAUSE).await;
            }
        };
        tokio::spawn(async move { shutdown.run_until_cancelled(listening).await });
    }

    pub(super) fn deliveries(&self) -> NatsDeliveries {
        NatsDeliveries { nats: self.clone(), messages: None }
    }
}

/// News as one worker pulls them.
pub(super) struct NatsDeliveries {
    nats: Nats,
    messages: Option<pull::Stream>,
}

impl std::fmt::Debug for NatsDeliveries {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("NatsDeliveries").field("nats", &self.nats).finish_non_exhaustive()
    }
}

impl NatsDeliveries {
    /// The next piece of news. It may be dropped while it waits; nothing is lost.
    pub(super) async fn next(&mut self) -> Held {
        loop {
            let failure = match &mut self.messages {
                None => match self.open().await {
                    Ok(messages) => {
                        self.messages = Some(messages);
                        continue;
                    }
                    Err(failure) => failure,
                },
                Some(messages) => match messages.next().await {
                    Some(Ok(message)) => return Held::new(message),
                    Some(Err(error)) => error.to_string(),
                    None => "the stream ended".to_owned(),
                },
            };
            tracing::debug!(failure, "NATS delivers no news; workers look by themselves");
            self.messages = None;
            sleep(PAUSE).await;
        }
    }

    async fn open(&self) -> Result<pull::Stream, String> {
        let consumer = timeout(ANSWER, self.nats.consumer()).await.map_err(|_| "no answer in time".to_owned())??;
        consumer.stream().max_messages_per_batch(1).messages().await.map_err(|error| error.to_string())
    }
}

/// A piece of news that this worker holds: it says that it is at work until it is done or dropped.
#[derive(Debug)]
pub(super) struct Held {
    message: Arc<Message>,
    _alive: AbortOnDropHandle<()>,
}

impl Held {
    fn new(message: Message) -> Self {
        let message = Arc::new(message);
        let held = message.clone();
        let alive = tokio::spawn(async move {
            loop {
                sleep(SIGN_OF_LIFE).await;
                // A failure lets the news come again, which costs a look into the table.
                let _ = held.ack_with(AckKind::Progress).await;
            }
        });
        Self { message, _alive: AbortOnDropHandle::new(alive) }
    }

    pub(super) async fn done(self) {
        if let Err(error) = self.message.ack().await {
            tracing::debug!(%error, "NATS was not told that news has done its work; it comes again");
        }
    }
}
