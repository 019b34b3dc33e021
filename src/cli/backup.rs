//! `surefoot backup`, `restore` and `doctor`: the data directory copied, brought back, examined.

use super::serve;
use crate::storage::{self, Store};
use anyhow::{Context, bail};
use std::path::PathBuf;

/// Which data directory is meant.
#[derive(Debug, Clone, clap::Args)]
struct Whose {
    /// Data directory; default: as `surefoot serve` would choose
    #[arg(long, value_name = "DIR")]
    data_dir: Option<PathBuf>,
    /// Configuration file; default: `surefoot.toml` when it exists
    #[arg(long, value_name = "FILE")]
    config: Option<PathBuf>,
}

impl Whose {
    fn data_dir(&self) -> anyhow::Result<PathBuf> {
        match &self.data_dir {
            Some(folder) => Ok(folder.clone()),
            None => Ok(serve::load_config(self.config.as_deref())?.data_dir),
        }
    }

    /// The store of a directory that is one already: a look must not make one.
    async fn store(&self) -> anyhow::Result<Store> {
        let folder = self.data_dir()?;
        if !folder.is_dir() {
            bail!("there is no data directory {}; name it with --data-dir", folder.display());
        }
        Store::open(&folder).await.with_context(|| format!("cannot open the data directory {}", folder.display()))
    }
}

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
    whose: Whose,
}

/// Make a data directory from a backup
///
/// Checks every digest on the way. The service must not run on that directory meanwhile.
#[derive(Debug, Clone, clap::Args)]
#[command(after_help = "Example:\n  surefoot restore /backups/2026-11-27 --data-dir /var/lib/surefoot-restored")]
pub struct RestoreArgs {
    /// Folder that `surefoot backup` wrote
    backup: PathBuf,
    #[command(flatten)]
    whose: Whose,
}

/// Look for damage in the data directory
///
/// Ends with status 1 when something is damaged, and says for each what to do. Works also while the service runs.
#[derive(Debug, Clone, clap::Args)]
pub struct DoctorArgs {
    #[command(flatten)]
    whose: Whose,
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
    let store = args.whose.store().await?;
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
    let data_dir = args.whose.data_dir()?;
    let manifest = storage::restore(&args.backup, &data_dir).await?;
    println!(
        "{}: {} recordings and the database of {}, made by version {}",
        data_dir.display(),
        manifest.blobs.len(),
        manifest.created_at,
        manifest.software_version
    );
    Ok(())
}

/// Runs `doctor`.
///
/// # Errors
/// When something in the data directory is damaged, or it cannot be opened.
pub async fn examine(args: &DoctorArgs) -> anyhow::Result<()> {
    let store = args.whose.store().await?;
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
