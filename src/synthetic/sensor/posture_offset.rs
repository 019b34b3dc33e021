//! The slow error of a depth sensor: joints sit beside their true place by a distance that depends on the posture.
//!
//! ```text
//! e_j(θ) = c_j + Σₖ a_jk sin(w_jk · θ + φ_jk)
//! ```
//!
//! with directions `w_jk` in the space of postures drawn once for a recording. A quick movement therefore moves the
//! error quickly, a posture that comes back has the same error again, and no filter in time can take it away.

use super::standard_normals;
use crate::body::pose::{PoseVector, attitude_offset, hinge_offset};
use crate::body::{Joint, Limb, POSE_DIMENSION};
use crate::recording::SkeletonRecording;
use nalgebra::Vector3;
use rand::{Rng, RngExt};
use rand_distr::StandardNormal;
use std::f64::consts::TAU;

/// Waves of each joint.
const WAVES: usize = 3;

/// Radians of a wave's phase for each radian of the joint's own limb, of the trunk, and of the other leg (which hides
/// and is hidden).
const OWN_LIMB: f64 = 0.8;
const TRUNK: f64 = 0.6;
const OTHER_LEG: f64 = 0.2;

/// Size of the error, root mean square of its length over recordings and postures, millimetres.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct OffsetSize {
    /// The part that stays through a recording.
    pub constant_mm: f64,
    /// The part that follows the posture.
    pub posture_mm: f64,
}

/// Sizes for a Kinect v2 joint: what UI-PRMD shows against Vicon, in all 20 mm at the shoulders to 56 mm at the feet.
pub fn kinect_v2_size(joint: Joint) -> OffsetSize {
    let (constant_mm, posture_mm) = match joint {
        Joint::LeftHip | Joint::RightHip => (25.0, 20.0),
        Joint::LeftKnee | Joint::RightKnee => (25.0, 30.0),
        Joint::LeftAnkle | Joint::RightAnkle | Joint::LeftFoot | Joint::RightFoot => (32.0, 46.0),
        Joint::LeftElbow | Joint::RightElbow => (20.0, 25.0),
        Joint::LeftWrist | Joint::RightWrist | Joint::LeftHand | Joint::RightHand => (24.0, 32.0),
        _ => (16.0, 12.0),
    };
    OffsetSize { constant_mm, posture_mm }
}

/// Sizes for every joint of a Kinect v2 against motion capture, the torso's too: 30 mm (roots of limbs) to 45 mm (their
/// ends) that stay, 20 to 30 mm that follow the posture.
pub fn every_joint_size(joint: Joint) -> OffsetSize {
    let level =
        Limb::ALL.into_iter().find_map(|limb| limb.joints().iter().position(|(a, b)| *a == joint || *b == joint));
    let (constant_mm, posture_mm) = match level {
        Some(2) => (45.0, 30.0),
        Some(1) => (38.0, 25.0),
        _ => (30.0, 20.0),
    };
    OffsetSize { constant_mm, posture_mm }
}

/// Error of one joint as a function of the posture.
struct JointError {
    constant: Vector3<f64>,
    waves: [(Vector3<f64>, PoseVector, f64); WAVES],
}

impl JointError {
    fn draw(joint: Joint, size: OffsetSize, rng: &mut impl Rng) -> Self {
        let per_axis = 1.0 / 3f64.sqrt();
        let amplitude = size.posture_mm / 1000.0 * per_axis * (2.0 / WAVES as f64).sqrt();
        let weights = weights_of(joint);
        let mut wave = || {
            let direction = PoseVector::from_fn(|i, _| weights[i] * rng.sample::<f64, _>(StandardNormal));
            (standard_normals(rng) * amplitude, direction, TAU * rng.random::<f64>())
        };
        let waves = std::array::from_fn(|_| wave());
        Self { constant: standard_normals(rng) * (size.constant_mm / 1000.0 * per_axis), waves }
    }

    fn at(&self, theta: &PoseVector) -> Vector3<f64> {
        let moving =
            self.waves.iter().map(|(amplitude, direction, phase)| amplitude * (direction.dot(theta) + phase).sin());
        self.constant + moving.sum::<Vector3<f64>>()
    }
}

/// How much each element of θ moves the error of a joint.
fn weights_of(joint: Joint) -> PoseVector {
    let mut weights = PoseVector::zeros();
    weights.fixed_rows_mut::<3>(0).fill(TRUNK);
    let own = Limb::ALL.into_iter().find(|limb| limb.joints().iter().any(|(a, b)| *a == joint || *b == joint));
    let Some(own) = own else { return weights };
    let mut set = |limb: Limb, weight: f64| {
        weights.fixed_rows_mut::<3>(attitude_offset(limb.index())).fill(weight);
        weights[hinge_offset(limb.index())] = weight;
    };
    match own {
        Limb::LeftLeg => set(Limb::RightLeg, OTHER_LEG),
        Limb::RightLeg => set(Limb::LeftLeg, OTHER_LEG),
        Limb::LeftArm | Limb::RightArm => {}
    }
    set(own, OWN_LIMB);
    weights
}

/// Moves every joint of every frame by its error; `thetas` holds the true posture of each frame.
pub fn add(
    skeleton: &mut SkeletonRecording,
    thetas: &[PoseVector],
    size: impl Fn(Joint) -> OffsetSize,
    rng: &mut impl Rng,
) {
    const { assert!(POSE_DIMENSION == 19) };
    let errors: Vec<JointError> = skeleton.joints.iter().map(|j| JointError::draw(*j, size(*j), rng)).collect();
    for (frame, theta) in skeleton.positions.chunks_exact_mut(errors.len()).zip(thetas) {
        for (position, error) in frame.iter_mut().zip(&errors) {
            *position += error.at(theta);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::SeedableRng;
    use rand_chacha::ChaCha8Rng;

    #[test]
    fn the_error_has_its_stated_size_over_many_recordings() {
        let mut rng = ChaCha8Rng::seed_from_u64(7);
        let size = OffsetSize { constant_mm: 30.0, posture_mm: 40.0 };
        let theta = PoseVector::repeat(0.3);
        let n = 4000;
        let squares = (0..n).map(|_| JointError::draw(Joint::LeftKnee, size, &mut rng).at(&theta).norm_squared());
        let rms_mm = 1000.0 * (squares.sum::<f64>() / f64::from(n)).sqrt();
        // √(30² + 40²) = 50; the root mean square of 4000 three-dimensional draws is known to better than 1 %.
        assert!((rms_mm - 50.0).abs() < 1.0, "{rms_mm}");
    }

    #[test]
    fn the_same_posture_has_the_same_error_and_a_small_change_changes_it_little() {
        let mut rng = ChaCha8Rng::seed_from_u64(8);
        let error = JointError::draw(Joint::RightAnkle, kinect_v2_size(Joint::RightAnkle), &mut rng);
        let theta = PoseVector::repeat(0.2);
        let mut moved = theta;
        moved[hinge_offset(Limb::RightLeg.index())] += 1f64.to_radians();
        assert_eq!(error.at(&theta), error.at(&theta));
        let change = (error.at(&moved) - error.at(&theta)).norm();
        assert!(change > 0.0 && change < 0.005, "{change} m for one degree");
    }
}
