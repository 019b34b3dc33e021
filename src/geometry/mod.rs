//! Geometry: rotations of rigid bodies, a camera, a floor, solids. Knows nothing of bodies, sensors or time.
//!
//! A rotation is a [`nalgebra::UnitQuaternion`] or [`nalgebra::Rotation3`]; its *attitude vector* is the
//! rotation vector (unit axis × angle, radians).

pub mod attitude;
pub mod camera;
pub mod colour_image;
pub mod euler;
pub mod floor;
pub mod lanes;
pub mod tapered_cylinder;
pub mod three_point;
