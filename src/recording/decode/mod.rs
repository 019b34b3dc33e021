//! Bytes in, recording out: one push decoder for both formats.
//!
//! The same code runs twice on an upload. While the bytes arrive an [`Inspector`] checks all of them and keeps none,
//! in memory bounded by [`Limits`], so that every defect is told to the client at once; later [`decode`] reads the
//! stored bytes and keeps the frames.

mod assembler;
mod checks;
mod chunk;
mod depth;
mod depth_reader;
mod inertial;
mod json;
mod json_error;
mod limits;
mod mcap_stream;
mod message;
mod record;
mod side;
#[cfg(test)]
mod tests;
mod topic;

pub use depth_reader::DepthReader;
pub use limits::{Format, Limits};

use super::depth::DepthSummary;
use super::inertial_quality::InertialSummary;
use super::{DecodeError, Header, Recording};
use crate::body::Joint;
use assembler::{Assembled, Assembler};
use json::JsonDecoder;
use mcap_stream::McapDecoder;
use serde::{Deserialize, Serialize};
use std::io::Read;
use utoipa::ToSchema;

/// What is known of a recording that was read once, without its frames.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct Inspection {
    /// Encoding of the upload.
    pub format: Format,
    /// What was recorded, with what, of whom.
    pub header: Header,
    /// Skeleton frames; none in a recording of inertial units or of depth images alone.
    pub n_frames: u64,
    /// Time between the first and the last frame, seconds; without frames, that of the depth images or of
    /// the longest inertial unit.
    pub duration_s: f64,
    /// Joints of every frame.
    pub joints: Vec<Joint>,
    /// True when at least one joint of one frame has an orientation.
    pub has_orientations: bool,
    /// The inertial units, with what is doubtful about their data.
    #[serde(default)]
    pub inertial_units: Vec<InertialSummary>,
    /// The depth images, with what is doubtful about them.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub depth: Option<DepthSummary>,
    /// Names of the reference series.
    pub reference_channels: Vec<String>,
    /// Channels that were accepted and not read: those under `/x/`.
    pub ignored_channels: Vec<IgnoredChannel>,
}

/// A channel that was accepted and not read.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
pub struct IgnoredChannel {
    /// Its topic.
    pub topic: String,
    /// Messages on it.
    pub n_messages: u64,
}

/// Reads a recording while it arrives, checks everything and keeps nothing.
pub struct Inspector(Decoder);

impl Inspector {
    /// An inspector that has seen nothing yet.
    pub fn new(format: Format, limits: &Limits) -> Self {
        Self(Decoder::new(format, limits, false))
    }

    /// Reads the next bytes.
    ///
    /// # Errors
    /// The first defect of the recording; every later call answers the same one.
    pub fn push(&mut self, bytes: &[u8]) -> Result<(), DecodeError> {
        self.0.push(bytes)
    }

    /// Ends the recording.
    ///
    /// # Errors
    /// The first defect, also one that only the end shows, for example `truncated`.
    pub fn finish(self) -> Result<Inspection, DecodeError> {
        Ok(self.0.finish()?.inspection)
    }
}

/// Reads a whole recording.
///
/// # Errors
/// The first defect; `unreadable` when `reader` itself fails.
pub fn decode(mut reader: impl Read, format: Format, limits: &Limits) -> Result<Recording, DecodeError> {
    let mut decoder = Decoder::new(format, limits, true);
    let mut buffer = vec![0; 64 * 1024];
    loop {
        match reader.read(&mut buffer) {
            Ok(0) => break,
            Ok(n) => decoder.push(&buffer[..n])?,
            Err(error) if error.kind() == std::io::ErrorKind::Interrupted => {}
            Err(error) => {
                return Err(DecodeError::new("unreadable", format!("the recording could not be read: {error}")));
            }
        }
    }
    let assembled = decoder.finish()?;
    assembled.recording.ok_or_else(|| DecodeError::new("empty_recording", "the recording has no data"))
}

enum Reader {
    Mcap(Box<McapDecoder>),
    Json(JsonDecoder),
}

struct Decoder {
    format: Format,
    reader: Reader,
    assembler: Assembler,
    defect: Option<DecodeError>,
}

impl Decoder {
    fn new(format: Format, limits: &Limits, keep: bool) -> Self {
        let reader = match format {
            Format::Mcap => Reader::Mcap(Box::new(McapDecoder::new(limits))),
            Format::Json => Reader::Json(JsonDecoder::default()),
        };
        Self { format, reader, assembler: Assembler::new(limits.clone(), keep), defect: None }
    }

    fn push(&mut self, bytes: &[u8]) -> Result<(), DecodeError> {
        if let Some(defect) = &self.defect {
            return Err(defect.clone());
        }
        let result = match &mut self.reader {
            Reader::Mcap(reader) => reader.push(bytes, &mut self.assembler),
            Reader::Json(reader) => reader.push(bytes, &self.assembler),
        };
        if let Err(defect) = &result {
            self.defect = Some(defect.clone());
        }
        result
    }

    fn finish(mut self) -> Result<Assembled, DecodeError> {
        if let Some(defect) = self.defect {
            return Err(defect);
        }
        match self.reader {
            Reader::Mcap(reader) => reader.finish(&mut self.assembler)?,
            Reader::Json(reader) => reader.finish(&mut self.assembler)?,
        }
        self.assembler.finish(self.format)
    }
}
