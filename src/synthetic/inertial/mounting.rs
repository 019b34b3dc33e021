//! Where a unit sits on its bone, and how it came there.

use super::path::{RigidPath, grid_time};
use super::protocol::Phases;
use crate::body::{Bone, Limb, Skeleton};
use crate::recording::inertial::world_from_plank;
use crate::synthetic::motion::{Wander, between};
use nalgebra::{Rotation3, Unit, UnitQuaternion, Vector3};
use rand::{Rng, RngExt};
use rand_distr::{Distribution, UnitSphere};
use std::f64::consts::PI;
use std::ops::Range;

/// How units are turned against their bones.
#[derive(Debug, Clone, PartialEq)]
pub enum Mounting {
    /// As in \[fusion\], but turned about a random axis by an angle in this range, degrees.
    Scheme(Range<f64>),
    /// Any way round.
    Arbitrary,
}

impl Mounting {
    /// Five to ten degrees: what a hand does on a limb that is no cylinder.
    pub const USUAL: Mounting = Mounting::Scheme(5.0..10.0);

    /// `bone_from_imu` of a unit; one that is upside down is turned by half a turn about the axis that points inwards.
    pub(super) fn draw(&self, bone: Bone, upside_down: bool, rng: &mut impl Rng) -> UnitQuaternion<f64> {
        let axis = Unit::new_unchecked(Vector3::from(UnitSphere.sample(rng)));
        let share: f64 = rng.random();
        let turned = match self {
            Mounting::Scheme(degrees) => {
                let angle = (degrees.start + (degrees.end - degrees.start) * share).to_radians();
                bone.scheme_from_imu() * Rotation3::from_axis_angle(&axis, angle)
            }
            Mounting::Arbitrary => arbitrary_rotation(rng),
        };
        let flip = Rotation3::from_axis_angle(&Vector3::z_axis(), if upside_down { PI } else { 0.0 });
        UnitQuaternion::from_rotation_matrix(&(turned * flip))
    }
}

/// A rotation of which none is more likely than another (a normalised vector of four normal numbers).
fn arbitrary_rotation(rng: &mut impl Rng) -> Rotation3<f64> {
    let [w, i, j, k]: [f64; 4] = std::array::from_fn(|_| rng.sample(rand_distr::StandardNormal));
    UnitQuaternion::from_quaternion(nalgebra::Quaternion::new(w, i, j, k)).to_rotation_matrix()
}

/// Place of a unit from the proximal end of its bone (the torso joint for the trunk), in the bone's axes, metres.
///
/// It sits 60 % down the bone on the side away from the inside, where the scheme's Z points from; on the trunk at the
/// sternum.
pub fn bone_from_unit_position(skeleton: &Skeleton, bone: Bone) -> Vector3<f64> {
    /// Distance from the bone's axis, metres: about half of the segment's width.
    const THIGH_M: f64 = 0.080;
    const SHANK_M: f64 = 0.050;
    const UPPER_ARM_M: f64 = 0.045;
    const FOREARM_M: f64 = 0.035;
    const CHEST_M: f64 = 0.110;
    const DOWN_THE_BONE: f64 = 0.6;
    let (along, outside) = match bone {
        Bone::Trunk => (-0.5 * skeleton.offsets[Limb::LeftArm.index()].y, CHEST_M),
        Bone::Proximal(limb) => {
            (DOWN_THE_BONE * skeleton.proximal[limb.index()], if limb.is_arm() { UPPER_ARM_M } else { THIGH_M })
        }
        Bone::Distal(limb) => {
            (DOWN_THE_BONE * skeleton.distal[limb.index()], if limb.is_arm() { FOREARM_M } else { SHANK_M })
        }
    };
    bone.scheme_from_imu() * Vector3::new(along, 0.0, -outside)
}

/// Height of the plank above the floor and its distance before the subject, metres.
const PLANK_HEIGHT_M: f64 = 0.75;
const PLANK_DISTANCE_M: f64 = 0.8;
/// Distance between two units on the plank, metres.
const PLANK_SPACING_M: f64 = 0.06;
/// Time from one unit's being taken from the plank to the next one's, and time to put a unit on, seconds.
const NEXT_UNIT_S: f64 = 0.55;
const PUT_ON_S: f64 = 3.6;
/// Irregular turns and ways of a hand with a unit, root mean square.
const HANDLING_RAD: f64 = 0.6;
const HANDLING_M: f64 = 0.08;

/// A unit's way from the plank to its bone.
pub(super) struct PuttingOn {
    start_s: f64,
    plank: Vector3<f64>,
    world_from_plank: UnitQuaternion<f64>,
    turns: [Wander; 3],
    ways: [Wander; 3],
}

impl PuttingOn {
    /// The way of the unit on a bone; `origin` is the place on the floor where the subject stands, in `world`, and
    /// `plank_error` turns the plank against where it should lie. None when there is no plank.
    pub(super) fn draw(
        phases: &Phases,
        bone: Bone,
        origin: &Vector3<f64>,
        plank_error: &UnitQuaternion<f64>,
        rng: &mut impl Rng,
    ) -> Option<Self> {
        let start_s = phases.putting_on.as_ref()?.start + NEXT_UNIT_S * (0.5 + bone.index() as f64);
        let beside = PLANK_SPACING_M * (bone.index() as f64 - 4.0);
        let plank = origin + Vector3::new(beside, PLANK_HEIGHT_M, -PLANK_DISTANCE_M);
        let world_from_plank = plank_error * UnitQuaternion::from_rotation_matrix(&world_from_plank());
        let mut three = || std::array::from_fn(|_| Wander::draw(rng));
        Some(Self { start_s, plank, world_from_plank, turns: three(), ways: three() })
    }

    /// The whole way of a unit whose way on its bone is `mounted`.
    pub(super) fn path(&self, mounted: &RigidPath) -> RigidPath {
        let n = mounted.position.len();
        let taken = (0..n).find(|i| grid_time(*i) >= self.start_s).unwrap_or(n - 1);
        let home = mounted.rotation[taken];
        let from_plank = (home.inverse() * self.world_from_plank).scaled_axis();
        let place = |i: usize| {
            let t = grid_time(i);
            let u = ((t - self.start_s) / PUT_ON_S).clamp(0.0, 1.0);
            let share = between(0.0, 1.0, u);
            // 0 at both ends together with its two derivatives.
            let handling = (4.0 * u * (1.0 - u)).powi(3);
            let wander =
                |waves: &[Wander; 3], size: f64| Vector3::from_fn(|axis, _| handling * size * waves[axis].at(t));
            // Nothing moves on the plank: the subject's sway comes in with the share of the way.
            let swayed = (home.inverse() * mounted.rotation[i]).scaled_axis() * share;
            let rotation = home
                * UnitQuaternion::new(swayed)
                * UnitQuaternion::new(from_plank * (1.0 - share))
                * UnitQuaternion::new(wander(&self.turns, HANDLING_RAD));
            (self.plank.lerp(&mounted.position[i], share) + wander(&self.ways, HANDLING_M), rotation)
        };
        let on_bone = |i: usize| (mounted.position[i], mounted.rotation[i]);
        let is_on = |i: usize| grid_time(i) >= self.start_s + PUT_ON_S;
        let (position, rotation) = (0..n).map(|i| if is_on(i) { on_bone(i) } else { place(i) }).unzip();
        RigidPath { position, rotation }
    }
}
