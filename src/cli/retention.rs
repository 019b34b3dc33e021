//! `surefoot retention`: what the rules of retention take away, said or done.

use super::place::Place;
use crate::storage::audit::Actor;
use crate::storage::retention::RetentionRules;

/// Remove what is older than the configuration keeps it
///
/// The rules are `retain_recordings_days`, `retain_patients_days` and `retain_audit_days` of the configuration; none is set by
/// default. A running service does this every hour by itself. What is removed cannot be brought back.
#[derive(Debug, Clone, clap::Args)]
#[command(after_help = "Example:\n  surefoot retention --dry-run --config /etc/surefoot.toml")]
pub struct Args {
    #[command(flatten)]
    place: Place,
    /// Say what would be removed, and remove nothing
    #[arg(long)]
    dry_run: bool,
    /// Print JSON, for programs
    #[arg(long)]
    json: bool,
}

/// Runs the command.
///
/// # Errors
/// When the data directory cannot be opened, or something cannot be removed.
pub async fn run(args: &Args) -> anyhow::Result<()> {
    let rules = RetentionRules::from(&args.place.configuration()?);
    let store = args.place.open_existing().await?;
    if args.dry_run {
        let plan = store.retention_plan(&rules).await?;
        store.close().await;
        if args.json {
            println!("{}", serde_json::to_string_pretty(&plan)?);
            return Ok(());
        }
        plan.patients.iter().for_each(|patient| println!("patient {} would be erased", patient.id));
        plan.recordings.iter().for_each(|recording| println!("bytes of recording {} would be removed", recording.id));
        println!("{} entries of the audit log would be removed", plan.audit_entries);
        println!("{} answers kept for repeated requests are over", plan.kept_answers);
        return Ok(());
    }
    let done = store.apply_retention(&rules, Actor::operator).await?;
    store.close().await;
    if args.json {
        println!("{}", serde_json::to_string_pretty(&done)?);
    } else {
        println!(
            "removed: {} patients, bytes of {} recordings, {} entries of the audit log, {} kept answers",
            done.patients, done.recordings, done.audit_entries, done.kept_answers
        );
    }
    Ok(())
}
