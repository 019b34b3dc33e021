//! How far a result can be trusted.

use super::fusion_quality::FusionQuality;
use serde::{Deserialize, Serialize};
use utoipa::ToSchema;
use uuid::Uuid;

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
    /// How camera and inertial units were brought together, when they were.
    #[serde(default)]
    pub fusion: Option<FusionQuality>,
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
    /// What the recording itself was measured in: `static_window`, `whole_recording`, or `incomplete_recording` when some
    /// limb was hardly ever seen whole.
    pub source: String,
    /// First and last second of the static window, when there is one.
    pub window_s: Option<[f64; 2]>,
    /// Frames that were used.
    pub n_frames: u64,
    /// Segment lengths.
    pub segments: Vec<SegmentLength>,
    /// Root mean square of the segments' `measured_uncertainty_m`, metres; null when one of them was not measured.
    #[serde(default)]
    pub measured_uncertainty_m: Option<f64>,
    /// Shoulders and hips in the trunk, as this recording alone shows them.
    #[serde(default)]
    pub measured_trunk_offsets: Vec<TrunkOffset>,
    /// What was known beside the recording and used: `segment_lengths`, `patient`, `stature`; empty when nothing was.
    #[serde(default)]
    pub knowledge: Vec<String>,
    /// The earlier assessment of the same patient whose calibration was used, when settings asked for it.
    #[serde(default)]
    pub patient_assessment_id: Option<Uuid>,
}

/// Where a shoulder or hip sits in the trunk.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct TrunkOffset {
    /// Joint, for example `left_hip`.
    pub joint: String,
    /// Position from the torso joint: forward, up, right; metres.
    pub position_m: [f64; 3],
    /// Standard deviation of each coordinate, metres.
    pub uncertainty_m: f64,
}

/// Length of one body segment.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct SegmentLength {
    /// Segment, for example `left_thigh`.
    pub segment: String,
    /// Length that was used, metres: the recording's own measurement and all that is known beside it.
    pub length_m: f64,
    /// Standard deviation of the length that was used, metres.
    #[serde(default)]
    pub uncertainty_m: Option<f64>,
    /// Robust standard deviation over the frames used, metres; null when the segment was seen in too few.
    pub spread_m: Option<f64>,
    /// Robust mean length in this recording alone, metres; null when the segment was seen in too few frames.
    #[serde(default)]
    pub measured_m: Option<f64>,
    /// Standard deviation of `measured_m`, metres.
    #[serde(default)]
    pub measured_uncertainty_m: Option<f64>,
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
