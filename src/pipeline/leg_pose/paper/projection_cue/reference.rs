//! Cue 2 as it is written in the paper: the whole image is rendered with a depth buffer and every pixel compared, `f64`.

use super::super::foreground::Foreground;
use super::super::render::render;
use super::is_in_front;
use crate::geometry::camera::Intrinsics;
use crate::geometry::tapered_cylinder::TaperedCylinder;

/// Eq. 8, metres.
pub(in super::super) fn distance(
    solids: &[TaperedCylinder],
    foreground: &Foreground,
    camera: &Intrinsics,
) -> Option<f64> {
    if !solids.iter().all(is_in_front) {
        return None;
    }
    let (width, height) = (foreground.width, foreground.height);
    let model = render(solids, camera, width, height);
    let mut sum = 0.0;
    for j in 0..height {
        for i in 0..width {
            sum += (f64::from(model.depth[j * width + i]) - f64::from(foreground.depth(i, j))).abs();
        }
    }
    Some(sum / (width * height) as f64)
}
