use super::super::render::render;
use super::super::scene::{CAMERA, REGION, WIDTH, any_state, floor, foreground, image, walking};
use super::*;
use crate::body::legs::solids::solids;
use crate::body::legs::{LegState, forward_kinematics};
use crate::geometry::camera::{DepthMap, Intrinsics};
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

/// Legs at any place, as seen by a camera whose columns fill no whole strips: cut by every edge of the image, one behind the
/// other, near and far.
fn check_by_narrow_camera(shares: &[f64; 23], shift: [f64; 3]) {
    const SIZE: [usize; 2] = [149, 113];
    const NARROW: Intrinsics = Intrinsics { fx: 131.0, fy: 127.0, cx: 70.3, cy: 60.2 };
    struct Narrow<'a>(&'a Foreground, &'a [TaperedCylinder; SOLID_COUNT]);
    impl WithSimd for Narrow<'_> {
        type Output = Option<f64>;

        #[inline(always)]
        fn with_simd<S: Simd>(self, simd: S) -> Option<f64> {
            ProjectionCue::new(self.0, &NARROW).distance(simd, self.1, &mut Scratch::default())
        }
    }
    let moved = |solids: [TaperedCylinder; SOLID_COUNT]| {
        let shift = Vector3::from(shift);
        solids.map(|solid| TaperedCylinder { start: solid.start + shift, end: solid.end + shift, ..solid })
    };
    let image = render(&walking(1.0).2, &NARROW, SIZE[0], SIZE[1]);
    let seen = Foreground::find(&image, &DepthMap::empty(SIZE[0], SIZE[1]), &NARROW, &REGION, 4.0);
    let state = any_state(shares);
    let solids = moved(solids(&state, &forward_kinematics(&state, &floor())));
    let plain = reference::distance(&solids, &seen, &NARROW);
    let fast = Arch::new().dispatch(Narrow(&seen, &solids));
    assert_eq!(fast, Narrow(&seen, &solids).with_simd(Scalar::new()), "the instruction sets differ");
    match (fast, plain) {
        (Some(fast), Some(plain)) => assert!((fast - plain).abs() < 1e-3 * plain.max(1e-3), "{fast} against {plain}"),
        _ => assert_eq!(fast, plain),
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(96))]
    #[test]
    fn legs_that_the_images_edges_cut_have_the_plain_sum_too(
        shares in prop::array::uniform23(0.0..1.0f64),
        x in -0.9..0.9f64,
        y in -0.8..0.8f64,
        z in -0.4..1.5f64,
    ) {
        check_by_narrow_camera(&shares, [x, y, z]);
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
