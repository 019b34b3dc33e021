//! `surefoot patient`: everything about one patient, at the machine.

use super::place::Place;
use crate::api::auth::Caller;
use crate::api::patient_export::archive_of;
use crate::queue::{Queue, QueueSettings};
use crate::storage::audit::{Actor, AuditEvent};
use crate::storage::{Client, ClientId, OrganisationId, PatientId, Role};
use anyhow::Context;
use clap::Subcommand;
use std::path::{Path, PathBuf};
use tokio::io::AsyncWriteExt;
use uuid::Uuid;

/// Export everything about one patient
#[derive(Debug, Clone, clap::Args)]
pub struct Args {
    #[command(subcommand)]
    command: PatientCommand,
}

#[derive(Debug, Clone, Subcommand)]
enum PatientCommand {
    /// Write everything about a patient into a ZIP archive, also while the service runs
    ///
    /// The same archive as GET /v1/patients/ID/export. It leaves an entry in the audit log.
    #[command(
        after_help = "Example:\n  surefoot patient export 0193b2a8-1111-7aaa-8bbb-000000000000 --out patient.zip"
    )]
    Export {
        /// Id of the patient
        id: Uuid,
        /// The archive; must not exist
        #[arg(long, value_name = "FILE")]
        out: PathBuf,
        #[command(flatten)]
        place: Place,
    },
}

/// Runs the command.
///
/// # Errors
/// When there is no such patient, or the archive cannot be written.
pub async fn run(args: &Args) -> anyhow::Result<()> {
    let PatientCommand::Export { id, out, place } = &args.command;
    let (store, patient) = (place.open_existing().await?, PatientId(*id));
    let organisation = store.organisation_of_patient(patient).await.context("nothing was exported")?;
    let event = AuditEvent::of_command(
        store.now(),
        Actor::operator(Some(organisation)),
        "patient export",
        Some(patient.into()),
        String::new(),
    );
    store.audit(&[event]).await?;
    let queue = Queue::new(store.clone(), QueueSettings::default());
    let written = write(queue, organisation, patient, out).await;
    store.close().await;
    let bytes = written?;
    println!("{}: {bytes} bytes; it holds health data, keep it accordingly", out.display());
    Ok(())
}

async fn write(queue: Queue, organisation: OrganisationId, patient: PatientId, out: &Path) -> anyhow::Result<u64> {
    let mut options = tokio::fs::File::options();
    options.write(true).create_new(true);
    #[cfg(unix)]
    options.mode(0o600);
    let mut file = options.open(out).await.with_context(|| format!("cannot make {}", out.display()))?;
    let mut pieces = archive_of(queue, operator(organisation), patient);
    let mut bytes = 0;
    let copying = async {
        while let Some(piece) = pieces.recv().await {
            let piece = piece?;
            bytes += piece.len() as u64;
            file.write_all(&piece).await?;
        }
        file.sync_all().await
    };
    if let Err(error) = copying.await {
        // Half an archive of health data helps nobody.
        tokio::fs::remove_file(out).await.ok();
        return Err(error).context("the archive was not written");
    }
    Ok(bytes)
}

/// Whoever is at the machine may read everything.
fn operator(organisation: OrganisationId) -> Caller {
    let client = Client {
        id: ClientId(Uuid::nil()),
        organisation_id: organisation,
        role: Role::Admin,
        label: "operator".to_owned(),
        is_user: false,
        created_at: time::OffsetDateTime::UNIX_EPOCH,
        expires_at: None,
        revoked_at: None,
        previous_key_until: None,
        last_used_at: None,
    };
    Caller { access: client.access(), client }
}
