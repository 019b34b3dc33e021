//! Keys that were looked up a moment ago, so that a busy client costs no question to the database per request.
//!
//! A revocation or a rotation in this process takes effect at once: it empties the table. One by another process (`surefoot key
//! revoke` beside a running service) takes effect after [`TRUSTED_FOR`] at the latest. A key that comes to its end is not known
//! any more from that moment on.

use super::Client;
use std::collections::HashMap;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};
use time::OffsetDateTime;

/// How long an answer of the database is taken for true.
const TRUSTED_FOR: Duration = Duration::from_millis(500);

/// Keys that are held; a table that is full is emptied, which costs each of them one question.
const MOST_KEYS: usize = 10_000;

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

/// The table; a clone is another handle to the same. It holds true keys only, and no more than [`MOST_KEYS`].
#[derive(Debug, Clone, Default)]
pub(super) struct KnownKeys(Arc<Mutex<Table>>);

#[derive(Debug, Default)]
struct Table {
    /// Counts revocations. An answer that the database gave before one of them is not remembered after it.
    changes: u64,
    clients: HashMap<KeyDigest, Entry>,
}

#[derive(Debug)]
struct Entry {
    since: Instant,
    /// When the key ends by itself.
    valid_until: Option<OffsetDateTime>,
    client: Client,
}

impl KnownKeys {
    pub(super) fn look_up(&self, key: &KeyDigest, now: OffsetDateTime) -> Known {
        let table = self.lock();
        let holds =
            |entry: &&Entry| entry.since.elapsed() < TRUSTED_FOR && entry.valid_until.is_none_or(|end| end > now);
        match table.clients.get(key).filter(holds) {
            Some(entry) => Known::Client(entry.client.clone()),
            None => Known::Nothing { changes: table.changes },
        }
    }

    pub(super) fn changes(&self) -> u64 {
        self.lock().changes
    }

    pub(super) fn remember(&self, key: KeyDigest, client: &Client, valid_until: Option<OffsetDateTime>, changes: u64) {
        let mut table = self.lock();
        if table.changes != changes {
            return;
        }
        if table.clients.len() >= MOST_KEYS {
            table.clients.clear();
        }
        table.clients.insert(key, Entry { since: Instant::now(), valid_until, client: client.clone() });
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

    const KEY: KeyDigest = [7; 32];
    const NOW: OffsetDateTime = OffsetDateTime::UNIX_EPOCH;

    fn client() -> Client {
        Client {
            id: ClientId::new(),
            organisation_id: OrganisationId::new(),
            role: Role::Device,
            label: "app".into(),
            is_user: false,
            created_at: NOW,
            expires_at: None,
            revoked_at: None,
            previous_key_until: None,
            last_used_at: None,
        }
    }

    #[test]
    fn an_answer_from_before_a_revocation_is_not_remembered_after_it() {
        let known = KnownKeys::default();
        let Known::Nothing { changes } = known.look_up(&KEY, NOW) else { panic!("nothing is known yet") };
        known.forget_all();
        known.remember(KEY, &client(), None, changes);
        assert!(matches!(known.look_up(&KEY, NOW), Known::Nothing { changes: 1 }));
    }

    #[test]
    fn an_answer_is_not_trusted_for_ever() {
        let known = KnownKeys::default();
        let long_ago = Instant::now().checked_sub(TRUSTED_FOR).unwrap();
        let entry = Entry { since: long_ago, valid_until: None, client: client() };
        known.lock().clients.insert(KEY, entry);
        assert!(matches!(known.look_up(&KEY, NOW), Known::Nothing { .. }));
    }

    #[test]
    fn a_key_that_has_come_to_its_end_is_not_known_any_more() {
        let known = KnownKeys::default();
        let end = NOW + Duration::from_millis(100);
        known.remember(KEY, &client(), Some(end), 0);
        assert!(matches!(known.look_up(&KEY, NOW), Known::Client(_)));
        assert!(matches!(known.look_up(&KEY, end), Known::Nothing { .. }));
    }

    #[test]
    fn the_table_does_not_grow_without_bound() {
        let known = KnownKeys::default();
        for i in 0..=MOST_KEYS as u64 {
            let mut key = KEY;
            key[..8].copy_from_slice(&i.to_le_bytes());
            known.remember(key, &client(), None, 0);
        }
        assert!(known.lock().clients.len() <= MOST_KEYS);
    }
}
