//! What is known of the subject's body beside the recording's own measurement.
//!
//! Every source is a Gaussian about each length, and they are fused by precision:
//!
//! ```text
//! length = Σ lengthᵢ / σᵢ²  ·  σ²        σ² = 1 / Σ 1/σᵢ²
//! ```
//!
//! Lengths given in the recording's header and those of an earlier recording of the patient always take part. Stature is
//! weak knowledge, and takes part only where the recording itself shows a segment in few frames or never.

use crate::assessment::quality::{CalibrationQuality, TrunkOffset};
use crate::assessment::{CalibrationChoice, JointAngleSettings};
use crate::body::{Limb, Skeleton};
use crate::pipeline::{Inputs, PatientCalibration};
use crate::recording::Header;

/// Segments of the four limbs, proximal before distal, in the order of [`Limb::ALL`].
pub const SEGMENT_COUNT: usize = 8;

/// Standard deviation of a length measured on the body with a tape, metres. Our provisional choice.
const TAPE_SD_M: f64 = 0.010;
/// Standard deviation of the difference between a segment as a sensor's joints show it and as it is felt on the body,
/// metres. Our provisional choice: sensors report joint centres beneath the surface, a tape ends at bony landmarks.
const SENSOR_TO_ANATOMY_SD_M: f64 = 0.015;
/// Standard deviation of a person's segment about Drillis and Contini's share of stature, as a share of its length. Our
/// provisional choice: the tabulated shares are averages and come without a spread.
const SHARE_SD: f64 = 0.06;

/// Frames under which the recording's own measurement of a segment is poor, so that stature is asked: one second at the
/// usual 30 Hz.
pub const FEW_FRAMES: usize = 30;

/// A length with its standard deviation, metres.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Estimate {
    /// Length.
    pub length_m: f64,
    /// Standard deviation of the length.
    pub sd_m: f64,
}

impl Estimate {
    /// Both pieces of knowledge together; infinite standard deviations know nothing.
    #[must_use]
    pub fn fused(self, other: Self) -> Self {
        let (a, b) = (self.sd_m.powi(-2), other.sd_m.powi(-2));
        Self { length_m: (a * self.length_m + b * other.length_m) / (a + b), sd_m: (a + b).sqrt().recip() }
    }

    /// True when two pieces of knowledge differ by more than chance allows: three standard deviations of the difference.
    pub fn contradicts(self, other: Self) -> bool {
        (self.length_m - other.length_m).abs() > 3.0 * self.sd_m.hypot(other.sd_m)
    }
}

/// Where knowledge of a segment comes from.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Source {
    /// `segment_lengths_m` of the recording's header.
    GivenLengths,
    /// An earlier recording of the same patient.
    Patient,
    /// `subject_height_m` of the recording's header.
    Stature,
}

impl Source {
    /// Name in the quality block.
    pub fn name(self) -> &'static str {
        match self {
            Source::GivenLengths => "segment_lengths",
            Source::Patient => "patient",
            Source::Stature => "stature",
        }
    }
}

/// What is known of one body; the default is nothing.
#[derive(Debug, Clone, Default)]
pub struct BodyKnowledge<'a> {
    given: [Option<Estimate>; SEGMENT_COUNT],
    stature: [Option<Estimate>; SEGMENT_COUNT],
    patient: Option<&'a PatientCalibration>,
    /// True when an earlier calibration was asked for and there is none.
    pub lacks_patient: bool,
}

impl<'a> BodyKnowledge<'a> {
    /// What header, settings and inputs say.
    pub fn of(header: &Header, settings: &JointAngleSettings, inputs: &'a Inputs) -> Self {
        let names = segment_names();
        let sd_m = TAPE_SD_M.hypot(SENSOR_TO_ANATOMY_SD_M);
        let given = names.each_ref().map(|name| header.segment_lengths_m.get(name));
        let given = given.map(|length| length.map(|length_m| Estimate { length_m: *length_m, sd_m }));
        let lengths = header.subject_height_m.map(|stature| lengths_of(&Skeleton::of_stature(stature)));
        let of_share = |length_m: f64| Estimate { length_m, sd_m: (SHARE_SD * length_m).hypot(SENSOR_TO_ANATOMY_SD_M) };
        let stature = std::array::from_fn(|segment| lengths.map(|lengths| of_share(lengths[segment])));
        let wants_patient = settings.calibration == CalibrationChoice::Patient;
        let patient = inputs.patient_calibration.as_ref().filter(|_| wants_patient);
        Self { given, stature, patient, lacks_patient: wants_patient && patient.is_none() }
    }

    /// What is known of a segment; stature only where the recording's own measurement of it `is_poor`.
    pub fn of_segment(&self, segment: usize, is_poor: bool) -> Vec<(Source, Estimate)> {
        let patient = self.patient.and_then(|patient| own_length(&patient.quality, segment));
        let stature = self.stature[segment].filter(|_| is_poor);
        let all = [(Source::GivenLengths, self.given[segment]), (Source::Patient, patient), (Source::Stature, stature)];
        all.into_iter().filter_map(|(source, estimate)| Some((source, estimate?))).collect()
    }

    /// Trunk offsets of the patient's earlier recording, in the order of [`Limb::ALL`].
    pub fn trunk_offsets(&self) -> Option<&'a [TrunkOffset; 4]> {
        self.patient?.quality.measured_trunk_offsets.as_slice().try_into().ok()
    }

    /// True when anything beside the recording is known.
    pub fn is_some(&self) -> bool {
        self.patient.is_some() || self.given.iter().chain(&self.stature).any(Option::is_some)
    }

    /// The earlier recording's assessment.
    pub fn patient(&self) -> Option<&'a PatientCalibration> {
        self.patient
    }
}

/// What a recording itself said of a segment, without what was known before: knowledge that goes from recording to recording
/// must not count itself twice.
fn own_length(quality: &CalibrationQuality, segment: usize) -> Option<Estimate> {
    let own = quality.segments.get(segment)?;
    Some(Estimate { length_m: own.measured_m?, sd_m: own.measured_uncertainty_m? })
}

/// Names of the segments in order.
pub fn segment_names() -> [String; SEGMENT_COUNT] {
    std::array::from_fn(|segment| Limb::ALL[segment / 2].segment_names()[segment % 2].clone())
}

/// Lengths of the segments in order.
pub fn lengths_of(skeleton: &Skeleton) -> [f64; SEGMENT_COUNT] {
    std::array::from_fn(|segment| match segment % 2 {
        0 => skeleton.proximal[segment / 2],
        _ => skeleton.distal[segment / 2],
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn knowledge_is_fused_by_precision() {
        let fused = Estimate { length_m: 0.40, sd_m: 0.01 }.fused(Estimate { length_m: 0.45, sd_m: 0.02 });
        // Weights 4 to 1.
        assert!((fused.length_m - 0.41).abs() < 1e-12);
        assert!((fused.sd_m - 0.02 / 5.0_f64.sqrt()).abs() < 1e-12);
        let nothing = Estimate { length_m: 0.0, sd_m: f64::INFINITY };
        assert_eq!(Estimate { length_m: 0.40, sd_m: 0.5 }.fused(nothing), Estimate { length_m: 0.40, sd_m: 0.5 });
    }

    #[test]
    fn stature_speaks_only_where_the_recording_shows_little() {
        let header = Header { subject_height_m: Some(1.7), ..Header::default() };
        let inputs = Inputs::default();
        let knowledge = BodyKnowledge::of(&header, &JointAngleSettings::default(), &inputs);
        assert_eq!(knowledge.of_segment(4, false), []);
        let [(Source::Stature, thigh)] = knowledge.of_segment(4, true)[..] else { panic!("no stature") };
        assert!((thigh.length_m - 0.245 * 1.7).abs() < 1e-12);
    }
}
