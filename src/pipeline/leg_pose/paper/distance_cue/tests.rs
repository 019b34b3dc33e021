use super::super::scene::{any_state, floor, foreground, image, walking};
use super::*;
use crate::body::legs::forward_kinematics;
use crate::body::legs::solids::solids;
use proptest::prelude::*;
use pulp::{Arch, Scalar, WithSimd};

struct Task<'a>(&'a DistanceCue, &'a [TaperedCylinder; SOLID_COUNT]);

impl WithSimd for Task<'_> {
    type Output = Distances;

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) -> Distances {
        self.0.distances(simd, self.1)
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(48))]
    #[test]
    fn both_sums_agree_with_the_plain_ones_to_a_thousandth_on_any_state(
        shares in prop::array::uniform23(0.0..1.0f64),
        phase in 0.0..6.3f64,
        weight in 0.0..1.0f64,
    ) {
        let seen = foreground(&image(&walking(phase).2));
        let cue = DistanceCue::new(&seen.points).expect("points");
        let used = &seen.points[..seen.points.len() / LANES * LANES];
        // From the truth to anywhere.
        let (near, far) = (walking(phase).0.to_vector(), any_state(&shares).to_vector());
        let state = crate::body::legs::LegState::from_vector(&(near + (far - near) * weight));
        let solids = solids(&state, &forward_kinematics(&state, &floor()));
        let plain = reference::distances(&solids, used);
        let fast = Arch::new().dispatch(Task(&cue, &solids));
        for (fast, plain) in [(fast.from_foreground, plain.from_foreground), (fast.from_model, plain.from_model)] {
            prop_assert!((fast / plain - 1.0).abs() < 1e-3, "{fast} against {plain}");
        }
        let narrow = Task(&cue, &solids).with_simd(Scalar::new());
        prop_assert_eq!(narrow, fast);
    }
}

#[test]
fn the_true_model_is_near_its_own_surface_and_a_shifted_one_is_not() {
    let (_, _, solids) = walking(0.8);
    let cue = DistanceCue::new(&foreground(&image(&solids)).points).expect("points");
    let at = |shift: Vector3<f64>| {
        let moved = solids.map(|s| TaperedCylinder { start: s.start + shift, end: s.end + shift, ..s });
        Arch::new().dispatch(Task(&cue, &moved))
    };
    let truth = at(Vector3::zeros());
    // The nearest axis point is up to half a spacing (2 cm) beside the foot of the perpendicular.
    assert!(truth.from_foreground < 0.006, "{truth:?}");
    for shift in [Vector3::x(), Vector3::y(), Vector3::z()] {
        assert!(at(shift * 0.05).mean() > truth.mean() + 0.003, "{shift}: {:?}", at(shift * 0.05));
    }
}

#[test]
fn fewer_points_than_a_register_holds_are_no_cue() {
    assert!(DistanceCue::new(&[[0.0, 0.0, 1.0]; LANES - 1]).is_none());
    assert!(DistanceCue::new(&[[0.0, 0.0, 1.0]; LANES]).is_some());
}

proptest! {
    #[test]
    fn the_nearest_point_is_found_from_anywhere(
        points in prop::collection::vec(prop::array::uniform3(-0.3..0.3f32), LANES * 6..LANES * 7),
        place in prop::array::uniform3(-0.6..0.6f32),
    ) {
        struct Nearest<'a>(&'a NearestField, [f32; 3]);
        impl WithSimd for Nearest<'_> {
            type Output = f32;
            #[inline(always)]
            fn with_simd<S: Simd>(self, simd: S) -> f32 {
                self.0.distance(simd, &self.1)
            }
        }
        let points = points[..LANES * 6].to_vec();
        let plain = points.iter().map(|p| (Vector3::from(*p) - Vector3::from(place)).norm()).fold(f32::INFINITY, f32::min);
        let fast = Arch::new().dispatch(Nearest(&NearestField::new(points), place));
        prop_assert!((fast - plain).abs() < 1e-6, "{fast} against {plain}");
    }
}
