//! What importing did to each trial.

use crate::recording::Segment;
use serde::Serialize;

/// Defects that were found and handled, counted in samples.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize)]
pub struct Defects {
    /// Joint positions at exactly 0, 0, 0: imported as lost.
    pub lost_joints: u64,
    /// Joint positions that jumped: imported as lost.
    pub jumps: u64,
    /// Quaternions of four zeros: imported as no orientation.
    pub zero_quaternions: u64,
    /// Markers of the reference system at exactly 0, 0, 0; the reference angles do not depend on them.
    pub lost_reference_markers: u64,
}

impl Defects {
    /// Adds the counts of another trial.
    pub fn add(&mut self, other: &Defects) {
        self.lost_joints += other.lost_joints;
        self.jumps += other.jumps;
        self.zero_quaternions += other.zero_quaternions;
        self.lost_reference_markers += other.lost_reference_markers;
    }
}

/// The lag between the two clocks of a trial, as estimated.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct ClockOffset {
    /// Added to the reference's clock to reach the skeleton's, seconds.
    pub offset_s: f64,
    /// What is left of the difference at the best lag after a constant offset, degrees.
    pub rmse_without_offset_deg: f64,
    /// False when the limb hardly moved, or the best lag is the largest tried; then the offset means little.
    pub is_determined: bool,
}

/// An inertial unit of a trial.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct UnitNotes {
    /// What the unit is fixed to.
    pub segment: Segment,
    /// Samples.
    pub n_samples: usize,
    /// Mean rate, per second.
    pub rate_hz: f64,
    /// Doubts about its data, one sentence each.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub warnings: Vec<String>,
}

/// What importing did to one trial.
#[derive(Debug, Clone, PartialEq, Default, Serialize)]
pub struct ImportNotes {
    /// Name of the trial.
    pub name: String,
    /// Data set it comes from.
    pub dataset: String,
    /// What the subject did.
    pub exercise: String,
    /// Skeleton frames.
    pub n_frames: usize,
    /// Mean frame rate, per second.
    pub frame_rate_hz: f64,
    /// Inertial units.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub inertial: Vec<UnitNotes>,
    /// Reference channels.
    pub references: Vec<String>,
    /// Lag between the clocks, where there is a reference on a clock of its own.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub clock_offset: Option<ClockOffset>,
    /// Defects that were handled.
    pub defects: Defects,
    /// Anything else a person should know, one sentence each.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub remarks: Vec<String>,
}

/// What importing did to a data set.
#[derive(Debug, Clone, PartialEq, Default, Serialize)]
pub struct ImportReport {
    /// The data set.
    pub dataset: String,
    /// Number of trials.
    pub n_trials: usize,
    /// Trials with at least one reference channel.
    pub n_trials_with_reference: usize,
    /// Skeleton frames of all trials.
    pub n_frames: usize,
    /// Samples of the inertial units of all trials.
    pub n_inertial_samples: usize,
    /// Defects of all trials.
    pub defects: Defects,
    /// Every trial, sorted by name.
    pub trials: Vec<ImportNotes>,
}

impl ImportReport {
    /// Sums up trials of one data set.
    pub fn of(dataset: &str, trials: Vec<ImportNotes>) -> Self {
        let mut defects = Defects::default();
        for trial in &trials {
            defects.add(&trial.defects);
        }
        Self {
            dataset: dataset.to_owned(),
            n_trials: trials.len(),
            n_trials_with_reference: trials.iter().filter(|trial| !trial.references.is_empty()).count(),
            n_frames: trials.iter().map(|trial| trial.n_frames).sum(),
            n_inertial_samples: trials.iter().flat_map(|trial| &trial.inertial).map(|unit| unit.n_samples).sum(),
            defects,
            trials,
        }
    }
}
