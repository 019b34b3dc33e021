//! Why bytes are not a recording: always the client's fault, always with the place.

/// A defect of an upload, with where it stands and what was expected.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[error("{sentence}")]
pub struct DecodeError {
    /// Stable, documented code, for example `time_not_increasing`.
    pub code: &'static str,
    /// Where: a field path or a place in the stream, for example `frames[17].time_ns` or `byte 4096`.
    pub place: Option<String>,
    /// One sentence for a person: what was found, what was expected, what to do.
    pub sentence: String,
}

impl DecodeError {
    /// A defect without a place.
    pub fn new(code: &'static str, sentence: impl Into<String>) -> Self {
        Self { code, place: None, sentence: sentence.into() }
    }

    /// The same defect at a place.
    #[must_use]
    pub fn at(mut self, place: impl Into<String>) -> Self {
        self.place = Some(place.into());
        self
    }
}
