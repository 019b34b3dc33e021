//! The way into the log for requests: a bounded channel, and one task that writes what has gathered in one transaction.

use super::AuditEvent;
use crate::storage::{StorageError, Store};
use std::time::Duration;
use tokio::sync::{mpsc, oneshot};
use tokio::time::{Instant, sleep_until, timeout_at};

/// Events that may wait to be written; whoever brings more waits.
const WAITING: usize = 4096;
/// Events of one transaction at most.
const BATCH: usize = 512;
/// How long a read may wait for company before it is written.
const GATHERING: Duration = Duration::from_millis(200);
/// Pause before another try when the database fails.
const RETRY: Duration = Duration::from_secs(1);

enum Order {
    /// Something was read: enter it soon.
    Note(AuditEvent),
    /// Something was changed: enter it and say so.
    Enter(AuditEvent, oneshot::Sender<bool>),
    /// Say when everything before is entered.
    Flush(oneshot::Sender<bool>),
}

/// Enters what requests did. A clone is another handle to the same.
#[derive(Debug, Clone)]
pub struct AuditTrail(mpsc::Sender<Order>);

impl std::fmt::Debug for Order {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(match self {
            Order::Note(_) => "Note",
            Order::Enter(..) => "Enter",
            Order::Flush(_) => "Flush",
        })
    }
}

impl AuditTrail {
    /// Starts the task; it ends when every handle is dropped. Make one per process and clone it.
    pub fn start(store: Store) -> Self {
        let (sender, orders) = mpsc::channel(WAITING);
        tokio::spawn(write(store, orders));
        Self(sender)
    }

    /// Hands in a read. It is on the disk within a moment; when too many wait already, this waits.
    pub async fn note(&self, event: AuditEvent) {
        // The task ends after its handles only.
        let _ = self.0.send(Order::Note(event)).await;
    }

    /// Enters a change; when this returns true the entry is on the disk.
    pub async fn enter(&self, event: AuditEvent) -> bool {
        let (done, waits) = oneshot::channel();
        self.0.send(Order::Enter(event, done)).await.is_ok() && waits.await.unwrap_or(false)
    }

    /// Waits until everything that was handed in before is on the disk; false when the database fails.
    pub async fn flush(&self) -> bool {
        let (done, waits) = oneshot::channel();
        self.0.send(Order::Flush(done)).await.is_ok() && waits.await.unwrap_or(false)
    }
}

/// What has gathered.
#[derive(Default)]
struct Batch {
    events: Vec<AuditEvent>,
    answers: Vec<oneshot::Sender<bool>>,
}

impl Batch {
    /// Takes an order; true when somebody waits for it.
    fn take(&mut self, order: Order) -> bool {
        match order {
            Order::Note(event) => {
                self.events.push(event);
                false
            }
            Order::Enter(event, answer) => {
                self.events.push(event);
                self.answers.push(answer);
                true
            }
            Order::Flush(answer) => {
                self.answers.push(answer);
                true
            }
        }
    }

    async fn write(&mut self, store: &Store) -> Result<(), StorageError> {
        store.audit(&self.events).await?;
        self.events.clear();
        Ok(())
    }
}

async fn write(store: Store, mut orders: mpsc::Receiver<Order>) {
    let mut batch = Batch::default();
    while let Some(first) = orders.recv().await {
        let mut is_waited_for = batch.take(first);
        let deadline = Instant::now() + GATHERING;
        while batch.events.len() < BATCH {
            let next = match is_waited_for {
                // What is there already comes along, nothing is waited for.
                true => orders.try_recv().ok(),
                false => timeout_at(deadline, orders.recv()).await.ok().flatten(),
            };
            let Some(order) = next else { break };
            is_waited_for |= batch.take(order);
        }
        let mut written = batch.write(&store).await;
        if let Err(error) = &written {
            tracing::error!(%error, waiting = batch.events.len(), "the audit log could not be written");
        }
        batch.answers.drain(..).for_each(|answer| {
            // Whoever waited may have given up.
            let _ = answer.send(written.is_ok());
        });
        // What could not be written is not forgotten: reads wait behind it, and changes are not acknowledged.
        while written.is_err() && !orders.is_closed() {
            sleep_until(Instant::now() + RETRY).await;
            while let Ok(order) = orders.try_recv() {
                if batch.take(order) {
                    batch.answers.drain(..).for_each(|answer| {
                        let _ = answer.send(false);
                    });
                }
                if batch.events.len() >= WAITING {
                    break;
                }
            }
            written = batch.write(&store).await;
        }
    }
}
