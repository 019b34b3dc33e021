//! Keys that were looked up a moment ago, so that a busy client costs no question to the database per request.
//!
//! A revocation in this process takes effect at once: it empties the table. One by another process (`surefoot key
//! revoke` beside a running service) takes effect after [`TRUSTED_FOR`] at the latest.

use super::Client;
use std::collections::HashMap;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

/// How long an answer of the database is taken for true.
const TRUSTED_FOR: Duration = Duration::from_millis(500);

/// SHA-256 of a key.
pub(super) type KeyDigest = [u8; 32];

/// What the table says of a key.
#[derive(Debug)]
pub(super) enum Known {
    /// Its holder.
    Client(Client),
    /// Nothing: ask the database, and bring `changes` along with its answer.
    Nothing { changes: u64 },
}

/// The table; a clone is another handle to the same. It holds true keys only, so it cannot outgrow the clients.
#[derive(Debug, Clone, Default)]
pub(super) struct KnownKeys(Arc<Mutex<Table>>);

#[derive(Debug, Default)]
struct Table {
    /// Counts revocations. An answer that the database gave before one of them is not remembered after it.
    changes: u64,
    clients: HashMap<KeyDigest, (Instant, Client)>,
}

impl KnownKeys {
    pub(super) fn look_up(&self, key: &KeyDigest) -> Known {
        let table = self.lock();
        match table.clients.get(key).filter(|(since, _)| since.elapsed() < TRUSTED_FOR) {
            Some((_, client)) => Known::Client(client.clone()),
            None => Known::Nothing { changes: table.changes },
        }
    }

    pub(super) fn changes(&self) -> u64 {
        self.lock().changes
    }

    pub(super) fn remember(&self, key: KeyDigest, client: &Client, changes: u64) {
        let mut table = self.lock();
        if table.changes == changes {
            table.clients.insert(key, (Instant::now(), client.clone()));
        }
    }

    pub(super) fn forget_all(&self) {
        let mut table = self.lock();
        table.changes += 1;
        table.clients.clear();
    }

    fn lock(&self) -> MutexGuard<'_, Table> {
        // Nothing panics while it holds the lock halfway through a change.
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::storage::{ClientId, OrganisationId, Role};
    use time::OffsetDateTime;

    const KEY: KeyDigest = [7; 32];

    fn client() -> Client {
        Client {
            id: ClientId::new(),
            organisation_id: OrganisationId::new(),
            role: Role::Device,
            label: "app".into(),
            created_at: OffsetDateTime::UNIX_EPOCH,
            revoked_at: None,
            last_used_at: None,
        }
    }

    #[test]
    fn an_answer_from_before_a_revocation_is_not_remembered_after_it() {
        let known = KnownKeys::default();
        let Known::Nothing { changes } = known.look_up(&KEY) else { panic!("nothing is known yet") };
        known.forget_all();
        known.remember(KEY, &client(), changes);
        assert!(matches!(known.look_up(&KEY), Known::Nothing { changes: 1 }));
    }

    #[test]
    fn an_answer_is_not_trusted_for_ever() {
        let known = KnownKeys::default();
        let long_ago = Instant::now().checked_sub(TRUSTED_FOR).unwrap();
        known.lock().clients.insert(KEY, (long_ago, client()));
        assert!(matches!(known.look_up(&KEY), Known::Nothing { .. }));
    }
}
