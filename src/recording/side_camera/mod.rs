//! Colour cameras beside the depth camera: what the paper compares depth with (\[walker\], section 4.4.4).

mod calibration;
pub mod png_image;
mod summary;

pub use calibration::SideCalibration;
pub use summary::SideCameraSummary;

use crate::geometry::camera::Intrinsics;
use crate::geometry::colour_image::ColourImage;
use nalgebra::Isometry3;

/// Segments that a label can name: thigh, calf and foot of the left leg, then of the right.
pub const SEGMENT_LABELS: usize = 6;

/// Names of both cameras in topics and places, in the order of [`SideImages`].
pub const SIDE_NAMES: [&str; 2] = ["left", "right"];

/// A colour camera whose place beside the depth camera is known.
#[derive(Debug, Clone, PartialEq)]
pub struct SideCamera {
    /// Its intrinsics, pixels.
    pub intrinsics: Intrinsics,
    /// A point in its own axes (x right in the image, y down, z away) from one in `sensor`, metres.
    pub camera_from_sensor: Isometry3<f64>,
    /// Its first image.
    pub first: ColourImage,
    /// Which segment each pixel of its first image shows, row by row: 0 for none, then 1 to [`SEGMENT_LABELS`].
    pub labels: Vec<u8>,
}

/// What both cameras saw at one time: the left one in the image of the depth camera, then the right one.
pub type SideImages = [ColourImage; 2];
