use super::constraints::{clearance, legs_intersect, stand};
use super::solids::solids;
use super::*;
use crate::geometry::floor::Floor;
use proptest::prelude::*;

fn floor() -> Floor {
    Floor::under_camera(0.7, 0.2)
}

fn upright() -> LegState {
    LegState::upright(1.7, Vector3::new(-0.085, -0.1, 0.9))
}

/// Joints in floor axes relative to the right hip: forward, up, to the right.
fn in_floor_axes(state: &LegState) -> [Vector3<f64>; 8] {
    let floor_from_sensor = floor().sensor_from_floor().inverse();
    forward_kinematics(state, &floor()).joints().map(|joint| floor_from_sensor * (joint - state.right_hip))
}

/// The state seen in a mirror that stands in the plane x = 0 of `sensor`.
fn mirrored(state: &LegState) -> LegState {
    let left_hip = forward_kinematics(state, &floor()).sides[0].hip;
    LegState {
        pelvis_turn: -state.pelvis_turn,
        hip_elevation: -state.hip_elevation,
        right_hip: Vector3::new(-left_hip.x, left_hip.y, left_hip.z),
        angles: [state.angles[1], state.angles[0]],
        ..*state
    }
}

fn any_state() -> impl Strategy<Value = LegVector> {
    prop::array::uniform23(0.0..1.0f64).prop_map(|shares| {
        LegVector::from_fn(|i, _| {
            let [low, high] = bounds::bounds(i);
            low + shares[i] * (high - low)
        })
    })
}

#[test]
fn in_the_reference_posture_the_legs_hang_straight_down_and_the_feet_point_forward() {
    let state = upright();
    let [left_hip, left_knee, left_ankle, left_toe, right_hip, right_knee, right_ankle, right_toe] =
        in_floor_axes(&state);
    let ahead = state.foot;
    let below = state.thigh + state.calf;
    for (joint, expected) in [
        (right_hip, Vector3::zeros()),
        (right_knee, Vector3::new(0.0, -state.thigh, 0.0)),
        (right_ankle, Vector3::new(0.0, -below, 0.0)),
        (right_toe, Vector3::new(ahead, -below - kinematics::ANKLE_HEIGHT * state.foot, 0.0)),
        (left_hip, Vector3::new(0.0, 0.0, -0.17)),
        (left_knee, Vector3::new(0.0, -state.thigh, -0.17)),
        (left_ankle, Vector3::new(0.0, -below, -0.17)),
        (left_toe, Vector3::new(ahead, -below - kinematics::ANKLE_HEIGHT * state.foot, -0.17)),
    ] {
        assert!((joint - expected).norm() < 1e-12, "{joint} instead of {expected}");
    }
}

#[test]
fn every_angle_has_its_clinical_sign_on_both_sides() {
    for (side, outward) in [(0, -1.0), (1, 1.0)] {
        let (knee, ankle, toe) = (4 * side + 1, 4 * side + 2, 4 * side + 3);
        let base = in_floor_axes(&upright());
        let with = |change: &dyn Fn(&mut LegAngles)| {
            let mut state = upright();
            change(&mut state.angles[side]);
            in_floor_axes(&state)
        };
        assert!(with(&|a| a.hip[0] = 0.3)[knee].x > base[knee].x + 0.1, "flexion brings the knee forward");
        assert!(outward * (with(&|a| a.hip[1] = 0.3)[knee].z - base[knee].z) > 0.1, "abduction takes it outwards");
        assert!(outward * (with(&|a| a.hip[2] = 0.3)[toe].z - base[toe].z) < -0.05, "internal rotation turns toes in");
        assert!(with(&|a| a.knee = 0.3)[ankle].x < base[ankle].x - 0.1, "knee flexion brings the ankle back");
        assert!(with(&|a| a.ankle[0] = 0.3)[toe].y > base[toe].y + 0.05, "dorsiflexion lifts the toes");
        let mut state = upright();
        state.angles[side].ankle[1] = 0.3;
        let floor_from_sensor = floor().sensor_from_floor().inverse();
        let sole = floor_from_sensor * -forward_kinematics(&state, &floor()).sides[side].dorsal;
        assert!(outward * sole.z < -0.1, "inversion turns the sole to the other foot");
    }
}

#[test]
fn standing_puts_the_lower_sole_on_the_floor() {
    let mut state = upright();
    state.angles[0].hip[0] = 0.6;
    state.angles[0].knee = 0.9;
    let (stood, pose, solids) = stand(&state, &floor());
    assert!(clearance(&solids, &floor()).abs() < 1e-12);
    assert!((forward_kinematics(&stood, &floor()).sides[0].toe - pose.sides[0].toe).norm() < 1e-12);
    assert!(floor().height(&pose.sides[1].toe).abs() < 1e-12, "the straight leg carries");
}

#[test]
fn legs_side_by_side_are_apart_and_crossed_calves_intersect() {
    let apart = upright();
    let pose = forward_kinematics(&apart, &floor());
    assert!(!legs_intersect(&solids(&apart, &pose)));
    let mut crossed = apart;
    crossed.angles[0].hip[1] = -0.25;
    let pose = forward_kinematics(&crossed, &floor());
    assert!(legs_intersect(&solids(&crossed, &pose)));
}

#[test]
fn an_upright_adult_is_within_the_bounds_and_a_giant_is_brought_back() {
    assert!(bounds::contains(&upright().to_vector()));
    let giant = LegState::upright(2.5, upright().right_hip).to_vector();
    assert!(!bounds::contains(&giant) && bounds::contains(&bounds::clamp(&giant)));
}

proptest! {
    #[test]
    fn a_state_survives_the_way_through_names(x in any_state()) {
        prop_assert_eq!(LegState::from_vector(&x).to_vector(), x);
    }

    #[test]
    fn a_mirrored_state_has_mirrored_joints(x in any_state()) {
        let state = LegState::from_vector(&x);
        let [left, right] = forward_kinematics(&state, &floor()).sides;
        let found = forward_kinematics(&mirrored(&state), &floor()).sides;
        for (found, original) in [(found[0], right), (found[1], left)] {
            for (a, b) in [(found.hip, original.hip), (found.knee, original.knee), (found.toe, original.toe)] {
                prop_assert!((a - Vector3::new(-b.x, b.y, b.z)).norm() < 1e-12);
            }
        }
    }

    #[test]
    fn segments_have_the_lengths_of_the_state(x in any_state()) {
        let state = LegState::from_vector(&x);
        let pose = forward_kinematics(&state, &floor());
        prop_assert!(((pose.sides[0].hip - pose.sides[1].hip).norm() - state.hip_distance).abs() < 1e-12);
        for side in pose.sides {
            prop_assert!(((side.hip - side.knee).norm() - state.thigh).abs() < 1e-12);
            prop_assert!(((side.knee - side.ankle).norm() - state.calf).abs() < 1e-12);
        }
    }
}
