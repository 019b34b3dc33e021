//! What a depth sensor and its body tracking make of a movement.
//!
//! Each kind of error is a file of its own and draws from a random stream of its own, so that the others stay as they
//! are when one is changed.

pub mod dropout;
pub mod episode;
pub mod hand_jump;
pub mod limb_swap;
pub mod occlusion;
pub mod orientation;
pub mod posture_offset;
pub mod white_noise;

use super::posture::limbs_of;
use crate::body::kinematics::Points;
use crate::body::pose::PoseVector;
use crate::body::skeleton::point_index;
use crate::body::{Joint, Limb, Pose, Side};
use crate::recording::SkeletonRecording;
use episode::Episodes;
use nalgebra::Vector3;
use orientation::OrientationNoise;
use rand::{Rng, RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rand_distr::StandardNormal;
use std::fmt;
use std::str::FromStr;

/// A sensor with its errors.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Preset {
    /// No error at all: truth as a recording.
    Clean,
    /// The paper's white noise (\[angles\] Table 1).
    Table1,
    /// A Kinect v2: little jitter, but an offset that follows the posture.
    KinectV2,
    /// A Kinect v2 with the offsets that are measured for every joint: 30 to 45 mm that stay and 20 to 30 mm that
    /// follow the posture.
    KinectOffset,
    /// The paper's noise with lost joints, jumping hands, exchanged limbs and missing frames.
    Failures,
}

impl Preset {
    /// Every preset, the gentlest first.
    pub const ALL: [Preset; 5] =
        [Preset::Clean, Preset::Table1, Preset::KinectV2, Preset::KinectOffset, Preset::Failures];

    /// The presets that joint angles from a skeleton alone are measured with.
    pub const OF_JOINT_ANGLES: [Preset; 4] = [Preset::Clean, Preset::Table1, Preset::KinectV2, Preset::Failures];

    /// Name in commands and as the recording's device.
    pub fn name(self) -> &'static str {
        match self {
            Preset::Clean => "clean",
            Preset::Table1 => "table1",
            Preset::KinectV2 => "kinect-v2",
            Preset::KinectOffset => "kinect-offset",
            Preset::Failures => "failures",
        }
    }

    /// The joints that the sensor reports: those of NITE, or of the Kinect v2 without its finger tips and toes.
    pub fn joints(self) -> Vec<Joint> {
        let mut joints = match self {
            Preset::KinectV2 | Preset::KinectOffset => {
                vec![Joint::Head, Joint::Neck, Joint::SpineShoulder, Joint::Torso, Joint::Pelvis]
            }
            _ => vec![Joint::Head, Joint::Neck, Joint::Torso],
        };
        for limb in Limb::ALL {
            let names = limb.joints();
            joints.extend(names.iter().map(|(kinect, nite)| if self.is_kinect() { *kinect } else { *nite }));
        }
        joints
    }

    /// True of a Kinect v2, whose legs end at the ankle and arms at the wrist.
    fn is_kinect(self) -> bool {
        matches!(self, Preset::KinectV2 | Preset::KinectOffset)
    }

    /// Stretches without frames.
    pub fn frame_gaps(self) -> Option<Episodes> {
        (self == Preset::Failures).then_some(Episodes { per_s: 0.05, shortest_s: 0.08, longest_s: 0.4 })
    }

    /// Errors of the middleware's joint orientations.
    pub fn orientation_noise(self) -> Option<OrientationNoise> {
        let flips = |per_s| Episodes { per_s, shortest_s: 0.2, longest_s: 3.0 };
        match self {
            Preset::Clean => None,
            Preset::KinectV2 | Preset::KinectOffset => {
                Some(OrientationNoise { sd_deg: 3.0, axial_sd_deg: 12.0, flips: flips(0.01) })
            }
            Preset::Table1 => Some(OrientationNoise { sd_deg: 5.0, axial_sd_deg: 20.0, flips: flips(0.04) }),
            Preset::Failures => Some(OrientationNoise { sd_deg: 6.0, axial_sd_deg: 25.0, flips: flips(0.08) }),
        }
    }

    /// Disturbs a true recording as this sensor does; `poses` and `thetas` hold the true posture of each frame.
    pub fn disturb(self, skeleton: &mut SkeletonRecording, poses: &[Pose], thetas: &[PoseVector], seed: u64) {
        if let Some(noise) = self.orientation_noise() {
            orientation::disturb(skeleton, poses, noise, &mut stream(seed, Stream::Orientation));
        }
        match self {
            Preset::Clean => {}
            Preset::Table1 | Preset::Failures => {
                white_noise::add(skeleton, white_noise::table1_sd_mm, &mut stream(seed, Stream::WhiteNoise));
            }
            Preset::KinectV2 | Preset::KinectOffset => {
                /// Frame-to-frame jitter of a Kinect v2, millimetres.
                const JITTER_MM: f64 = 1.0;
                let mut rng = stream(seed, Stream::PostureOffset);
                let size = match self {
                    Preset::KinectOffset => posture_offset::every_joint_size,
                    _ => posture_offset::kinect_v2_size,
                };
                posture_offset::add(skeleton, thetas, size, &mut rng);
                let jitter = |_| Vector3::repeat(JITTER_MM);
                white_noise::add(skeleton, jitter, &mut stream(seed, Stream::WhiteNoise));
            }
        }
        if self == Preset::Failures {
            limb_swap::apply(skeleton, limb_swap::USUAL, &mut stream(seed, Stream::LimbSwap));
            hand_jump::apply(skeleton, hand_jump::USUAL, &mut stream(seed, Stream::HandJump));
            dropout::apply(skeleton, dropout::usual, &mut stream(seed, Stream::Dropout));
        }
    }
}

/// A name that no preset has.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("`{0}` is not a noise preset; there are clean, table1, kinect-v2, kinect-offset and failures")]
pub struct UnknownPreset(pub String);

impl FromStr for Preset {
    type Err = UnknownPreset;

    fn from_str(name: &str) -> Result<Self, Self::Err> {
        Self::ALL.into_iter().find(|p| p.name() == name).ok_or_else(|| UnknownPreset(name.to_owned()))
    }
}

impl fmt::Display for Preset {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

/// Random streams, one for each kind of error; the subject's own is 1.
#[derive(Debug, Clone, Copy)]
pub(super) enum Stream {
    Clock = 2,
    WhiteNoise = 3,
    PostureOffset = 4,
    Dropout = 5,
    HandJump = 6,
    LimbSwap = 7,
    Orientation = 8,
    Occlusion = 9,
    Jumps = 10,
    Plank = 11,
    /// First of the streams of inertial units, see [`unit_stream`].
    Units = 1000,
}

pub(super) fn stream(seed: u64, stream: Stream) -> ChaCha8Rng {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    rng.set_stream(stream as u64);
    rng
}

/// Random stream of one kind of error of the inertial unit with a number.
pub(super) fn unit_stream(seed: u64, unit: usize, kind: UnitError) -> ChaCha8Rng {
    /// More than there are kinds.
    const KINDS: u64 = 16;
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    rng.set_stream(Stream::Units as u64 + KINDS * unit as u64 + kind as u64);
    rng
}

/// Kinds of an inertial unit's errors that draw at random.
#[derive(Debug, Clone, Copy)]
pub(super) enum UnitError {
    Mounting = 0,
    Handling = 1,
    Clock = 2,
    Gyroscope = 3,
    Accelerometer = 4,
    Scale = 5,
    Gaps = 6,
    Shock = 7,
}

/// Three independent standard normal numbers.
pub(super) fn standard_normals(rng: &mut impl Rng) -> Vector3<f64> {
    Vector3::from_fn(|_, _| rng.sample(StandardNormal))
}

/// True place of a joint relative to the torso joint, in `subject`, metres. Those that the linked skeleton does not
/// have are put on the line between shoulders and hips, or above it.
pub(super) fn true_position(joint: Joint, points: &Points, pose: &Pose, stature_m: f64) -> Vector3<f64> {
    /// Neck and head above the shoulders, shares of stature (Winter 2009, Figure 4.1).
    const NECK_SHARE: f64 = 0.03;
    const HEAD_SHARE: f64 = 0.118;
    let middle = |level_of: fn(Side) -> Limb| {
        (points[point_index(level_of(Side::Left), 0)] + points[point_index(level_of(Side::Right), 0)]) / 2.0
    };
    let shoulders = || middle(|side| limbs_of(side).0);
    let up = pose.trunk * Vector3::y() * stature_m;
    let of_limb = Limb::ALL.into_iter().find_map(|limb| {
        let level = limb.joints().iter().position(|(kinect, nite)| *kinect == joint || *nite == joint)?;
        Some(points[point_index(limb, level)])
    });
    of_limb.unwrap_or_else(|| match joint {
        Joint::SpineShoulder => shoulders(),
        Joint::Neck => shoulders() + up * NECK_SHARE,
        Joint::Head => shoulders() + up * HEAD_SHARE,
        Joint::Pelvis => middle(|side| limbs_of(side).1),
        _ => Vector3::zeros(),
    })
}

#[cfg(test)]
mod tests;
