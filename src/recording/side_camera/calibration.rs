//! A colour camera at the side: its intrinsics, and where it is beside the depth camera.

use super::SideCamera;
use crate::geometry::camera::Intrinsics;
use crate::recording::depth::{Mounting, intrinsics_defect};
use nalgebra::Isometry3;
use serde::{Deserialize, Serialize};

/// The content of a `/side/…/calibration` message: pixels and metres.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SideCalibration {
    /// Focal length along the rows, pixels.
    pub fx: f64,
    /// Focal length along the columns, pixels.
    pub fy: f64,
    /// Column of the optical axis.
    pub cx: f64,
    /// Row of the optical axis.
    pub cy: f64,
    /// A point in the camera's axes (x right in the image, y down, z away) from one in those of the depth camera.
    pub camera_from_sensor: Mounting,
}

impl SideCalibration {
    /// The calibration of a camera.
    pub fn of_camera(camera: &SideCamera) -> Self {
        let Intrinsics { fx, fy, cx, cy } = camera.intrinsics;
        Self { fx, fy, cx, cy, camera_from_sensor: Mounting::of_isometry(&camera.camera_from_sensor) }
    }

    /// The intrinsics.
    pub fn intrinsics(&self) -> Intrinsics {
        Intrinsics { fx: self.fx, fy: self.fy, cx: self.cx, cy: self.cy }
    }

    /// Where the camera is.
    pub fn camera_from_sensor(&self) -> Isometry3<f64> {
        self.camera_from_sensor.isometry()
    }

    /// The first value that no camera has, with a sentence.
    pub(crate) fn defect(&self) -> Option<(&'static str, String)> {
        let mounting = || self.camera_from_sensor.defect().map(|sentence| ("camera_from_sensor", sentence));
        intrinsics_defect(&self.intrinsics()).or_else(mounting)
    }
}
