//! Backup of a data directory while it is in use, its way back, and a look at its health.
//!
//! A backup is a folder: the database as one consistent file, the blobs that it names, and a list of both with their
//! digests that is written last. Rows name only blobs that were on the disk before them and never change, so blobs that are
//! copied after the database fit it, whatever is written meanwhile.

use super::database::{Row, query};
use super::{DATABASE_FILE, StorageError, Store, StoredBlob, row};
use serde::{Deserialize, Serialize};
use sha2::{Digest, Sha256};
use sqlx::sqlite::{SqliteConnectOptions, SqliteConnection};
use sqlx::{ConnectOptions, Connection};
use std::collections::BTreeSet;
use std::fs::{self, File};
use std::io::{self, Read, Write};
use std::path::{Path, PathBuf};
use time::OffsetDateTime;
use tokio::task::spawn_blocking;

/// The list of a backup; a folder without it is not one.
const MANIFEST_FILE: &str = "backup.json";
/// Folder of blobs in a backup, and in a data directory.
const BLOB_FOLDER: &str = "blobs";
/// Bytes that are copied at a time.
const COPY_BYTES: usize = 1 << 20;

/// What a backup holds.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct BackupManifest {
    /// Version of the software that made it.
    pub software_version: String,
    /// When it was begun.
    #[serde(with = "time::serde::rfc3339")]
    pub created_at: OffsetDateTime,
    /// SHA-256 of the database file.
    pub database_sha256: String,
    /// Bytes of the database file.
    pub database_bytes: u64,
    /// The blobs, by key.
    pub blobs: Vec<BackupBlob>,
}

/// One blob of a backup.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
pub struct BackupBlob {
    /// Its key.
    pub key: String,
    /// SHA-256 of its bytes.
    pub sha256: String,
    /// How many they are.
    pub size_bytes: u64,
}

impl BackupManifest {
    /// Bytes of everything.
    pub fn total_bytes(&self) -> u64 {
        self.database_bytes + self.blobs.iter().map(|blob| blob.size_bytes).sum::<u64>()
    }
}

/// What is wrong with a data directory, or worth knowing of it.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct Ailment {
    /// Stable code: `database_damaged`, `blob_missing`, `blob_damaged`; `blob_unnamed`, which costs room alone.
    pub code: &'static str,
    /// True when something that was stored is lost.
    pub is_damage: bool,
    /// One sentence for the operator.
    pub sentence: String,
}

impl Store {
    /// Copies everything into a new folder while the service runs, and checks every blob's digest on the way.
    ///
    /// # Errors
    /// When the folder exists already and is not empty, the disk is full, or a blob is missing or damaged.
    pub async fn back_up(&self, folder: &Path) -> Result<BackupManifest, StorageError> {
        let created_at = self.now();
        require_empty(folder)?;
        let database = folder.join(DATABASE_FILE);
        let target = database.to_str().ok_or_else(|| StorageError::Corrupt("the path is not text".to_owned()))?;
        // One transaction of SQLite's own: a consistent state, without pages that deleted rows stood in. On a connection of
        // its own, so that nobody waits to write meanwhile.
        let mut connection = self.database.sqlite_writer()?.connect_options().as_ref().clone().connect().await?;
        sqlx::query("VACUUM INTO ?1").bind(target).execute(&mut connection).await?;
        connection.close().await?;
        let blobs = blobs_of(&database).await?;
        for blob in &blobs {
            let reader = self.blobs().reader(&stored(blob)).await?;
            let (to, expected) = (folder.join(BLOB_FOLDER).join(&blob.key), blob.clone());
            in_background(move || copy_checked(reader, &to, &expected)).await?;
        }
        let to_digest = database.clone();
        let (database_sha256, database_bytes) = in_background(move || digest_of(File::open(to_digest)?)).await?;
        let software_version = env!("CARGO_PKG_VERSION").to_owned();
        let manifest = BackupManifest { software_version, created_at, database_sha256, database_bytes, blobs };
        let (json, path) = (row::readable_json("the list of a backup", &manifest)?, folder.join(MANIFEST_FILE));
        in_background(move || write_durably(&path, json.as_bytes())).await?;
        Ok(manifest)
    }

    /// Looks for damage: the database's own check, and every blob that a row names. With `reads_blobs` their digests too.
    ///
    /// # Errors
    /// When the database cannot be asked at all.
    pub async fn ailments(&self, reads_blobs: bool) -> Result<Vec<Ailment>, StorageError> {
        let mut found = Vec::new();
        self.database.sqlite_writer()?;
        let complaints: Vec<String> = query("PRAGMA integrity_check").fetch_values(self.reader()).await?;
        found.extend(complaints.into_iter().filter(|complaint| complaint != "ok").map(|complaint| Ailment {
            code: "database_damaged",
            is_damage: true,
            sentence: format!("the database says: {complaint}; restore a backup"),
        }));
        let dangling = query("PRAGMA foreign_key_check").fetch_all(self.reader()).await?;
        if !dangling.is_empty() {
            let sentence = format!("{} rows refer to rows that are not there; restore a backup", dangling.len());
            found.push(Ailment { code: "database_damaged", is_damage: true, sentence });
        }
        let rows = query(BLOBS).fetch_all(self.reader()).await?;
        let blobs = rows.iter().map(blob_from_row).collect::<Result<Vec<_>, _>>()?;
        for blob in &blobs {
            found.extend(self.ailment_of_blob(blob, reads_blobs).await?);
        }
        let named: BTreeSet<String> = blobs.into_iter().map(|blob| blob.key).collect();
        for key in self.blobs().keys().await? {
            if !named.contains(&key) {
                let sentence = format!(
                    "no row names the blob {key}; an upload ended before its row was written, or is just ending"
                );
                found.push(Ailment { code: "blob_unnamed", is_damage: false, sentence });
            }
        }
        Ok(found)
    }

    async fn ailment_of_blob(&self, blob: &BackupBlob, reads: bool) -> Result<Option<Ailment>, StorageError> {
        let Ok(reader) = self.blobs().reader(&stored(blob)).await else {
            let sentence = format!("the blob {} is not there; restore it from a backup", blob.key);
            return Ok(Some(Ailment { code: "blob_missing", is_damage: true, sentence }));
        };
        if !reads {
            return Ok(None);
        }
        let digest = in_background(move || digest_of(reader)).await;
        let is_sound = matches!(&digest, Ok((sha256, size)) if *sha256 == blob.sha256 && *size == blob.size_bytes);
        Ok((!is_sound).then(|| Ailment {
            code: "blob_damaged",
            is_damage: true,
            sentence: format!("the blob {} is not what was stored; restore it from a backup", blob.key),
        }))
    }
}

/// Makes a data directory from a backup, after every digest was checked.
///
/// # Errors
/// When the folder is not a backup or is damaged, or the data directory is not empty.
pub async fn restore(backup: &Path, data_dir: &Path) -> Result<BackupManifest, StorageError> {
    require_empty(data_dir)?;
    let (from, to) = (backup.to_owned(), data_dir.to_owned());
    in_background(move || {
        let manifest: BackupManifest = serde_json::from_slice(&fs::read(from.join(MANIFEST_FILE))?)?;
        for blob in &manifest.blobs {
            let path = checked_path(&blob.key).ok_or_else(|| io::Error::other("a key leads out of the folder"))?;
            let reader = File::open(from.join(BLOB_FOLDER).join(&path))?;
            copy_checked(reader, &to.join(BLOB_FOLDER).join(&path), blob)?;
        }
        let database = BackupBlob {
            key: DATABASE_FILE.to_owned(),
            sha256: manifest.database_sha256.clone(),
            size_bytes: manifest.database_bytes,
        };
        // The database comes last: a directory that was filled in part has none, and is not taken for a whole one.
        copy_checked(File::open(from.join(DATABASE_FILE))?, &to.join(DATABASE_FILE), &database)?;
        Ok(manifest)
    })
    .await
}

/// Blobs that rows name.
const BLOBS: &str = "SELECT DISTINCT blob_key, sha256, size_bytes FROM recordings
                     WHERE content_removed_at IS NULL ORDER BY blob_key";

async fn blobs_of(database: &Path) -> Result<Vec<BackupBlob>, StorageError> {
    let options = SqliteConnectOptions::new().filename(database).read_only(true);
    let mut connection: SqliteConnection = options.connect().await?;
    let rows = sqlx::query(BLOBS).fetch_all(&mut connection).await?;
    rows.into_iter().map(|row| blob_from_row(&Row::Sqlite(row))).collect()
}

fn blob_from_row(row: &Row) -> Result<BackupBlob, StorageError> {
    Ok(BackupBlob {
        key: row.try_get("blob_key")?,
        sha256: row.try_get("sha256")?,
        size_bytes: row::count(row, "size_bytes")?,
    })
}

fn stored(blob: &BackupBlob) -> StoredBlob {
    let BackupBlob { key, sha256, size_bytes } = blob.clone();
    StoredBlob { key, sha256, size_bytes }
}

/// The path of a key inside a folder; none for one that would lead out of it.
fn checked_path(key: &str) -> Option<PathBuf> {
    let path = Path::new(key);
    path.components().all(|part| matches!(part, std::path::Component::Normal(_))).then(|| path.to_owned())
}

fn require_empty(folder: &Path) -> Result<(), StorageError> {
    let look = || {
        fs::create_dir_all(folder)?;
        Ok(fs::read_dir(folder)?.next().is_none())
    };
    match look().map_err(StorageError::blob("looking into a folder"))? {
        true => Ok(()),
        false => Err(StorageError::Conflict {
            code: "folder_not_empty",
            sentence: format!("{} is not empty; name a new folder", folder.display()),
        }),
    }
}

async fn in_background<T: Send + 'static>(
    work: impl FnOnce() -> io::Result<T> + Send + 'static,
) -> Result<T, StorageError> {
    let done = spawn_blocking(work).await.unwrap_or_else(|panic| Err(io::Error::other(panic)));
    done.map_err(StorageError::blob("copying or reading a backup"))
}

fn copy_checked(mut from: impl Read, to: &Path, expected: &BackupBlob) -> io::Result<()> {
    if let Some(folder) = to.parent() {
        fs::create_dir_all(folder)?;
    }
    let mut target = File::create_new(to)?;
    let (mut digest, mut size, mut buffer) = (Sha256::new(), 0u64, vec![0; COPY_BYTES]);
    loop {
        let n = from.read(&mut buffer)?;
        if n == 0 {
            break;
        }
        digest.update(&buffer[..n]);
        target.write_all(&buffer[..n])?;
        size += n as u64;
    }
    target.sync_all()?;
    if hex::encode(digest.finalize()) != expected.sha256 || size != expected.size_bytes {
        return Err(io::Error::other(format!("{} is not what was stored", expected.key)));
    }
    Ok(())
}

fn digest_of(mut from: impl Read) -> io::Result<(String, u64)> {
    let (mut digest, mut size, mut buffer) = (Sha256::new(), 0u64, vec![0; COPY_BYTES]);
    loop {
        let n = from.read(&mut buffer)?;
        if n == 0 {
            return Ok((hex::encode(digest.finalize()), size));
        }
        digest.update(&buffer[..n]);
        size += n as u64;
    }
}

fn write_durably(path: &Path, bytes: &[u8]) -> io::Result<()> {
    let mut file = File::create_new(path)?;
    file.write_all(bytes)?;
    file.sync_all()?;
    match path.parent() {
        Some(folder) => File::open(folder)?.sync_all(),
        None => Ok(()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use bytes::Bytes;

    async fn with_one_recording(folder: &Path) -> (Store, StoredBlob) {
        let store = Store::open(folder).await.unwrap();
        let mut writer = store.blobs().writer().await.unwrap();
        writer.write(Bytes::from_static(b"a recording")).await.unwrap();
        let blob = writer.seal().await.unwrap().keep().await.unwrap();
        let mut connection = store.database.sqlite_writer().unwrap().acquire().await.unwrap();
        for statement in [
            "INSERT INTO organisations VALUES (zeroblob(16), 'o', 0)",
            "INSERT INTO clients (id, organisation_id, role, label, key_sha256, created_at)
             VALUES (zeroblob(16), zeroblob(16), 'admin', 'a', zeroblob(32), 0)",
            "INSERT INTO patients (id, organisation_id, pseudonym, created_at) VALUES (zeroblob(16), zeroblob(16), 'p', 0)",
            "INSERT INTO sessions (id, organisation_id, patient_id, created_by, started_at, created_at)
             VALUES (zeroblob(16), zeroblob(16), zeroblob(16), zeroblob(16), 0, 0)",
        ] {
            sqlx::query(statement).execute(&mut *connection).await.unwrap();
        }
        sqlx::query(
            "INSERT INTO recordings (id, organisation_id, session_id, created_by, size_bytes, sha256, blob_key, inspection,
                                     created_at)
             VALUES (zeroblob(16), zeroblob(16), zeroblob(16), zeroblob(16), ?1, ?2, ?3, '{}', 0)",
        )
        .bind(blob.size_bytes as i64)
        .bind(&blob.sha256)
        .bind(&blob.key)
        .execute(&mut *connection)
        .await
        .unwrap();
        drop(connection);
        (store, blob)
    }

    #[tokio::test]
    async fn what_was_backed_up_comes_back_and_a_second_time_is_refused() {
        let folder = tempfile::tempdir().unwrap();
        let at = |name: &str| folder.path().join(name);
        let (store, blob) = with_one_recording(&at("data")).await;
        let manifest = store.back_up(&at("backup")).await.unwrap();
        assert_eq!((manifest.blobs.len(), manifest.blobs[0].key.as_str()), (1, blob.key.as_str()));
        assert!(manifest.total_bytes() > blob.size_bytes);
        assert!(matches!(store.back_up(&at("backup")).await, Err(StorageError::Conflict { .. })));

        assert_eq!(restore(&at("backup"), &at("again")).await.unwrap(), manifest);
        let again = Store::open(&at("again")).await.unwrap();
        assert_eq!(again.ailments(true).await.unwrap(), []);
        let mut bytes = Vec::new();
        again.blobs().reader(&blob).await.unwrap().read_to_end(&mut bytes).unwrap();
        assert_eq!(bytes, b"a recording");
        assert!(matches!(restore(&at("backup"), &at("again")).await, Err(StorageError::Conflict { .. })));
    }

    #[tokio::test]
    async fn damage_is_named_and_a_damaged_backup_is_not_restored() {
        let folder = tempfile::tempdir().unwrap();
        let at = |name: &str| folder.path().join(name);
        let (store, blob) = with_one_recording(&at("data")).await;
        store.back_up(&at("backup")).await.unwrap();
        let codes = |ailments: Vec<Ailment>| ailments.into_iter().map(|a| a.code).collect::<Vec<_>>();
        fs::write(at("data").join(BLOB_FOLDER).join(&blob.key), b"another one").unwrap();
        assert_eq!(codes(store.ailments(false).await.unwrap()), Vec::<&str>::new());
        assert_eq!(codes(store.ailments(true).await.unwrap()), ["blob_damaged"]);
        assert!(store.back_up(&at("second")).await.is_err());
        fs::remove_file(at("data").join(BLOB_FOLDER).join(&blob.key)).unwrap();
        fs::create_dir_all(at("data").join(BLOB_FOLDER).join("zz")).unwrap();
        fs::write(at("data").join(BLOB_FOLDER).join("zz/stray"), b"stray").unwrap();
        assert_eq!(codes(store.ailments(false).await.unwrap()), ["blob_missing", "blob_unnamed"]);

        fs::write(at("backup").join(DATABASE_FILE), b"not a database").unwrap();
        assert!(restore(&at("backup"), &at("again")).await.is_err());
        assert!(!at("again").join(DATABASE_FILE).exists() || Store::open(&at("again")).await.is_err());
        assert!(restore(&at("data"), &at("third")).await.is_err(), "a data directory is no backup");
        assert_eq!(checked_path("../x"), None);
    }
}
