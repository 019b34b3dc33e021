use super::super::scene::{CAMERA, WIDTH, any_state, floor, foreground, image, walking};
use super::*;
use crate::body::legs::solids::solids;
use crate::body::legs::{LegState, forward_kinematics};
use crate::geometry::camera::DepthMap;
use nalgebra::Vector3;
use proptest::prelude::*;
use pulp::{Arch, Scalar, WithSimd};

struct Task<'a>(&'a Foreground, &'a [TaperedCylinder; SOLID_COUNT]);

impl WithSimd for Task<'_> {
    type Output = Option<f64>;

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) -> Option<f64> {
        ProjectionCue::new(self.0, &CAMERA).distance(simd, self.1, &mut Scratch::default())
    }
}

fn check(seen: &Foreground, solids: &[TaperedCylinder; SOLID_COUNT], tolerance: f64) {
    let plain = reference::distance(solids, seen, &CAMERA);
    let fast = Arch::new().dispatch(Task(seen, solids));
    assert_eq!(fast, Task(seen, solids).with_simd(Scalar::new()), "the instruction sets differ");
    match (fast, plain) {
        (Some(fast), Some(plain)) => {
            assert!((fast - plain).abs() < tolerance * plain.max(1e-3), "{fast} against {plain}");
        }
        _ => assert_eq!(fast, plain),
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(96))]
    #[test]
    fn the_sum_agrees_with_the_plain_one_to_a_thousandth_on_any_state(
        shares in prop::array::uniform23(0.0..1.0f64),
        phase in 0.0..6.3f64,
        weight in 0.0..1.0f64,
    ) {
        let seen = foreground(&image(&walking(phase).2));
        let (near, far) = (walking(phase).0.to_vector(), any_state(&shares).to_vector());
        let state = LegState::from_vector(&(near + (far - near) * weight));
        check(&seen, &solids(&state, &forward_kinematics(&state, &floor())), 1e-3);
    }

    #[test]
    fn the_model_alone_agrees_pixel_by_pixel(shares in prop::array::uniform23(0.0..1.0f64)) {
        // In front of an empty foreground the sum is the model's own: an error in any face or edge shows.
        let nothing = foreground(&DepthMap::empty(WIDTH, super::super::scene::HEIGHT));
        let state = any_state(&shares);
        check(&nothing, &solids(&state, &forward_kinematics(&state, &floor())), 1e-3);
    }
}

#[test]
fn a_model_in_its_own_image_is_at_no_distance() {
    let (_, _, solids) = walking(2.0);
    let seen = foreground(&image(&solids));
    let distance = Arch::new().dispatch(Task(&seen, &solids)).expect("in front of the camera");
    assert!(distance < 1e-5, "{distance}");
}

#[test]
fn a_model_outside_of_the_image_leaves_the_foreground_as_the_distance() {
    let (_, _, solids) = walking(2.0);
    let seen = foreground(&image(&solids));
    let all = seen.depth_sum / (seen.width * seen.height) as f64;
    for shift in [Vector3::new(9.0, 0.0, 0.0), Vector3::new(-9.0, 0.0, 0.0), Vector3::new(0.0, 9.0, 0.0)] {
        let away = solids.map(|s| TaperedCylinder { start: s.start + shift, end: s.end + shift, ..s });
        let distance = Arch::new().dispatch(Task(&seen, &away)).expect("in front of the camera");
        assert!((distance - all).abs() < 1e-9);
    }
}

#[test]
fn a_model_behind_the_camera_has_no_distance() {
    let (_, _, solids) = walking(2.0);
    let seen = foreground(&image(&solids));
    let behind =
        solids.map(|s| TaperedCylinder { start: s.start - Vector3::z() * 1.2, end: s.end - Vector3::z() * 1.2, ..s });
    assert_eq!(Arch::new().dispatch(Task(&seen, &behind)), None);
}
