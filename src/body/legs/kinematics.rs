//! Forward kinematics of the legs: where their eight joints are.
//!
//! ```text
//! pelvis = R_sensor_floor · Ry(turn)
//! left   = right + distance · pelvis · (0, sin e, −cos e)
//! thigh  = pelvis · Rz(flexion) · Rx(∓abduction) · Ry(±internal rotation)      upper sign: right leg
//! calf   = thigh · Rz(−knee)
//! foot   = calf · Rz(dorsiflexion) · Rx(±inversion)
//! ```

use super::{LegAngles, LegState, side_index};
use crate::body::joint::Side;
use crate::geometry::floor::Floor;
use nalgebra::{Matrix3, Vector3};

/// Height of the ankle above the sole, as a share of the length from ankle to toe. Provisional: 0.039 of the stature for
/// the lateral malleolus (Drillis and Contini, 1966) less what a half cylinder adds.
pub const ANKLE_HEIGHT: f64 = 0.30;

/// Joints and axes of one leg, in `sensor`, metres.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SidePose {
    /// Hip joint.
    pub hip: Vector3<f64>,
    /// Knee joint.
    pub knee: Vector3<f64>,
    /// Ankle joint.
    pub ankle: Vector3<f64>,
    /// Tip of the foot, on the sole.
    pub toe: Vector3<f64>,
    /// Direction from heel to toe along the sole.
    pub forward: Vector3<f64>,
    /// Away from the sole, into the foot.
    pub dorsal: Vector3<f64>,
}

/// Joints of both legs.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LegPose {
    /// Left, right.
    pub sides: [SidePose; 2],
}

impl LegPose {
    /// One leg.
    pub fn side(&self, side: Side) -> &SidePose {
        &self.sides[side_index(side)]
    }

    /// Hip, knee, ankle and toe of the left leg, then of the right one, in `sensor`, metres.
    pub fn joints(&self) -> [Vector3<f64>; 8] {
        let [l, r] = &self.sides;
        [l.hip, l.knee, l.ankle, l.toe, r.hip, r.knee, r.ankle, r.toe]
    }
}

/// Joints of a state (K) over a floor.
pub fn forward_kinematics(state: &LegState, floor: &Floor) -> LegPose {
    let pelvis = floor.sensor_from_floor().into_inner() * about_y(state.pelvis_turn);
    let (sine, cosine) = state.hip_elevation.sin_cos();
    let left_hip = state.right_hip + pelvis * Vector3::new(0.0, sine, -cosine) * state.hip_distance;
    LegPose {
        sides: [
            side_pose(state, &state.angles[0], &pelvis, left_hip, -1.0),
            side_pose(state, &state.angles[1], &pelvis, state.right_hip, 1.0),
        ],
    }
}

/// One leg. `outward` is +1 for the right leg, whose outside is Z, and −1 for the left one.
fn side_pose(state: &LegState, angles: &LegAngles, pelvis: &Matrix3<f64>, hip: Vector3<f64>, outward: f64) -> SidePose {
    let [flexion, abduction, internal_rotation] = angles.hip;
    let thigh = pelvis * about_z(flexion) * about_x(-outward * abduction) * about_y(outward * internal_rotation);
    let calf = thigh * about_z(-angles.knee);
    let foot = calf * about_z(angles.ankle[0]) * about_x(outward * angles.ankle[1]);
    let knee = hip - thigh.column(1) * state.thigh;
    let ankle = knee - calf.column(1) * state.calf;
    let (forward, dorsal) = (foot.column(0).into_owned(), foot.column(1).into_owned());
    SidePose { hip, knee, ankle, toe: ankle + (forward - dorsal * ANKLE_HEIGHT) * state.foot, forward, dorsal }
}

fn about_x(angle: f64) -> Matrix3<f64> {
    let (s, c) = angle.sin_cos();
    Matrix3::new(1.0, 0.0, 0.0, 0.0, c, -s, 0.0, s, c)
}

fn about_y(angle: f64) -> Matrix3<f64> {
    let (s, c) = angle.sin_cos();
    Matrix3::new(c, 0.0, s, 0.0, 1.0, 0.0, -s, 0.0, c)
}

fn about_z(angle: f64) -> Matrix3<f64> {
    let (s, c) = angle.sin_cos();
    Matrix3::new(c, -s, 0.0, s, c, 0.0, 0.0, 0.0, 1.0)
}
