//! How far a result can be trusted.

use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

/// Quality block of an assessment.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize, ToSchema)]
pub struct Quality {
    /// Frames in the recording.
    pub n_frames: u64,
    /// Time from the first to the last frame, seconds.
    pub duration_s: f64,
    /// Median time between frames, seconds.
    pub median_interval_s: f64,
    /// Longest time between two frames, seconds.
    pub longest_gap_s: f64,
    /// Share of frames in which every joint of the model was seen and believed, 0 to 1.
    pub coverage: f64,
    /// Effective number of particles, when the method has particles.
    pub effective_sample_size: Option<EffectiveSampleSize>,
    /// How segment lengths were found.
    pub calibration: Option<CalibrationQuality>,
    /// What the reader should know; each has a stable code.
    pub warnings: Vec<Warning>,
    /// What went wrong when, by time; the longest thousand when there were more.
    pub events: Vec<Event>,
    /// How often each kind of event happened; a kind that was looked for and not found has zeros.
    #[serde(default)]
    pub event_counts: Vec<EventCount>,
}

/// Effective sample size of a particle filter, in particles.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct EffectiveSampleSize {
    /// Particles in use.
    pub particles: u32,
    /// Median over the frames.
    pub median: f64,
    /// Smallest of all frames.
    pub min: f64,
}

impl EffectiveSampleSize {
    /// Summary of the sizes of all frames.
    pub fn of_frames(particles: u32, mut sizes: Vec<f64>) -> Self {
        sizes.sort_by(f64::total_cmp);
        let median = sizes.get(sizes.len() / 2).copied().unwrap_or(0.0);
        Self { particles, median, min: sizes.first().copied().unwrap_or(0.0) }
    }
}

/// How segment lengths were found.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct CalibrationQuality {
    /// `static_window` or `whole_recording`.
    pub source: String,
    /// First and last second of the static window, when there is one.
    pub window_s: Option<[f64; 2]>,
    /// Frames that were used.
    pub n_frames: u64,
    /// Segment lengths.
    pub segments: Vec<SegmentLength>,
}

/// Length of one body segment.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct SegmentLength {
    /// Segment, for example `left_thigh`.
    pub segment: String,
    /// Robust mean length, metres.
    pub length_m: f64,
    /// Robust standard deviation over the frames used, metres.
    pub spread_m: f64,
}

/// Something the reader should know.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct Warning {
    /// Stable code, for example `no_static_window`.
    pub code: String,
    /// One sentence for a person.
    pub message: String,
}

impl Warning {
    /// A warning with a stable code.
    pub fn new(code: &str, message: impl Into<String>) -> Self {
        Self { code: code.to_owned(), message: message.into() }
    }
}

/// Something that went wrong during a recording.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct Event {
    /// Kind: `frame_gap`, `lost_user`, `lost_joint`, `limb_swap`, `hand_jump`, `foot_jump` or `occlusion`.
    pub kind: String,
    /// What it concerns: a joint of the recording, for example `left_wrist`; `legs` or `arms` that were exchanged;
    /// `user`, or `recording`.
    pub subject: String,
    /// Time of the first frame concerned, seconds from the recording's first frame. A gap begins at the frame before it.
    pub start_s: f64,
    /// Time of the last frame concerned, seconds from the recording's first frame. A gap ends at the frame after it.
    pub end_s: f64,
    /// Frames concerned; of a gap the frames that are missing by the median interval.
    #[serde(default)]
    pub n_frames: u64,
}

/// How often a kind of event happened in a recording.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct EventCount {
    /// Kind, as in the events.
    pub kind: String,
    /// Events.
    pub n_events: u64,
    /// Frames concerned, summed over the events; a frame counts once for each subject.
    pub n_frames: u64,
}
