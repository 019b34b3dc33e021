//! Depth images: what a camera on a walker records.

mod calibration;
mod codec;
mod image;
pub(crate) mod summary;
mod writer;

pub use super::decode::DepthReader;
pub(crate) use calibration::intrinsics_defect;
pub use calibration::{DepthCalibration, Mounting};
pub use codec::{DepthCoding, DepthDecoder, DepthEncoder, ImageHeader, MAX_PIXELS, MAX_SIDE};
pub use image::{DepthImage, DepthUnit, MISSING_RAW, RAW_OFFSET, RAW_SLOPE, raw_from_depth};
pub use summary::{DepthSummary, DepthWarning, DepthWarningKind};
pub use writer::DepthWriter;
