//! Blobs: the uploaded bytes, named by their digest.
//!
//! While bytes arrive they go to a part file in the data directory, digested on the way. Only a complete upload
//! becomes a blob: the part is synced to the disk and renamed to `<aa>/<sha256>`, so a blob is never half there and the
//! same bytes are stored once. Whatever ends an upload early (a dropped writer, a killed process) leaves no blob; a
//! part that nobody holds open any more is removed when the store is opened.
//!
//! Blobs are read through `object_store`, whose local folder is the default; another store takes the sealed part as a
//! multipart upload.

use super::StorageError;
use bytes::Bytes;
use futures::StreamExt;
use futures::stream::BoxStream;
use object_store::buffered::BufWriter;
use object_store::local::LocalFileSystem;
use object_store::path::Path as Key;
use object_store::{GetResultPayload, ObjectStore, ObjectStoreExt};
use sha2::{Digest, Sha256};
use std::fs::{self, File};
use std::io::{self, Read, Write};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use tokio::io::AsyncWriteExt;
use tokio::runtime::Handle;
use tokio::task::{JoinHandle, spawn_blocking};
use uuid::Uuid;

/// Arriving bytes are written in batches of this size: large enough that a hop to a blocking thread is cheap against
/// digesting it, small enough that many uploads fit into memory (each holds at most two batches and a chunk).
const BATCH_BYTES: usize = 512 << 10;
/// Folder of blobs in the data directory.
const BLOB_FOLDER: &str = "blobs";
/// Folder of part files in the data directory; on the same file system as the blobs, so that a rename is atomic.
const PART_FOLDER: &str = "parts";

/// Uploaded bytes at rest.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct StoredBlob {
    /// Where the blob store keeps them.
    pub key: String,
    /// SHA-256 of the bytes, lower-case hexadecimal.
    pub sha256: String,
    /// How many they are.
    pub size_bytes: u64,
}

/// The folder of blobs. A clone is another handle to the same.
#[derive(Debug, Clone)]
pub struct BlobStore {
    parts: PathBuf,
    /// The folder behind `store` when it is a local one: parts are renamed into it.
    folder: Option<PathBuf>,
    store: Arc<dyn ObjectStore>,
}

impl BlobStore {
    /// Opens the blobs of a data directory, made when absent, and removes the parts of uploads that ended early.
    ///
    /// # Errors
    /// When the directory cannot be made or read.
    pub async fn open(data_dir: &Path) -> Result<Self, StorageError> {
        let (parts, folder) = (data_dir.join(PART_FOLDER), data_dir.join(BLOB_FOLDER));
        let folder = in_background("opening the blob folder", move || {
            fs::create_dir_all(&parts)?;
            fs::create_dir_all(&folder)?;
            remove_abandoned_parts(&parts)?;
            Ok((parts, folder))
        });
        let (parts, folder) = folder.await?;
        let store = LocalFileSystem::new_with_prefix(&folder).map_err(store_error("opening the blob folder"))?;
        Ok(Self { parts, folder: Some(folder), store: Arc::new(store) })
    }

    /// Blobs in any object store; parts still wait in the local folder `parts` until they are complete.
    ///
    /// # Errors
    /// When the folder of parts cannot be made or read.
    pub async fn in_object_store(parts: PathBuf, store: Arc<dyn ObjectStore>) -> Result<Self, StorageError> {
        let parts = in_background("opening the folder of parts", move || {
            fs::create_dir_all(&parts)?;
            remove_abandoned_parts(&parts)?;
            Ok(parts)
        })
        .await?;
        Ok(Self { parts, folder: None, store })
    }

    /// Blobs in an S3 bucket; parts wait in a folder of the data directory until they are complete.
    ///
    /// # Errors
    /// When the address is not one of a bucket, the environment does not say how to reach it, or the folder cannot be made.
    #[cfg(feature = "scaleout")]
    pub async fn in_bucket(data_dir: &Path, url: &str) -> Result<Self, StorageError> {
        use object_store::aws::AmazonS3Builder;
        use object_store::prefix::PrefixStore;

        let opening = || store_error("opening the bucket");
        let bucket = AmazonS3Builder::from_env().with_url(url).build().map_err(opening())?;
        let prefix = url.split_once("://").and_then(|(_, rest)| rest.split_once('/')).map_or("", |(_, prefix)| prefix);
        let prefix = Key::parse(prefix.trim_end_matches('/')).map_err(|error| opening()(error.into()))?;
        Self::in_object_store(data_dir.join(PART_FOLDER), Arc::new(PrefixStore::new(bucket, prefix))).await
    }

    /// Begins an upload.
    ///
    /// # Errors
    /// When no part file can be made.
    pub async fn writer(&self) -> Result<BlobWriter, StorageError> {
        let path = self.parts.join(Uuid::now_v7().to_string());
        let (part, file) = in_background("making a part file", move || {
            let file = File::options().write(true).create_new(true).open(&path)?;
            let part = Part { path };
            // The lock tells `remove_abandoned_parts`, in this process or another, that the upload is alive.
            file.lock()?;
            Ok((part, file))
        })
        .await?;
        let state = WriteState { file, digest: Sha256::new() };
        Ok(BlobWriter {
            store: self.clone(),
            part,
            work: Work::Idle(state),
            batch: Vec::new(),
            batch_bytes: 0,
            size_bytes: 0,
        })
    }

    /// Succeeds when an upload could be received: the readiness check. It leaves nothing.
    ///
    /// # Errors
    /// When no part file can be made.
    pub async fn check_ready(&self) -> Result<(), StorageError> {
        self.writer().await.map(drop)
    }

    /// Opens a blob for reading on a blocking thread; it is never in memory as a whole. Whoever reads it to its end learns there
    /// whether it is what was stored.
    ///
    /// # Errors
    /// When there is no such blob, or the store fails.
    pub async fn reader(&self, blob: &StoredBlob) -> Result<BlobReader, StorageError> {
        let found = self.store.get(&Key::from(blob.key.as_str())).await.map_err(store_error("opening a blob"))?;
        let source = match found.payload {
            GetResultPayload::File(file, _) => Source::File(file),
            GetResultPayload::Stream(stream) => {
                Source::Stream { handle: Handle::current(), stream, chunk: Bytes::new() }
            }
        };
        Ok(BlobReader { source, check: Some(Check { digest: Sha256::new(), expected: blob.sha256.clone() }) })
    }

    /// Fails when a blob is not there any more. Inside the transaction that names it: blobs are removed inside of one too, so
    /// none is removed between this look and the row.
    ///
    /// # Errors
    /// When there is no such blob, or the store fails.
    pub(crate) async fn require(&self, blob: &StoredBlob) -> Result<(), StorageError> {
        let found = self.store.head(&Key::from(blob.key.as_str())).await;
        found.map(drop).map_err(store_error("looking for a blob that was just stored"))
    }

    /// Removes a blob; one that is not there is removed already.
    ///
    /// # Errors
    /// When the store fails.
    pub(crate) async fn remove(&self, key: &str) -> Result<(), StorageError> {
        match self.store.delete(&Key::from(key)).await {
            Ok(()) | Err(object_store::Error::NotFound { .. }) => {}
            Err(error) => return Err(store_error("removing a blob")(error)),
        }
        let Some(folder) = self.folder.as_ref().and_then(|folder| folder.join(key).parent().map(Path::to_owned)) else {
            return Ok(());
        };
        // The name is gone from the disk too.
        in_background("removing a blob", move || match File::open(folder) {
            Ok(folder) => folder.sync_all(),
            Err(error) if error.kind() == io::ErrorKind::NotFound => Ok(()),
            Err(error) => Err(error),
        })
        .await
    }

    /// Keys of all blobs.
    ///
    /// # Errors
    /// When the store fails.
    pub async fn keys(&self) -> Result<Vec<String>, StorageError> {
        let listed: Vec<_> = self.store.list(None).collect().await;
        let key = |found: object_store::Result<object_store::ObjectMeta>| Ok(found?.location.to_string());
        listed.into_iter().map(key).collect::<object_store::Result<_>>().map_err(store_error("listing the blobs"))
    }

    /// Makes a blob of a file that has all of `blob`'s bytes and is synced. The file stays: in a local folder the blob is a
    /// second name of it, so it must not be written any more.
    ///
    /// # Errors
    /// When the disk fails or is full.
    pub async fn keep_file(&self, file: &Path, sha256: String, size_bytes: u64) -> Result<StoredBlob, StorageError> {
        let blob = StoredBlob { key: key_of_digest(&sha256), sha256, size_bytes };
        let part = Part { path: self.parts.join(Uuid::now_v7().to_string()) };
        let source = match &self.folder {
            None => file.to_owned(),
            Some(_) => {
                let (from, to) = (file.to_owned(), part.path.clone());
                // The name among the parts is what a rename moves; where a file cannot have two names, it is a copy.
                let naming = move || fs::hard_link(&from, &to).or_else(|_| fs::copy(&from, &to).map(drop));
                in_background("naming a file as a part", naming).await?;
                part.path.clone()
            }
        };
        self.keep(&source, &blob).await?;
        Ok(blob)
    }

    async fn keep(&self, part: &Path, blob: &StoredBlob) -> Result<(), StorageError> {
        let key = Key::from(blob.key.as_str());
        let there = match self.store.head(&key).await {
            Ok(found) => found.size == blob.size_bytes,
            Err(object_store::Error::NotFound { .. }) => false,
            Err(error) => return Err(store_error("looking for a blob")(error)),
        };
        match &self.folder {
            Some(folder) => {
                let (part, target) = (part.to_owned(), folder.join(&blob.key));
                in_background("moving a part to the blobs", move || rename_durably(&part, &target, there)).await
            }
            None if there => Ok(()),
            None => {
                let copying = StorageError::blob;
                let mut part = tokio::fs::File::open(part).await.map_err(copying("reading a part file"))?;
                let mut upload = BufWriter::new(self.store.clone(), key);
                match tokio::io::copy(&mut part, &mut upload).await {
                    Ok(_) => upload.shutdown().await.map_err(copying("storing a blob")),
                    Err(error) => {
                        upload.abort().await.map_err(store_error("giving up a blob"))?;
                        Err(copying("storing a blob")(error))
                    }
                }
            }
        }
    }
}

/// A part file; it is removed when this is dropped, wherever the upload has come to. After a rename to a blob there is
/// nothing to remove.
#[derive(Debug)]
struct Part {
    path: PathBuf,
}

impl Drop for Part {
    fn drop(&mut self) {
        if let Err(error) = fs::remove_file(&self.path)
            && error.kind() != io::ErrorKind::NotFound
        {
            tracing::warn!(path = %self.path.display(), %error, "a part file could not be removed");
        }
    }
}

#[derive(Debug)]
struct WriteState {
    file: File,
    digest: Sha256,
}

impl WriteState {
    fn write(mut self, batch: &[Bytes]) -> io::Result<Self> {
        for bytes in batch {
            self.digest.update(bytes);
            self.file.write_all(bytes)?;
        }
        Ok(self)
    }
}

#[derive(Debug)]
enum Work {
    Idle(WriteState),
    Running(JoinHandle<io::Result<WriteState>>),
    Failed,
}

/// An upload under way. Dropping it ends the upload and leaves nothing.
#[derive(Debug)]
pub struct BlobWriter {
    store: BlobStore,
    part: Part,
    work: Work,
    batch: Vec<Bytes>,
    batch_bytes: usize,
    size_bytes: u64,
}

impl BlobWriter {
    /// Takes the next bytes. One batch is written in the background while the next one arrives.
    ///
    /// # Errors
    /// When the disk fails or is full; the upload is lost then.
    pub async fn write(&mut self, bytes: Bytes) -> Result<(), StorageError> {
        self.size_bytes += bytes.len() as u64;
        self.batch_bytes += bytes.len();
        self.batch.push(bytes);
        if self.batch_bytes >= BATCH_BYTES { self.flush().await } else { Ok(()) }
    }

    /// Bytes taken so far.
    pub fn size_bytes(&self) -> u64 {
        self.size_bytes
    }

    /// Ends the upload. The result says what arrived; it becomes a blob when it is kept.
    ///
    /// # Errors
    /// When the disk fails or is full.
    pub async fn seal(mut self) -> Result<SealedBlob, StorageError> {
        self.flush().await?;
        let state = self.settle().await?;
        let sha256 = hex::encode(state.digest.finalize());
        let key = key_of_digest(&sha256);
        let blob = StoredBlob { key, sha256, size_bytes: self.size_bytes };
        Ok(SealedBlob { store: self.store, part: self.part, lock: state.file, blob })
    }

    async fn flush(&mut self) -> Result<(), StorageError> {
        let state = self.settle().await?;
        let batch = std::mem::take(&mut self.batch);
        self.batch_bytes = 0;
        self.work = Work::Running(spawn_blocking(move || state.write(&batch)));
        Ok(())
    }

    async fn settle(&mut self) -> Result<WriteState, StorageError> {
        let failed = StorageError::blob("writing a part file");
        match std::mem::replace(&mut self.work, Work::Failed) {
            Work::Idle(state) => Ok(state),
            Work::Running(task) => task.await.unwrap_or_else(|panic| Err(io::Error::other(panic))).map_err(failed),
            Work::Failed => Err(failed(io::Error::other("an earlier write of this upload failed"))),
        }
    }
}

/// A complete upload that is not a blob yet. Dropping it leaves nothing.
#[derive(Debug)]
pub struct SealedBlob {
    store: BlobStore,
    part: Part,
    /// Holds the lock on the part file.
    lock: File,
    blob: StoredBlob,
}

impl SealedBlob {
    /// SHA-256 of what arrived, lower-case hexadecimal.
    pub fn sha256(&self) -> &str {
        &self.blob.sha256
    }

    /// How many bytes arrived.
    pub fn size_bytes(&self) -> u64 {
        self.blob.size_bytes
    }

    /// Reads what arrived, for a look before it is kept.
    ///
    /// # Errors
    /// When the part file cannot be opened.
    pub fn reader(&self) -> Result<BlobReader, StorageError> {
        let file = File::open(&self.part.path).map_err(StorageError::blob("reading a part file"))?;
        Ok(BlobReader { source: Source::File(file), check: None })
    }

    /// Makes it a blob; when this returns, the bytes are on the disk under their name.
    ///
    /// # Errors
    /// When the disk fails or is full.
    pub async fn keep(self) -> Result<StoredBlob, StorageError> {
        self.store.keep(&self.part.path, &self.blob).await?;
        drop(self.lock);
        Ok(self.blob)
    }
}

/// A blob being read. Reads block: use it on a blocking thread.
pub struct BlobReader {
    source: Source,
    check: Option<Check>,
}

/// The digest of what was read, and what it is to be.
struct Check {
    digest: Sha256,
    expected: String,
}

impl Check {
    /// Takes what was read; nothing is the end.
    fn take(&mut self, bytes: &[u8]) -> io::Result<()> {
        self.digest.update(bytes);
        if bytes.is_empty() && hex::encode(self.digest.clone().finalize()) != self.expected {
            return Err(io::Error::other(
                "the stored bytes are not what was stored: a disk or a person has changed them",
            ));
        }
        Ok(())
    }
}

enum Source {
    File(File),
    Stream { handle: Handle, stream: BoxStream<'static, object_store::Result<Bytes>>, chunk: Bytes },
}

impl std::fmt::Debug for BlobReader {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str("BlobReader(…)")
    }
}

impl Read for BlobReader {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        let n = self.source.read(buffer)?;
        if let Some(check) = self.check.as_mut().filter(|_| !buffer.is_empty()) {
            check.take(&buffer[..n])?;
        }
        Ok(n)
    }
}

impl Source {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        match self {
            Self::File(file) => file.read(buffer),
            Self::Stream { handle, stream, chunk } => {
                while chunk.is_empty() {
                    match handle.block_on(stream.next()) {
                        Some(next) => *chunk = next.map_err(io::Error::other)?,
                        None => return Ok(0),
                    }
                }
                let n = chunk.len().min(buffer.len());
                buffer[..n].copy_from_slice(&chunk.split_to(n));
                Ok(n)
            }
        }
    }
}

/// Where bytes are kept, by their digest in hexadecimal.
pub(super) fn key_of_digest(sha256: &str) -> String {
    format!("{}/{sha256}", sha256.get(..2).unwrap_or_default())
}

async fn in_background<T: Send + 'static>(
    doing: &'static str,
    work: impl FnOnce() -> io::Result<T> + Send + 'static,
) -> Result<T, StorageError> {
    spawn_blocking(work).await.unwrap_or_else(|panic| Err(io::Error::other(panic))).map_err(StorageError::blob(doing))
}

fn store_error(doing: &'static str) -> impl FnOnce(object_store::Error) -> StorageError {
    move |error| StorageError::Blob { doing, source: io::Error::other(error) }
}

/// Syncs the part, gives it its name, and syncs the folders, in this order: a name on the disk never stands for bytes
/// that are not. When the blob is `there` already the part is left to be dropped, but the folder is still synced,
/// because the upload that stored it may not have come to that yet.
fn rename_durably(part: &Path, target: &Path, there: bool) -> io::Result<()> {
    let folder = target.parent().ok_or_else(|| io::Error::other("a blob's key has no folder"))?;
    if !there {
        File::open(part)?.sync_all()?;
        if !folder.is_dir() {
            fs::create_dir_all(folder)?;
            if let Some(above) = folder.parent() {
                File::open(above)?.sync_all()?;
            }
        }
        fs::rename(part, target)?;
    }
    File::open(folder)?.sync_all()
}

/// Removes the parts whose lock nobody holds: their uploads ended with their process.
fn remove_abandoned_parts(parts: &Path) -> io::Result<()> {
    for entry in fs::read_dir(parts)? {
        let path = entry?.path();
        // Another process may finish its upload between the listing and the look.
        let Ok(file) = File::open(&path) else { continue };
        if file.try_lock().is_ok() && fs::remove_file(&path).is_ok() {
            tracing::info!(path = %path.display(), "removed the part of an upload that ended early");
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests;
