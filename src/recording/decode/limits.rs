//! The two formats, and how much of one is accepted.

use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

/// Encoding of an upload.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
#[serde(rename_all = "snake_case")]
pub enum Format {
    /// MCAP with the profile `surefoot`.
    Mcap,
    /// One JSON document.
    Json,
}

impl Format {
    /// Recognises a format by the first bytes of an upload; eight are enough, unless JSON begins with blanks.
    pub fn sniff(first_bytes: &[u8]) -> Option<Format> {
        if first_bytes.starts_with(mcap::MAGIC) {
            return Some(Format::Mcap);
        }
        let text = first_bytes.strip_prefix(BYTE_ORDER_MARK).unwrap_or(first_bytes);
        let first = text.iter().find(|byte| !byte.is_ascii_whitespace());
        (first == Some(&b'{')).then_some(Format::Json)
    }

    /// The format that an HTTP content type names, its parameters aside.
    pub fn from_content_type(content_type: &str) -> Option<Format> {
        let essence = content_type.split(';').next().unwrap_or_default().trim();
        if essence.eq_ignore_ascii_case("application/json") {
            Some(Format::Json)
        } else if essence.eq_ignore_ascii_case("application/mcap") || essence.eq_ignore_ascii_case("application/x-mcap")
        {
            Some(Format::Mcap)
        } else {
            None
        }
    }

    /// The content type under which a recording of this format is sent.
    pub fn content_type(self) -> &'static str {
        match self {
            Format::Mcap => "application/mcap",
            Format::Json => "application/json",
        }
    }
}

/// Some editors write it before JSON; it says nothing.
pub(super) const BYTE_ORDER_MARK: &[u8] = b"\xef\xbb\xbf";

/// How much is accepted, so that no upload can use more memory or time than the operator allows.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Limits {
    /// Skeleton frames. The default, 500 000, is 4.6 hours at 30 frames/s and at most 900 MB decoded.
    pub max_frames: u64,
    /// Time between the first and the last frame, seconds; default 12 hours.
    pub max_duration_s: u64,
    /// Samples of all reference channels together; default 10 million.
    pub max_reference_samples: u64,
    /// Samples of all inertial units together; default 10 million: two hours of nine units at 150 Hz, at most 800 MB
    /// decoded.
    pub max_inertial_samples: u64,
    /// Bytes of a JSON recording, which is parsed in memory; default 32 MiB.
    pub max_json_bytes: usize,
    /// Bytes of one MCAP record, and of one MCAP chunk before and after decompression; default 16 MiB.
    pub max_chunk_bytes: usize,
    /// Bytes of all MCAP chunks together after decompression; default 4 GiB.
    pub max_decompressed_bytes: u64,
    /// Bytes of all depth images together after decompression; default 64 GiB: an hour of 640 × 480 at 30 images/s.
    pub max_depth_bytes: u64,
    /// MCAP channels; default 256.
    pub max_channels: usize,
}

impl Default for Limits {
    fn default() -> Self {
        Self {
            max_frames: 500_000,
            max_duration_s: 12 * 3600,
            max_reference_samples: 10_000_000,
            max_inertial_samples: 10_000_000,
            max_json_bytes: 32 << 20,
            max_chunk_bytes: 16 << 20,
            max_decompressed_bytes: 4 << 30,
            max_depth_bytes: 64 << 30,
            max_channels: 256,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn formats_are_recognised_by_their_first_bytes() {
        assert_eq!(Format::sniff(b"\x89MCAP0\r\n\x01"), Some(Format::Mcap));
        assert_eq!(Format::sniff(b" \n{\"format\""), Some(Format::Json));
        assert_eq!(Format::sniff(b"\xef\xbb\xbf{}"), Some(Format::Json));
        assert_eq!(Format::sniff(b"\x89MCAP1\r\n"), None);
        assert_eq!(Format::sniff(b"[1]"), None);
        assert_eq!(Format::sniff(b""), None);
    }

    #[test]
    fn content_types_are_recognised_without_their_parameters() {
        assert_eq!(Format::from_content_type("Application/JSON; charset=utf-8"), Some(Format::Json));
        for format in [Format::Mcap, Format::Json] {
            assert_eq!(Format::from_content_type(format.content_type()), Some(format));
        }
        assert_eq!(Format::from_content_type("text/plain"), None);
    }
}
