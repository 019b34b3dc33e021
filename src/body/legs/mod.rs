//! Two legs as the user of a wheeled walker shows them to the camera: the 23-element state of \[walker\].
//!
//! ```text
//! left hip about the right hip (3)   distance, turn of the pelvis about the vertical, elevation
//! right hip (3)                      position in `sensor`
//! lengths (3), widths (2)            thigh, calf, foot; factors of the radii of thigh and calf, and of the foot
//! angles (2 × 6)                     hip flexion, abduction, internal rotation; knee; ankle dorsiflexion, inversion
//! ```
//!
//! Lengths and widths are shared by both legs. The reference posture stands upright and faces the camera: thighs and
//! calves along the vertical of the [`Floor`](crate::geometry::floor::Floor), feet forward. Angles are positive in
//! flexion, abduction and internal rotation, dorsiflexion and inversion, on both sides.
//!
//! The paper leaves open what the spherical coordinates are measured against and how the angles are composed: here
//! against floor axes (so that a tilted camera does not lean the legs), hip angles about Z-X-Y (ISB) in pelvis axes, which
//! the turn of the hips gives.

pub mod bounds;
pub mod constraints;
pub mod kinematics;
pub mod solids;

use super::joint::Side;
use nalgebra::{SVector, Vector3};

pub use kinematics::{LegPose, SidePose, forward_kinematics};

/// Elements of the state.
pub const LEG_DIMENSION: usize = 23;

/// First of the elements that are joint angles; they are the last of the state.
pub const FIRST_ANGLE: usize = 11;

/// Elements of the right hip's position.
pub const RIGHT_HIP: std::ops::Range<usize> = 3..6;

/// The state as a vector, in metres, radians and factors: distance, turn and elevation of the left hip; right hip (x, y,
/// z); thigh, calf, foot; width of the leg, of the foot; left hip (flexion, abduction, internal rotation), right hip, left
/// knee, right knee, left ankle (dorsiflexion, inversion), right ankle.
pub type LegVector = SVector<f64, LEG_DIMENSION>;

/// Place of a side in arrays of two: left first.
pub const fn side_index(side: Side) -> usize {
    match side {
        Side::Left => 0,
        Side::Right => 1,
    }
}

/// Angles of one leg, radians.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct LegAngles {
    /// Hip: flexion, abduction, internal rotation.
    pub hip: [f64; 3],
    /// Knee flexion.
    pub knee: f64,
    /// Ankle: dorsiflexion, inversion.
    pub ankle: [f64; 2],
}

/// The state with names.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LegState {
    /// Between the hips, metres.
    pub hip_distance: f64,
    /// Turn of the pelvis about the vertical, radians; positive to the subject's left, zero facing the camera.
    pub pelvis_turn: f64,
    /// How far the left hip stands above the right one, as an angle, radians.
    pub hip_elevation: f64,
    /// Right hip in `sensor`, metres.
    pub right_hip: Vector3<f64>,
    /// Hip to knee, metres.
    pub thigh: f64,
    /// Knee to ankle, metres.
    pub calf: f64,
    /// Ankle to toe along the sole, metres.
    pub foot: f64,
    /// Factor of the radii of thigh and calf.
    pub leg_width: f64,
    /// Factor of the radii of the foot.
    pub foot_width: f64,
    /// Angles of the left and of the right leg.
    pub angles: [LegAngles; 2],
}

impl LegState {
    /// Upright, facing the camera, with segments in proportion to the stature (metres) and hips level with `right_hip`.
    ///
    /// Segments are shares of the stature: thigh 0.245, calf 0.246, foot 0.152 of which three quarters lie before the ankle
    /// (R. Drillis and R. Contini, 1966, as in D. Winter, Biomechanics and Motor Control of Human Movement). The hips are
    /// 0.1 of the stature apart.
    pub fn upright(stature: f64, right_hip: Vector3<f64>) -> Self {
        Self {
            hip_distance: 0.1 * stature,
            pelvis_turn: 0.0,
            hip_elevation: 0.0,
            right_hip,
            thigh: 0.245 * stature,
            calf: 0.246 * stature,
            foot: 0.75 * 0.152 * stature,
            leg_width: 1.0,
            foot_width: 1.0,
            angles: [LegAngles::default(); 2],
        }
    }

    /// The state with names from the state as a vector.
    pub fn from_vector(x: &LegVector) -> Self {
        let angles = |hip: usize, knee: usize, ankle: usize| LegAngles {
            hip: [x[hip], x[hip + 1], x[hip + 2]],
            knee: x[knee],
            ankle: [x[ankle], x[ankle + 1]],
        };
        Self {
            hip_distance: x[0],
            pelvis_turn: x[1],
            hip_elevation: x[2],
            right_hip: Vector3::new(x[3], x[4], x[5]),
            thigh: x[6],
            calf: x[7],
            foot: x[8],
            leg_width: x[9],
            foot_width: x[10],
            angles: [angles(11, 17, 19), angles(14, 18, 21)],
        }
    }

    /// The state as a vector.
    pub fn to_vector(&self) -> LegVector {
        let (hip, [left, right]) = (&self.right_hip, &self.angles);
        LegVector::from([
            self.hip_distance,
            self.pelvis_turn,
            self.hip_elevation,
            hip.x,
            hip.y,
            hip.z,
            self.thigh,
            self.calf,
            self.foot,
            self.leg_width,
            self.foot_width,
            left.hip[0],
            left.hip[1],
            left.hip[2],
            right.hip[0],
            right.hip[1],
            right.hip[2],
            left.knee,
            right.knee,
            left.ankle[0],
            left.ankle[1],
            right.ankle[0],
            right.ankle[1],
        ])
    }
}

/// Names of the elements, in order.
pub const ELEMENT_NAMES: [&str; LEG_DIMENSION] = [
    "hip_distance",
    "pelvis_turn",
    "hip_elevation",
    "right_hip_x",
    "right_hip_y",
    "right_hip_z",
    "thigh",
    "calf",
    "foot",
    "leg_width",
    "foot_width",
    "left_hip_flexion",
    "left_hip_abduction",
    "left_hip_internal_rotation",
    "right_hip_flexion",
    "right_hip_abduction",
    "right_hip_internal_rotation",
    "left_knee_flexion",
    "right_knee_flexion",
    "left_ankle_dorsiflexion",
    "left_ankle_inversion",
    "right_ankle_dorsiflexion",
    "right_ankle_inversion",
];

#[cfg(test)]
mod tests;
