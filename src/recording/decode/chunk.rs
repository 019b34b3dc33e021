//! One MCAP chunk, decompressed into bounded memory and checked before anything in it is believed.

use super::record::{Chunk, Fields, Malformed};
use crate::recording::DecodeError;
use std::borrow::Cow;
use std::io::Read;

/// The chunk's records, decompressed, with their checksum verified; at most `limit` bytes.
pub(super) fn open<'a>(chunk: &Chunk<'a>, limit: usize) -> Result<Cow<'a, [u8]>, DecodeError> {
    if chunk.uncompressed_size > limit as u64 {
        let sentence = format!(
            "a chunk holds {} bytes after decompression, at most {limit} are accepted; write smaller chunks",
            chunk.uncompressed_size
        );
        return Err(DecodeError::new("decompression_limit", sentence));
    }
    let size = chunk.uncompressed_size;
    let content = match chunk.compression {
        "" => Cow::Borrowed(chunk.data),
        "zstd" => match zstd::stream::read::Decoder::with_buffer(chunk.data) {
            Ok(decoder) => Cow::Owned(read_at_most(decoder, size)?),
            Err(error) => return Err(corrupt(&error)),
        },
        "lz4" => match lz4::Decoder::new(chunk.data) {
            Ok(decoder) => Cow::Owned(read_at_most(decoder, size)?),
            Err(error) => return Err(corrupt(&error)),
        },
        other => {
            let shown: String = other.chars().take(16).collect();
            let sentence = format!("chunks are compressed with `{shown}`; use `zstd`, `lz4` or none");
            return Err(DecodeError::new("unsupported_compression", sentence));
        }
    };
    if content.len() as u64 != size {
        let sentence =
            format!("a chunk holds {} bytes where its header says {size}; send the recording again", content.len());
        return Err(DecodeError::new("checksum_mismatch", sentence));
    }
    // Zero means that the writer computed none.
    if chunk.uncompressed_crc != 0 {
        let mut crc = flate2::Crc::new();
        crc.update(&content);
        if crc.sum() != chunk.uncompressed_crc {
            let sentence = format!(
                "a chunk's checksum is {:08x}, its header says {:08x}: the bytes changed on the way; send the recording again",
                crc.sum(),
                chunk.uncompressed_crc
            );
            return Err(DecodeError::new("checksum_mismatch", sentence));
        }
    }
    Ok(content)
}

/// Reads one byte more than allowed, so that a longer content shows.
fn read_at_most(decoder: impl Read, size: u64) -> Result<Vec<u8>, DecodeError> {
    let mut content = Vec::new();
    decoder.take(size + 1).read_to_end(&mut content).map_err(|error| corrupt(&error))?;
    Ok(content)
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
