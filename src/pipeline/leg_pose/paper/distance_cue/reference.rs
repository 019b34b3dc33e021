//! Cue 1 as it is written in the paper: every point against every other, `f64`.

use super::{Distances, POINTS_OF_SEGMENT};
use crate::geometry::tapered_cylinder::TaperedCylinder;
use nalgebra::Vector3;

/// Points on the axes of the solids, with their radii.
fn model_points(solids: &[TaperedCylinder]) -> Vec<(Vector3<f64>, f64)> {
    let mut points = Vec::new();
    for solid in solids {
        for k in 0..POINTS_OF_SEGMENT {
            let share = k as f64 / (POINTS_OF_SEGMENT - 1) as f64;
            points.push((solid.start + (solid.end - solid.start) * share, solid.radius_at(share)));
        }
    }
    points
}

/// Eqs. 4 and 5.
pub(in super::super) fn distances(solids: &[TaperedCylinder], foreground: &[[f32; 3]]) -> Distances {
    let model = model_points(solids);
    let foreground: Vec<Vector3<f64>> = foreground.iter().map(|f| Vector3::from(f.map(f64::from))).collect();
    let mut from_foreground = 0.0;
    for f in &foreground {
        let mut nearest = (f64::INFINITY, 0.0);
        for (m, w) in &model {
            let distance = (f - m).norm();
            if distance < nearest.0 {
                nearest = (distance, *w);
            }
        }
        from_foreground += (nearest.1 - nearest.0).abs();
    }
    let mut from_model = 0.0;
    for (m, w) in &model {
        let nearest = foreground.iter().map(|f| (f - m).norm()).fold(f64::INFINITY, f64::min);
        from_model += (w - nearest).abs();
    }
    Distances {
        from_foreground: from_foreground / foreground.len() as f64,
        from_model: from_model / model.len() as f64,
    }
}
