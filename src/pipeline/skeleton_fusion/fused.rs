//! The default: every bone follows its unit, turned into the camera's frame by the alignment; a bone without one follows
//! the camera, helped by the units of its neighbours.

use super::alignment::Alignment;
use super::motion::UnitMotion;
use super::posture::{BoneRotations, pose_covariance, pose_of_bones};
use super::track::CameraTrack;
use super::turns::BoneTurns;
use crate::body::anatomical_angles::shoulder_rotation;
use crate::body::bones::bone_rotations;
use crate::body::pose::{attitude_offset, hinge_offset};
use crate::body::skeleton::point_index;
use crate::body::{BONE_COUNT, Bone, Limb, Pose};
use crate::pipeline::joint_angles::observation::{ALL_SEEN, SeenMask};
use crate::pipeline::joint_angles::posterior::Spread;
use nalgebra::Rotation3;

/// The fused body over time.
#[derive(Debug)]
pub struct FusedBody<'a> {
    /// The solution of the alignment.
    alignment: &'a Alignment,
    /// The units' motions.
    motions: &'a [UnitMotion],
    /// The camera's track for bones without a unit; none when every bone has one throughout, or there is no camera.
    track: Option<&'a CameraTrack>,
    /// Time from which on the units are worn, nanoseconds.
    worn_from_ns: i64,
    /// Rotations of bones of which nothing is known; no result is given for them.
    unknown: BoneRotations,
}

/// The posture at one time.
#[derive(Debug, Clone, PartialEq)]
pub struct FusedPosture {
    /// Posture.
    pub pose: Pose,
    /// Bones that follow their units, by the bit of their index.
    pub followed: u16,
    /// Points that the posture rests on, for the flags of its angles.
    pub seen: SeenMask,
}

impl<'a> FusedBody<'a> {
    /// A body whose units are worn from a time on.
    pub fn new(
        alignment: &'a Alignment,
        motions: &'a [UnitMotion],
        track: Option<&'a CameraTrack>,
        worn_from_ns: i64,
    ) -> Self {
        Self { alignment, motions, track, worn_from_ns, unknown: bone_rotations(&standing()) }
    }

    /// The units that are worn at a time and whose mounting is determined.
    fn followed_units(&self, time_ns: i64) -> impl Iterator<Item = (usize, &UnitMotion)> {
        let determined = |(u, _): &(usize, &UnitMotion)| self.alignment.units[*u].is_determined;
        self.motions.iter().enumerate().filter(move |unit| time_ns >= self.worn_from_ns && determined(unit))
    }

    /// Rotations of all bones at a time, the bones that follow their units, and the points that the rotations rest on.
    fn bones(&self, time_ns: i64) -> (BoneRotations, u16, SeenMask) {
        let mut own = [None; BONE_COUNT];
        for (u, motion) in self.followed_units(time_ns) {
            if let Some((stretch, earth)) = motion.at(time_ns) {
                own[motion.bone.index()] = Some(self.alignment.subject_from_bone(u, time_ns, stretch, &earth));
            }
        }
        let follows = |bone: Bone| own[bone.index()].is_some();
        let needs_camera = own.iter().any(Option::is_none);
        let track = self.track.filter(|_| needs_camera);
        let (others, hinges) = track.and_then(|track| track.at(time_ns)).unwrap_or((self.unknown, [0.0; 4]));
        let mut seen = track.and_then(|track| track.nearest(time_ns)).map_or(0, |posterior| posterior.seen);
        let mut bones: BoneRotations = std::array::from_fn(|i| own[i].unwrap_or(others[i]));
        for limb in Limb::ALL {
            let (proximal, distal) = (Bone::Proximal(limb), Bone::Distal(limb));
            // The camera's hinge is the better one where its two bones were seen together.
            if !follows(distal) && follows(proximal) {
                let hinge = Rotation3::new(limb.hinge_axis() * hinges[limb.index()]);
                bones[distal.index()] = bones[proximal.index()] * hinge;
            }
            let first = point_index(limb, 0);
            seen |= if follows(proximal) { 0b011 << first } else { 0 };
            seen |= if follows(proximal) && follows(distal) { 0b111 << first } else { 0 };
            seen |= if follows(Bone::Trunk) { 1 << first } else { 0 };
        }
        let followed = Bone::ALL.iter().fold(0, |mask, bone| mask | u16::from(follows(*bone)) << bone.index());
        (bones, followed, seen & ALL_SEEN)
    }

    /// The posture at a time.
    pub fn posture(&self, time_ns: i64) -> FusedPosture {
        let (bones, followed, seen) = self.bones(time_ns);
        FusedPosture { pose: pose_of_bones(&bones), followed, seen }
    }

    /// How uncertain the posture at a time is.
    pub fn spread(&self, time_ns: i64) -> Spread {
        let (bones, followed, _) = self.bones(time_ns);
        let mut turns = BoneTurns::new(self.alignment);
        for (u, motion) in self.followed_units(time_ns) {
            if let Some(at) = motion.at(time_ns) {
                turns.follow(motion.bone, u, time_ns, &at);
            }
        }
        let mut covariance = pose_covariance(&bones, &turns);
        let other = self.track.and_then(|track| track.covariance(time_ns));
        let follows = |bone: Bone| followed >> bone.index() & 1 == 1;
        let mut take = |range: std::ops::Range<usize>| {
            let n = range.len();
            let block = other.as_ref().map(|c| c.view((range.start, range.start), (n, n)).into_owned());
            let mut view = covariance.view_mut((range.start, range.start), (n, n));
            match block {
                Some(block) => view.copy_from(&block),
                None => view.fill_with_identity(),
            }
        };
        if !follows(Bone::Trunk) {
            take(0..3);
        }
        for limb in Limb::ALL {
            let (a, h) = (attitude_offset(limb.index()), hinge_offset(limb.index()));
            if !(follows(Bone::Trunk) && follows(Bone::Proximal(limb))) {
                take(a..a + 3);
            }
            if !(follows(Bone::Proximal(limb)) && follows(Bone::Distal(limb))) {
                take(h..h + 1);
            }
        }
        Spread::of(&pose_of_bones(&bones), &covariance)
    }
}

/// Standing with hanging arms: where nothing is known, for parts that no result is given for.
fn standing() -> Pose {
    let mut pose = Pose::reference();
    for limb in [Limb::LeftArm, Limb::RightArm] {
        pose.limbs[limb.index()] = shoulder_rotation(limb.side(), 0.0, 0.0, 0.0);
    }
    pose
}
