//! Why bytes are not a recording: always the client's fault, always with the place.

/// A defect of an upload, with where it stands and what was expected.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[error("{sentence}")]
pub struct DecodeError {
    /// Stable code, one of [`DECODE_CODES`], for example `time_not_increasing`.
    pub code: &'static str,
    /// Where: a field path or a place in the stream, for example `frames[17].time_ns` or `byte 4096`.
    pub place: Option<String>,
    /// One sentence for a person: what was found, what was expected, what to do.
    pub sentence: String,
}

impl DecodeError {
    /// A defect without a place.
    pub fn new(code: &'static str, sentence: impl Into<String>) -> Self {
        debug_assert!(DECODE_CODES.contains(&code), "`{code}` is not a documented code");
        Self { code, place: None, sentence: sentence.into() }
    }

    /// The same defect at a place.
    #[must_use]
    pub fn at(mut self, place: impl Into<String>) -> Self {
        self.place = Some(place.into());
        self
    }
}

/// Every code of a [`DecodeError`], sorted; `docs/recording-format.md` says what each means.
pub const DECODE_CODES: [&str; 41] = [
    "acceleration_unit",
    "angular_rate_unit",
    "bad_quaternion",
    "checksum_mismatch",
    "confidence_out_of_range",
    "decompression_limit",
    "depth_size",
    "duplicate_channel",
    "duplicate_joint",
    "empty_recording",
    "invalid_depth",
    "invalid_image",
    "invalid_json",
    "invalid_mcap",
    "invalid_value",
    "joint_count_mismatch",
    "missing_field",
    "missing_header",
    "misplaced_message",
    "not_a_recording",
    "not_finite",
    "position_out_of_range",
    "record_too_large",
    "sample_count_mismatch",
    "time_not_increasing",
    "too_few_frames",
    "too_large",
    "too_long",
    "too_many_channels",
    "too_many_frames",
    "too_many_samples",
    "truncated",
    "unknown_field",
    "unknown_joint",
    "unknown_segment",
    "unknown_topic",
    "unreadable",
    "unsupported_compression",
    "unsupported_encoding",
    "unsupported_version",
    "wrong_profile",
];

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_page_on_the_format_lists_exactly_the_codes() {
        let page = include_str!("../../docs/recording-format.md");
        let table = page.split("## Codes").nth(1).expect("the section").split("\n## ").next().expect("its text");
        let listed: Vec<&str> = table.lines().filter_map(|line| line.strip_prefix("| `")?.split('`').next()).collect();
        assert_eq!(listed, DECODE_CODES);
    }
}
