//! News between processes that share a queue.
//!
//! The table of jobs is the only truth, and whoever hears nothing looks into it by itself after a while. News make that
//! prompt: that a job waits, and that one has changed. Inside of one process signals suffice; between machines NATS carries
//! them, and what it loses costs no more than that while.

#[cfg(feature = "scaleout")]
mod nats;

use crate::storage::JobId;
use tokio::sync::broadcast;
use tokio_util::sync::CancellationToken;

/// What carries news to other processes; the default carries none.
#[derive(Debug, Clone, Default)]
pub struct Messenger {
    #[cfg(feature = "scaleout")]
    nats: Option<nats::Nats>,
}

/// The news that jobs wait, as one worker hears them.
#[derive(Debug)]
pub struct Deliveries {
    #[cfg(feature = "scaleout")]
    nats: Option<nats::NatsDeliveries>,
}

/// News that a job waits, held until it was looked for.
#[derive(Debug)]
pub struct Delivery {
    #[cfg(feature = "scaleout")]
    held: nats::Held,
}

impl Messenger {
    /// News over a NATS server. `subject` keeps apart the installations that share a server.
    ///
    /// # Errors
    /// When the address is none, or this build cannot speak to NATS. A server that is silent is no error: it is tried again.
    pub async fn connect(url: &str, subject: &str) -> Result<Self, String> {
        #[cfg(feature = "scaleout")]
        return Ok(Self { nats: Some(nats::Nats::connect(url, subject).await?) });
        #[cfg(not(feature = "scaleout"))]
        {
            let _ = (url, subject);
            Err("the setting `nats_url` needs a build with `--features scaleout`".to_owned())
        }
    }

    /// Tells workers of every machine that a job waits.
    pub(super) fn tell_waiting(&self, id: JobId) {
        #[cfg(feature = "scaleout")]
        if let Some(nats) = &self.nats {
            nats.tell_waiting(id);
        }
        #[cfg(not(feature = "scaleout"))]
        let _ = id;
    }

    /// Tells watchers of every machine that a job has changed.
    pub(super) fn tell_changed(&self, id: JobId) {
        #[cfg(feature = "scaleout")]
        if let Some(nats) = &self.nats {
            nats.tell_changed(id);
        }
        #[cfg(not(feature = "scaleout"))]
        let _ = id;
    }

    /// Passes changes that other machines tell of on to the watchers of this process, until `shutdown`.
    pub(super) fn listen(&self, changes: &broadcast::Sender<JobId>, shutdown: &CancellationToken) {
        #[cfg(feature = "scaleout")]
        if let Some(nats) = &self.nats {
            nats.listen(changes.clone(), shutdown.clone());
        }
        #[cfg(not(feature = "scaleout"))]
        let _ = (changes, shutdown);
    }

    /// The news for one more worker.
    pub(super) fn deliveries(&self) -> Deliveries {
        Deliveries {
            #[cfg(feature = "scaleout")]
            nats: self.nats.as_ref().map(nats::Nats::deliveries),
        }
    }
}

impl Deliveries {
    /// The next news that a job waits; never when no messenger is there.
    pub async fn next(&mut self) -> Delivery {
        #[cfg(feature = "scaleout")]
        if let Some(nats) = &mut self.nats {
            return Delivery { held: nats.next().await };
        }
        std::future::pending().await
    }
}

impl Delivery {
    /// Says that the news has done its work; one that is dropped before comes again, to any worker.
    pub async fn done(self) {
        #[cfg(feature = "scaleout")]
        self.held.done().await;
    }
}
