//! Uploads under way in this process, so that those of a patient can be ended: on a withdrawal, and before an erasure.

use super::{PatientId, Store};
use std::collections::HashMap;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::Duration;
use tokio_util::sync::CancellationToken;

/// How often somebody who waits for the end of uploads looks.
const LOOK_EVERY: Duration = Duration::from_millis(10);

/// The uploads under way. A clone is another handle to the same.
#[derive(Debug, Clone, Default)]
pub struct Uploads(Arc<Mutex<Table>>);

#[derive(Debug, Default)]
struct Table {
    next: u64,
    under_way: HashMap<u64, (PatientId, CancellationToken)>,
}

/// One upload under way; dropping it says that it has ended and left nothing behind.
#[derive(Debug)]
pub struct UploadUnderWay {
    uploads: Uploads,
    number: u64,
    stopped: CancellationToken,
}

impl UploadUnderWay {
    /// Ready once somebody has asked to stop it.
    pub async fn stopped(&self) {
        self.stopped.cancelled().await;
    }
}

impl Drop for UploadUnderWay {
    fn drop(&mut self) {
        self.uploads.lock().under_way.remove(&self.number);
    }
}

impl Uploads {
    /// Notes an upload of a patient's recording.
    pub fn begin(&self, patient: PatientId) -> UploadUnderWay {
        let stopped = CancellationToken::new();
        let mut table = self.lock();
        table.next += 1;
        let number = table.next;
        table.under_way.insert(number, (patient, stopped.clone()));
        UploadUnderWay { uploads: self.clone(), number, stopped }
    }

    /// Asks every upload of a patient to end.
    pub fn stop(&self, patient: PatientId) {
        let table = self.lock();
        table.under_way.values().filter(|(of, _)| *of == patient).for_each(|(_, stopped)| stopped.cancel());
    }

    /// Like [`Uploads::stop`], and waits until they have; false when some have not within `patience`.
    pub async fn stop_and_wait(&self, patient: PatientId, patience: Duration) -> bool {
        self.stop(patient);
        let ended = async {
            while self.lock().under_way.values().any(|(of, _)| *of == patient) {
                tokio::time::sleep(LOOK_EVERY).await;
            }
        };
        tokio::time::timeout(patience, ended).await.is_ok()
    }

    fn lock(&self) -> MutexGuard<'_, Table> {
        // Nothing panics while it holds the lock halfway through a change.
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl Store {
    /// The uploads under way in this process.
    pub fn uploads(&self) -> &Uploads {
        &self.uploads
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[tokio::test]
    async fn uploads_of_one_patient_are_stopped_and_others_go_on() {
        let uploads = Uploads::default();
        let (one, other) = (PatientId::new(), PatientId::new());
        let (first, second) = (uploads.begin(one), uploads.begin(other));
        assert!(!uploads.stop_and_wait(one, Duration::from_millis(30)).await, "it has not ended yet");
        first.stopped().await;
        assert!(!second.stopped.is_cancelled());
        drop(first);
        assert!(uploads.stop_and_wait(one, Duration::ZERO).await);
        assert_eq!(uploads.lock().under_way.len(), 1);
    }
}
