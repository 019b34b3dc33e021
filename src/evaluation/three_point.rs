//! The angle that any program can read off three joints: no model, no filter. What an estimate has to beat.

use crate::body::{Limb, Side};
use crate::geometry::three_point::flexion_of_three_points;
use crate::recording::SkeletonRecording;

/// Knee flexion of each frame, degrees; see [`hinge_flexion_deg`].
pub fn knee_flexion_deg(skeleton: &SkeletonRecording, side: Side) -> Option<Vec<f64>> {
    hinge_flexion_deg(skeleton, if side == Side::Left { Limb::LeftLeg } else { Limb::RightLeg })
}

/// Flexion of a limb's knee or elbow in each frame, degrees: 180° less the angle at it between the limb's root and end;
/// NaN where one of the three is missing. None for a recording that has no such joints.
pub fn hinge_flexion_deg(skeleton: &SkeletonRecording, limb: Limb) -> Option<Vec<f64>> {
    let mut columns = [0; 3];
    for (column, (joint, stand_in)) in columns.iter_mut().zip(limb.joints()) {
        *column = skeleton.column(joint).or_else(|| skeleton.column(stand_in))?;
    }
    let flexion = |t: usize| {
        let [root, hinge, end] = columns.map(|column| skeleton.frame(t)[column]);
        flexion_of_three_points(&root, &hinge, &end).to_degrees()
    };
    Some((0..skeleton.len()).map(flexion).collect())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::body::Joint;
    use nalgebra::Vector3;

    fn leg(joints: [Joint; 3], positions: [[f64; 3]; 3]) -> SkeletonRecording {
        SkeletonRecording {
            joints: joints.to_vec(),
            time_ns: vec![0],
            positions: positions.map(Vector3::from).to_vec(),
            confidence: vec![1.0; 3],
            orientations: Vec::new(),
        }
    }

    #[test]
    fn a_right_angle_is_90_degrees_and_a_straight_leg_0() {
        let joints = [Joint::RightHip, Joint::RightKnee, Joint::RightFoot];
        let bent = leg(joints, [[0.0, 1.0, 0.0], [0.0, 0.5, 0.0], [0.0, 0.5, 0.4]]);
        assert!((knee_flexion_deg(&bent, Side::Right).unwrap()[0] - 90.0).abs() < 1e-9);
        let straight = leg(joints, [[0.0, 1.0, 0.0], [0.0, 0.5, 0.0], [0.0, 0.1, 0.0]]);
        assert!(knee_flexion_deg(&straight, Side::Right).unwrap()[0].abs() < 1e-5);
        assert_eq!(knee_flexion_deg(&straight, Side::Left), None);
    }

    #[test]
    fn an_elbow_bends_as_a_knee_does() {
        let joints = [Joint::LeftShoulder, Joint::LeftElbow, Joint::LeftWrist];
        let bent = leg(joints, [[0.0, 1.0, 0.0], [0.0, 0.7, 0.0], [0.3, 0.7, 0.0]]);
        assert!((hinge_flexion_deg(&bent, Limb::LeftArm).unwrap()[0] - 90.0).abs() < 1e-9);
        assert_eq!(hinge_flexion_deg(&bent, Limb::RightArm), None);
    }

    #[test]
    fn a_missing_or_coinciding_joint_gives_no_number() {
        let joints = [Joint::LeftHip, Joint::LeftKnee, Joint::LeftAnkle];
        for knee in [[f64::NAN; 3], [0.0, 1.0, 0.0]] {
            let lost = leg(joints, [[0.0, 1.0, 0.0], knee, [0.0, 0.1, 0.0]]);
            assert!(knee_flexion_deg(&lost, Side::Left).unwrap()[0].is_nan());
        }
    }
}
