//! What one pipeline found in one recording: series, summary, quality, provenance. Values only, no behaviour of HTTP
//! or of a database.

pub mod footfalls;
pub mod fusion_quality;
pub mod fusion_settings;
pub mod gait;
pub mod joint_angles;
pub mod joint_track;
pub mod leg_pose;
pub mod leg_pose_settings;
pub mod noise_model;
pub mod performance;
pub mod provenance;
pub mod quality;
pub mod series;
pub mod settings;

pub use footfalls::Footfalls;
pub use fusion_quality::{ClockQuality, FusionQuality, UnitQuality};
pub use fusion_settings::{Clocks, FusionMethod, Mounting, SkeletonFusionSettings};
pub use gait::Gait;
pub use joint_angles::AngleChannel;
pub use joint_track::JointTrack;
pub use leg_pose::LegChannel;
pub use leg_pose_settings::{LegCues, LegPoseMode, LegPoseSettings};
pub use noise_model::{NoiseModel, NoiseModelName, NoiseModelReference};
pub use performance::{Performance, PerformanceMeasure, PerformanceStatus, Repetition};
pub use provenance::Provenance;
pub use quality::{Event, Quality, Warning};
pub use series::{ChannelSummary, Series};
pub use settings::{CalibrationChoice, JointAngleSettings, Method, NoiseModelSettings, Pass, Settings};

/// One pipeline's result on one recording.
#[derive(Debug, Clone, PartialEq)]
pub struct Assessment {
    /// The pipeline, for example `joint_angles`.
    pub pipeline: &'static str,
    /// Time of each sample on the recording's clock, nanoseconds.
    pub time_ns: Vec<i64>,
    /// The estimated series, all as long as `time_ns`.
    pub series: Vec<Series>,
    /// One line per series.
    pub summary: Vec<ChannelSummary>,
    /// Steps, when the pipeline finds steps.
    pub gait: Option<Gait>,
    /// Where joints were, when the recording has a skeleton.
    pub joints: Option<JointTrack>,
    /// How the exercise or test was performed; none until it is measured.
    pub performance: Option<Performance>,
    /// How far the result can be trusted.
    pub quality: Quality,
    /// What is needed to compute the same bytes again.
    pub provenance: Provenance,
}
