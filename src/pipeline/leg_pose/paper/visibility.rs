//! How much of a model the foreground shows, segment by segment.

use super::foreground::{Foreground, SAMPLING};
use crate::body::legs::solids::SOLID_COUNT;
use crate::geometry::camera::Intrinsics;
use crate::geometry::tapered_cylinder::TaperedCylinder;
use nalgebra::Vector3;

/// A point farther from every surface is on neither leg, metres.
const REACH: f64 = 0.09;

/// What of a model is seen.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Visibility {
    /// Pixels whose nearest segment this is: thigh, calf, foot of the left leg, then of the right.
    pub pixels: [f64; SOLID_COUNT],
    /// The same as a share of the pixels that the segment would cover, 0 to 1.
    pub shares: [f32; SOLID_COUNT],
    /// Share of the foreground that is on neither leg, 0 to 1.
    pub unexplained: f64,
}

impl Visibility {
    /// What a foreground shows of some solids.
    pub fn new(foreground: &Foreground, solids: &[TaperedCylinder; SOLID_COUNT], camera: &Intrinsics) -> Self {
        let mut pixels = [0.0; SOLID_COUNT];
        let mut stray = 0usize;
        for point in &foreground.points {
            let point = Vector3::from(point.map(f64::from));
            let distances = solids.iter().map(|solid| distance_to_side(solid, &point).abs());
            match distances.enumerate().min_by(|a, b| a.1.total_cmp(&b.1)) {
                Some((segment, distance)) if distance < REACH => pixels[segment] += SAMPLING as f64,
                _ => stray += 1,
            }
        }
        let covered = solids.each_ref().map(|solid| covered_pixels(solid, camera));
        Self {
            pixels,
            shares: std::array::from_fn(|k| (pixels[k] / covered[k].max(1.0)).min(1.0) as f32),
            unexplained: stray as f64 / foreground.points.len().max(1) as f64,
        }
    }
}

/// Distance of a point from the side of a solid, metres; negative inside.
fn distance_to_side(solid: &TaperedCylinder, point: &Vector3<f64>) -> f64 {
    let axis = solid.end - solid.start;
    let share = ((point - solid.start).dot(&axis) / axis.norm_squared().max(1e-12)).clamp(0.0, 1.0);
    (point - solid.start - axis * share).norm() - solid.radius_at(share)
}

/// About as many pixels as a solid covers: length across the view times width, and a disc at one end.
fn covered_pixels(solid: &TaperedCylinder, camera: &Intrinsics) -> f64 {
    let view = 0.5 * (solid.start + solid.end);
    let distance = view.norm().max(0.1);
    let across = (solid.end - solid.start).cross(&view).norm() / distance;
    let width = solid.radii[0] + solid.radii[1];
    (across * width + 0.5 * width * width) * camera.fx * camera.fy / (distance * distance)
}

#[cfg(test)]
mod tests {
    use super::super::scene::{CAMERA, foreground, image, walking};
    use super::*;

    #[test]
    fn what_is_rendered_is_seen_and_what_is_taken_away_is_not() {
        let (_, _, solids) = walking(0.6);
        let whole = Visibility::new(&foreground(&image(&solids)), &solids, &CAMERA);
        assert!(whole.unexplained < 0.01, "{whole:?}");
        assert!(whole.shares[1] > 0.5 && whole.shares[4] > 0.5, "{whole:?}");
        let one_leg = Visibility::new(&foreground(&image(&solids[..3])), &solids, &CAMERA);
        assert!(one_leg.shares[4] < 0.1 && one_leg.pixels[1] > 0.9 * whole.pixels[1], "{one_leg:?}");
        let moved = solids.map(|solid| TaperedCylinder {
            start: solid.start + Vector3::new(0.5, 0.0, 0.0),
            end: solid.end + Vector3::new(0.5, 0.0, 0.0),
            ..solid
        });
        assert!(Visibility::new(&foreground(&image(&solids)), &moved, &CAMERA).unexplained > 0.9);
    }
}
