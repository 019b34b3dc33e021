//! Training of a noise model from recordings of one kind of sensor (\[angles\], "noise model").
//!
//! ```text
//! Σy   covariance of the twelve points about their course in seconds without movement, shrunk towards its diagonal
//! s    slow offset: from the error of hinge angles where there is a reference, else from bones that change in length
//! Σθ   mean square of the turns in 1/30 s, of reference angles where there are any, else of estimated ones
//! ```
//!
//! Left and right count alike: every second of a standing subject is taken together with its mirror image, which
//! supposes that the subject faces the sensor, and turns of left and right joints are averaged.
//!
//! Few people have static recordings of a sensor at hand; white noise can also be taken from movements, less surely.
//!
//! Deviations from the paper: its static recordings give one covariance, of noise and offset together. A Kinect v2 has a
//! millimetre of the one and centimetres of the other, and only the first is new in every frame; hence two parts.

mod offset;
mod transition;
mod white;

use crate::assessment::JointAngleSettings;
use crate::assessment::noise_model::{
    NITE_TABLE1, NoiseModel, NoiseModelDocument, PointNoise, TrainingRecord, TrainingSource, nite_table1,
};
use crate::body::{Limb, OBSERVATION_DIMENSION};
use crate::pipeline::PipelineError;
use crate::pipeline::joint_angles::observation::Observations;
use crate::pipeline::joint_angles::sensor_noise::white_noise;
use crate::progress::{Monitor, Step};
use crate::recording::{Recording, SkeletonRecording};
use offset::Offsets;
use transition::Turns;
use white::WhiteNoise;

/// Static recordings that are needed (`methods.md`, training).
pub const MIN_STATIC_RECORDINGS: usize = 2;
/// Seconds of white noise that are needed in all: two recordings of ten seconds.
pub const MIN_WHITE_S: f64 = 20.0;
/// What may be missing of them, seconds: ten seconds at any frame rate end an interval early, which may cost each of the
/// two recordings its last second.
const TOLERANCE_S: f64 = 2.0;
/// Seconds of movement that are needed, when any movement is given.
pub const MIN_MOVEMENT_S: f64 = 10.0;

/// Which recording it is, for the model's own account of its training.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct RecordingIdentity {
    /// Name of the file, or id of the stored recording.
    pub name: String,
    /// SHA-256 of its bytes, lower-case hexadecimal.
    pub sha256: String,
}

/// Takes recordings one after the other, and keeps of each only sums: memory does not grow with their number.
#[derive(Debug, Clone, Default)]
pub struct Trainer {
    white: WhiteNoise,
    white_from_movement: bool,
    turns: Turns,
    offsets: Offsets,
    static_recordings: Vec<TrainingSource>,
    movement_recordings: Vec<TrainingSource>,
}

impl Trainer {
    /// A trainer that takes white noise from the third differences of the movement recordings, and needs no static ones:
    /// for sensors of which nobody has recorded a subject standing still.
    pub fn with_white_noise_from_movement() -> Self {
        Self { white_from_movement: true, ..Self::default() }
    }

    /// Adds a recording of a subject who stands still.
    ///
    /// # Errors
    /// `no_skeleton` and `joints_missing`, with the recording as the place; [`PipelineError::Cancelled`].
    pub fn add_static(
        &mut self,
        identity: RecordingIdentity,
        recording: &Recording,
        monitor: &Monitor,
    ) -> Result<(), PipelineError> {
        let observations = in_recording(&identity, observations_of(recording))?;
        monitor.begin(Step::Estimating, observations.len() as u64)?;
        let used_s = match self.white_from_movement {
            true => 0.0,
            false => self.white.add_still(&observations, &white_noise(&observations)),
        };
        self.static_recordings.push(source(identity, &observations, used_s));
        Ok(monitor.advance(observations.len() as u64)?)
    }

    /// Adds a recording of the movements that the model is for.
    ///
    /// # Errors
    /// What an assessment by the default method refuses, with the recording as the place;
    /// [`PipelineError::Cancelled`].
    pub fn add_movement(
        &mut self,
        identity: RecordingIdentity,
        recording: &Recording,
        monitor: &Monitor,
    ) -> Result<(), PipelineError> {
        let observations = in_recording(&identity, observations_of(recording))?;
        let used_s = in_recording(&identity, self.turns.add(recording, monitor))?;
        self.offsets.add(recording, &observations);
        if self.white_from_movement {
            self.white.add_moving(&observations);
        }
        self.movement_recordings.push(source(identity, &observations, used_s));
        Ok(monitor.check()?)
    }

    /// The model of all recordings, as version 1 of a name.
    ///
    /// # Errors
    /// `too_few_static_recordings`, `static_too_short`, `not_static`, `too_few_movement_recordings` or
    /// `movement_too_short` when there is not enough to
    /// learn from; `implausible_noise` when what was learned is no sensor's noise.
    pub fn finish(self, name: &str, description: &str) -> Result<NoiseModel, PipelineError> {
        self.check_enough()?;
        let covariance = self.white.covariance();
        let slow_offset_mm = self.offsets.standard_deviations().map(|sd| rounded(sd * 1e3));
        let white_sd_mm = |row: usize| rounded(covariance.sd[row] * 1e3);
        let points = Limb::ALL.into_iter().flat_map(|limb| limb.joints().map(|(joint, _)| joint));
        let points = points.enumerate().map(|(p, point)| PointNoise {
            point,
            white_sd_mm: std::array::from_fn(|axis| white_sd_mm(3 * p + axis)),
            slow_offset_sd_mm: slow_offset_mm[p],
        });
        let correlation = |row: usize, column: usize| (covariance.correlation[(row, column)] * 1e4).round() / 1e4;
        let (transition_sd_deg, transition_source) = match self.turns.source() {
            Some(source) => (self.turns.standard_deviations_deg(), source),
            None => (nite_table1().document().transition_sd_deg.clone(), NITE_TABLE1),
        };
        let document = NoiseModelDocument {
            name: name.to_owned(),
            version: 1,
            description: description.to_owned(),
            points: points.collect(),
            correlations: (1..OBSERVATION_DIMENSION)
                .map(|row| (0..row).map(|column| correlation(row, column)).collect())
                .collect(),
            transition_sd_deg,
            training: Some(TrainingRecord {
                software_version: env!("CARGO_PKG_VERSION").to_owned(),
                white_source: if self.white_from_movement { "third_differences" } else { "still_seconds" }.to_owned(),
                white_s: rounded(self.white.seconds()),
                shrinkage: rounded(covariance.shrinkage),
                transition_source: transition_source.to_owned(),
                arm_offset_source: self.offsets.source(true).to_owned(),
                leg_offset_source: self.offsets.source(false).to_owned(),
                static_recordings: self.static_recordings,
                movement_recordings: self.movement_recordings,
            }),
        };
        NoiseModel::try_from(document).map_err(|error| PipelineError::Unsuitable {
            code: "implausible_noise",
            sentence: format!(
                "what the recordings show is no sensor's noise ({}); check that positions are in metres, that frames do \
                 not repeat, and that the subject stands still in the static recordings",
                error.reason
            ),
            place: Some(error.place),
        })
    }

    fn check_enough(&self) -> Result<(), PipelineError> {
        if self.white_from_movement {
            self.check_white_from_movement()?
        } else {
            self.check_static()?
        }
        let movement_s: f64 = self.movement_recordings.iter().map(|r| r.used_s).sum();
        if !self.movement_recordings.is_empty() && movement_s < MIN_MOVEMENT_S {
            let sentence = format!(
                "the movement recordings hold {movement_s:.1} s in which joints were seen, and {MIN_MOVEMENT_S:.0} s are \
                 needed; record longer, or give no movement recording"
            );
            return Err(PipelineError::unsuitable("movement_too_short", sentence));
        }
        Ok(())
    }

    fn check_static(&self) -> Result<(), PipelineError> {
        let recordings = &self.static_recordings;
        if recordings.len() < MIN_STATIC_RECORDINGS {
            let sentence = format!(
                "static recordings given: {}, needed: {MIN_STATIC_RECORDINGS}; record the subject standing still for ten \
                 seconds, twice",
                recordings.len()
            );
            return Err(PipelineError::unsuitable("too_few_static_recordings", sentence));
        }
        let length_s: f64 = recordings.iter().map(|r| r.duration_s).sum();
        if length_s < MIN_WHITE_S - TOLERANCE_S {
            let sentence = format!(
                "the static recordings last {length_s:.1} s in all and {MIN_WHITE_S:.0} s are needed; record the subject \
                 standing still for ten seconds, twice"
            );
            return Err(PipelineError::unsuitable("static_too_short", sentence));
        }
        let contributing = recordings.iter().filter(|r| r.used_s > 0.0).count();
        let still_s = self.white.seconds();
        if still_s < MIN_WHITE_S - TOLERANCE_S || contributing < MIN_STATIC_RECORDINGS {
            let list: Vec<String> =
                recordings.iter().map(|r| format!("{}: {:.0} of {:.0} s", r.name, r.used_s, r.duration_s)).collect();
            let sentence = format!(
                "the subject stands still, with every joint seen, for {still_s:.0} s of the static recordings ({}), and \
                 {MIN_WHITE_S:.0} s from at least {MIN_STATIC_RECORDINGS} of them are needed; record the subject standing \
                 still",
                list.join(", ")
            );
            return Err(PipelineError::unsuitable("not_static", sentence));
        }
        Ok(())
    }

    fn check_white_from_movement(&self) -> Result<(), PipelineError> {
        let (recordings, seconds) = (self.movement_recordings.len(), self.white.seconds());
        if recordings >= MIN_STATIC_RECORDINGS && seconds >= MIN_WHITE_S {
            return Ok(());
        }
        let sentence = format!(
            "{recordings} movement recordings show white noise for {seconds:.0} s, and {MIN_WHITE_S:.0} s from at least \
             {MIN_STATIC_RECORDINGS} are needed; give more of them, or static recordings"
        );
        Err(PipelineError::unsuitable("too_few_movement_recordings", sentence))
    }
}

/// To three decimals: a micrometre, a thousandth of a degree or of a share.
fn rounded(value: f64) -> f64 {
    (value * 1e3).round() / 1e3
}

fn source(identity: RecordingIdentity, observations: &Observations, used_s: f64) -> TrainingSource {
    let RecordingIdentity { name, sha256 } = identity;
    TrainingSource { name, sha256, duration_s: rounded(observations.duration_s()), used_s: rounded(used_s) }
}

fn skeleton_of(recording: &Recording) -> Result<&SkeletonRecording, PipelineError> {
    recording.skeleton.as_ref().filter(|skeleton| skeleton.len() > 1).ok_or_else(|| {
        PipelineError::unsuitable(
            "no_skeleton",
            "it has no skeleton frames to learn from; record with body tracking on",
        )
    })
}

fn observations_of(recording: &Recording) -> Result<Observations, PipelineError> {
    Observations::from_recording(skeleton_of(recording)?, &JointAngleSettings::default())
}

/// Says in which of several recordings a defect lies.
fn in_recording<T>(identity: &RecordingIdentity, result: Result<T, PipelineError>) -> Result<T, PipelineError> {
    result.map_err(|error| match error {
        PipelineError::Defect(defect) => PipelineError::Defect(defect),
        PipelineError::Cancelled => PipelineError::Cancelled,
        PipelineError::Unsuitable { code, place, sentence } => {
            let place = place.map_or_else(|| identity.name.clone(), |place| format!("{}: {place}", identity.name));
            PipelineError::Unsuitable { code, place: Some(place), sentence }
        }
    })
}
