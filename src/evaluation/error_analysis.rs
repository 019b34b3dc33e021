//! The paper's error analysis (\[angles\] Table 2): how far a method's joint rotations are from the reference's, and
//! whether they are nearer than the middleware's.
//!
//! ```text
//! E = R_estimate R_reference⁻¹      ε = |log E|      E = Rz(flexion) Rx(adduction) Ry(rotation)
//! Δε = ε(nite) − ε(method)          Wilcoxon's signed-rank test of Δε against 0
//! ```
//!
//! The knee is a hinge here: its ε is the absolute error of its flexion. Numbers run over the frames of all trials, as
//! in the paper; frames follow each other smoothly, so the test's probabilities are smaller than the evidence.

use super::agreement::quartiles;
use super::reference::interpolated;
use super::signed_rank::signed_rank;
use crate::assessment::{AngleChannel, Assessment};
use crate::body::Side;
use crate::geometry::attitude::rotation_from_attitude;
use crate::geometry::euler::zxy_from_rotation;
use crate::recording::Recording;
use nalgebra::Vector3;
use serde::Serialize;

/// Errors of one side in each frame, degrees, none negative; NaN where there is no estimate or no reference.
#[derive(Debug, Clone, PartialEq)]
pub struct FrameErrors {
    /// The side.
    pub side: Side,
    /// Absolute Euler angles of the hip's error: flexion, abduction, rotation.
    pub hip_angles: Vec<[f64; 3]>,
    /// Modulus of the hip's error attitude vector.
    pub hip_modulus: Vec<f64>,
    /// Absolute error of knee flexion.
    pub knee: Vec<f64>,
}

/// Errors of an assessment in the frames of its recording, for each side; a reference that is absent leaves NaN.
pub fn frame_errors(recording: &Recording, assessment: &Assessment) -> Vec<FrameErrors> {
    Side::BOTH.map(|side| errors_of_side(recording, assessment, side)).to_vec()
}

fn errors_of_side(recording: &Recording, assessment: &Assessment, side: Side) -> FrameErrors {
    let n = assessment.time_ns.len();
    let pair = |channel: AngleChannel| {
        let name = channel.name();
        let series = assessment.series.iter().find(|s| s.channel == name);
        let reference = recording.references.iter().find(|r| r.channel == name);
        let estimate = series.map_or(vec![f64::NAN; n], |s| s.value.iter().map(|v| f64::from(*v)).collect());
        let truth = reference.map_or(vec![f64::NAN; n], |r| interpolated(r, &assessment.time_ns));
        (estimate, truth)
    };
    let (knee, knee_truth) = pair(AngleChannel::KneeFlexion(side));
    let hip = [0, 1, 2].map(|axis| pair(AngleChannel::HipAttitude(side, axis)));
    let mut errors = FrameErrors { side, hip_angles: Vec::new(), hip_modulus: Vec::new(), knee: Vec::new() };
    for t in 0..n {
        errors.knee.push((knee[t] - knee_truth[t]).abs());
        let estimate = Vector3::from_fn(|axis, _| hip[axis].0[t].to_radians());
        let truth = Vector3::from_fn(|axis, _| hip[axis].1[t].to_radians());
        if !(estimate.norm().is_finite() && truth.norm().is_finite()) {
            errors.hip_angles.push([f64::NAN; 3]);
            errors.hip_modulus.push(f64::NAN);
            continue;
        }
        let error = rotation_from_attitude(&estimate) * rotation_from_attitude(&truth).inverse();
        let euler = zxy_from_rotation(&error);
        errors.hip_angles.push([euler.first, euler.second, euler.third].map(|angle| angle.to_degrees().abs()));
        errors.hip_modulus.push(error.angle().to_degrees());
    }
    errors
}

/// Mean and quartiles of a set of errors, degrees.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Spread {
    /// Mean.
    pub mean_deg: f64,
    /// First quartile.
    pub p25_deg: f64,
    /// Third quartile.
    pub p75_deg: f64,
}

impl Spread {
    /// Of the finite values; none without any.
    pub fn of(values: &[f64]) -> Option<Self> {
        let [p25_deg, _, p75_deg] = quartiles(values)?;
        let finite: Vec<f64> = values.iter().copied().filter(|v| v.is_finite()).collect();
        Some(Self { mean_deg: finite.iter().sum::<f64>() / finite.len() as f64, p25_deg, p75_deg })
    }
}

/// How much nearer to the reference a method is than the middleware.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Gain {
    /// Δε: positive where the middleware's error is larger.
    pub difference: Spread,
    /// Frames compared.
    pub n_frames: usize,
    /// Standard error of the mean Δε over frames, degrees, as in the paper's Figure 3. Frames are not independent:
    /// the true one is larger.
    pub standard_error_deg: f64,
    /// Standardised rank sum of Wilcoxon's test.
    pub z: f64,
    /// Its two-sided probability.
    pub p: f64,
}

impl Gain {
    fn of(baseline: &[f64], method: &[f64]) -> Option<Self> {
        let differences: Vec<f64> = baseline.iter().zip(method).map(|(a, b)| a - b).collect();
        let test = signed_rank(&differences)?;
        let difference = Spread::of(&differences)?;
        let deviations = || differences.iter().filter(|d| d.is_finite()).map(|d| (d - difference.mean_deg).powi(2));
        let n_frames = deviations().count();
        let variance = deviations().sum::<f64>() / n_frames.saturating_sub(1).max(1) as f64;
        let standard_error_deg = (variance / n_frames.max(1) as f64).sqrt();
        Some(Self { difference, n_frames, standard_error_deg, z: test.z, p: test.p })
    }
}

/// One method on one side in one exercise: a cell row of the paper's Table 2.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct ErrorRow {
    /// Where the trials come from.
    pub dataset: String,
    /// What was done, or `all`.
    pub exercise: String,
    /// The side.
    pub side: Side,
    /// The method.
    pub method: String,
    /// Hip flexion.
    pub hip_flexion: Option<Spread>,
    /// Hip abduction.
    pub hip_abduction: Option<Spread>,
    /// Hip axial rotation.
    pub hip_axial_rotation: Option<Spread>,
    /// Knee flexion.
    pub knee_flexion: Option<Spread>,
    /// Gain at the hip over the middleware; none for the middleware itself, or when it was not run.
    pub hip_gain: Option<Gain>,
    /// Gain at the knee over the middleware.
    pub knee_gain: Option<Gain>,
}

/// The row of a method from its errors in every trial of an exercise, beside the middleware's in the same trials.
pub fn error_row(method: &str, side: Side, trials: &[(&FrameErrors, Option<&FrameErrors>)]) -> ErrorRow {
    let pooled = |values: &dyn Fn(&FrameErrors) -> Vec<f64>| -> Vec<f64> {
        trials.iter().flat_map(|(own, _)| values(own)).collect()
    };
    let gain = |values: fn(&FrameErrors) -> &Vec<f64>| {
        let pairs = || trials.iter().filter_map(|(own, baseline)| Some((values(own), values((*baseline)?))));
        let baseline: Vec<f64> = pairs().flat_map(|(_, b)| b.iter().copied()).collect();
        let own: Vec<f64> = pairs().flat_map(|(a, _)| a.iter().copied()).collect();
        Gain::of(&baseline, &own)
    };
    let hip = |axis: usize| Spread::of(&pooled(&|errors| errors.hip_angles.iter().map(|e| e[axis]).collect()));
    ErrorRow {
        dataset: String::new(),
        exercise: String::new(),
        side,
        method: method.to_owned(),
        hip_flexion: hip(0),
        hip_abduction: hip(1),
        hip_axial_rotation: hip(2),
        knee_flexion: Spread::of(&pooled(&|errors| errors.knee.clone())),
        hip_gain: gain(|errors| &errors.hip_modulus),
        knee_gain: gain(|errors| &errors.knee),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn errors(hip_modulus: &[f64], knee: &[f64]) -> FrameErrors {
        let hip_angles = hip_modulus.iter().map(|e| [*e, 0.0, 2.0]).collect();
        FrameErrors { side: Side::Left, hip_angles, hip_modulus: hip_modulus.to_vec(), knee: knee.to_vec() }
    }

    #[test]
    fn a_method_nearer_than_the_middleware_in_every_frame_has_a_positive_gain() {
        let own = errors(&[1.0, 2.0, 3.0, 4.0, 5.0], &[1.0; 5]);
        let middleware = errors(&[3.0, 5.0, 7.0, 9.0, 11.0], &[1.0; 5]);
        let row = error_row("iekf", Side::Left, &[(&own, Some(&middleware))]);
        let gain = row.hip_gain.unwrap();
        // Differences 2, 3, 4, 5, 6; rank sum 15 against a mean of 7.5 with variance 5 · 6 · 11 / 24 = 13.75.
        assert_eq!(gain.difference, Spread { mean_deg: 4.0, p25_deg: 3.0, p75_deg: 5.0 });
        assert!((gain.z - 7.5 / 13.75f64.sqrt()).abs() < 1e-12);
        // Squares of −2, −1, 0, 1, 2 sum to 10; 10 / 4 / 5 = 0.5.
        assert!(gain.n_frames == 5 && (gain.standard_error_deg - 0.5f64.sqrt()).abs() < 1e-12);
        assert_eq!(row.knee_gain, None, "no difference, no test");
        assert_eq!(row.hip_flexion, Some(Spread { mean_deg: 3.0, p25_deg: 2.0, p75_deg: 4.0 }));
    }

    #[test]
    fn frames_without_a_number_are_left_out_and_without_the_middleware_there_is_no_gain() {
        let own = errors(&[1.0, f64::NAN], &[f64::NAN, f64::NAN]);
        let row = error_row("ik", Side::Left, &[(&own, None)]);
        assert_eq!(row.hip_flexion.unwrap().mean_deg, 1.0);
        assert_eq!((row.knee_flexion, row.hip_gain), (None, None));
    }
}
