//! The list of erasures: a file beside the database, one JSON object a line. A backup that was made before an erasure still
//! holds the patient; restoring it with the list of the data directory that was in use erases them again. It names patients by
//! the keyed hash of their ids, which means nothing without the database.

use super::{Erasure, ErasureOrder, ErasureReason, erasure_from_row};
use crate::storage::audit::{Actor, Thing};
use crate::storage::database::query;
use crate::storage::{OrganisationId, PatientId, StorageError, Store};
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::fs::{self, File};
use std::io::{self, Write};
use std::path::Path;
use time::OffsetDateTime;
use tokio::task::spawn_blocking;

/// Name of the file in the data directory.
pub(in crate::storage) const LIST_FILE: &str = "erasures.jsonl";

/// One line of the list.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
struct Line {
    /// Keyed hash of the patient's id, hexadecimal.
    patient: String,
    /// The patient's organisation.
    organisation_id: OrganisationId,
    /// When the patient was erased.
    #[serde(with = "time::serde::rfc3339")]
    erased_at: OffsetDateTime,
}

impl Store {
    /// Writes an erasure into the list, when it is not there yet; it is on the disk when this returns.
    pub(super) async fn note_in_list(&self, erasure: &Erasure) -> Result<(), StorageError> {
        let line = Line {
            patient: erasure.patient.to_string(),
            organisation_id: erasure.organisation,
            erased_at: erasure.begun_at,
        };
        let path = self.erasure_list.clone();
        let written = spawn_blocking(move || {
            if read(&path)?.contains_key(&line.patient) {
                return Ok(());
            }
            append(&path, &[line])
        });
        settle(written.await, "writing the list of erasures")
    }

    /// Writes every erasure that the database knows of into the list: after a restore, when there is none.
    ///
    /// # Errors
    /// When the database or the disk fails.
    pub async fn rebuild_erasure_list(&self) -> Result<(), StorageError> {
        let rows = query("SELECT * FROM erasures ORDER BY id").fetch_all(self.reader()).await?;
        for row in &rows {
            self.note_in_list(&erasure_from_row(row)?).await?;
        }
        Ok(())
    }

    /// Erases every patient whom a list names and who is here again; how many there were. The list is taken over.
    ///
    /// # Errors
    /// When the list cannot be read, or an erasure fails.
    pub async fn erase_listed(&self, list: &Path) -> Result<usize, StorageError> {
        let path = list.to_owned();
        let listed = settle(
            spawn_blocking(move || {
                // A list that is named and is not there was mistyped: nothing would be erased, and nobody would notice.
                fs::metadata(&path)?;
                read(&path)
            })
            .await,
            "reading the list of erasures",
        )?;
        let rows = query("SELECT id, organisation_id FROM patients").fetch_all(self.reader()).await?;
        let mut erased = 0;
        for row in &rows {
            let (patient, organisation): (PatientId, OrganisationId) =
                (row.try_get("id")?, row.try_get("organisation_id")?);
            if !listed.contains_key(&self.audit_hash(Thing::from(patient)).to_string()) {
                continue;
            }
            self.erase_patient(&ErasureOrder {
                organisation,
                patient,
                reason: ErasureReason::Restore,
                actor: Actor::operator(Some(organisation)),
                request_id: "",
                confirmation: None,
            })
            .await?;
            erased += 1;
        }
        let path = self.erasure_list.clone();
        let taken_over = spawn_blocking(move || {
            let known = read(&path)?;
            let new: Vec<Line> = listed.into_values().filter(|line| !known.contains_key(&line.patient)).collect();
            append(&path, &new)
        });
        settle(taken_over.await, "writing the list of erasures")?;
        Ok(erased)
    }
}

/// The lines by patient; none when there is no list. A last line that a crash has cut off is left aside: its erasure is not done,
/// and writes it again.
fn read(path: &Path) -> io::Result<BTreeMap<String, Line>> {
    let text = match fs::read_to_string(path) {
        Ok(text) => text,
        Err(error) if error.kind() == io::ErrorKind::NotFound => return Ok(BTreeMap::new()),
        Err(error) => return Err(error),
    };
    let mut lines = BTreeMap::new();
    for line in text.split_inclusive('\n').filter(|line| line.ends_with('\n') && !line.trim().is_empty()) {
        let line: Line = match serde_json::from_str(line) {
            Ok(line) => line,
            Err(error) => {
                let what = format!("{} is not a list of erasures: {error}", path.display());
                return Err(io::Error::new(io::ErrorKind::InvalidData, what));
            }
        };
        lines.insert(line.patient.clone(), line);
    }
    Ok(lines)
}

fn append(path: &Path, lines: &[Line]) -> io::Result<()> {
    let mut text = String::new();
    for line in lines {
        text.push_str(&serde_json::to_string(line)?);
        text.push('\n');
    }
    let mut file = File::options().read(true).append(true).create(true).open(path)?;
    let whole = fs::read(path)?;
    let end = whole.iter().rposition(|byte| *byte == b'\n').map_or(0, |last| last + 1);
    if end < whole.len() {
        file.set_len(end as u64)?;
    }
    // One write: a reader never meets half a line of a process that is alive.
    file.write_all(text.as_bytes())?;
    file.sync_all()?;
    path.parent().map_or(Ok(()), |folder| File::open(folder)?.sync_all())
}

fn settle<T>(done: Result<io::Result<T>, tokio::task::JoinError>, doing: &'static str) -> Result<T, StorageError> {
    done.unwrap_or_else(|panic| Err(io::Error::other(panic))).map_err(StorageError::blob(doing))
}
