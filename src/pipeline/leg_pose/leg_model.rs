//! The legs as the tracker sees them: eight points, joined by six cones with round ends.
//!
//! A pose is the position of hip, knee, ankle and toe of both legs in `floor`. Cone ends are spheres about these points,
//! so a surface is "the set of points at radius r(t) from an axis", and its distance, with derivatives, has a closed form
//! that is linear in the end points. Lengths are not built in but pulled towards those of the shape, which both legs
//! share: a trouser leg that slides over the knee then bends the estimate by millimetres, not the whole leg.

use crate::body::Side;
use nalgebra::{SMatrix, SVector, Vector3};

/// Points of one leg.
pub const POINTS_OF_LEG: usize = 4;
/// Points of both legs.
pub const POINTS: usize = 2 * POINTS_OF_LEG;
/// Coordinates of a pose.
pub const POSE: usize = 3 * POINTS;
/// Numbers of a shape.
pub const SHAPE: usize = 8;

/// A point of a leg.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum LegPoint {
    /// Centre of the hip joint.
    Hip,
    /// Centre of the knee.
    Knee,
    /// Centre of the ankle.
    Ankle,
    /// Middle of the forefoot, near the toes.
    Toe,
}

impl LegPoint {
    /// From the hip down.
    pub const ALL: [LegPoint; POINTS_OF_LEG] = [LegPoint::Hip, LegPoint::Knee, LegPoint::Ankle, LegPoint::Toe];

    /// Place of this point of one leg among the points of both: the left leg's first.
    pub fn index(self, side: Side) -> usize {
        side as usize * POINTS_OF_LEG + self as usize
    }
}

/// A part of a leg between two of its points.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum LegSegment {
    /// Hip to knee.
    Thigh,
    /// Knee to ankle.
    Shank,
    /// Ankle to toe.
    Foot,
}

impl LegSegment {
    /// From the hip down.
    pub const ALL: [LegSegment; 3] = [LegSegment::Thigh, LegSegment::Shank, LegSegment::Foot];

    /// Its upper point.
    pub fn start(self) -> LegPoint {
        LegPoint::ALL[self as usize]
    }

    /// Its lower point.
    pub fn end(self) -> LegPoint {
        LegPoint::ALL[self as usize + 1]
    }

    /// Places of its length and of its radii at start and end among the numbers of a shape.
    pub fn shape_indices(self) -> (usize, [usize; 2]) {
        match self {
            LegSegment::Thigh => (0, [3, 4]),
            LegSegment::Shank => (1, [4, 5]),
            LegSegment::Foot => (2, [6, 7]),
        }
    }
}

/// Eight points in `floor`, metres, one after the other.
pub type PoseVector = SVector<f64, POSE>;
/// Lengths of thigh, shank and foot, then radii at hip, knee, ankle, instep and toe; metres.
pub type ShapeVector = SVector<f64, SHAPE>;

/// A point of a pose.
pub fn point_of(pose: &PoseVector, side: Side, point: LegPoint) -> Vector3<f64> {
    pose.fixed_rows::<3>(3 * point.index(side)).into_owned()
}

/// Sets a point of a pose.
pub fn set_point(pose: &mut PoseVector, side: Side, point: LegPoint, position: &Vector3<f64>) {
    pose.fixed_rows_mut::<3>(3 * point.index(side)).copy_from(position);
}

/// An adult's shape: lengths are those of a stature of 1.70 m (Winter, segment lengths as shares of stature: thigh 0.245,
/// shank 0.246), the foot from ankle to the base of the toes; radii are girths of adults over trousers.
pub fn adult_shape() -> ShapeVector {
    ShapeVector::from([0.415, 0.415, 0.155, 0.085, 0.060, 0.045, 0.042, 0.032])
}

/// What is known of legs before any is seen.
#[derive(Debug, Clone, PartialEq)]
pub struct ShapePrior {
    /// The most probable shape.
    pub mean: ShapeVector,
    /// Inverse of the covariance about it, 1/m².
    pub information: SMatrix<f64, SHAPE, SHAPE>,
}

impl ShapePrior {
    /// Walkers' users of every size: [`adult_shape`], larger or smaller as a whole, and each number somewhat by itself.
    /// Thighs are as long as shanks (Winter: 0.245 and 0.246 of stature), and hips are often out of sight.
    pub fn people() -> Self {
        /// Size as a share of an adult's: from a child of 1.2 m to a man of 2.1 m and beyond.
        const SIZE_SD: f64 = 0.17;
        /// How a body of its size differs from others of that size, metres; girths include clothes.
        const OWN_SD: [f64; SHAPE] = [0.025, 0.025, 0.018, 0.015, 0.015, 0.025, 0.008, 0.006];
        const THIGH_LIKE_SHANK_SD: f64 = 0.015;
        let mean = adult_shape();
        let own = ShapeVector::from(OWN_SD.map(|sd| 1.0 / (sd * sd)));
        // Inverse of diag(1/own) + size² mean meanᵀ (Sherman–Morrison).
        let along = own.component_mul(&mean);
        let share = 1.0 / (SIZE_SD * SIZE_SD) + mean.dot(&along);
        let mut information = SMatrix::from_diagonal(&own) - along * along.transpose() / share;
        let alike = 1.0 / (THIGH_LIKE_SHANK_SD * THIGH_LIKE_SHANK_SD);
        for k in 0..2 {
            information[(k, k)] += alike;
            information[(k, 1 - k)] -= alike;
        }
        Self { mean, information }
    }

    /// The nearest shape that somebody may have, in clothes.
    pub fn bounded(&self, shape: ShapeVector) -> ShapeVector {
        const LENGTHS: [f64; 2] = [0.5, 1.35];
        const RADII: [f64; 2] = [0.4, 3.0];
        ShapeVector::from_fn(|k, _| {
            let [least, most] = if k < 3 { LENGTHS } else { RADII };
            shape[k].clamp(least * self.mean[k], most * self.mean[k])
        })
    }
}

/// How large legs are beside those of [`adult_shape`].
pub fn size_of(shape: &ShapeVector) -> f64 {
    let adult = adult_shape();
    (shape[0] + shape[1]) / (adult[0] + adult[1])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn legs_that_are_smaller_as_a_whole_are_likelier_than_legs_with_one_bone_as_much_shorter() {
        let prior = ShapePrior::people();
        let surprise = |change: ShapeVector| (prior.information * change).dot(&change);
        let smaller = surprise(prior.mean * -0.2);
        let mut short = ShapeVector::zeros();
        short[1] = -0.2 * prior.mean[1];
        // A fifth of the size is little more than one standard deviation of 17 %.
        assert!((1.0..2.0).contains(&smaller), "{smaller}");
        assert!(surprise(short) > 8.0 * smaller, "{} {smaller}", surprise(short));
        assert!(prior.information.cholesky().is_some());
    }

    #[test]
    fn a_shape_within_bounds_stays_and_one_beyond_is_drawn_to_them() {
        let prior = ShapePrior::people();
        assert_eq!(prior.bounded(prior.mean * 0.6), prior.mean * 0.6);
        let tiny = prior.bounded(prior.mean * 0.1);
        assert_eq!((tiny[0], tiny[3]), (0.5 * prior.mean[0], 0.4 * prior.mean[3]));
        assert!((size_of(&(prior.mean * 0.7)) - 0.7).abs() < 1e-12);
    }
}
