//! Joint angles from a camera skeleton and inertial units together (\[fusion\]).
//!
//! Camera's body (observations, segment lengths) → clocks → orientation of every unit → set-up (plank, mounting, heading,
//! tilt of the camera) → posture at the units' rate → anatomical angles with intervals, places of all joints.
//!
//! `hierarchy` is the paper's method on the same parts; `inertial` leaves the camera out, `camera` the units.

pub mod alignment;
pub mod camera;
mod clocks;
pub mod evidence;
mod fused;
pub mod hierarchy;
pub mod hinge;
pub mod motion;
mod place;
mod posture;
mod report;
mod series;
pub mod setup;
pub mod synchronization;
mod track;
mod turns;
mod units;

use super::{PipelineError, joint_angles};
use crate::assessment::{
    Assessment, FusionMethod, JointAngleSettings, Provenance, Quality, Series, Settings, SkeletonFusionSettings,
    Warning,
};
use crate::body::{Bone, Pose, Skeleton};
use crate::pipeline::joint_angles::posterior::{Spread, Summary};
use crate::progress::{Monitor, Step};
use crate::recording::Recording;
use camera::CameraBody;
use clocks::{ClockedUnit, ClockedUnits, clocked_units};
use fused::FusedBody;
use hierarchy::Hierarchy;
use motion::{MotionSettings, UnitMotion, motion_of_unit};
use nalgebra::Vector3;
use place::Places;
use series::{Grid, Placed};
use setup::{Plank, Setup};
use synchronization::CommonRest;
use track::CameraTrack;
use units::worn_units;

/// Stature of an adult of whom nothing is known, metres; without a camera it scales nothing but the drawing.
const AVERAGE_STATURE_M: f64 = 1.7;

/// Time between two estimates of the uncertainty, seconds; it changes with the posture.
const SPREAD_STEP_S: f64 = 0.2;

/// Estimates posture and places at the units' rate.
///
/// # Errors
/// [`PipelineError::Unsuitable`]: `no_skeleton` for the methods that need one, `no_alignment`, `no_overlap`,
/// `too_many_samples`, `no_reference_skeleton`, `no_joint_between_units`, those of the units and the clocks, and those of the joint-angle pipeline.
pub fn assess(
    recording: &Recording,
    settings: &SkeletonFusionSettings,
    monitor: &Monitor,
) -> Result<Assessment, PipelineError> {
    if settings.method == FusionMethod::Camera {
        return camera_alone(recording, settings, monitor);
    }
    monitor.begin(Step::Calibrating, 0)?;
    let mut warnings = Vec::new();
    let units = worn_units(recording, &mut warnings)?;
    let camera = camera_body(recording, settings, &mut warnings)?;
    let camera = camera.as_ref();
    let ClockedUnits { units, plank } = clocked_units(recording, &units, settings.clocks, &mut warnings)?;
    let motions = motions(&units, plank.as_ref(), settings, monitor)?;
    let plank = plank.map(|rest| Plank::of(&rest, camera));
    let skeleton = camera.map_or_else(|| average_skeleton(recording), |camera| camera.skeleton().clone());
    let setup = Setup::of(camera, &skeleton, &motions, plank, settings.mounting).ok_or_else(|| {
        let sentence = "the units' data contradict each other so far that no mounting explains them; check which unit \
                        was worn where";
        PipelineError::unsuitable("no_alignment", sentence)
    })?;
    let grid = Grid::of(camera, &motions, setup.worn_from_ns, settings.rate_hz).ok_or_else(|| {
        let sentence = "camera and units have no time in common; check their clocks, and that both recorded the same \
                        movement";
        PipelineError::unsuitable("no_overlap", sentence)
    })?;
    let grid = grid.bounded(settings.rate_hz.is_some(), &mut warnings)?;
    warnings.extend(report::warnings(&setup));
    let start_ns = camera.map_or_else(|| grid.time_ns(0), |camera| camera.observations.time_ns[0]);
    let mut fusion = report::fusion_quality(&units, &setup, &grid, &motions, camera.is_some(), start_ns);
    let series = if settings.method == FusionMethod::Hierarchy {
        let headings = paper_headings(&setup, &motions);
        let body = camera.and_then(|camera| Hierarchy::new(camera, &motions, headings, setup.worn_from_ns));
        let body = body.ok_or_else(|| {
            let sentence = "no frame shows the whole body, which the reference skeleton is taken from";
            PipelineError::unsuitable("no_reference_skeleton", sentence)
        })?;
        fusion.reference_frame_s = Some((body.reference().time_ns - start_ns) as f64 * 1e-9);
        warnings.push(Warning::new(
            "no_interval",
            "the paper's hierarchy has no model of noise and gives no credible intervals; choose `fused` for them",
        ));
        series_of_hierarchy(camera, &skeleton, &body, &grid, monitor)?
    } else {
        let track = match camera {
            Some(camera) => Some(CameraTrack::of(camera, &setup.alignment, &motions, setup.worn_from_ns, monitor)?),
            None => None,
        };
        let body = FusedBody::new(&setup.alignment, &motions, track.as_ref(), setup.worn_from_ns);
        series_of_fusion(camera, &skeleton, &body, &grid, monitor)?
    };
    if series.iter().all(|series| series.value.iter().all(|value| value.is_nan())) {
        let sentence = "no joint of the model lies between two of the units, and no camera saw the others; wear units on \
                        both segments of a joint, or record with a camera";
        return Err(PipelineError::unsuitable("no_joint_between_units", sentence));
    }
    let mut quality = quality(camera, &grid, warnings);
    quality.fusion = Some(fusion);
    Ok(Assessment {
        gait: None,
        joints: None,
        performance: None,
        pipeline: "skeleton_fusion",
        time_ns: grid.times_ns(),
        summary: series.iter().map(Series::summarize).collect(),
        series,
        quality,
        provenance: provenance(settings),
    })
}

/// The camera alone, by the default method of joint angles.
fn camera_alone(
    recording: &Recording,
    settings: &SkeletonFusionSettings,
    monitor: &Monitor,
) -> Result<Assessment, PipelineError> {
    let own = JointAngleSettings { min_confidence: settings.min_confidence, ..JointAngleSettings::default() };
    let assessment = joint_angles::assess(recording, &own, monitor)?;
    let noise_model = assessment.provenance.noise_model.clone();
    let provenance = Provenance { noise_model, ..provenance(settings) };
    Ok(Assessment { pipeline: "skeleton_fusion", provenance, ..assessment })
}

/// The camera's part, for the methods that look at it.
fn camera_body(
    recording: &Recording,
    settings: &SkeletonFusionSettings,
    warnings: &mut Vec<Warning>,
) -> Result<Option<CameraBody>, PipelineError> {
    if settings.method == FusionMethod::Inertial {
        return Ok(None);
    }
    match recording.skeleton.as_ref().filter(|skeleton| skeleton.len() > 1) {
        Some(skeleton) => Ok(Some(CameraBody::of(&recording.header, skeleton, settings)?)),
        None if settings.method == FusionMethod::Hierarchy => Err(PipelineError::unsuitable(
            "no_skeleton",
            "the recording has no skeleton frames, which the hierarchy takes its reference skeleton from; record with body \
             tracking on, or choose the method inertial",
        )),
        None => {
            warnings.push(Warning::new(
                "no_camera",
                "the recording has no skeleton frames: angles come from the units alone, and only for joints between two \
                 of them",
            ));
            Ok(None)
        }
    }
}

fn motions(
    units: &[ClockedUnit<'_>],
    plank: Option<&CommonRest>,
    settings: &SkeletonFusionSettings,
    monitor: &Monitor,
) -> Result<Vec<UnitMotion>, PipelineError> {
    let is_paper = settings.method == FusionMethod::Hierarchy;
    let mut motions = Vec::with_capacity(units.len());
    for ClockedUnit { bone, unit, clock, .. } in units {
        monitor.check()?;
        let at_rest = plank.and_then(|rest| rest.units.iter().find(|at_rest| at_rest.segment == unit.segment));
        let how = MotionSettings {
            method: settings.chosen_orientation(),
            gain: settings.gain,
            splits_at_gaps: !is_paper,
            // The paper's filter estimates no bias; its units were calibrated at rest, as those on the plank can be.
            bias: at_rest.filter(|_| is_paper).map_or_else(Vector3::zeros, |at_rest| at_rest.angular_rate),
        };
        let motion = motion_of_unit(unit, *bone, |time_ns| clock.camera_ns(time_ns), &how)
            .map_err(|error| PipelineError::unsuitable("unusable_unit", format!("{}: {error}", unit.segment)))?;
        motions.push(motion);
    }
    Ok(motions)
}

/// Headings that the paper takes as known: those by which the units agree on the plank, and without one those of the
/// alignment.
fn paper_headings(setup: &Setup, motions: &[UnitMotion]) -> Vec<f64> {
    let of_unit = |u: usize| {
        let on_plank = setup.plank_headings.as_ref().and_then(|plank| plank.units[u]);
        on_plank.map_or_else(|| setup.alignment.units[u].headings.first().map_or(0.0, |c| c.values[0]), |(_, h)| h)
    };
    (0..motions.len()).map(of_unit).collect()
}

fn series_of_fusion(
    camera: Option<&CameraBody>,
    skeleton: &Skeleton,
    body: &FusedBody<'_>,
    grid: &Grid,
    monitor: &Monitor,
) -> Result<Vec<Series>, PipelineError> {
    let places = camera.map(|camera| Places::of(camera, |time_ns| body.posture(time_ns).pose));
    let placed = camera.zip(places.as_ref()).map(|(camera, places)| Placed { places, camera });
    let per_spread = ((SPREAD_STEP_S * grid.rate_hz()).round() as usize).max(1);
    let spread_at = |i: usize| body.spread(grid.time_ns(i.min(grid.len - 1)));
    let mut spreads: (usize, Spread, Spread) = (0, spread_at(0), spread_at(per_spread));
    series::build(grid, skeleton, placed.as_ref(), monitor, |i, time_ns| {
        let step = i / per_spread;
        if step != spreads.0 {
            spreads = (step, spreads.2.clone(), spread_at((step + 1) * per_spread));
        }
        let share = (i % per_spread) as f64 / per_spread as f64;
        let posture = body.posture(time_ns);
        let follows = |bone: Bone| posture.followed >> bone.index() & 1 == 1;
        Summary {
            spread: Some(spreads.1.towards(&spreads.2, share)),
            seen: posture.seen,
            limb_flags: [0; 4],
            twist_seen: crate::body::Limb::ALL.map(|limb| follows(Bone::Proximal(limb))),
            pose: posture.pose,
        }
    })
}

fn series_of_hierarchy(
    camera: Option<&CameraBody>,
    skeleton: &Skeleton,
    body: &Hierarchy<'_>,
    grid: &Grid,
    monitor: &Monitor,
) -> Result<Vec<Series>, PipelineError> {
    let places = camera.map(|camera| Places::of(camera, |time_ns| body.posture(time_ns, &Pose::reference()).0));
    let placed = camera.zip(places.as_ref()).map(|(camera, places)| Placed { places, camera });
    let mut pose = Pose::reference();
    series::build(grid, skeleton, placed.as_ref(), monitor, |_, time_ns| {
        let (found, seen) = body.posture(time_ns, &pose);
        pose = found.clone();
        Summary { pose: found, spread: None, seen, limb_flags: [0; 4], twist_seen: [false; 4] }
    })
}

fn average_skeleton(recording: &Recording) -> Skeleton {
    Skeleton::of_stature(recording.header.subject_height_m.unwrap_or(AVERAGE_STATURE_M))
}

fn quality(camera: Option<&CameraBody>, grid: &Grid, mut warnings: Vec<Warning>) -> Quality {
    let Some(camera) = camera else {
        let step_s = 1.0 / grid.rate_hz();
        return Quality {
            n_frames: grid.len as u64,
            duration_s: step_s * (grid.len - 1) as f64,
            median_interval_s: step_s,
            longest_gap_s: step_s,
            warnings,
            ..Quality::default()
        };
    };
    let own = joint_angles::observations_quality(&camera.observations, &camera.calibration);
    warnings.extend(own.warnings);
    Quality { warnings, events: camera.events.clone(), event_counts: camera.event_counts.clone(), ..own }
}

fn provenance(settings: &SkeletonFusionSettings) -> Provenance {
    Provenance {
        software_version: env!("CARGO_PKG_VERSION").to_owned(),
        pipeline: "skeleton_fusion".to_owned(),
        method: settings.method.name().to_owned(),
        settings: Settings::SkeletonFusion(settings.clone()),
        // No method of this pipeline draws random numbers.
        seed: 0,
        ..Provenance::default()
    }
}
