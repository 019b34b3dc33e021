//! The bytes of one chunk.
//!
//! ```text
//! f32   byte planes (all first bytes, all second bytes, …), zstd
//! u8    zstd
//! i64   differences from the sample before (the first from 0, wrapping), byte planes, zstd
//! ```
//!
//! The high bytes of neighbouring floats are alike and the low bytes are noise: in planes of their own the alike ones
//! compress. Every bit survives, those of a NaN too. Each zstd frame carries a checksum, so damage is found on reading.

use crate::assessment::Series;
use crate::storage::StorageError;
use std::ops::Range;
use zstd::bulk::{Compressor, Decompressor};
use zstd::zstd_safe::CParameter;

/// zstd level: higher ones gain under 2 % on angle series and cost several times the computation.
const LEVEL: i32 = 3;

/// One chunk of sample times.
#[derive(Debug)]
pub(super) struct TimeChunk {
    pub(super) n_samples: usize,
    pub(super) first_ns: i64,
    pub(super) last_ns: i64,
    pub(super) bytes: Vec<u8>,
}

/// One chunk of one channel.
#[derive(Debug)]
pub(super) struct SeriesChunk {
    /// Smallest and largest finite value; `None` when no value is finite.
    pub(super) value_range: Option<(f64, f64)>,
    pub(super) value: Vec<u8>,
    pub(super) low: Vec<u8>,
    pub(super) high: Vec<u8>,
    pub(super) flags: Vec<u8>,
}

/// Codes chunks one after the other with one context.
pub(in crate::storage) struct Encoder {
    zstd: Compressor<'static>,
}

impl Encoder {
    pub(in crate::storage) fn new() -> Result<Self, StorageError> {
        let mut zstd = Compressor::new(LEVEL).map_err(not_coded)?;
        zstd.set_parameter(CParameter::ChecksumFlag(true)).map_err(not_coded)?;
        Ok(Self { zstd })
    }

    pub(super) fn encode_time(&mut self, time_ns: &[i64]) -> Result<TimeChunk, StorageError> {
        let (Some(&first_ns), Some(&last_ns)) = (time_ns.first(), time_ns.last()) else {
            return Err(StorageError::Corrupt("a chunk without samples".into()));
        };
        Ok(TimeChunk { n_samples: time_ns.len(), first_ns, last_ns, bytes: self.encode_times(time_ns)? })
    }

    pub(super) fn encode_series(&mut self, series: &Series, range: Range<usize>) -> Result<SeriesChunk, StorageError> {
        let value = &series.value[range.clone()];
        let finite = || value.iter().copied().filter(|v| v.is_finite());
        let value_range = finite()
            .next()
            .map(|first| (f64::from(finite().fold(first, f32::min)), f64::from(finite().fold(first, f32::max))));
        Ok(SeriesChunk {
            value_range,
            value: self.encode_f32(value)?,
            low: self.encode_f32(&series.low[range.clone()])?,
            high: self.encode_f32(&series.high[range.clone()])?,
            flags: self.compress(&series.flags[range])?,
        })
    }

    fn encode_f32(&mut self, values: &[f32]) -> Result<Vec<u8>, StorageError> {
        let words: Vec<[u8; 4]> = values.iter().map(|v| v.to_le_bytes()).collect();
        self.compress(&planes(&words))
    }

    /// Floats of any number, in one piece.
    pub(in crate::storage) fn encode_floats(&mut self, values: &[f32]) -> Result<Vec<u8>, StorageError> {
        self.encode_f32(values)
    }

    /// Times of any number, in one piece: differences.
    pub(in crate::storage) fn encode_times(&mut self, time_ns: &[i64]) -> Result<Vec<u8>, StorageError> {
        self.compress(&planes(&differences(time_ns)))
    }

    fn compress(&mut self, bytes: &[u8]) -> Result<Vec<u8>, StorageError> {
        self.zstd.compress(bytes).map_err(not_coded)
    }
}

fn differences(time_ns: &[i64]) -> Vec<[u8; 8]> {
    let mut before = 0i64;
    let difference = |&t: &i64| {
        let difference = t.wrapping_sub(before);
        before = t;
        difference.to_le_bytes()
    };
    time_ns.iter().map(difference).collect()
}

fn planes<const N: usize>(words: &[[u8; N]]) -> Vec<u8> {
    (0..N).flat_map(|byte| words.iter().map(move |word| word[byte])).collect()
}

/// Decodes chunks one after the other with one set of buffers.
pub(in crate::storage) struct Decoder {
    zstd: Decompressor<'static>,
    bytes: Vec<u8>,
    most_values: usize,
}

impl Decoder {
    pub(in crate::storage) fn new() -> Result<Self, StorageError> {
        Self::of_pieces(super::CHUNK_SAMPLES)
    }

    /// A decoder of pieces of at most so many values.
    pub(in crate::storage) fn of_pieces(most_values: usize) -> Result<Self, StorageError> {
        Ok(Self { zstd: Decompressor::new().map_err(damaged)?, bytes: Vec::new(), most_values })
    }

    /// Appends `n` floats.
    pub(in crate::storage) fn decode_f32(
        &mut self,
        chunk: &[u8],
        n: usize,
        into: &mut Vec<f32>,
    ) -> Result<(), StorageError> {
        let bytes = self.decompress(chunk, n, 4)?;
        let (first, rest) = bytes.split_at(n);
        let (second, rest) = rest.split_at(n);
        let (third, fourth) = rest.split_at(n);
        let planes = first.iter().zip(second).zip(third).zip(fourth);
        into.extend(planes.map(|(((a, b), c), d)| f32::from_le_bytes([*a, *b, *c, *d])));
        Ok(())
    }

    /// Appends `n` bytes.
    pub(super) fn decode_u8(&mut self, chunk: &[u8], n: usize, into: &mut Vec<u8>) -> Result<(), StorageError> {
        into.extend_from_slice(self.decompress(chunk, n, 1)?);
        Ok(())
    }

    /// Appends `n` times.
    pub(in crate::storage) fn decode_time(
        &mut self,
        chunk: &[u8],
        n: usize,
        into: &mut Vec<i64>,
    ) -> Result<(), StorageError> {
        let bytes = self.decompress(chunk, n, 8)?;
        let mut time = 0i64;
        into.extend((0..n).map(|i| {
            time = time.wrapping_add(i64::from_le_bytes(std::array::from_fn(|byte| bytes[byte * n + i])));
            time
        }));
        Ok(())
    }

    fn decompress(&mut self, chunk: &[u8], n: usize, width: usize) -> Result<&[u8], StorageError> {
        if n > self.most_values {
            return Err(StorageError::Corrupt(format!("a chunk of {n} values")));
        }
        self.bytes.resize(self.bytes.len().max(n * width), 0);
        let found = self.zstd.decompress_to_buffer(chunk, &mut self.bytes[..n * width]).map_err(damaged)?;
        if found != n * width {
            return Err(StorageError::Corrupt(format!("a chunk of {found} bytes where {} belong", n * width)));
        }
        Ok(&self.bytes[..found])
    }
}

fn damaged(error: std::io::Error) -> StorageError {
    StorageError::Corrupt(format!("a chunk could not be read: {error}"))
}

fn not_coded(error: std::io::Error) -> StorageError {
    StorageError::Corrupt(format!("a chunk could not be compressed: {error}"))
}
