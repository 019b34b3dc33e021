//! Known defects of skeleton data, made explicit: what cannot be believed is lost.

use super::report::Defects;
use crate::recording::SkeletonRecording;
use nalgebra::Vector3;

/// Farthest a joint may move from one frame to the next, metres: 7.5 m/s at 30 frames/s, beyond any exercise.
pub const MAX_JUMP_M: f64 = 0.25;

/// Frames after which a joint that stays away is believed again; a quarter of a second at 30 frames/s.
const MAX_GAP: usize = 8;

/// Marks joints at exactly 0, 0, 0 and joints that jumped as lost, and counts both.
///
/// A jump is measured from the last frame in which the joint was believed, and `k` frames later the joint may have
/// moved `k` times as far; so the frame to which it returns is kept, not the excursion.
pub fn mark_lost(skeleton: &mut SkeletonRecording) -> Defects {
    let n = skeleton.joints.len();
    let mut defects = Defects::default();
    for j in 0..n {
        let mut believed: Option<(usize, Vector3<f64>)> = None;
        for t in 0..skeleton.len() {
            let position = skeleton.positions[t * n + j];
            if position.x.is_nan() {
                continue;
            }
            let is_zero = position == Vector3::zeros();
            let is_jump = believed.is_some_and(|(since, from)| {
                let frames = t - since;
                frames <= MAX_GAP && (position - from).norm() > MAX_JUMP_M * frames as f64
            });
            if is_zero {
                defects.lost_joints += 1;
            } else if is_jump {
                defects.jumps += 1;
            } else {
                believed = Some((t, position));
                continue;
            }
            lose(skeleton, t * n + j);
        }
    }
    defects
}

fn lose(skeleton: &mut SkeletonRecording, sample: usize) {
    skeleton.positions[sample] = Vector3::repeat(f64::NAN);
    skeleton.confidence[sample] = 0.0;
    if let Some(orientation) = skeleton.orientations.get_mut(sample) {
        *orientation = None;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::body::Joint;

    fn track(x: &[f64]) -> SkeletonRecording {
        SkeletonRecording {
            joints: vec![Joint::LeftAnkle],
            time_ns: (0..x.len() as i64).collect(),
            positions: x.iter().map(|&x| if x == 0.0 { Vector3::zeros() } else { Vector3::new(x, 1.0, 2.0) }).collect(),
            confidence: vec![1.0; x.len()],
            orientations: Vec::new(),
        }
    }

    fn lost(skeleton: &SkeletonRecording) -> Vec<usize> {
        (0..skeleton.len()).filter(|&t| skeleton.confidence[t] == 0.0).collect()
    }

    #[test]
    fn an_excursion_is_lost_and_the_return_is_kept() {
        let mut skeleton = track(&[1.0, 1.01, 2.0, 1.9, 1.02, 1.03]);
        let defects = mark_lost(&mut skeleton);
        assert_eq!((defects.jumps, lost(&skeleton)), (2, vec![2, 3]));
        assert!(skeleton.positions[2].x.is_nan());
    }

    #[test]
    fn a_joint_that_stays_away_is_believed_again() {
        let mut x = vec![1.0; 3];
        x.extend([5.0; 12]);
        let mut skeleton = track(&x);
        mark_lost(&mut skeleton);
        assert_eq!(lost(&skeleton), (3..11).collect::<Vec<_>>());
    }

    #[test]
    fn a_joint_at_exactly_zero_is_lost() {
        let mut skeleton = track(&[1.0, 0.0, 1.0]);
        let defects = mark_lost(&mut skeleton);
        assert_eq!((defects.lost_joints, defects.jumps, lost(&skeleton)), (1, 0, vec![1]));
    }
}
