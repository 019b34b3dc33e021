//! One MCAP chunk, decompressed into bounded memory and checked before anything in it is believed.

use super::record::{Chunk, Fields, Malformed};
use crate::recording::DecodeError;
use std::io::Read;
use zstd::bulk::Decompressor;

/// Opens chunks one after the other into the same memory.
#[derive(Default)]
pub(super) struct Opener {
    zstd: Option<Decompressor<'static>>,
    content: Vec<u8>,
}

impl Opener {
    /// The chunk's records, decompressed, with their checksum verified; at most `limit` bytes.
    pub(super) fn open<'a>(&'a mut self, chunk: &Chunk<'a>, limit: usize) -> Result<&'a [u8], DecodeError> {
        let content = self.decompress(chunk, limit)?;
        check(content, chunk)?;
        Ok(content)
    }

    fn decompress<'a>(&'a mut self, chunk: &Chunk<'a>, limit: usize) -> Result<&'a [u8], DecodeError> {
        let size = usize::try_from(chunk.uncompressed_size).unwrap_or(usize::MAX);
        if size > limit {
            let sentence = format!(
                "a chunk holds {size} bytes after decompression, at most {limit} are accepted; write smaller chunks"
            );
            return Err(DecodeError::new("decompression_limit", sentence));
        }
        self.content.clear();
        match chunk.compression {
            "" => return Ok(chunk.data),
            "zstd" => {
                let zstd = match &mut self.zstd {
                    Some(zstd) => zstd,
                    none => none.insert(Decompressor::new().map_err(|error| corrupt(&error))?),
                };
                // Reserved is not used: the system gives pages to what is written, which is never more than the limit.
                self.content.reserve_exact(size);
                zstd.decompress_to_buffer(chunk.data, &mut self.content).map_err(|error| corrupt(&error))?;
            }
            "lz4" => {
                let decoder = lz4::Decoder::new(chunk.data).map_err(|error| corrupt(&error))?;
                // One byte more than allowed, so that a longer content shows.
                let mut decoder = decoder.take(chunk.uncompressed_size + 1);
                decoder.read_to_end(&mut self.content).map_err(|error| corrupt(&error))?;
            }
            other => {
                let shown: String = other.chars().take(16).collect();
                let sentence = format!("chunks are compressed with `{shown}`; use `zstd`, `lz4` or none");
                return Err(DecodeError::new("unsupported_compression", sentence));
            }
        }
        Ok(&self.content)
    }
}

fn check(content: &[u8], chunk: &Chunk<'_>) -> Result<(), DecodeError> {
    let size = chunk.uncompressed_size;
    if content.len() as u64 != size {
        let sentence =
            format!("a chunk holds {} bytes where its header says {size}; send the recording again", content.len());
        return Err(DecodeError::new("checksum_mismatch", sentence));
    }
    // Zero means that the writer computed none.
    if chunk.uncompressed_crc != 0 {
        let mut crc = flate2::Crc::new();
        crc.update(content);
        if crc.sum() != chunk.uncompressed_crc {
            let sentence = format!(
                "a chunk's checksum is {:08x}, its header says {:08x}: the bytes changed on the way; send the recording again",
                crc.sum(),
                chunk.uncompressed_crc
            );
            return Err(DecodeError::new("checksum_mismatch", sentence));
        }
    }
    Ok(())
}

fn corrupt(error: &std::io::Error) -> DecodeError {
    let sentence =
        format!("a chunk cannot be decompressed ({error}): the bytes changed on the way; send the recording again");
    DecodeError::new("checksum_mismatch", sentence)
}

/// The next record `(opcode, body)` of a chunk's content.
pub(super) fn next_record<'a>(content: &mut Fields<'a>) -> Option<Result<(u8, &'a [u8]), Malformed>> {
    if content.rest().is_empty() {
        return None;
    }
    Some(content.u8().and_then(|opcode| {
        let length = content.u64()?;
        Ok((opcode, content.bytes(length)?))
    }))
}
