//! Where a command finds the data: by the same choice as `surefoot serve`.

use super::serve;
use crate::config::Config;
use crate::storage::Store;
use anyhow::bail;
use std::path::PathBuf;

/// Which data are meant.
#[derive(Debug, Clone, Default, clap::Args)]
pub struct Place {
    /// Directory of the database and the recordings, or of the parts of uploads when these are elsewhere; default: as the
    /// configuration says
    #[arg(long, global = true, value_name = "DIR")]
    pub data_dir: Option<PathBuf>,
    /// Configuration file in TOML; default: `surefoot.toml` when it exists
    #[arg(long, global = true, value_name = "FILE")]
    pub config: Option<PathBuf>,
}

impl Place {
    /// The configuration of file and environment, with the directory that was named.
    ///
    /// # Errors
    /// When a source cannot be read or holds a value that does not fit.
    pub fn configuration(&self) -> anyhow::Result<Config> {
        let mut config = serve::load_config(self.config.as_deref())?;
        if let Some(data_dir) = &self.data_dir {
            config.data_dir.clone_from(data_dir);
        }
        Ok(config)
    }

    /// The store, made when there is none.
    ///
    /// # Errors
    /// When it cannot be reached or used.
    pub async fn open(&self) -> anyhow::Result<Store> {
        serve::open_store(&self.configuration()?).await
    }

    /// The store that is there already: a look must not make one.
    ///
    /// # Errors
    /// When there is none, or it cannot be reached or used.
    pub async fn open_existing(&self) -> anyhow::Result<Store> {
        let config = self.configuration()?;
        if config.database_url.is_none() && !config.data_dir.is_dir() {
            bail!("there is no data directory {}; name it with --data-dir", config.data_dir.display());
        }
        serve::open_store(&config).await
    }
}
