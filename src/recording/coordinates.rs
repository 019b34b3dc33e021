//! From the axes that a recording declares to the one convention inside: right-handed `world`, y up.
//!
//! Two steps, in this order: the declared vertical axis is turned onto y by a quarter or half turn about x or z, then
//! a left-handed frame is mirrored by negating x. Only axes are swapped and negated, so positions stay exact.
//!
//! A mirror turns no left leg into a right one: names stay with the limbs. What a *wrong* declaration does is that the
//! subject appears mirrored; that is found later, from the direction in which the knees bend.

use nalgebra::{Quaternion, UnitQuaternion, Vector3};
use std::f64::consts::FRAC_1_SQRT_2;

/// Handedness of a coordinate frame.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Handedness {
    /// x × y = z, as Kinect SDK v2 camera space.
    Right,
    /// x × y = −z, as NITE real-world coordinates.
    Left,
}

/// The axis that points away from the ground.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Up {
    /// +x
    PlusX,
    /// −x
    MinusX,
    /// +y
    PlusY,
    /// −y
    MinusY,
    /// +z
    PlusZ,
    /// −z
    MinusZ,
}

/// The axes in which a recording was written.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Coordinates {
    /// Handedness of the frame.
    pub handedness: Handedness,
    /// Vertical axis of the frame.
    pub up: Up,
}

impl Handedness {
    /// `right` or `left`.
    pub fn from_name(name: &str) -> Option<Self> {
        match name {
            "right" => Some(Self::Right),
            "left" => Some(Self::Left),
            _ => None,
        }
    }
}

impl Up {
    /// One of `+x`, `-x`, `+y`, `-y`, `+z`, `-z`.
    pub fn from_name(name: &str) -> Option<Self> {
        match name {
            "+x" => Some(Self::PlusX),
            "-x" => Some(Self::MinusX),
            "+y" => Some(Self::PlusY),
            "-y" => Some(Self::MinusY),
            "+z" => Some(Self::PlusZ),
            "-z" => Some(Self::MinusZ),
            _ => None,
        }
    }
}

impl Coordinates {
    /// The convention inside: right-handed, y up.
    pub const WORLD: Coordinates = Coordinates { handedness: Handedness::Right, up: Up::PlusY };

    /// A point or direction in `world`.
    pub fn world_from_declared(self, p: Vector3<f64>) -> Vector3<f64> {
        let upright = match self.up {
            Up::PlusY => p,
            Up::MinusY => Vector3::new(p.x, -p.y, -p.z),
            Up::PlusZ => Vector3::new(p.x, p.z, -p.y),
            Up::MinusZ => Vector3::new(p.x, -p.z, p.y),
            Up::PlusX => Vector3::new(-p.y, p.x, p.z),
            Up::MinusX => Vector3::new(p.y, -p.x, p.z),
        };
        match self.handedness {
            Handedness::Right => upright,
            Handedness::Left => Vector3::new(-upright.x, upright.y, upright.z),
        }
    }

    /// `world_from_joint` of a declared joint orientation.
    ///
    /// In a left-handed recording the joint's own axes are left-handed too and are mirrored with it, so that y and z
    /// of a segment (the axis along the bone is one of them in every known middleware) still point where they did.
    pub fn world_from_joint(self, declared_from_joint: UnitQuaternion<f64>) -> UnitQuaternion<f64> {
        const H: f64 = FRAC_1_SQRT_2;
        let turn = match self.up {
            Up::PlusY => None,
            Up::MinusY => Some(Quaternion::new(0.0, 1.0, 0.0, 0.0)),
            Up::PlusZ => Some(Quaternion::new(H, -H, 0.0, 0.0)),
            Up::MinusZ => Some(Quaternion::new(H, H, 0.0, 0.0)),
            Up::PlusX => Some(Quaternion::new(H, 0.0, 0.0, H)),
            Up::MinusX => Some(Quaternion::new(H, 0.0, 0.0, -H)),
        };
        let upright = match turn {
            None => declared_from_joint,
            Some(turn) => UnitQuaternion::new_unchecked(turn) * declared_from_joint,
        };
        match self.handedness {
            Handedness::Right => upright,
            Handedness::Left => {
                UnitQuaternion::new_unchecked(Quaternion::new(upright.w, upright.i, -upright.j, -upright.k))
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    const ALL_UP: [Up; 6] = [Up::PlusX, Up::MinusX, Up::PlusY, Up::MinusY, Up::PlusZ, Up::MinusZ];

    fn all() -> impl Iterator<Item = Coordinates> {
        ALL_UP
            .into_iter()
            .flat_map(|up| [Handedness::Right, Handedness::Left].map(|handedness| Coordinates { handedness, up }))
    }

    /// Inverse of `world_from_declared`, found by trying: the matrix's transpose.
    fn declared_from_world(c: Coordinates, p: Vector3<f64>) -> Vector3<f64> {
        let columns = [Vector3::x(), Vector3::y(), Vector3::z()].map(|axis| c.world_from_declared(axis));
        Vector3::new(columns[0].dot(&p), columns[1].dot(&p), columns[2].dot(&p))
    }

    #[test]
    fn the_declared_vertical_becomes_y_and_a_left_handed_frame_becomes_right_handed() {
        for c in all() {
            let up = match c.up {
                Up::PlusX => Vector3::x(),
                Up::MinusX => -Vector3::x(),
                Up::PlusY => Vector3::y(),
                Up::MinusY => -Vector3::y(),
                Up::PlusZ => Vector3::z(),
                Up::MinusZ => -Vector3::z(),
            };
            assert_eq!(c.world_from_declared(up), Vector3::y(), "{c:?}");
            let [x, y, z] = [Vector3::x(), Vector3::y(), Vector3::z()].map(|axis| c.world_from_declared(axis));
            let determinant = if c.handedness == Handedness::Right { 1.0 } else { -1.0 };
            assert_eq!(x.cross(&y).dot(&z), determinant, "{c:?}");
        }
    }

    /// A person who stands in front of a NITE sensor and looks at it: x right in the image, y up, z away, left-handed.
    /// The subject's right is at −x of the image... seen from the sensor the subject's right hand is on the left.
    struct Pose {
        left_hip: Vector3<f64>,
        right_hip: Vector3<f64>,
        right_knee: Vector3<f64>,
        right_ankle: Vector3<f64>,
    }

    /// Flexion sign and lateral side of the right leg as anatomy sees them: X = Y × Z with Z to the subject's right.
    fn forward_and_lateral(pose: &Pose) -> (f64, f64) {
        let up = Vector3::y();
        let right = (pose.right_hip - pose.left_hip).normalize();
        let forward = up.cross(&right);
        let middle = (pose.right_hip + pose.right_ankle) / 2.0;
        ((pose.right_knee - middle).dot(&forward), (pose.right_ankle - pose.right_hip).dot(&right))
    }

    #[test]
    fn a_flexed_right_knee_lies_forward_and_an_abducted_right_leg_to_the_right_in_every_declared_frame() {
        // In the right-handed world: the subject faces +z (to the sensor), so the subject's right is −x.
        let pose_in_world = Pose {
            left_hip: Vector3::new(0.1, 0.9, -2.0),
            right_hip: Vector3::new(-0.1, 0.9, -2.0),
            right_knee: Vector3::new(-0.2, 0.6, -1.7),
            right_ankle: Vector3::new(-0.3, 0.3, -2.0),
        };
        for c in all() {
            let there_and_back = |p: Vector3<f64>| c.world_from_declared(declared_from_world(c, p));
            let pose = Pose {
                left_hip: there_and_back(pose_in_world.left_hip),
                right_hip: there_and_back(pose_in_world.right_hip),
                right_knee: there_and_back(pose_in_world.right_knee),
                right_ankle: there_and_back(pose_in_world.right_ankle),
            };
            let (forward, lateral) = forward_and_lateral(&pose);
            assert!(forward > 0.2 && lateral > 0.1, "{c:?}: knee {forward} m forward, ankle {lateral} m to the right");
        }
    }

    #[test]
    fn nite_and_kinect_v2_coordinates_of_the_same_person_agree_on_forward() {
        // One person, 2 m away, facing the sensor, right knee flexed: image right is the subject's left.
        let nite = |x, y, z| {
            Coordinates { handedness: Handedness::Left, up: Up::PlusY }.world_from_declared(Vector3::new(x, y, z))
        };
        let from_nite = Pose {
            left_hip: nite(0.1, 0.0, 2.0),
            right_hip: nite(-0.1, 0.0, 2.0),
            right_knee: nite(-0.1, -0.3, 1.7),
            right_ankle: nite(-0.1, -0.6, 2.0),
        };
        // Kinect v2: x grows to the sensor's left, so the same points have the opposite x.
        let kinect = |x, y, z| Coordinates::WORLD.world_from_declared(Vector3::new(x, y, z));
        let from_kinect = Pose {
            left_hip: kinect(-0.1, 0.0, 2.0),
            right_hip: kinect(0.1, 0.0, 2.0),
            right_knee: kinect(0.1, -0.3, 1.7),
            right_ankle: kinect(0.1, -0.6, 2.0),
        };
        assert_eq!(from_nite.right_knee, from_kinect.right_knee);
        assert!(forward_and_lateral(&from_nite).0 > 0.2);
        // The trap: the same numbers declared right-handed put the knee behind the leg.
        let wrong = |x, y, z| Coordinates::WORLD.world_from_declared(Vector3::new(x, y, z));
        let mirrored = Pose {
            left_hip: wrong(0.1, 0.0, 2.0),
            right_hip: wrong(-0.1, 0.0, 2.0),
            right_knee: wrong(-0.1, -0.3, 1.7),
            right_ankle: wrong(-0.1, -0.6, 2.0),
        };
        assert!(forward_and_lateral(&mirrored).0 < -0.2);
    }

    proptest! {
        #[test]
        fn a_bone_along_local_y_or_z_is_the_same_by_position_and_by_orientation(
            q in prop::array::uniform4(-1.0..1.0f64).prop_filter("not zero", |q| q.iter().map(|v| v * v).sum::<f64>() > 0.01)
        ) {
            let declared = UnitQuaternion::new_normalize(Quaternion::new(q[0], q[1], q[2], q[3]));
            for c in all() {
                for axis in [Vector3::y(), Vector3::z()] {
                    let by_position = c.world_from_declared(declared * axis);
                    let by_orientation = c.world_from_joint(declared) * axis;
                    prop_assert!((by_position - by_orientation).norm() < 1e-12, "{c:?}");
                }
            }
        }
    }
}
