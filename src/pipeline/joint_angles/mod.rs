//! Joint angles from skeleton joint positions (\[angles\]).
//!
//! Twelve points relative to the torso joint → events (exchanged limbs exchanged back, jumps taken out) → calibration
//! (lengths, offsets, facing) → the chosen method's posterior
//! of the posture in every frame → anatomical angles with intervals and flags.

mod body_fusion;
pub mod body_knowledge;
pub mod calibration;
pub mod events;
pub mod guided;
pub mod iekf;
pub mod inverse_kinematics;
pub mod length_uncertainty;
mod likelihood_kernel;
pub mod live;
pub mod middleware;
pub mod noise_model;
pub mod observation;
pub mod particle;
pub mod particle_model;
pub mod posterior;
pub mod sensor_noise;
pub mod series_builder;
pub mod state_space;
pub mod training;
pub mod ukf;

use super::{Inputs, PipelineError};
use crate::assessment::noise_model::find_shipped;
use crate::assessment::{
    Assessment, JointAngleSettings, Method, NoiseModelReference, Provenance, Quality, Series, Settings, Warning,
};
use crate::body::Pose;
use crate::progress::{Monitor, Step};
use crate::recording::Recording;
use body_knowledge::BodyKnowledge;
use calibration::{Calibration, calibrate_with};
use events::{Inspection, Repairs, inspect};
use guided::Sampling;
use noise_model::NoiseModel;
use observation::{ALL_SEEN, Observations};
use posterior::{Posterior, Summary};
use sensor_noise::SensorNoise;
use series_builder::SeriesBuilder;
use state_space::{StateSpace, Tuning};

/// Fewest frames of a recording that can be assessed.
const MIN_FRAMES: usize = 2;

/// Estimates the joint angles of every frame, on noise models that come with the software.
///
/// # Errors
/// See [`assess_with`].
pub fn assess(
    recording: &Recording,
    settings: &JointAngleSettings,
    monitor: &Monitor,
) -> Result<Assessment, PipelineError> {
    assess_with(recording, settings, &Inputs::default(), monitor)
}

/// Estimates the joint angles of every frame.
///
/// # Errors
/// [`PipelineError::Unsuitable`] with a code for each thing that a recording can lack; see the modules. Also
/// `noise_model_missing` when the settings name a noise model that is neither shipped nor among the inputs.
pub fn assess_with(
    recording: &Recording,
    settings: &JointAngleSettings,
    inputs: &Inputs,
    monitor: &Monitor,
) -> Result<Assessment, PipelineError> {
    let Some(skeleton) = recording.skeleton.as_ref().filter(|s| s.len() >= MIN_FRAMES) else {
        return Err(PipelineError::unsuitable(
            "no_skeleton",
            "the recording has no skeleton frames, which joint angles are computed from; record with body tracking on",
        ));
    };
    let pass =
        settings.chosen_pass().map_err(|error| PipelineError::unsuitable("no_backward_pass", error.to_string()))?;
    let noise = chosen_noise(settings, inputs)?;
    monitor.begin(Step::Calibrating, 0)?;
    let recorded = Observations::from_recording(skeleton, settings)?;
    let Inspection { repaired, repairs, events, counts } = inspect(skeleton, &recorded, settings)?;
    // The middleware's rotations cannot be repaired: `nite` shows them as they are.
    let (mut observations, repairs) =
        if settings.method == Method::Nite { (recorded, Repairs::default()) } else { (repaired, repairs) };
    let knowledge = BodyKnowledge::of(&recording.header, settings, inputs);
    let calibration = calibrate_with(&mut observations, &knowledge)?;
    let mut quality = observations_quality(&observations, &calibration);
    (quality.events, quality.event_counts) = (events, counts);
    let mut builder = SeriesBuilder::new(observations.len(), repairs);
    let emit = |posterior: &Posterior| builder.push(&posterior.summarize());
    match settings.method {
        Method::Particle => {
            let model = noise.model().cloned().unwrap_or_else(NoiseModel::nite_table1);
            let particles = settings.chosen_particles();
            let sizes = particle::run(&observations, &calibration, model, particles, settings.seed, monitor, emit)?;
            quality.effective_sample_size = Some(sizes);
        }
        Method::Iekf | Method::Ukf | Method::Guided => {
            let noise = match noise.model() {
                Some(model) => SensorNoise::of_model(model, &observations),
                None => SensorNoise::adaptive(&observations),
            };
            let tuning = if settings.method == Method::Iekf { Tuning::default() } else { Tuning::rigid() };
            let model = StateSpace::new(&calibration.skeleton, &noise, &tuning);
            let emit = |summary: &Summary| builder.push(summary);
            match settings.method {
                Method::Guided => {
                    let sampling = Sampling { particles: settings.chosen_particles(), seed: settings.seed };
                    let sizes = guided::run(&observations, &model, sampling, pass, monitor, emit)?;
                    quality.effective_sample_size = Some(sizes);
                }
                Method::Ukf => ukf::run(&observations, &model, pass, monitor, emit)?,
                _ => iekf::run(&observations, &model, pass, monitor, emit)?,
            }
        }
        Method::Ik => run_closed_geometry(&observations, &calibration, monitor, emit)?,
        Method::Nite => middleware::run(skeleton, &observations, &calibration, monitor, emit)?,
    }
    if matches!(settings.method, Method::Ik | Method::Nite) {
        quality.warnings.push(Warning::new(
            "no_interval",
            "this baseline has no model of noise and gives no credible intervals; choose another method for them",
        ));
    }
    monitor.begin(Step::Summarizing, 0)?;
    let series = builder.finish();
    Ok(Assessment {
        gait: None,
        joints: None,
        performance: None,
        pipeline: "joint_angles",
        time_ns: observations.time_ns,
        summary: series.iter().map(Series::summarize).collect(),
        series,
        quality,
        provenance: Provenance {
            software_version: env!("CARGO_PKG_VERSION").to_owned(),
            pipeline: "joint_angles".to_owned(),
            method: settings.method.name().to_owned(),
            settings: Settings::JointAngles(settings.clone()),
            noise_model: noise.reference(),
            patient_assessment_id: knowledge.patient().map(|patient| patient.assessment_id),
            seed: settings.seed,
            recording_sha256: String::new(),
        },
    })
}

/// The noise that a method runs on.
#[derive(Debug, Clone, Copy, PartialEq)]
enum ChosenNoise<'a> {
    /// None: the method has no model of noise.
    None,
    /// Estimated from the recording itself.
    Adaptive,
    /// A named model.
    Model(&'a NoiseModel),
}

impl<'a> ChosenNoise<'a> {
    fn model(self) -> Option<&'a NoiseModel> {
        if let Self::Model(model) = self { Some(model) } else { None }
    }

    fn reference(self) -> Option<NoiseModelReference> {
        match self {
            Self::None => None,
            Self::Adaptive => Some(NoiseModelReference::adaptive()),
            Self::Model(model) => Some(model.reference()),
        }
    }
}

/// Finds what the settings name, among the inputs and the shipped models.
fn chosen_noise<'a>(settings: &JointAngleSettings, inputs: &'a Inputs) -> Result<ChosenNoise<'a>, PipelineError> {
    let name = settings
        .chosen_noise_model()
        .map_err(|error| PipelineError::unsuitable("unusable_noise_model", error.to_string()))?;
    let Some(name) = name else { return Ok(ChosenNoise::None) };
    if name.is_adaptive() {
        return Ok(ChosenNoise::Adaptive);
    }
    let given = inputs.noise_model.as_ref().filter(|model| {
        let found = model.name();
        found.name == name.name && (name.version.is_none() || name.version == found.version)
    });
    given.or_else(|| find_shipped(&name)).map(ChosenNoise::Model).ok_or_else(|| {
        let sentence = format!("the noise model `{name}` is not there; name one that exists, or leave it out");
        PipelineError::unsuitable("noise_model_missing", sentence)
    })
}

/// Closed geometry, frame by frame.
fn run_closed_geometry(
    observations: &Observations,
    calibration: &Calibration,
    monitor: &Monitor,
    mut emit: impl FnMut(&Posterior),
) -> Result<(), PipelineError> {
    monitor.begin(Step::Estimating, observations.len() as u64)?;
    let mut pose = Pose::reference();
    for (t, points) in observations.points.iter().enumerate() {
        pose = inverse_kinematics::pose_from_points(&calibration.skeleton, points, &pose);
        emit(&Posterior { pose: pose.clone(), covariance: None, seen: observations.seen(t), limb_flags: [0; 4] });
        monitor.advance(1)?;
    }
    Ok(())
}

/// Quality of the camera's frames.
pub(super) fn observations_quality(observations: &Observations, calibration: &Calibration) -> Quality {
    let n = observations.len();
    let complete = (0..n).filter(|t| observations.seen(*t) == ALL_SEEN).count();
    let mut intervals: Vec<f64> = (1..n).map(|t| observations.interval_s(t)).collect();
    intervals.sort_by(f64::total_cmp);
    Quality {
        n_frames: n as u64,
        duration_s: intervals.iter().sum(),
        median_interval_s: intervals.get(intervals.len() / 2).copied().unwrap_or(0.0),
        longest_gap_s: intervals.last().copied().unwrap_or(0.0),
        coverage: complete as f64 / n.max(1) as f64,
        effective_sample_size: None,
        calibration: Some(calibration.quality.clone()),
        fusion: None,
        warnings: calibration.warnings.clone(),
        events: Vec::new(),
        event_counts: Vec::new(),
    }
}
