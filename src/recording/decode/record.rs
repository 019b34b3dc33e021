//! Fields of the few MCAP records that matter, read in place.
//!
//! The container's framing, end and checksums are the `mcap` crate's; its record parser is not used because it
//! reserves memory for lengths that it has not yet seen the bytes of (up to 4 GiB for one string).

use std::collections::BTreeMap;

/// Opcodes of the records that matter.
pub(super) mod opcode {
    pub(in super::super) use mcap::records::op::{CHANNEL, CHUNK, DATA_END, HEADER, MESSAGE, METADATA, STATISTICS};
}

/// A record that is shorter than its own fields say, or whose text is not UTF-8.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Malformed;

/// Cursor over the fields of one record; numbers are little-endian.
pub(super) struct Fields<'a>(&'a [u8]);

impl<'a> Fields<'a> {
    pub(super) fn new(record: &'a [u8]) -> Self {
        Self(record)
    }

    /// Bytes that were not read yet.
    pub(super) fn rest(&self) -> &'a [u8] {
        self.0
    }

    pub(super) fn bytes(&mut self, n: u64) -> Result<&'a [u8], Malformed> {
        let n = usize::try_from(n).map_err(|_| Malformed)?;
        let (taken, rest) = self.0.split_at_checked(n).ok_or(Malformed)?;
        self.0 = rest;
        Ok(taken)
    }

    fn array<const N: usize>(&mut self) -> Result<[u8; N], Malformed> {
        let (taken, rest) = self.0.split_first_chunk().ok_or(Malformed)?;
        self.0 = rest;
        Ok(*taken)
    }

    pub(super) fn u8(&mut self) -> Result<u8, Malformed> {
        Ok(self.array::<1>()?[0])
    }

    pub(super) fn u16(&mut self) -> Result<u16, Malformed> {
        Ok(u16::from_le_bytes(self.array()?))
    }

    pub(super) fn u32(&mut self) -> Result<u32, Malformed> {
        Ok(u32::from_le_bytes(self.array()?))
    }

    pub(super) fn u64(&mut self) -> Result<u64, Malformed> {
        Ok(u64::from_le_bytes(self.array()?))
    }

    pub(super) fn text(&mut self) -> Result<&'a str, Malformed> {
        let length = self.u32()?;
        std::str::from_utf8(self.bytes(length.into())?).map_err(|_| Malformed)
    }

    /// Map of texts; the last of equal keys counts.
    pub(super) fn map(&mut self) -> Result<BTreeMap<&'a str, &'a str>, Malformed> {
        let length = self.u32()?;
        let mut entries = Fields(self.bytes(length.into())?);
        let mut map = BTreeMap::new();
        while !entries.0.is_empty() {
            let key = entries.text()?;
            map.insert(key, entries.text()?);
        }
        Ok(map)
    }
}

/// Channel record.
pub(super) struct Channel<'a> {
    pub(super) id: u16,
    pub(super) topic: &'a str,
    pub(super) message_encoding: &'a str,
    pub(super) metadata: BTreeMap<&'a str, &'a str>,
}

impl<'a> Channel<'a> {
    pub(super) fn parse(record: &'a [u8]) -> Result<Self, Malformed> {
        let mut fields = Fields::new(record);
        let id = fields.u16()?;
        fields.u16()?;
        Ok(Self { id, topic: fields.text()?, message_encoding: fields.text()?, metadata: fields.map()? })
    }
}

/// Message record.
pub(super) struct Message<'a> {
    pub(super) channel: u16,
    pub(super) log_time: u64,
    pub(super) data: &'a [u8],
}

impl<'a> Message<'a> {
    pub(super) fn parse(record: &'a [u8]) -> Result<Self, Malformed> {
        let mut fields = Fields::new(record);
        let channel = fields.u16()?;
        fields.u32()?;
        let log_time = fields.u64()?;
        fields.u64()?;
        Ok(Self { channel, log_time, data: fields.rest() })
    }
}

/// Chunk record.
pub(super) struct Chunk<'a> {
    pub(super) uncompressed_size: u64,
    pub(super) uncompressed_crc: u32,
    pub(super) compression: &'a str,
    pub(super) data: &'a [u8],
}

impl<'a> Chunk<'a> {
    pub(super) fn parse(record: &'a [u8]) -> Result<Self, Malformed> {
        let mut fields = Fields::new(record);
        fields.u64()?;
        fields.u64()?;
        let uncompressed_size = fields.u64()?;
        let uncompressed_crc = fields.u32()?;
        let compression = fields.text()?;
        let compressed_size = fields.u64()?;
        Ok(Self { uncompressed_size, uncompressed_crc, compression, data: fields.bytes(compressed_size)? })
    }
}

/// Counts of a statistics record.
#[derive(Debug, PartialEq, Eq)]
pub(super) struct Statistics {
    pub(super) messages: u64,
    pub(super) chunks: u32,
}

impl Statistics {
    pub(super) fn parse(record: &[u8]) -> Result<Self, Malformed> {
        let mut fields = Fields::new(record);
        let messages = fields.u64()?;
        fields.u16()?;
        fields.u32()?;
        fields.u32()?;
        fields.u32()?;
        Ok(Self { messages, chunks: fields.u32()? })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn any_bytes_are_parsed_or_refused_without_panic(bytes in prop::collection::vec(any::<u8>(), 0..200)) {
            let _ = Channel::parse(&bytes);
            let _ = Message::parse(&bytes);
            let _ = Chunk::parse(&bytes);
            let _ = Statistics::parse(&bytes);
            let _ = Fields::new(&bytes).map();
        }
    }

    #[test]
    fn a_length_beyond_the_record_is_refused_before_memory_is_taken() {
        assert!(Fields::new(&[0xff, 0xff, 0xff, 0xff, b'a']).text().is_err());
    }
}
