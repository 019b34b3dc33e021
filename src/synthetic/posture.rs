//! From what an exercise asks of the body to a posture that stands on the floor.
//!
//! An exercise says where the pelvis is in the plane, where the feet are, and how trunk, arms and lifted legs are
//! turned. The pelvis then stands as high as the supporting legs reach, and each leg on the floor gets the hip and
//! knee angles that bring its ankle to its place: for thigh `L₁`, shank `L₂` and the hip-ankle distance `d`
//!
//! ```text
//! cos φ = (d² − L₁² − L₂²) / (2 L₁ L₂)            knee flexion
//! Rz(f) Rx(−a) Ry(r) (−L₂ sin φ, −L₁ − L₂ cos φ, 0) = ankle − hip   hip flexion f, abduction a, rotation r given
//! ```
//!
//! Positions are in `subject` (X forward, Y up, Z to the right), metres, with the origin on the floor below the place
//! where the pelvis stood first.

use crate::body::anatomical_angles::hip_rotation;
use crate::body::{Limb, Pose, Side, Skeleton};
use crate::geometry::euler::rotation_from_zxy;
use nalgebra::{Rotation3, Vector3};
use std::f64::consts::{FRAC_PI_2, PI, TAU};

/// Height of the ankle's centre above the sole, share of stature (Winter 2009, Figure 4.1).
pub const ANKLE_HEIGHT_SHARE: f64 = 0.039;

/// Smallest knee flexion of a supporting leg: people do not lock their knees.
const STANDING_KNEE_RAD: f64 = 4.0 * PI / 180.0;

/// Width of the transition from one supporting leg to the other as the one that limits the height, metres.
const HEIGHT_BLEND_M: f64 = 0.004;

/// Distance from full extension over which a reaching leg stops bending, metres.
const EXTENSION_BLEND_M: f64 = 0.001;

/// Trunk angles, radians.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Trunk {
    /// Bending forwards.
    pub flexion: f64,
    /// Bending to the right.
    pub lateral: f64,
    /// Turning to the left.
    pub axial: f64,
}

/// Arm angles, radians: swing out, then forwards. The T-posture is 90° of abduction.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Arm {
    /// From hanging outwards.
    pub abduction: f64,
    /// Forwards.
    pub flexion: f64,
    /// Flexion of the elbow.
    pub elbow: f64,
}

/// Leg angles, radians.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct LegAngles {
    /// Hip flexion.
    pub flexion: f64,
    /// Hip abduction.
    pub abduction: f64,
    /// Hip internal rotation.
    pub axial: f64,
    /// Knee flexion.
    pub knee: f64,
}

/// What is asked of one leg.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Leg {
    /// Where the ankle stands or swings.
    pub ankle: Vector3<f64>,
    /// How far the leg limits the height of the pelvis, 0 to 1: 1 while its ankle, on the floor or swinging, is to be
    /// reached, 0 while it is lifted.
    pub support: f64,
    /// Hip internal rotation while the leg follows its ankle, radians.
    pub axial: f64,
    /// Angles of the leg when it is lifted.
    pub lifted: LegAngles,
    /// How far the leg follows `lifted` (1) instead of `ankle` (0).
    pub lift: f64,
}

/// What an exercise asks of the body at one instant; sides are left, right.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Posture {
    /// The trunk, the pelvis with it.
    pub trunk: Trunk,
    /// Middle of the hips: forward and right.
    pub pelvis: [f64; 2],
    /// Height of the middle of the hips on a seat, and how far (0 to 1) the body sits on it.
    pub seat: (f64, f64),
    /// How far the pelvis is above the height to which the supporting legs hold it, metres; negative in a crouch.
    pub rise: f64,
    /// The arms.
    pub arms: [Arm; 2],
    /// The legs.
    pub legs: [Leg; 2],
}

/// A posture that stands on the floor.
#[derive(Debug, Clone, PartialEq)]
pub struct Stance {
    /// Rotations of all joints.
    pub pose: Pose,
    /// The torso joint in `subject`, metres above the floor.
    pub torso: Vector3<f64>,
}

impl Posture {
    /// The posture of a body with this skeleton.
    pub fn stand(&self, skeleton: &Skeleton) -> Stance {
        let trunk = rotation_from_zxy(-self.trunk.flexion, self.trunk.lateral, self.trunk.axial);
        let middle = (skeleton.offsets[Limb::LeftLeg.index()] + skeleton.offsets[Limb::RightLeg.index()]) / 2.0;
        let hip_from_pelvis =
            [Limb::LeftLeg, Limb::RightLeg].map(|leg| trunk * (skeleton.offsets[leg.index()] - middle));
        let standing = self.standing_height(skeleton, &hip_from_pelvis);
        let (seat, seated) = self.seat;
        let height = standing + (seat - standing) * seated + self.rise;
        let pelvis = Vector3::new(self.pelvis[0], height, self.pelvis[1]);

        let mut pose = Pose { trunk, ..Pose::reference() };
        for side in Side::BOTH {
            let (arm_limb, leg_limb) = limbs_of(side);
            let arm = self.arms[side as usize];
            pose.limbs[arm_limb.index()] = arm_rotation(side, &arm);
            pose.hinges[arm_limb.index()] = arm.elbow;

            let leg = &self.legs[side as usize];
            let reach = trunk.inverse() * (leg.ankle - pelvis - hip_from_pelvis[side as usize]);
            let lengths = [skeleton.proximal[leg_limb.index()], skeleton.distal[leg_limb.index()]];
            let angles = blend(&reaching_leg(side, &reach, lengths, leg.axial), &leg.lifted, leg.lift);
            pose.limbs[leg_limb.index()] = hip_rotation(side, angles.flexion, angles.abduction, angles.axial);
            pose.hinges[leg_limb.index()] = angles.knee;
        }
        Stance { pose, torso: pelvis - trunk * middle }
    }

    /// Height of the pelvis at which the supporting legs are just not locked: a smooth minimum over the legs.
    fn standing_height(&self, skeleton: &Skeleton, hip_from_pelvis: &[Vector3<f64>; 2]) -> f64 {
        let mut heights = [0.0; 2];
        for (i, leg) in [Limb::LeftLeg, Limb::RightLeg].into_iter().enumerate() {
            let [thigh, shank] = [skeleton.proximal[leg.index()], skeleton.distal[leg.index()]];
            let length = (thigh * thigh + shank * shank + 2.0 * thigh * shank * STANDING_KNEE_RAD.cos()).sqrt();
            let from_ankle =
                Vector3::new(self.pelvis[0], 0.0, self.pelvis[1]) + hip_from_pelvis[i] - self.legs[i].ankle;
            let horizontal = from_ankle.x.hypot(from_ankle.z).min(0.9 * length);
            heights[i] =
                (length * length - horizontal * horizontal).sqrt() + self.legs[i].ankle.y - hip_from_pelvis[i].y;
        }
        let weights = [self.legs[0].support, self.legs[1].support].map(|w| w.max(1e-9));
        let lowest = heights[0].min(heights[1]);
        let share = |i: usize| weights[i] * (-(heights[i] - lowest) / HEIGHT_BLEND_M).exp();
        lowest - HEIGHT_BLEND_M * ((share(0) + share(1)) / (weights[0] + weights[1])).ln()
    }
}

/// The arm and the leg of a side.
pub fn limbs_of(side: Side) -> (Limb, Limb) {
    match side {
        Side::Left => (Limb::LeftArm, Limb::LeftLeg),
        Side::Right => (Limb::RightArm, Limb::RightLeg),
    }
}

/// Rotation of an upper arm against the T-posture. Turns about X mirror between the sides, turns about Z do not.
fn arm_rotation(side: Side, arm: &Arm) -> Rotation3<f64> {
    let outward = if side == Side::Left { -1.0 } else { 1.0 };
    Rotation3::from_axis_angle(&Vector3::z_axis(), arm.flexion)
        * Rotation3::from_axis_angle(&Vector3::x_axis(), outward * (FRAC_PI_2 - arm.abduction))
}

/// Angles that bring the ankle to `reach` from the hip, in `trunk`; a target out of reach gets a straight leg.
fn reaching_leg(side: Side, reach: &Vector3<f64>, [thigh, shank]: [f64; 2], axial: f64) -> LegAngles {
    let mirrored = if side == Side::Left { -reach.z } else { reach.z };
    let slack = thigh + shank - reach.norm();
    let distance = thigh + shank - 0.5 * (slack + slack.hypot(EXTENSION_BLEND_M));
    let cosine = (distance * distance - thigh * thigh - shank * shank) / (2.0 * thigh * shank);
    let knee = cosine.clamp(-1.0, 1.0).acos();
    let bent = Vector3::new(-shank * knee.sin(), -thigh - shank * knee.cos(), 0.0);
    let turned = Rotation3::from_axis_angle(&Vector3::y_axis(), axial) * bent;
    // Rx(s) must give the height over the sagittal plane, Rz(f) then turns within that plane.
    let radius = turned.y.hypot(turned.z);
    let adduction = turned.z.atan2(-turned.y) - (mirrored / radius).clamp(-1.0, 1.0).asin();
    let lowered = turned.y * adduction.cos() - turned.z * adduction.sin();
    let flexion = reach.y.atan2(reach.x) - lowered.atan2(turned.x);
    LegAngles { flexion: flexion - TAU * (flexion / TAU).round(), abduction: -adduction, axial, knee }
}

fn blend(from: &LegAngles, to: &LegAngles, share: f64) -> LegAngles {
    let mix = |a: f64, b: f64| a + (b - a) * share;
    LegAngles {
        flexion: mix(from.flexion, to.flexion),
        abduction: mix(from.abduction, to.abduction),
        axial: mix(from.axial, to.axial),
        knee: mix(from.knee, to.knee),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::body::kinematics::forward_kinematics;
    use crate::body::skeleton::point_index;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn a_reaching_leg_brings_its_ankle_to_the_target(
            (forward, right, down) in (-0.4..0.5f64, -0.3..0.4f64, 0.45..0.65f64),
            axial in -0.5..0.5f64,
            is_left in any::<bool>(),
        ) {
            let side = if is_left { Side::Left } else { Side::Right };
            let skeleton = Skeleton::of_stature(1.7);
            let (_, limb) = limbs_of(side);
            let i = limb.index();
            let reach = Vector3::new(forward, -down, right);
            prop_assume!(reach.norm() < 0.98 * (skeleton.proximal[i] + skeleton.distal[i]));
            let angles = reaching_leg(side, &reach, [skeleton.proximal[i], skeleton.distal[i]], axial);
            let mut pose = Pose::reference();
            pose.limbs[i] = hip_rotation(side, angles.flexion, angles.abduction, angles.axial);
            pose.hinges[i] = angles.knee;
            let points = forward_kinematics(&skeleton, &pose);
            let found = points[point_index(limb, 2)] - points[point_index(limb, 0)];
            // Softened extension moves the ankle by less than the blend's width.
            prop_assert!((found - reach).norm() < EXTENSION_BLEND_M, "{found} instead of {reach}");
            prop_assert!(angles.knee >= 0.0);
        }
    }

    #[test]
    fn the_arm_in_the_t_posture_is_not_turned_and_a_hanging_arm_points_down() {
        for side in Side::BOTH {
            let (limb, _) = limbs_of(side);
            let spread = arm_rotation(side, &Arm { abduction: FRAC_PI_2, ..Arm::default() });
            assert!(spread.angle() < 1e-12);
            let hanging = arm_rotation(side, &Arm::default()) * limb.reference_direction();
            assert!((hanging + Vector3::y()).norm() < 1e-12, "{side:?}: {hanging}");
        }
    }
}
