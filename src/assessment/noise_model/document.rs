//! A noise model as it is written down: units in the names, points and joints by name, left and right alike.

use super::{NoiseModel, ObservationCovariance, is_model_name};
use crate::body::pose::{PoseVector, attitude_offset, hinge_offset};
use crate::body::skeleton::point_index;
use crate::body::{Joint, Limb, OBSERVATION_DIMENSION};
use serde::{Deserialize, Serialize};
use std::ops::RangeInclusive;
use utoipa::ToSchema;

/// Standard deviations of a point's white noise that a sensor can have, millimetres. A sensor whose points never move
/// repeats its frames; the hands of \[angles\] Table 1 have 182 mm.
const PLAUSIBLE_WHITE_SD_MM: RangeInclusive<f64> = 0.01..=500.0;
/// Standard deviations of a slow offset that a sensor can have, millimetres.
const PLAUSIBLE_OFFSET_SD_MM: RangeInclusive<f64> = 0.0..=500.0;
/// Standard deviations of a joint's turn in 1/30 s, degrees.
const PLAUSIBLE_TRANSITION_SD_DEG: RangeInclusive<f64> = 0.01..=45.0;

/// A noise model as JSON.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct NoiseModelDocument {
    /// Name: 1 to 64 lower-case letters, digits and hyphens, beginning with a letter.
    pub name: String,
    /// Version, from 1. A version never changes.
    #[schema(minimum = 1)]
    pub version: u32,
    /// What the model describes and where it comes from, for a person.
    pub description: String,
    /// Noise of the twelve points, in the order of the correlations: left arm, right arm, left leg, right leg, each from
    /// the trunk outwards.
    pub points: Vec<PointNoise>,
    /// Correlations of white noise below the diagonal of Σy: list `i` holds those of coordinate `i + 1` with coordinates
    /// 0 to `i`. Coordinate 3 p + a is axis a of point p.
    pub correlations: Vec<Vec<f64>>,
    /// How far joints turn.
    pub transition_sd_deg: TransitionNoise,
    /// What it was trained on; null for a model that was not trained here.
    pub training: Option<TrainingRecord>,
}

/// Noise of one observed point relative to the torso joint.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct PointNoise {
    /// The point.
    pub point: Joint,
    /// Standard deviation of white noise in the sensor's axes (right, up, depth), millimetres.
    pub white_sd_mm: [f64; 3],
    /// Standard deviation of the slow offset of each coordinate, millimetres.
    pub slow_offset_sd_mm: f64,
}

/// Standard deviation of each joint's turn in 1/30 s, degrees; ball joints about the axes forward, up and rightward.
/// Variances grow with time: over an interval dt they are dt · 30 times as large.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct TransitionNoise {
    /// Trunk.
    pub trunk: [f64; 3],
    /// Both shoulders.
    pub shoulder: [f64; 3],
    /// Both elbows.
    pub elbow: f64,
    /// Both hips.
    pub hip: [f64; 3],
    /// Both knees.
    pub knee: f64,
}

/// What a model was trained on.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct TrainingRecord {
    /// Version of Surefoot that trained it.
    pub software_version: String,
    /// Recordings of a subject who stands still.
    pub static_recordings: Vec<TrainingSource>,
    /// Recordings of movements.
    pub movement_recordings: Vec<TrainingSource>,
    /// Where white noise comes from: `still_seconds` or, of movements, `third_differences`.
    pub white_source: String,
    /// Seconds from which white noise was estimated.
    pub white_s: f64,
    /// Share by which the correlations were shrunk towards zero, 0 to 1.
    pub shrinkage: f64,
    /// Where the turns of the joints come from: `reference`, `estimate`, `reference_and_estimate`, or the name of the
    /// model they were taken from.
    pub transition_source: String,
    /// Where the slow offset of the arms comes from: `reference` (elbow angles), `bone_lengths`, or `none`.
    pub arm_offset_source: String,
    /// Where the slow offset of the legs comes from: `reference` (knee angles), `bone_lengths`, or `none`.
    pub leg_offset_source: String,
}

/// One recording that a model was trained on.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct TrainingSource {
    /// Name of the file, or id of the stored recording.
    pub name: String,
    /// SHA-256 of its bytes, lower-case hexadecimal.
    pub sha256: String,
    /// Its length, seconds.
    pub duration_s: f64,
    /// Seconds of it that were used.
    pub used_s: f64,
}

/// A document that describes no noise model.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[error("{place}: {reason}")]
pub struct InvalidNoiseModel {
    /// Where in the document, for example `points[3].white_sd_mm`.
    pub place: String,
    /// What was found and expected.
    pub reason: String,
}

impl From<NoiseModel> for NoiseModelDocument {
    fn from(model: NoiseModel) -> Self {
        model.document
    }
}

impl TryFrom<NoiseModelDocument> for NoiseModel {
    type Error = InvalidNoiseModel;

    fn try_from(document: NoiseModelDocument) -> Result<Self, InvalidNoiseModel> {
        check_name(&document)?;
        check_points(&document.points)?;
        let observation = observation(&document)?;
        let transition_sd = transition(&document.transition_sd_deg)?.map(f64::to_radians);
        let slow_offset = std::array::from_fn(|p| document.points[p].slow_offset_sd_mm * 1e-3);
        Ok(Self { document, transition_sd, observation, slow_offset })
    }
}

fn invalid(place: impl Into<String>, reason: impl Into<String>) -> InvalidNoiseModel {
    InvalidNoiseModel { place: place.into(), reason: reason.into() }
}

fn check_name(document: &NoiseModelDocument) -> Result<(), InvalidNoiseModel> {
    if !is_model_name(&document.name) {
        let reason = "must be 1 to 64 lower-case letters, digits and hyphens, beginning with a letter";
        return Err(invalid("name", reason));
    }
    if document.version == 0 { Err(invalid("version", "must be 1 or more")) } else { Ok(()) }
}

/// The joint of each observed point, in order.
pub(super) fn observed_joints() -> impl Iterator<Item = Joint> {
    Limb::ALL.into_iter().flat_map(|limb| limb.joints().map(|(joint, _)| joint))
}

fn check_points(points: &[PointNoise]) -> Result<(), InvalidNoiseModel> {
    let expected: Vec<Joint> = observed_joints().collect();
    if points.iter().map(|p| p.point).ne(expected.iter().copied()) {
        let names: Vec<&str> = expected.iter().map(|joint| joint.name()).collect();
        return Err(invalid("points", format!("must be, in this order, {}", names.join(", "))));
    }
    for (p, point) in points.iter().enumerate() {
        for sd in point.white_sd_mm {
            check(sd, &PLAUSIBLE_WHITE_SD_MM, || format!("points[{p}].white_sd_mm"), "millimetres")?;
        }
        let place = || format!("points[{p}].slow_offset_sd_mm");
        check(point.slow_offset_sd_mm, &PLAUSIBLE_OFFSET_SD_MM, place, "millimetres")?;
    }
    Ok(())
}

/// Refuses NaN too.
fn check(
    value: f64,
    plausible: &RangeInclusive<f64>,
    place: impl FnOnce() -> String,
    unit: &str,
) -> Result<(), InvalidNoiseModel> {
    if plausible.contains(&value) {
        return Ok(());
    }
    let (low, high) = (plausible.start(), plausible.end());
    Err(invalid(place(), format!("{value} {unit} is no plausible standard deviation; expected {low} to {high}")))
}

fn observation(document: &NoiseModelDocument) -> Result<ObservationCovariance, InvalidNoiseModel> {
    let sd = |row: usize| document.points[row / 3].white_sd_mm[row % 3] * 1e-3;
    let mut covariance = ObservationCovariance::zeros();
    for row in 0..OBSERVATION_DIMENSION {
        covariance[(row, row)] = sd(row).powi(2);
    }
    if document.correlations.len() != OBSERVATION_DIMENSION - 1 {
        return Err(invalid("correlations", format!("must hold {} lists", OBSERVATION_DIMENSION - 1)));
    }
    for (i, correlations) in document.correlations.iter().enumerate() {
        let row = i + 1;
        if correlations.len() != row {
            return Err(invalid(format!("correlations[{i}]"), format!("must hold {row} numbers")));
        }
        for (column, correlation) in correlations.iter().enumerate() {
            // Written so that NaN is outside too.
            if !(-1.0..=1.0).contains(correlation) {
                let place = format!("correlations[{i}][{column}]");
                return Err(invalid(place, format!("{correlation} does not lie between -1 and 1")));
            }
            let value = correlation * sd(row) * sd(column);
            covariance[(row, column)] = value;
            covariance[(column, row)] = value;
        }
    }
    if covariance.cholesky().is_none() {
        return Err(invalid("correlations", "the covariance that they make is not positive definite"));
    }
    Ok(covariance)
}

fn transition(noise: &TransitionNoise) -> Result<PoseVector, InvalidNoiseModel> {
    let mut sd_deg = PoseVector::zeros();
    let mut set = |start: usize, values: &[f64], name: &str| {
        for (i, value) in values.iter().enumerate() {
            check(*value, &PLAUSIBLE_TRANSITION_SD_DEG, || format!("transition_sd_deg.{name}"), "degrees")?;
            sd_deg[start + i] = *value;
        }
        Ok(())
    };
    set(0, &noise.trunk, "trunk")?;
    for limb in Limb::ALL {
        let (ball, ball_name, hinge, hinge_name) = if limb.is_arm() {
            (&noise.shoulder, "shoulder", noise.elbow, "elbow")
        } else {
            (&noise.hip, "hip", noise.knee, "knee")
        };
        set(attitude_offset(limb.index()), ball, ball_name)?;
        set(hinge_offset(limb.index()), &[hinge], hinge_name)?;
    }
    Ok(sd_deg)
}

impl NoiseModelDocument {
    /// Noise of a limb's point; `level` 0 is shoulder or hip, 1 elbow or knee, 2 hand or foot.
    pub fn point(&self, limb: Limb, level: usize) -> Option<&PointNoise> {
        self.points.get(point_index(limb, level))
    }
}
