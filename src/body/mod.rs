//! The human body as a model: joints, the linked skeleton, ranges of motion, anatomical angles, a pair of legs.
//!
//! # Frames
//!
//! `world` is the sensor's right-handed frame, y up. `subject` is `world` turned about the vertical so that X is the
//! subject's initial facing direction, Y up and Z to the subject's right (ISB order). `trunk` moves with the trunk and
//! equals `subject` in the reference posture: the T-posture (arms lateral, palms forward, legs down).

pub mod anatomical_angles;
pub mod bones;
pub mod joint;
pub mod kinematics;
pub mod legs;
pub mod pose;
pub mod range_of_motion;
pub mod skeleton;

pub use bones::{BONE_COUNT, Bone};
pub use joint::{Joint, Side};
pub use pose::{POSE_DIMENSION, Pose};
pub use skeleton::{Limb, OBSERVATION_DIMENSION, POINT_COUNT, Skeleton};
