//! The bytes of uploads under way: one file for each, in a folder of the data directory.
//!
//! Whoever is told that bytes have arrived can rely on it: they were synced to the disk before. An addition that fails, for
//! lack of room or otherwise, is cut off again, so that the file is as long as what was promised. The last bytes of an upload
//! are written only when all of it has been found sound: a file is never as long as its recording before that.

use crate::storage::{ResumableUploadId, StorageError};
use bytes::Bytes;
use futures::StreamExt;
use std::io::{self, SeekFrom};
use std::path::{Path, PathBuf};
use std::time::Duration;
use tokio::fs::{self, File};
use tokio::io::{AsyncSeekExt, AsyncWriteExt};
use tus_protocol::async_trait::async_trait;
use tus_protocol::{AppendRequest, ChunkStream, ConcatRequest, Error, Storage, StorageHandle, UploadId};

/// Folder of the files in the data directory; on the same file system as the blobs.
const FOLDER: &str = "resumable";

/// The files of uploads under way. A clone is another handle to the same folder.
#[derive(Debug, Clone)]
pub struct PartialFiles {
    folder: PathBuf,
}

impl PartialFiles {
    /// Those of a data directory. Their folder is made with the first upload.
    pub fn in_directory(data_dir: &Path) -> Self {
        Self { folder: data_dir.join(FOLDER) }
    }

    /// The file of an upload, which need not be there.
    pub fn path(&self, id: ResumableUploadId) -> PathBuf {
        self.folder.join(id.to_string())
    }

    /// Ids of the uploads that have a file here; of whatever else lies in the folder, nothing is said.
    ///
    /// # Errors
    /// When the folder cannot be read.
    pub async fn ids(&self) -> Result<Vec<ResumableUploadId>, StorageError> {
        let reading = || StorageError::blob("listing the files of uploads");
        let mut entries = match fs::read_dir(&self.folder).await {
            Err(error) if error.kind() == io::ErrorKind::NotFound => return Ok(Vec::new()),
            entries => entries.map_err(reading())?,
        };
        let mut ids = Vec::new();
        while let Some(entry) = entries.next_entry().await.map_err(reading())? {
            ids.extend(entry.file_name().to_str().and_then(|name| name.parse::<ResumableUploadId>().ok()));
        }
        Ok(ids)
    }

    /// How many bytes of an upload are on this disk; none when it has no file here.
    ///
    /// # Errors
    /// When the disk fails.
    pub async fn size_bytes(&self, id: ResumableUploadId) -> Result<Option<u64>, StorageError> {
        size_of(&self.path(id)).await.map_err(StorageError::blob("looking at the file of an upload"))
    }

    /// Time since the file of an upload was written; none when it has no file here.
    ///
    /// # Errors
    /// When the disk fails.
    pub async fn age(&self, id: ResumableUploadId) -> Result<Option<Duration>, StorageError> {
        let modified = match fs::metadata(self.path(id)).await {
            Err(error) if error.kind() == io::ErrorKind::NotFound => return Ok(None),
            found => found.and_then(|found| found.modified()),
        };
        let modified = modified.map_err(StorageError::blob("looking at the file of an upload"))?;
        // A file from the future was written by a clock that has been set back since.
        Ok(Some(modified.elapsed().unwrap_or_default()))
    }

    /// Removes the file of an upload, if there is one.
    ///
    /// # Errors
    /// When the disk fails.
    pub async fn remove(&self, id: ResumableUploadId) -> Result<(), StorageError> {
        removed(&self.path(id)).await.map_err(StorageError::blob("removing the file of an upload"))
    }

    /// The file that a handle names. Names that could lead elsewhere are refused, wherever they come from.
    fn file_of(&self, name: &str) -> Result<PathBuf, Error> {
        name.parse::<UploadId>()?;
        if name.starts_with('.') {
            return Err(Error::InvalidUploadId("a name of a file must not begin with a point".into()));
        }
        Ok(self.folder.join(name))
    }
}

#[async_trait]
impl Storage for PartialFiles {
    fn name(&self) -> &'static str {
        "files"
    }

    async fn create(&self, upload_id: &str) -> Result<StorageHandle, Error> {
        let path = self.file_of(upload_id)?;
        let failed = failed("making the file of an upload");
        fs::create_dir_all(&self.folder).await.map_err(&failed)?;
        let file = File::options().write(true).create_new(true).open(&path).await.map_err(&failed)?;
        file.sync_all().await.map_err(&failed)?;
        sync_folder(&self.folder).await.map_err(&failed)?;
        Ok(StorageHandle::new(upload_id))
    }

    async fn append(&self, request: AppendRequest) -> Result<StorageHandle, Error> {
        let AppendRequest { handle, expected_offset, data, .. } = request;
        let path = self.file_of(handle.key())?;
        let failed = failed("writing the file of an upload");
        // A file that a restored backup does not bring back begins anew.
        let options = File::options().write(true).create(expected_offset == 0).truncate(false).clone();
        let mut file = options.open(&path).await.map_err(&failed)?;
        let actual = file.metadata().await.map_err(&failed)?.len();
        if actual != expected_offset {
            return Err(Error::OffsetMismatch { expected: actual, actual: expected_offset });
        }
        let written = write_at(&mut file, expected_offset, data).await;
        if let Err(error) = written {
            cut_off(&mut file, expected_offset).await.map_err(&failed)?;
            return Err(failed(error));
        }
        Ok(handle)
    }

    async fn concat(&self, _: ConcatRequest) -> Result<StorageHandle, Error> {
        Err(Error::ExtensionNotSupported("concatenation".into()))
    }

    async fn delete(&self, handle: &StorageHandle) -> Result<(), Error> {
        removed(&self.file_of(handle.key())?).await.map_err(failed("removing the file of an upload"))
    }

    async fn size(&self, handle: &StorageHandle) -> Result<Option<u64>, Error> {
        size_of(&self.file_of(handle.key())?).await.map_err(failed("looking at the file of an upload"))
    }
}

/// Writes what comes and syncs it. The last piece is held back until the end was good.
async fn write_at(file: &mut File, offset: u64, data: ChunkStream) -> io::Result<()> {
    file.seek(SeekFrom::Start(offset)).await?;
    match data {
        ChunkStream::Buffered(bytes) => file.write_all(&bytes).await?,
        ChunkStream::Stream(mut chunks) => {
            let mut last = Bytes::new();
            while let Some(chunk) = chunks.next().await {
                file.write_all(&std::mem::replace(&mut last, chunk?)).await?;
            }
            file.write_all(&last).await?;
        }
    }
    file.flush().await?;
    file.sync_data().await
}

async fn cut_off(file: &mut File, offset: u64) -> io::Result<()> {
    // What a writing in the background still has to say was said by the error that led here.
    let _ = file.flush().await;
    file.set_len(offset).await?;
    file.sync_data().await
}

async fn sync_folder(folder: &Path) -> io::Result<()> {
    File::open(folder).await?.sync_all().await
}

/// The length of a file, after its bytes have been synced: those of a process that died are promised only from here on.
async fn size_of(path: &Path) -> io::Result<Option<u64>> {
    let file = match File::open(path).await {
        Err(error) if error.kind() == io::ErrorKind::NotFound => return Ok(None),
        file => file?,
    };
    file.sync_data().await?;
    Ok(Some(file.metadata().await?.len()))
}

async fn removed(path: &Path) -> io::Result<()> {
    match fs::remove_file(path).await {
        Err(error) if error.kind() == io::ErrorKind::NotFound => Ok(()),
        result => result,
    }
}

fn failed(doing: &'static str) -> impl Fn(io::Error) -> Error {
    move |source| Error::storage(StorageError::Blob { doing, source })
}
