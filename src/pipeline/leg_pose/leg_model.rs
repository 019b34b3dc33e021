//! The legs as the tracker sees them: eight points, joined by six cones with round ends.
//!
//! A pose is the position of hip, knee, ankle and toe of both legs in `floor`. Cone ends are spheres about these points,
//! so a surface is "the set of points at radius r(t) from an axis", and its distance, with derivatives, has a closed form
//! that is linear in the end points. Lengths are not built in but pulled towards those of the shape, which both legs
//! share: a trouser leg that slides over the knee then bends the estimate by millimetres, not the whole leg.

use crate::body::Side;
use nalgebra::{SVector, Vector3};

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

/// How much adults differ from [`adult_shape`]: standard deviations, metres.
pub fn adult_shape_deviation() -> ShapeVector {
    ShapeVector::from([0.04, 0.04, 0.020, 0.015, 0.015, 0.020, 0.008, 0.006])
}
