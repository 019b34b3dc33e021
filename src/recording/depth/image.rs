//! One depth image as a sensor gives it, and what its numbers mean.

use crate::geometry::camera::DepthMap;
use std::sync::LazyLock;

/// Raw value of a pixel without depth.
pub const MISSING_RAW: u16 = 2047;

/// Constants of the raw values of a Kinect v1, z = 1 / (`RAW_OFFSET` − `RAW_SLOPE` · d) metres (\[walker\] Eq. 1).
pub const RAW_OFFSET: f64 = 3.33;
/// See [`RAW_OFFSET`].
pub const RAW_SLOPE: f64 = 0.00307;

/// Farthest depth that is told from "nothing", metres: the formula's pole is at raw value 1084.7, and beyond this depth
/// neighbouring values are more than a third of the depth apart.
const FARTHEST_M: f64 = 100.0;

const MM_PER_M: f32 = 1000.0;

/// What the numbers of a depth image are.
#[derive(Debug, Clone, Copy, PartialEq, Eq, serde::Serialize, serde::Deserialize, utoipa::ToSchema)]
#[serde(rename_all = "snake_case")]
pub enum DepthUnit {
    /// The 11-bit disparity code of a Kinect v1, 0 to 2046; 2047 is missing.
    Raw11,
    /// Millimetres; 0 is missing.
    Millimetres,
}

impl DepthUnit {
    /// The value that says "nothing seen here".
    pub fn missing(self) -> u16 {
        match self {
            DepthUnit::Raw11 => MISSING_RAW,
            DepthUnit::Millimetres => 0,
        }
    }

    /// Depth of a value, metres; 0 for a missing one and for raw values at or beyond the formula's pole.
    pub fn depth_m(self, value: u16) -> f32 {
        match self {
            DepthUnit::Raw11 => RAW_DEPTHS[usize::from(value.min(MISSING_RAW))],
            DepthUnit::Millimetres => f32::from(value) / MM_PER_M,
        }
    }
}

/// Depth of each raw value, metres.
static RAW_DEPTHS: LazyLock<[f32; MISSING_RAW as usize + 1]> = LazyLock::new(|| {
    std::array::from_fn(|raw| {
        let z = 1.0 / (RAW_OFFSET - RAW_SLOPE * raw as f64);
        if (0.0..FARTHEST_M).contains(&z) { z as f32 } else { 0.0 }
    })
});

/// The raw value, not rounded, that a Kinect v1 gives for a depth in metres.
pub fn raw_from_depth(z: f64) -> f64 {
    (RAW_OFFSET - 1.0 / z) / RAW_SLOPE
}

/// One depth image: a value for each pixel, row by row from the upper left corner.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct DepthImage {
    /// Pixels in a row.
    pub width: usize,
    /// Rows.
    pub height: usize,
    /// What the values are.
    pub unit: DepthUnit,
    /// `width · height` values.
    pub values: Vec<u16>,
}

impl DepthImage {
    /// An image in which nothing is seen.
    pub fn missing(width: usize, height: usize, unit: DepthUnit) -> Self {
        Self { width, height, unit, values: vec![unit.missing(); width * height] }
    }

    /// The image in metres.
    pub fn to_depth_map(&self) -> DepthMap {
        let mut map = DepthMap::empty(self.width, self.height);
        self.write_depth(&mut map);
        map
    }

    /// Writes the image in metres over another one, so that a stream of images needs one map only.
    pub fn write_depth(&self, map: &mut DepthMap) {
        (map.width, map.height) = (self.width, self.height);
        map.depth.clear();
        map.depth.extend(self.values.iter().map(|value| self.unit.depth_m(*value)));
    }

    /// Share of the pixels without depth, 0 to 1; 1 for an image without pixels.
    pub fn missing_share(&self) -> f64 {
        if self.values.is_empty() {
            return 1.0;
        }
        let missing = self.unit.missing();
        self.values.iter().filter(|value| **value == missing).count() as f64 / self.values.len() as f64
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_raw_value_is_the_depth_that_the_formula_says_and_back() {
        // 1000 / (3.33 − 0.00307 · 760) mm
        assert!((f64::from(DepthUnit::Raw11.depth_m(760)) - 1.0 / (3.33 - 2.3332)).abs() < 1e-6);
        for raw in [0, 400, 760, 1000] {
            assert!((raw_from_depth(f64::from(DepthUnit::Raw11.depth_m(raw))) - f64::from(raw)).abs() < 1e-2, "{raw}");
        }
    }

    #[test]
    fn what_is_missing_or_beyond_the_formula_has_no_depth() {
        for raw in [1085, 1500, 2046, MISSING_RAW, u16::MAX] {
            assert_eq!(DepthUnit::Raw11.depth_m(raw), 0.0, "{raw}");
        }
        assert_eq!(DepthUnit::Millimetres.depth_m(0), 0.0);
    }

    #[test]
    fn an_image_becomes_a_map_of_metres_and_counts_what_is_missing() {
        let image = DepthImage { width: 2, height: 2, unit: DepthUnit::Millimetres, values: vec![0, 500, 1500, 0] };
        let map = image.to_depth_map();
        assert_eq!((map.width, map.height, map.depth), (2, 2, vec![0.0, 0.5, 1.5, 0.0]));
        assert_eq!(image.missing_share(), 0.5);
        assert_eq!(DepthImage::missing(4, 3, DepthUnit::Raw11).missing_share(), 1.0);
    }
}
