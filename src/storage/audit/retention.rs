//! The old end of the log. Entries may be removed from the beginning on, never from the middle: an anchor says where the chain
//! begins from then on, and an entry at its end tells of the removal, so that an anchor cannot appear unseen.

use super::chain::Hash;
use super::{Actor, AuditEvent};
use crate::storage::clock::ms_from_time;
use crate::storage::database::query;
use crate::storage::{StorageError, Store};
use serde_json::json;
use time::OffsetDateTime;

impl Store {
    /// How many entries are older than a time.
    ///
    /// # Errors
    /// When the database fails.
    pub async fn count_audit_before(&self, time: OffsetDateTime) -> Result<u64, StorageError> {
        let n: i64 = query(
            "SELECT count(*) FROM audit_entries
             WHERE sequence <= (SELECT max(sequence) FROM audit_entries WHERE happened_at < $1)",
        )
        .bind(ms_from_time(time))
        .fetch_value(self.reader())
        .await?;
        Ok(n.unsigned_abs())
    }

    /// Removes the entries up to the last one that is older than a time; how many they were.
    ///
    /// # Errors
    /// When the database fails.
    pub async fn remove_audit_before(&self, time: OffsetDateTime, actor: Actor) -> Result<u64, StorageError> {
        let now = self.now();
        let mut transaction = self.begin().await?;
        let last =
            query("SELECT sequence, hash FROM audit_entries WHERE happened_at < $1 ORDER BY sequence DESC LIMIT 1")
                .bind(ms_from_time(time))
                .fetch_optional(&mut transaction)
                .await?;
        let Some(last) = last else { return Ok(0) };
        let (sequence, hash): (i64, _) = (last.try_get("sequence")?, Hash::from_bytes(last.try_get("hash")?)?);
        let n: i64 = query("SELECT count(*) FROM audit_entries WHERE sequence <= $1")
            .bind(sequence)
            .fetch_value(&mut transaction)
            .await?;
        query("INSERT INTO audit_anchors (sequence, hash, n_entries, created_at) VALUES ($1, $2, $3, $4)")
            .bind(sequence)
            .bind(&hash.0[..])
            .bind(n)
            .bind(ms_from_time(now))
            .execute(&mut transaction)
            .await?;
        query("DELETE FROM audit_entries WHERE sequence <= $1").bind(sequence).execute(&mut transaction).await?;
        let detail = json!({"entries": n, "up_to_sequence": sequence, "up_to_hash": hash.to_string()}).to_string();
        let event = AuditEvent::of_command(now, actor, "retention: audit", None, detail);
        self.audit_within(&mut transaction, event).await?;
        transaction.commit().await?;
        Ok(n.unsigned_abs())
    }
}
