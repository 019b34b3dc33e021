//! The camera of a depth recording: its intrinsics, and what is known of where it is mounted.

use crate::geometry::camera::Intrinsics;
use nalgebra::{Isometry3, Quaternion, Translation3, UnitQuaternion, Vector3};
use serde::{Deserialize, Serialize};

/// The content of a `/depth/calibration` message: pixels, metres, degrees.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct DepthCalibration {
    /// Focal length along the rows, pixels.
    pub fx: f64,
    /// Focal length along the columns, pixels.
    pub fy: f64,
    /// Column of the optical axis.
    pub cx: f64,
    /// Row of the optical axis.
    pub cy: f64,
    /// Where the camera is; the sensor frame is x right in the image, y down, z away.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub world_from_sensor: Option<Mounting>,
    /// Height of the camera above the floor, metres.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub camera_height_m: Option<f64>,
    /// Tilt of the camera downwards, degrees.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub camera_tilt_deg: Option<f64>,
}

/// A rigid transform as it is written.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Mounting {
    /// Unit quaternion, scalar first.
    pub rotation: [f64; 4],
    /// Metres.
    pub translation_m: [f64; 3],
}

/// Focal lengths that a depth camera may have, pixels: from a fisheye of a small image to a telescope.
const FOCAL_PX: std::ops::RangeInclusive<f64> = 20.0..=20_000.0;

/// Heights of a camera above the floor, metres, and its tilts, degrees.
const HEIGHT_M: std::ops::RangeInclusive<f64> = 0.0..=5.0;
/// See [`HEIGHT_M`].
const TILT_DEG: std::ops::RangeInclusive<f64> = -90.0..=90.0;

/// Accepted deviation of a quaternion's norm from one, as for joints.
const QUATERNION_TOLERANCE: f64 = 0.01;

/// No camera of a recording is farther from its origin, metres.
const FARTHEST_M: f64 = 100.0;

impl DepthCalibration {
    /// A calibration with nothing known of the mounting.
    pub fn of_intrinsics(camera: &Intrinsics) -> Self {
        let Intrinsics { fx, fy, cx, cy } = *camera;
        Self { fx, fy, cx, cy, world_from_sensor: None, camera_height_m: None, camera_tilt_deg: None }
    }

    /// The intrinsics.
    pub fn intrinsics(&self) -> Intrinsics {
        Intrinsics { fx: self.fx, fy: self.fy, cx: self.cx, cy: self.cy }
    }

    /// Where the camera is, when that was said.
    pub fn world_from_sensor(&self) -> Option<Isometry3<f64>> {
        self.world_from_sensor.map(|mounting| mounting.isometry())
    }

    /// The first value that no camera has, with a sentence.
    pub(crate) fn defect(&self) -> Option<(&'static str, String)> {
        if let Some(defect) = intrinsics_defect(&self.intrinsics()) {
            return Some(defect);
        }
        if let Some(height) = self.camera_height_m.filter(|height| !HEIGHT_M.contains(height)) {
            return Some(("camera_height_m", format!("the height is {height}, expected metres from 0 to 5")));
        }
        if let Some(tilt) = self.camera_tilt_deg.filter(|tilt| !TILT_DEG.contains(tilt)) {
            return Some(("camera_tilt_deg", format!("the tilt is {tilt}, expected degrees from -90 to 90")));
        }
        self.world_from_sensor?.defect().map(|sentence| ("world_from_sensor", sentence))
    }
}

impl Mounting {
    /// A transform as it is written.
    pub fn of_isometry(isometry: &Isometry3<f64>) -> Self {
        let q = isometry.rotation;
        Self { rotation: [q.w, q.i, q.j, q.k], translation_m: isometry.translation.vector.into() }
    }

    /// The transform.
    pub fn isometry(&self) -> Isometry3<f64> {
        let [w, x, y, z] = self.rotation;
        let rotation = UnitQuaternion::from_quaternion(Quaternion::new(w, x, y, z));
        Isometry3::from_parts(Translation3::from(Vector3::from(self.translation_m)), rotation)
    }

    /// What is wrong with it, in one sentence.
    pub(crate) fn defect(&self) -> Option<String> {
        let norm = self.rotation.iter().map(|q| q * q).sum::<f64>().sqrt();
        let is_unit = (norm - 1.0).abs() <= QUATERNION_TOLERANCE;
        let is_near = self.translation_m.iter().all(|t| t.abs() <= FARTHEST_M);
        let sentence = || format!("expected a unit quaternion w, x, y, z and a translation within {FARTHEST_M} m");
        (!is_unit || !is_near).then(sentence)
    }
}

/// The first of a camera's intrinsics that no camera has, with a sentence.
pub(crate) fn intrinsics_defect(camera: &Intrinsics) -> Option<(&'static str, String)> {
    let focal = [("fx", camera.fx), ("fy", camera.fy)].into_iter().find(|(_, value)| !FOCAL_PX.contains(value));
    if let Some((name, value)) = focal {
        return Some((name, format!("the focal length is {value}, expected pixels from 20 to 20000")));
    }
    let is_far = |value: f64| !value.is_finite() || value.abs() > *FOCAL_PX.end();
    let (name, value) = [("cx", camera.cx), ("cy", camera.cy)].into_iter().find(|(_, value)| is_far(*value))?;
    Some((name, format!("the optical axis is at {value}, expected pixels")))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn parse(text: &str) -> Result<DepthCalibration, serde_json::Error> {
        serde_json::from_str(text)
    }

    #[test]
    fn four_intrinsics_are_enough_and_the_rest_is_read_when_it_is_there() {
        let plain = parse(r#"{"fx": 580, "fy": 580, "cx": 319.5, "cy": 239.5}"#).unwrap();
        assert_eq!((plain.intrinsics().fx, plain.world_from_sensor(), plain.defect()), (580.0, None, None));
        let whole = parse(
            r#"{"fx": 580, "fy": 580, "cx": 319.5, "cy": 239.5, "camera_height_m": 0.5, "camera_tilt_deg": 10,
                "world_from_sensor": {"rotation": [0, 1, 0, 0], "translation_m": [0, 0.5, 0]}}"#,
        )
        .unwrap();
        let down = whole.world_from_sensor().unwrap() * Vector3::y();
        assert!((down + Vector3::y()).norm() < 1e-12 && whole.defect().is_none());
    }

    #[test]
    fn values_that_no_camera_has_are_named() {
        let named = |text: &str| parse(text).unwrap().defect().map(|(name, _)| name);
        assert_eq!(named(r#"{"fx": 0.58, "fy": 580, "cx": 0, "cy": 0}"#), Some("fx"));
        assert_eq!(named(r#"{"fx": 580, "fy": 580, "cx": 1e9, "cy": 0}"#), Some("cx"));
        let tilted = r#"{"fx": 580, "fy": 580, "cx": 0, "cy": 0, "camera_tilt_deg": 100}"#;
        assert_eq!(named(tilted), Some("camera_tilt_deg"));
        let skewed = r#"{"fx": 580, "fy": 580, "cx": 0, "cy": 0,
            "world_from_sensor": {"rotation": [1, 1, 0, 0], "translation_m": [0, 0, 0]}}"#;
        assert_eq!(named(skewed), Some("world_from_sensor"));
        assert!(parse(r#"{"fx": 580, "fy": 580, "cx": 0}"#).is_err());
    }
}
