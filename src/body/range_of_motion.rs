//! Bounds of the state θ: what the joints of a healthy adult can do, with a margin.
//!
//! They bound the estimator (\[angles\] trims its prior so); no clinician sees them. Values are common goniometric
//! ranges widened by 10 to 20°, because a person's own range and the sensor's offset both add to them.

use super::pose::{POSE_DIMENSION, PoseVector, attitude_offset, hinge_offset};

/// Lower and upper bound of each element of θ, radians.
#[derive(Debug, Clone, PartialEq)]
pub struct RangeOfMotion {
    /// Lower bounds.
    pub low: PoseVector,
    /// Upper bounds.
    pub high: PoseVector,
}

/// Knee: 10° of hyperextension to full flexion.
const KNEE_DEG: [f64; 2] = [-10.0, 165.0];
/// Elbow: 10° of hyperextension to full flexion.
const ELBOW_DEG: [f64; 2] = [-10.0, 165.0];
/// Right hip about X (adduction +), Y (internal rotation +), Z (flexion +).
const RIGHT_HIP_DEG: [[f64; 2]; 3] = [[-70.0, 50.0], [-60.0, 60.0], [-45.0, 145.0]];
/// Right shoulder from the T-posture about X (down −, up +), Y (forward +), Z (twist of the arm).
const RIGHT_SHOULDER_DEG: [[f64; 2]; 3] = [[-130.0, 130.0], [-80.0, 160.0], [-130.0, 130.0]];
/// Trunk about X and Z (lean); about Y it may turn round.
const TRUNK_LEAN_DEG: f64 = 120.0;

impl RangeOfMotion {
    /// The range of healthy adults. Left bounds mirror the right ones: turns about X and Y change sign.
    pub fn healthy_adult() -> Self {
        let mut range = Self { low: PoseVector::zeros(), high: PoseVector::zeros() };
        range.set(0, [-TRUNK_LEAN_DEG, TRUNK_LEAN_DEG]);
        range.set(1, [-360.0, 360.0]);
        range.set(2, [-TRUNK_LEAN_DEG, TRUNK_LEAN_DEG]);
        for (left, right, bounds) in [(0, 1, RIGHT_SHOULDER_DEG), (2, 3, RIGHT_HIP_DEG)] {
            for (axis, [low, high]) in bounds.into_iter().enumerate() {
                range.set(attitude_offset(right) + axis, [low, high]);
                let mirrored = if axis == 2 { [low, high] } else { [-high, -low] };
                range.set(attitude_offset(left) + axis, mirrored);
            }
        }
        for limb in 0..4 {
            range.set(hinge_offset(limb), if limb < 2 { ELBOW_DEG } else { KNEE_DEG });
        }
        range
    }

    fn set(&mut self, element: usize, bounds_deg: [f64; 2]) {
        self.low[element] = bounds_deg[0].to_radians();
        self.high[element] = bounds_deg[1].to_radians();
    }

    /// The nearest state inside the bounds.
    pub fn clamp(&self, theta: &PoseVector) -> PoseVector {
        PoseVector::from_fn(|i, _| theta[i].clamp(self.low[i], self.high[i]))
    }

    /// True when every element is inside its bounds.
    pub fn contains(&self, theta: &PoseVector) -> bool {
        (0..POSE_DIMENSION).all(|i| (self.low[i]..=self.high[i]).contains(&theta[i]))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_t_posture_a_hanging_arm_and_a_deep_squat_are_inside() {
        let range = RangeOfMotion::healthy_adult();
        let mut theta = PoseVector::zeros();
        assert!(range.contains(&theta));
        theta[attitude_offset(0)] = 90f64.to_radians();
        theta[attitude_offset(1)] = -90f64.to_radians();
        theta[attitude_offset(3) + 2] = 120f64.to_radians();
        theta[hinge_offset(3)] = 140f64.to_radians();
        assert!(range.contains(&theta));
    }

    #[test]
    fn a_knee_bent_forwards_is_outside_and_is_clamped_to_the_bound() {
        let range = RangeOfMotion::healthy_adult();
        let mut theta = PoseVector::zeros();
        theta[hinge_offset(2)] = -30f64.to_radians();
        assert!(!range.contains(&theta));
        assert_eq!(range.clamp(&theta)[hinge_offset(2)], -10f64.to_radians());
    }
}
