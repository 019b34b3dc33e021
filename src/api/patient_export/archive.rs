//! A ZIP archive that is written while it is sent: what is in memory does not grow with it.

use bytes::Bytes;
use serde::Serialize;
use sha2::{Digest, Sha256};
use std::io::{self, Write};
use std::mem;
use std::sync::{Arc, Mutex, PoisonError};
use tokio::sync::mpsc;
use utoipa::ToSchema;
use zip::write::{SimpleFileOptions, StreamWriter};
use zip::{CompressionMethod, ZipWriter};

/// Bytes that are sent at a time.
const PIECE: usize = 64 << 10;

/// A file of the archive, as the manifest lists it.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, ToSchema)]
pub struct ManifestFile {
    /// Its path in the archive.
    pub path: String,
    /// Bytes.
    pub size_bytes: u64,
    /// SHA-256 of the bytes, lower-case hexadecimal.
    pub sha256: String,
}

/// What has been written and not been sent.
#[derive(Debug, Clone, Default)]
struct Waiting(Arc<Mutex<Vec<u8>>>);

impl Waiting {
    fn take_when(&self, least: usize) -> Option<Vec<u8>> {
        // Nothing panics while it holds the lock.
        let mut bytes = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        (bytes.len() >= least && !bytes.is_empty()).then(|| mem::take(&mut *bytes))
    }
}

impl Write for Waiting {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner).extend_from_slice(bytes);
        Ok(bytes.len())
    }

    fn flush(&mut self) -> io::Result<()> {
        Ok(())
    }
}

/// The archive; files are written one after the other.
pub(super) struct Archive {
    zip: ZipWriter<StreamWriter<Waiting>>,
    waiting: Waiting,
    receiver: mpsc::Sender<io::Result<Bytes>>,
    files: Vec<ManifestFile>,
    digest: Sha256,
}

impl Archive {
    pub(super) fn new(receiver: mpsc::Sender<io::Result<Bytes>>) -> Self {
        let waiting = Waiting::default();
        let zip = ZipWriter::new_stream(waiting.clone());
        Self { zip, waiting, receiver, files: Vec::new(), digest: Sha256::new() }
    }

    /// Begins a file. Text is compressed, recordings are already.
    pub(super) fn begin(&mut self, path: String) -> io::Result<()> {
        let is_packed = path.ends_with(".mcap");
        let method = if is_packed { CompressionMethod::Stored } else { CompressionMethod::Deflated };
        let options = SimpleFileOptions::default().compression_method(method).large_file(true).unix_permissions(0o600);
        self.zip.start_file(path.as_str(), options)?;
        self.digest = Sha256::new();
        self.files.push(ManifestFile { path, size_bytes: 0, sha256: String::new() });
        Ok(())
    }

    /// Writes more of the file.
    pub(super) async fn write(&mut self, bytes: &[u8]) -> io::Result<()> {
        self.digest.update(bytes);
        if let Some(file) = self.files.last_mut() {
            file.size_bytes += bytes.len() as u64;
        }
        self.zip.write_all(bytes)?;
        self.send(PIECE).await
    }

    /// Ends the file.
    pub(super) fn end(&mut self) {
        let digest = mem::take(&mut self.digest);
        if let Some(file) = self.files.last_mut() {
            file.sha256 = hex::encode(digest.finalize());
        }
    }

    /// Writes a whole file of JSON.
    pub(super) async fn json(&mut self, path: &str, value: &impl Serialize) -> io::Result<()> {
        self.begin(path.to_owned())?;
        let text = serde_json::to_vec_pretty(value)?;
        self.write(&text).await?;
        self.end();
        Ok(())
    }

    /// The files so far.
    pub(super) fn files(&self) -> &[ManifestFile] {
        &self.files
    }

    /// Ends the archive.
    pub(super) async fn finish(self) -> io::Result<()> {
        self.zip.finish()?;
        send(&self.waiting, &self.receiver, 0).await
    }

    async fn send(&mut self, least: usize) -> io::Result<()> {
        send(&self.waiting, &self.receiver, least).await
    }
}

async fn send(waiting: &Waiting, receiver: &mpsc::Sender<io::Result<Bytes>>, least: usize) -> io::Result<()> {
    let Some(bytes) = waiting.take_when(least) else { return Ok(()) };
    let gone = |_| io::Error::new(io::ErrorKind::BrokenPipe, "whoever wanted the archive has gone");
    receiver.send(Ok(bytes.into())).await.map_err(gone)
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::io::Read;

    #[tokio::test]
    async fn what_is_sent_piece_by_piece_is_an_archive() {
        let (sender, mut pieces) = mpsc::channel(2);
        let writing = tokio::spawn(async move {
            let mut archive = Archive::new(sender);
            archive.json("a.json", &["b"]).await.unwrap();
            archive.begin("recordings/x.mcap".to_owned()).unwrap();
            for i in 0..300_u32 {
                archive.write(&i.to_be_bytes().repeat(256)).await.unwrap();
            }
            archive.end();
            let files = archive.files().to_vec();
            archive.finish().await.unwrap();
            files
        });
        let (mut whole, mut longest) = (Vec::new(), 0);
        while let Some(piece) = pieces.recv().await {
            let piece = piece.unwrap();
            longest = longest.max(piece.len());
            whole.extend_from_slice(&piece);
        }
        let files = writing.await.unwrap();
        assert!(longest < 2 * PIECE, "{longest}");
        assert_eq!(files[1].size_bytes, 300 * 1024);
        let mut archive = zip::ZipArchive::new(io::Cursor::new(whole)).unwrap();
        let mut bytes = Vec::new();
        archive.by_name("recordings/x.mcap").unwrap().read_to_end(&mut bytes).unwrap();
        assert_eq!((bytes.len(), hex::encode(Sha256::digest(&bytes))), (300 * 1024, files[1].sha256.clone()));
    }
}
