//! A scene for tests: two legs of cylinders that walk towards the camera over a level floor, seen without noise.

use super::foreground::Foreground;
use super::render::render;
use crate::body::legs::constraints::stand;
use crate::body::legs::solids::SOLID_COUNT;
use crate::body::legs::{LegPose, LegState, LegVector, bounds};
use crate::geometry::camera::{DepthMap, Intrinsics};
use crate::geometry::floor::Floor;
use crate::geometry::tapered_cylinder::TaperedCylinder;
use crate::pipeline::leg_pose::foreground::Region;
use nalgebra::Vector3;

/// Quarter resolution keeps the plain sums quick.
pub(super) const WIDTH: usize = 160;
pub(super) const HEIGHT: usize = 120;
pub(super) const CAMERA: Intrinsics = Intrinsics { fx: 131.0, fy: 131.0, cx: 79.5, cy: 59.5 };
pub(super) const REGION: Region = Region { depth: [0.0, 1.8], x: [-0.4, 0.4] };

pub(super) fn floor() -> Floor {
    Floor::under_camera(0.75, 0.3)
}

/// Legs at a phase of the gait cycle (radians): hips swing, the knee of the leg that swings is bent.
pub(super) fn walking(phase: f64) -> (LegState, LegPose, [TaperedCylinder; SOLID_COUNT]) {
    let mut state = LegState::upright(1.7, Vector3::new(-0.11, -0.1, 1.0));
    state.hip_distance = 0.2;
    for (side, phase) in [phase, phase + std::f64::consts::PI].into_iter().enumerate() {
        let angles = &mut state.angles[side];
        angles.hip[0] = 0.1 + 0.3 * phase.sin();
        angles.knee = 0.15 + 0.6 * phase.cos().max(0.0);
        angles.ankle[0] = angles.knee - angles.hip[0];
    }
    stand(&state, &floor())
}

/// The image of some solids in front of nothing.
pub(super) fn image(solids: &[TaperedCylinder]) -> DepthMap {
    render(solids, &CAMERA, WIDTH, HEIGHT)
}

/// The foreground of an image in front of nothing.
pub(super) fn foreground(image: &DepthMap) -> Foreground {
    Foreground::find(image, &DepthMap::empty(WIDTH, HEIGHT), &CAMERA, &REGION, 4.0)
}

/// A state anywhere inside the bounds, before the camera; shares from 0 to 1.
pub(super) fn any_state(shares: &[f64; 23]) -> LegState {
    let mut x = LegVector::from_fn(|i, _| {
        let [low, high] = bounds::bounds(i);
        low + shares[i] * (high - low)
    });
    x[3] = -0.3 + 0.6 * shares[3];
    x[4] = -0.4 + 0.8 * shares[4];
    x[5] = 0.7 + 0.8 * shares[5];
    LegState::from_vector(&x)
}
