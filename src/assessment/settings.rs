//! What can be asked of a pipeline. Settings stand with the result because they are part of its provenance, and because
//! whoever asks for an assessment need not know the pipeline.

use super::fusion_settings::SkeletonFusionSettings;
use super::leg_pose_settings::LegPoseSettings;
use super::noise_model::{ADAPTIVE, InvalidNoiseModelName, NITE_TABLE1, NoiseModelName};
use crate::recording::Segment;
use serde::{Deserialize, Serialize};
use std::fmt;
use std::str::FromStr;
use utoipa::ToSchema;
use uuid::Uuid;

/// How joint angles are estimated. All methods share one body model and one form of result.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Serialize, Deserialize, ToSchema)]
#[serde(rename_all = "snake_case")]
pub enum Method {
    /// The default: iterated extended Kalman filter over posture and rates with a Student-t weight for each point.
    Iekf,
    /// Unscented Kalman filter on the model of `iekf`: sigma points in place of a derivative.
    Ukf,
    /// Particle filter on the model of `iekf`: each particle steps towards the observation, weights stay exact.
    Guided,
    /// The paper's particle filter: prior as the proposal, multinomial resampling at every frame, mean as estimate.
    Particle,
    /// Closed geometry, frame by frame.
    Ik,
    /// The middleware's own rotations, with 180° axial flips undone.
    Nite,
}

impl Method {
    /// Every method, the default first.
    pub const ALL: [Method; 6] =
        [Method::Iekf, Method::Ukf, Method::Guided, Method::Particle, Method::Ik, Method::Nite];

    /// True of methods that can go back over the recording after they have been through it.
    pub fn can_smooth(self) -> bool {
        matches!(self, Method::Iekf | Method::Ukf | Method::Guided)
    }

    /// True of methods whose accuracy and cost depend on a number of particles.
    pub fn has_particles(self) -> bool {
        matches!(self, Method::Particle | Method::Guided)
    }

    /// Particles when none are asked for: the paper's middle choice, and for `guided` the number from which twice as many
    /// change its mean errors by less than a twentieth.
    pub fn default_particles(self) -> u32 {
        match self {
            Method::Guided => 96,
            _ => 512,
        }
    }

    /// The noise model that the method takes when the settings name none; `None` when it has no model of noise.
    pub fn default_noise_model(self) -> Option<&'static str> {
        match self {
            Method::Iekf | Method::Ukf | Method::Guided => Some(ADAPTIVE),
            Method::Particle => Some(NITE_TABLE1),
            Method::Ik | Method::Nite => None,
        }
    }

    /// Name in settings, tables and provenance.
    pub fn name(self) -> &'static str {
        match self {
            Method::Iekf => "iekf",
            Method::Ukf => "ukf",
            Method::Guided => "guided",
            Method::Particle => "particle",
            Method::Ik => "ik",
            Method::Nite => "nite",
        }
    }
}

/// What segment lengths rest on.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default, Serialize, Deserialize, ToSchema)]
#[serde(rename_all = "snake_case")]
pub enum CalibrationChoice {
    /// The recording and what its header says of the body.
    #[default]
    Recording,
    /// Also the best calibration among the assessments of the patient's other recordings.
    Patient,
}

/// Whether an estimate of a frame rests on the frames up to it or on the whole recording.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Serialize, Deserialize, ToSchema)]
#[serde(rename_all = "snake_case")]
pub enum Pass {
    /// Forwards only: what a live use of the method would have known.
    Filter,
    /// Forwards, then back over the whole recording.
    Smooth,
}

impl FromStr for Pass {
    type Err = UnknownPass;

    fn from_str(name: &str) -> Result<Self, Self::Err> {
        match name {
            "filter" => Ok(Pass::Filter),
            "smooth" => Ok(Pass::Smooth),
            _ => Err(UnknownPass(name.to_owned())),
        }
    }
}

/// A pass that does not exist.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("`{0}` is no pass; there are filter and smooth")]
pub struct UnknownPass(pub String);

/// A method that does not exist.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("`{0}` is no method; there are iekf, ukf, guided, particle, ik and nite")]
pub struct UnknownMethod(pub String);

impl FromStr for Method {
    type Err = UnknownMethod;

    fn from_str(name: &str) -> Result<Self, Self::Err> {
        Self::ALL.into_iter().find(|m| m.name() == name).ok_or_else(|| UnknownMethod(name.to_owned()))
    }
}

impl fmt::Display for Method {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

/// Which pipeline runs, and how. In JSON an object whose `pipeline` names it: `{"pipeline": "joint_angles"}`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(tag = "pipeline", rename_all = "snake_case")]
pub enum Settings {
    /// Joint angles from skeleton positions.
    JointAngles(JointAngleSettings),
    /// Joint angles from skeleton positions and inertial units.
    SkeletonFusion(SkeletonFusionSettings),
    /// Leg pose and steps of a walker's user from depth images.
    LegPose(LegPoseSettings),
    /// Training of a noise model from several recordings.
    NoiseModel(NoiseModelSettings),
}

impl Default for Settings {
    fn default() -> Self {
        Settings::JointAngles(JointAngleSettings::default())
    }
}

impl Settings {
    /// Recordings that a training reads, the first static one among them; none for the work on one recording.
    pub fn training_recordings(&self) -> impl Iterator<Item = Uuid> {
        let (still, movement) = match self {
            Settings::NoiseModel(settings) => (&settings.static_recordings[..], &settings.movement_recordings[..]),
            Settings::JointAngles(_) | Settings::SkeletonFusion(_) | Settings::LegPose(_) => (&[][..], &[][..]),
        };
        still.iter().chain(movement).copied()
    }

    /// What suits a recording that nobody said anything about: fusion where inertial units are worn on bones of the model,
    /// joint angles otherwise.
    pub fn suited_to(units: impl IntoIterator<Item = Segment>) -> Self {
        if units.into_iter().any(|segment| segment.bone().is_some()) {
            return Settings::SkeletonFusion(SkeletonFusionSettings::default());
        }
        Settings::default()
    }

    /// Name of the pipeline that they are for.
    pub fn pipeline(&self) -> &'static str {
        match self {
            Settings::JointAngles(_) => "joint_angles",
            Settings::SkeletonFusion(_) => "skeleton_fusion",
            Settings::LegPose(_) => "leg_pose",
            Settings::NoiseModel(_) => "noise_model",
        }
    }
}

/// Settings of the joint-angle pipeline; every field has a default.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(default, deny_unknown_fields)]
pub struct JointAngleSettings {
    /// How angles are estimated.
    pub method: Method,
    /// Whether the estimate of a frame rests on the frames up to it (`filter`) or on the whole recording (`smooth`).
    /// Null means `smooth` with methods that can, `filter` with others.
    pub pass: Option<Pass>,
    /// Particles of the methods `particle` and `guided`, 16 to 65536. Null means 512 for `particle`, of which the paper
    /// compares 128, 512 and 2048, and 96 for `guided`.
    #[schema(minimum = 16, maximum = 65536)]
    pub particles: Option<u32>,
    /// Seed of the random streams, at most 2^53 - 1, so that every JSON library reads the same number.
    #[schema(maximum = 9_007_199_254_740_991_i64)]
    pub seed: u64,
    /// Joints in which the sensor's confidence is lower count as not seen, 0 to 1.
    #[schema(minimum = 0, maximum = 1)]
    pub min_confidence: f32,
    /// Noise of the sensor: `adaptive` (estimated from the recording itself), a shipped model, or a trained one of the
    /// organisation, each as `name` or `name@version`; without a version the newest at the time of the request. Null
    /// means the method's own choice: `nite-table1` for `particle`, `adaptive` for `iekf`, `ukf` and `guided`.
    #[schema(pattern = "^[a-z][a-z0-9-]{0,63}(@[1-9][0-9]{0,9})?$", example = "kinect-v2")]
    pub noise_model: Option<String>,
    /// `recording`, or `patient`: segment lengths also from the patient's other recordings, of those assessed the newest
    /// with a static window, or else the one with the least uncertainty. It is looked up when the job runs.
    pub calibration: CalibrationChoice,
}

impl Default for JointAngleSettings {
    fn default() -> Self {
        Self {
            method: Method::Iekf,
            pass: None,
            particles: None,
            seed: 1,
            min_confidence: 0.3,
            noise_model: None,
            calibration: CalibrationChoice::Recording,
        }
    }
}

impl JointAngleSettings {
    /// The pass that runs: the one asked for, or the best that the method can do.
    ///
    /// # Errors
    /// [`NoBackwardPass`] when a method that has none is asked to smooth.
    pub fn chosen_pass(&self) -> Result<Pass, NoBackwardPass> {
        match self.pass {
            Some(Pass::Smooth) if !self.method.can_smooth() => Err(NoBackwardPass(self.method)),
            Some(pass) => Ok(pass),
            None => Ok(if self.method.can_smooth() { Pass::Smooth } else { Pass::Filter }),
        }
    }

    /// The number of particles that run: the one asked for, or the method's own.
    pub fn chosen_particles(&self) -> u32 {
        self.particles.unwrap_or_else(|| self.method.default_particles())
    }

    /// The noise model that the method runs on: the one asked for, or its own choice; `None` for methods without one.
    ///
    /// # Errors
    /// [`UnusableNoiseModel`] when the text is no name, or the method cannot run on it.
    pub fn chosen_noise_model(&self) -> Result<Option<NoiseModelName>, UnusableNoiseModel> {
        let Some(own) = self.method.default_noise_model() else {
            return if self.noise_model.is_some() { Err(UnusableNoiseModel::NoneTaken(self.method)) } else { Ok(None) };
        };
        let name: NoiseModelName = self.noise_model.as_deref().unwrap_or(own).parse()?;
        if name.name == ADAPTIVE && (name.version.is_some() || own != ADAPTIVE) {
            return Err(UnusableNoiseModel::NotAdaptive(self.method));
        }
        Ok(Some(name))
    }
}

/// A noise model that a method cannot run on.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum UnusableNoiseModel {
    /// The text is no name.
    #[error(transparent)]
    InvalidName(#[from] InvalidNoiseModelName),
    /// The method has no model of noise.
    #[error(
        "the method `{0}` has no model of noise; leave the noise model out, or choose the method iekf, ukf, guided or particle"
    )]
    NoneTaken(Method),
    /// The method needs a trained model.
    #[error(
        "the method `{0}` does not run on `adaptive` noise in this form; name a trained model, or choose iekf, ukf or guided with plain `adaptive`"
    )]
    NotAdaptive(Method),
}

/// Settings of the training of a noise model.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct NoiseModelSettings {
    /// Name of the model; a name that exists gets a further version.
    #[schema(pattern = "^[a-z][a-z0-9-]{0,63}$", max_length = 64, example = "ward-3")]
    pub name: String,
    /// What the model describes, for a person; at most 500 characters.
    #[serde(default)]
    #[schema(max_length = 500)]
    pub description: String,
    /// Recordings of a subject who stands still; at least two, with 20 seconds without movement in all.
    #[schema(min_items = 2, max_items = 50)]
    pub static_recordings: Vec<Uuid>,
    /// Recordings of the movements that the model is for. Without any, the joints turn as in `nite-table1`.
    #[serde(default)]
    #[schema(max_items = 50)]
    pub movement_recordings: Vec<Uuid>,
}

/// A method was asked to smooth that only goes forwards.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[error("the method `{0}` has no backward pass; use pass `filter`, leave it out, or choose iekf, ukf or guided")]
pub struct NoBackwardPass(pub Method);
