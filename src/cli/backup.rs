//! `surefoot backup`, `restore` and `doctor`: the data directory copied, brought back, examined.

use super::place::Place;
use crate::storage::{self, Store};
use anyhow::{Context, bail};
use std::path::PathBuf;

/// Copy the data directory into a new folder, also while the service runs
///
/// The copy holds the database in one consistent state, every recording that it names, and a list with digests that is
/// written last. `surefoot restore` brings it back.
#[derive(Debug, Clone, clap::Args)]
#[command(after_help = "Example:\n  surefoot backup /backups/$(date +%F) --data-dir /var/lib/surefoot")]
pub struct BackupArgs {
    /// Folder of the copy; made when absent, and must be empty
    folder: PathBuf,
    #[command(flatten)]
    place: Place,
}

/// Make a data directory from a backup
///
/// Checks every digest on the way. The service must not run on that directory meanwhile. Patients who were erased after the
/// backup was made are in it; the list of erasures says who they are, and they are erased again.
#[derive(Debug, Clone, clap::Args)]
#[command(
    after_help = "Example:\n  surefoot restore /backups/2026-11-27 --data-dir /var/lib/surefoot-restored \\\n      --erasures /var/lib/surefoot/erasures.jsonl"
)]
pub struct RestoreArgs {
    /// Folder that `surefoot backup` wrote
    backup: PathBuf,
    #[command(flatten)]
    place: Place,
    #[command(flatten)]
    erased: Erased,
}

/// What becomes of patients who were erased after the backup was made.
#[derive(Debug, Clone, clap::Args)]
#[group(required = true, multiple = false)]
struct Erased {
    /// List of erasures of the data directory that was in use (`erasures.jsonl` in it): whoever is on it is erased again
    #[arg(long, value_name = "FILE")]
    erasures: Option<PathBuf>,
    /// Restore without a list: nobody was erased since, or there is no list any more
    #[arg(long)]
    without_erasures: bool,
}

/// Look for damage in the data directory
///
/// Ends with status 1 when something is damaged, and says for each what to do. Works also while the service runs.
#[derive(Debug, Clone, clap::Args)]
pub struct DoctorArgs {
    #[command(flatten)]
    place: Place,
    /// Look whether recordings are there, without reading them
    #[arg(long)]
    quick: bool,
    /// Print JSON, for programs
    #[arg(long)]
    json: bool,
}

/// Runs `backup`.
///
/// # Errors
/// When the folder is not empty, the disk is full, or a recording is missing or damaged.
pub async fn back_up(args: &BackupArgs) -> anyhow::Result<()> {
    let store = args.place.open_existing().await?;
    let manifest = store.back_up(&args.folder).await?;
    store.close().await;
    let (n, bytes) = (manifest.blobs.len(), manifest.total_bytes());
    println!("{}: the database and {n} recordings, {bytes} bytes, every digest checked", args.folder.display());
    Ok(())
}

/// Runs `restore`.
///
/// # Errors
/// When the folder is no backup or is damaged, or the data directory is not empty.
pub async fn restore(args: &RestoreArgs) -> anyhow::Result<()> {
    let data_dir = args.place.configuration()?.data_dir;
    if let Some(list) = &args.erased.erasures
        && !list.is_file()
    {
        bail!("there is no list of erasures {}", list.display());
    }
    let manifest = storage::restore(&args.backup, &data_dir).await?;
    println!(
        "{}: {} recordings and the database of {}, made by version {}",
        data_dir.display(),
        manifest.blobs.len(),
        manifest.created_at,
        manifest.software_version
    );
    let store = Store::open(&data_dir).await?;
    store.rebuild_erasure_list().await?;
    let erased = match &args.erased.erasures {
        Some(list) => Some(store.erase_listed(list).await),
        None => None,
    };
    store.close().await;
    match erased {
        Some(erased) => {
            let unsafe_to_use = "patients who were erased since the backup are in it: do not use this data directory";
            println!("{} patients who were erased since then were erased again", erased.context(unsafe_to_use)?);
        }
        None => println!("patients who were erased since then are in it again"),
    }
    Ok(())
}

/// Runs `doctor`.
///
/// # Errors
/// When something in the data directory is damaged, or it cannot be opened.
pub async fn examine(args: &DoctorArgs) -> anyhow::Result<()> {
    let store = args.place.open_existing().await?;
    let found = store.ailments(!args.quick).await?;
    store.close().await;
    if args.json {
        println!("{}", serde_json::to_string_pretty(&found)?);
    }
    let damages = found.iter().filter(|ailment| ailment.is_damage).count();
    if !args.json {
        found.iter().for_each(|ailment| println!("{}: {}", ailment.code, ailment.sentence));
    }
    if damages > 0 {
        bail!("{damages} things in the data directory are damaged");
    }
    if !args.json {
        println!("nothing is damaged");
    }
    Ok(())
}
