use super::*;
use crate::body::kinematics::forward_kinematics;
use crate::body::skeleton::point_index;
use crate::body::{Joint, Limb, POINT_COUNT, Pose, Skeleton};
use crate::estimation::random::RandomStreams;
use nalgebra::{Rotation3, Vector3};

const HZ: f64 = 30.0;
const LEFT_LEG: usize = 2;
/// White noise of the test's sensor, metres.
const NOISE_M: f64 = 0.003;

/// Somebody who walks on the spot with hanging arms: legs and arms swing to and fro by 20° once in two seconds.
fn walking(n: usize) -> SkeletonRecording {
    moving(n, |seconds| {
        let swing = 20f64.to_radians() * (std::f64::consts::PI * seconds).sin();
        let forward = |angle: f64| Rotation3::from_axis_angle(&Vector3::z_axis(), angle);
        let hanging = |side: f64| Rotation3::from_axis_angle(&Vector3::x_axis(), side * 80f64.to_radians());
        let limbs = [forward(-swing) * hanging(-1.0), forward(swing) * hanging(1.0), forward(swing), forward(-swing)];
        Pose { limbs, hinges: [0.3, 0.3, 0.2, 0.2], ..Pose::reference() }
    })
}

/// A sensor's recording of an average adult in front of it, axes as in `subject`.
fn moving(n: usize, pose_at: impl Fn(f64) -> Pose) -> SkeletonRecording {
    let body = Skeleton::of_stature(1.7);
    let mut streams = RandomStreams::new(3);
    let torso = Vector3::new(0.2, 1.0, 2.5);
    let mut joints = vec![Joint::Torso];
    joints.extend(Limb::ALL.iter().flat_map(|limb| limb.joints().map(|(_, nite)| nite)));
    let mut positions = Vec::new();
    for t in 0..n {
        let points = forward_kinematics(&body, &pose_at(t as f64 / HZ));
        let mut noise = || Vector3::from_fn(|_, _| NOISE_M * streams.normal());
        positions.push(torso);
        positions.extend(points.iter().map(|p| torso + p + noise()));
    }
    let confidence = vec![1.0; positions.len()];
    let time_ns = (0..n).map(|t| (t as f64 / HZ * 1e9) as i64).collect();
    SkeletonRecording { joints, time_ns, positions, confidence, orientations: Vec::new() }
}

/// Place of a point of the model in a frame.
fn place(skeleton: &mut SkeletonRecording, t: usize, limb: usize, level: usize) -> &mut Vector3<f64> {
    let n = skeleton.joints.len();
    &mut skeleton.positions[t * n + 1 + 3 * limb + level]
}

fn confidence(skeleton: &mut SkeletonRecording, t: usize, column: usize) -> &mut f32 {
    let n = skeleton.joints.len();
    &mut skeleton.confidence[t * n + column]
}

fn without_frames(mut skeleton: SkeletonRecording, lost: std::ops::Range<usize>) -> SkeletonRecording {
    let n = skeleton.joints.len();
    skeleton.time_ns.drain(lost.clone());
    skeleton.positions.drain(lost.start * n..lost.end * n);
    skeleton.confidence.drain(lost.start * n..lost.end * n);
    skeleton
}

fn inspection(skeleton: &SkeletonRecording) -> Inspection {
    let settings = JointAngleSettings::default();
    let observations = Observations::from_recording(skeleton, &settings).unwrap();
    inspect(skeleton, &observations, &settings).unwrap()
}

/// Kind, subject, first and last frame, and number of frames of each event.
fn told(skeleton: &SkeletonRecording) -> Vec<(String, String, f64, f64, u64)> {
    let frame = |s: f64| (s * HZ).round();
    let events = inspection(skeleton).events.into_iter();
    events.map(|e| (e.kind, e.subject, frame(e.start_s), frame(e.end_s), e.n_frames)).collect()
}

fn event_of(kind: &str, subject: &str, first: f64, last: f64, n_frames: u64) -> (String, String, f64, f64, u64) {
    (kind.into(), subject.into(), first, last, n_frames)
}

#[test]
fn a_good_recording_has_no_events_and_is_left_as_it_is() {
    let walking = walking(300);
    let found = inspection(&walking);
    assert_eq!(found.events, []);
    let settings = JointAngleSettings::default();
    assert_eq!(found.repaired, Observations::from_recording(&walking, &settings).unwrap());
    let kinds: Vec<&str> = found.counts.iter().map(|c| c.kind.as_str()).collect();
    let all = ["frame_gap", "lost_user", "lost_joint", "limb_swap", "hand_jump", "foot_jump", "occlusion"];
    assert_eq!(kinds, all);
    assert!(found.counts.iter().all(|c| (c.n_events, c.n_frames) == (0, 0)));
}

#[test]
fn missing_frames_are_a_gap_a_single_one_is_not_and_seconds_without_frames_are_a_lost_user() {
    assert_eq!(told(&without_frames(walking(100), 40..41)), []);
    assert_eq!(told(&without_frames(walking(100), 40..45)), [event_of("frame_gap", "recording", 39.0, 45.0, 5)]);
    assert_eq!(told(&without_frames(walking(200), 40..100)), [event_of("lost_user", "user", 39.0, 100.0, 60)]);
}

#[test]
fn frames_with_hardly_a_point_are_a_lost_user_and_not_ten_lost_joints() {
    let mut skeleton = walking(100);
    for t in 50..80 {
        for column in 1..=10 {
            *confidence(&mut skeleton, t, column) = 0.0;
        }
    }
    assert_eq!(told(&skeleton), [event_of("lost_user", "user", 50.0, 79.0, 30)]);
}

#[test]
fn a_joint_that_flickers_is_one_event_and_one_that_comes_back_for_longer_two() {
    let mut skeleton = walking(100);
    let column = 1 + point_index(Limb::LeftArm, 2);
    for t in [20, 21, 24, 25, 26, 60] {
        *confidence(&mut skeleton, t, column) = 0.2;
    }
    *place(&mut skeleton, 60, 0, 2) = Vector3::repeat(f64::NAN);
    *confidence(&mut skeleton, 90, 0) = 0.0;
    let expected = [
        event_of("lost_joint", "left_hand", 20.0, 26.0, 5),
        event_of("lost_joint", "left_hand", 60.0, 60.0, 1),
        event_of("lost_joint", "torso", 90.0, 90.0, 1),
    ];
    assert_eq!(told(&skeleton), expected);
}

/// The recording with left and right exchanged in some frames, legs (2) or arms (0).
fn exchanged(mut skeleton: SkeletonRecording, first_limb: usize, frames: std::ops::Range<usize>) -> SkeletonRecording {
    for t in frames {
        for level in 1..3 {
            let left = *place(&mut skeleton, t, first_limb, level);
            *place(&mut skeleton, t, first_limb, level) =
                std::mem::replace(place(&mut skeleton, t, first_limb + 1, level), left);
        }
    }
    skeleton
}

#[test]
fn exchanged_limbs_are_exchanged_back_and_marked() {
    for (name, first_limb) in [("legs", 2), ("arms", 0)] {
        let good = inspection(&walking(120)).repaired;
        let found = inspection(&exchanged(walking(120), first_limb, 50..57));
        assert_eq!(found.repaired, good, "{name}");
        assert_eq!((found.events.len(), found.events[0].subject.as_str()), (1, name));
        assert_eq!((found.events[0].kind.as_str(), found.events[0].n_frames), ("limb_swap", 7));
        let marked = 0b110_110 << (3 * first_limb);
        assert!((0..120).all(|t| found.repairs.exchanged[t] == if (50..57).contains(&t) { marked } else { 0 }));
    }
}

#[test]
fn an_exchange_is_undone_although_an_ankle_is_lost_at_its_beginning() {
    let mut skeleton = exchanged(walking(120), LEFT_LEG, 50..60);
    for t in 45..65 {
        *place(&mut skeleton, t, LEFT_LEG, 2) = Vector3::repeat(f64::NAN);
        *confidence(&mut skeleton, t, 1 + point_index(Limb::LeftLeg, 2)) = 0.0;
    }
    assert!(told(&skeleton).contains(&event_of("limb_swap", "legs", 50.0, 59.0, 10)));
}

#[test]
fn limbs_that_stay_exchanged_or_only_seem_to_cross_are_left_alone() {
    // Nobody can tell from the end of a recording whether they would have come back.
    assert_eq!(told(&exchanged(walking(120), LEFT_LEG, 100..120)), []);
    // Legs that cross slowly: each knee passes to the other side within half a second, and returns.
    let crossing = moving(120, |seconds| {
        let across = 25f64.to_radians() * (std::f64::consts::PI * seconds).sin();
        let inwards = |side: f64| Rotation3::from_axis_angle(&Vector3::x_axis(), side * across);
        let identity = Rotation3::identity();
        Pose { limbs: [identity, identity, inwards(-1.0), inwards(1.0)], ..Pose::reference() }
    });
    assert_eq!(told(&crossing), []);
}

#[test]
fn a_hand_that_is_elsewhere_for_three_frames_is_taken_out_and_nothing_else() {
    for (limb, kind, subject) in [(1, "hand_jump", "right_hand"), (3, "foot_jump", "right_foot")] {
        let mut skeleton = walking(120);
        for t in 70..73 {
            *place(&mut skeleton, t, limb, 2) += Vector3::new(0.2, 0.1, -0.3);
        }
        assert_eq!(told(&skeleton), [event_of(kind, subject, 70.0, 72.0, 3)]);
        let found = inspection(&skeleton);
        let point = 3 * limb + 2;
        for t in 0..120 {
            let is_out = (70..73).contains(&t);
            assert_eq!(found.repaired.points[t][point].x.is_nan(), is_out);
            assert_eq!(found.repairs.rejected[t], if is_out { 1 << point } else { 0 });
        }
    }
}

#[test]
fn two_jumps_close_together_are_both_found() {
    let mut skeleton = walking(120);
    for t in [60, 64] {
        *place(&mut skeleton, t, 0, 2) += Vector3::new(0.0, 0.4, 0.3);
    }
    let found = inspection(&skeleton);
    let out: Vec<usize> = (0..120).filter(|t| found.repairs.rejected[*t] != 0).collect();
    assert_eq!(out, [60, 64]);
}

#[test]
fn a_step_of_ten_centimetres_and_a_quick_punch_are_no_jumps() {
    let mut skeleton = walking(120);
    for t in 70..73 {
        place(&mut skeleton, t, 0, 2).x += 0.10;
    }
    // Out by 60 cm and back within 0.4 s: 6 m/s at the quickest.
    for t in 30..42 {
        place(&mut skeleton, t, 1, 2).x += 0.6 * (std::f64::consts::PI * (t as f64 - 30.0) / 12.0).sin().powi(2);
    }
    assert_eq!(told(&skeleton), []);
}

/// Standing for two seconds, seated for three with thighs forward, standing for one.
fn sitting() -> SkeletonRecording {
    moving(180, |seconds| {
        let seated = ((seconds - 2.0).clamp(0.0, 0.5) - (seconds - 5.0).clamp(0.0, 0.5)) / 0.5;
        let bend = 88f64.to_radians() * seated;
        let thigh = Rotation3::from_axis_angle(&Vector3::z_axis(), bend);
        let identity = Rotation3::identity();
        Pose { limbs: [identity, identity, thigh, thigh], hinges: [0.0, 0.0, bend, bend], ..Pose::reference() }
    })
}

#[test]
fn sitting_alone_is_no_occlusion() {
    assert_eq!(told(&sitting()), []);
}

#[test]
fn a_hip_that_slides_along_a_seated_thigh_is_occluded_and_taken_out() {
    let mut skeleton = sitting();
    for t in 90..130 {
        place(&mut skeleton, t, LEFT_LEG, 0).x += 0.16;
    }
    let events = told(&skeleton);
    let [(kind, subject, first, last, _)] = events.as_slice() else { panic!("{events:?}") };
    assert_eq!((kind.as_str(), subject.as_str()), ("occlusion", "left_hip"));
    // Points are averaged over half a second, so the ends are known to a quarter of one.
    assert!((first - 90.0).abs() < 8.0 && (last - 129.0).abs() < 8.0, "{events:?}");
    assert!(inspection(&skeleton).repaired.points[110][point_index(Limb::LeftLeg, 0)].x.is_nan());
}

#[test]
fn a_point_that_freezes_is_occluded_unless_the_whole_frame_repeats() {
    let mut skeleton = walking(150);
    let frozen = *place(&mut skeleton, 60, 3, 1);
    for t in 61..90 {
        *place(&mut skeleton, t, 3, 1) = frozen;
    }
    assert_eq!(told(&skeleton), [event_of("occlusion", "right_knee", 61.0, 89.0, 29)]);
    let mut skeleton = walking(300);
    let n = skeleton.joints.len();
    for t in 61..90 {
        skeleton.positions.copy_within(60 * n..61 * n, t * n);
    }
    assert_eq!(told(&skeleton), []);
}

#[test]
fn points_of_a_bent_leg_that_the_sensor_infers_are_told_and_kept() {
    let mut skeleton = sitting();
    for t in 30..120 {
        *confidence(&mut skeleton, t, 1 + point_index(Limb::LeftLeg, 0)) = 0.5;
    }
    let events = told(&skeleton);
    let [(kind, subject, first, last, _)] = events.as_slice() else { panic!("{events:?}") };
    assert_eq!((kind.as_str(), subject.as_str(), *last), ("occlusion", "left_hip", 119.0));
    assert!((65.0..80.0).contains(first), "not before the legs are bent: {first}");
    assert!(inspection(&skeleton).repairs.rejected.iter().all(|mask| *mask == 0));
}

#[test]
fn too_little_to_look_at_is_looked_at_without_harm() {
    let mut nothing = walking(50);
    nothing.positions.fill(Vector3::repeat(f64::NAN));
    nothing.confidence.fill(0.0);
    assert_eq!(told(&nothing), [event_of("lost_user", "user", 0.0, 49.0, 50)]);

    let mut no_hand = walking(50);
    for t in 0..50 {
        *confidence(&mut no_hand, t, 1 + point_index(Limb::RightArm, 2)) = 0.0;
    }
    assert_eq!(told(&no_hand), [event_of("lost_joint", "right_hand", 0.0, 49.0, 50)]);

    for n in 0..4 {
        assert_eq!(told(&walking(n)), []);
    }
}

#[test]
fn a_list_that_is_too_long_keeps_the_longest_events_and_the_order_of_time() {
    let event = |i: usize| Event {
        kind: "lost_joint".into(),
        subject: "left_hand".into(),
        start_s: i as f64,
        end_s: i as f64 + if i.is_multiple_of(2) { 0.5 } else { 0.1 },
        n_frames: 1,
    };
    let kept = listed((0..2 * MAX_LISTED).map(event).collect());
    assert_eq!(kept.len(), MAX_LISTED);
    assert!(kept.iter().all(|e| e.start_s % 2.0 == 0.0) && kept.is_sorted_by(|a, b| a.start_s < b.start_s));
    assert_eq!(POINT_COUNT, 12, "the tests number limbs and points by hand");
}
