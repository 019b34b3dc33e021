//! Walking the chain.

use super::chain::Hash;
use crate::storage::database::query;
use crate::storage::{StorageError, Store};
use futures::TryStreamExt;
use serde::Serialize;

/// The first place where the chain does not hold.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct BrokenLink {
    /// The entry; of one that is missing the number that it would have.
    pub sequence: i64,
    /// What is wrong, for a person.
    pub reason: String,
}

/// What a walk along the chain came to.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct Verification {
    /// Entries that were looked at.
    pub n_entries: u64,
    /// The entry after which the chain begins: 0, or the last one that retention has removed.
    pub begins_after: i64,
    /// The last entry.
    pub head_sequence: i64,
    /// Hash of the last entry, hexadecimal: whoever keeps it elsewhere can tell later that nothing before it was changed.
    pub head_hash: String,
    /// Where the chain is broken; none when it is whole.
    pub broken: Option<BrokenLink>,
}

impl Store {
    /// Walks the whole chain. `known` is a head that was noted earlier: the chain must hold it still, unless retention has removed
    /// it.
    ///
    /// # Errors
    /// When the database fails.
    pub async fn verify_audit(&self, known: Option<(i64, Hash)>) -> Result<Verification, StorageError> {
        let anchor = query("SELECT sequence, hash FROM audit_anchors ORDER BY sequence DESC LIMIT 1")
            .fetch_optional(self.reader())
            .await?;
        let (begins_after, mut last) = match anchor {
            Some(row) => (row.try_get("sequence")?, Hash::from_bytes(row.try_get("hash")?)?),
            None => (0, Hash::BEGINNING),
        };
        let state = query("SELECT sequence, hash FROM audit_state WHERE id = 1").fetch_one(self.reader()).await?;
        let (head_sequence, head_hash): (i64, _) =
            (state.try_get("sequence")?, Hash::from_bytes(state.try_get("hash")?)?);
        let (mut sequence, mut n_entries) = (begins_after, 0);
        let mut broken = None;
        let mut entries = self.audit_from(i64::MIN);
        while let Some(entry) = entries.try_next().await? {
            // What came in while this walk goes on is not of this look.
            if entry.sequence > head_sequence {
                break;
            }
            let reason = if entry.sequence != sequence + 1 {
                Some(format!("entry {} is missing, or another one was slipped in", sequence + 1))
            } else if entry.previous_hash != last {
                Some("it does not follow the entry before".to_owned())
            } else if entry.content_hash() != entry.hash {
                Some("its content is not what was entered".to_owned())
            } else if known.is_some_and(|(at, hash)| at == entry.sequence && hash != entry.hash) {
                Some("its hash is not the one that was noted: entries up to here were written anew".to_owned())
            } else {
                None
            };
            if let Some(reason) = reason {
                broken = Some(BrokenLink { sequence: entry.sequence.min(sequence + 1), reason });
                break;
            }
            (sequence, last, n_entries) = (entry.sequence, entry.hash, n_entries + 1);
        }
        if broken.is_none() && (sequence, last) != (head_sequence, head_hash) {
            let reason = format!("the log ends here, and should go on to entry {head_sequence}");
            broken = Some(BrokenLink { sequence: sequence + 1, reason });
        }
        if let (None, Some((at, _))) = (&broken, known.filter(|(at, _)| *at > head_sequence)) {
            let reason = format!("the log ends before entry {at}, which was noted");
            broken = Some(BrokenLink { sequence: head_sequence + 1, reason });
        }
        Ok(Verification { n_entries, begins_after, head_sequence, head_hash: head_hash.to_string(), broken })
    }
}
