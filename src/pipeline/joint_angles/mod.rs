//! Joint angles from skeleton joint positions (\[angles\]).
//!
//! Twelve points relative to the torso joint → calibration (lengths, offsets, facing) → the chosen method's posterior
//! of the posture in every frame → anatomical angles with intervals and flags.

pub mod calibration;
pub mod guided;
pub mod iekf;
pub mod inverse_kinematics;
pub mod middleware;
pub mod noise_model;
pub mod observation;
pub mod particle;
pub mod particle_model;
pub mod posterior;
pub mod sensor_noise;
pub mod state_space;
pub mod ukf;

use super::PipelineError;
use crate::assessment::{Assessment, JointAngleSettings, Method, Provenance, Quality, Series, Settings, Warning};
use crate::body::Pose;
use crate::progress::{Monitor, Step};
use crate::recording::Recording;
use calibration::{Calibration, calibrate};
use guided::Sampling;
use noise_model::NoiseModel;
use observation::{ALL_SEEN, Observations};
use posterior::{Posterior, SeriesBuilder};
use state_space::Tuning;

/// Fewest frames of a recording that can be assessed.
const MIN_FRAMES: usize = 2;

/// Estimates the joint angles of every frame.
///
/// # Errors
/// [`PipelineError::Unsuitable`] with a code for each thing that a recording can lack; see the modules.
pub fn assess(
    recording: &Recording,
    settings: &JointAngleSettings,
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
    monitor.begin(Step::Calibrating, 0)?;
    let mut observations = Observations::from_recording(skeleton, settings)?;
    let calibration = calibrate(&mut observations)?;
    let mut quality = observations_quality(&observations, &calibration);
    let mut builder = SeriesBuilder::new(observations.len());
    let emit = |posterior: &Posterior| builder.push(posterior);
    match settings.method {
        Method::Particle => {
            let noise = NoiseModel::nite_table1();
            let particles = settings.chosen_particles();
            let sizes = particle::run(&observations, &calibration, noise, particles, settings.seed, monitor, emit)?;
            quality.effective_sample_size = Some(sizes);
        }
        Method::Guided => {
            let sampling = Sampling { particles: settings.chosen_particles(), seed: settings.seed };
            let sizes = guided::run(&observations, &calibration, &Tuning::default(), sampling, pass, monitor, emit)?;
            quality.effective_sample_size = Some(sizes);
        }
        Method::Ukf => ukf::run(&observations, &calibration, &Tuning::default(), pass, monitor, emit)?,
        Method::Iekf => iekf::run(&observations, &calibration, &Tuning::default(), pass, monitor, emit)?,
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
            seed: settings.seed,
            recording_sha256: String::new(),
        },
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

fn observations_quality(observations: &Observations, calibration: &Calibration) -> Quality {
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
        warnings: calibration.warnings.clone(),
        events: Vec::new(),
    }
}
