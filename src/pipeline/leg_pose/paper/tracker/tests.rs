use super::super::scene::{CAMERA, HEIGHT, REGION, WIDTH, floor, image, walking};
use super::*;
use crate::assessment::LegCues;

fn tracker(cues: LegCues, particles: usize) -> Tracker {
    let settings = PaperSettings { particles, cues, region: REGION, ..PaperSettings::default() };
    Tracker::new(settings, CAMERA, floor(), DepthMap::empty(WIDTH, HEIGHT))
}

/// Time and gait phase of a frame: one cycle takes two seconds, as walker users walk.
fn moment(frame: u32) -> (i64, f64) {
    (i64::from(frame) * 33_333_333, f64::from(frame) * std::f64::consts::PI / 30.0)
}

/// Mean and largest error of the ankles over some frames, metres.
fn ankle_errors(tracker: &mut Tracker, frames: u32) -> (f64, f64) {
    let (mut sum, mut worst) = (0.0, 0.0f64);
    for frame in 0..frames {
        let (time_ns, phase) = moment(frame);
        let (_, pose, solids) = walking(phase);
        let estimate = tracker.step(time_ns, &image(&solids)).expect("two legs in view");
        assert_eq!(estimate.started, frame == 0, "frame {frame} restarted the track");
        for (found, truth) in estimate.legs.sides.iter().zip(&pose.sides) {
            let error = (found.ankle - truth.ankle).norm();
            sum += error;
            worst = worst.max(error);
        }
    }
    (sum / f64::from(2 * frames), worst)
}

#[test]
fn a_walker_of_cylinders_is_followed_from_the_first_frame() {
    // With 5000 particles the mean is 2 cm; fewer wander more.
    let (mean, worst) = ankle_errors(&mut tracker(LegCues::Both, 2000), 15);
    assert!(mean < 0.045 && worst < 0.11, "ankles are off by {mean} on average, {worst} at most");
}

#[test]
fn each_cue_alone_follows_too() {
    for cues in [LegCues::Distance, LegCues::Projection] {
        let (mean, _) = ankle_errors(&mut tracker(cues, 1000), 10);
        assert!(mean < 0.10, "{cues:?}: ankles are off by {mean}");
    }
}

#[test]
fn one_and_three_threads_give_the_same_bytes() {
    let run = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("threads");
        pool.install(|| {
            let mut tracker = tracker(LegCues::Both, 200);
            (0..4).map(|frame| tracker.step(moment(frame).0, &image(&walking(moment(frame).1).2))).collect::<Vec<_>>()
        })
    };
    assert_eq!(run(1), run(3));
}

#[test]
fn a_track_is_found_again_after_the_camera_was_covered() {
    let mut tracker = tracker(LegCues::Both, 2000);
    let nothing = DepthMap::empty(WIDTH, HEIGHT);
    let mut found = Vec::new();
    for frame in 0..40 {
        let (time_ns, phase) = moment(frame);
        let seen = if (10..30).contains(&frame) { nothing.clone() } else { image(&walking(phase).2) };
        found.push(tracker.step(time_ns, &seen));
    }
    assert!(found[10..30].iter().all(|estimate| *estimate == Err(NoEstimate::NoForeground)));
    assert!(found[30].as_ref().is_ok_and(|estimate| estimate.started));
    let truth = walking(moment(39).1).1;
    let last = found[39].as_ref().expect("two legs in view");
    assert!((last.legs.sides[0].ankle - truth.sides[0].ankle).norm() < 0.06);
}

#[test]
fn hostile_frames_give_reasons_not_panics() {
    let mut tracker = tracker(LegCues::Both, 64);
    let (_, _, solids) = walking(0.0);
    let good = image(&solids);
    let filled =
        |value: &dyn Fn(usize) -> f32| DepthMap { depth: (0..WIDTH * HEIGHT).map(value).collect(), ..good.clone() };
    let noise = |k: usize| ((k as u64).wrapping_mul(6_364_136_223_846_793_005) >> 40) as f32;
    assert_eq!(tracker.step(0, &filled(&|_| 0.0)), Err(NoEstimate::NoForeground));
    assert_eq!(tracker.step(1, &DepthMap::empty(3, 5)), Err(NoEstimate::WrongSize));
    assert_eq!(tracker.step(1, &DepthMap { depth: vec![1.0; 7], ..good.clone() }), Err(NoEstimate::WrongSize));
    assert_eq!(tracker.step(1, &filled(&|_| f32::NAN)), Err(NoEstimate::NoForeground));
    assert_eq!(tracker.step(2, &filled(&|_| f32::INFINITY)), Err(NoEstimate::NoForeground));
    // Whatever these give, they give it in one piece.
    let _ = tracker.step(3, &filled(&|_| 1.0));
    let _ = tracker.step(4, &filled(&|_| 1e-30));
    let _ = tracker.step(5, &filled(&|k| noise(k) / 1.2e7));
    let _ = tracker.step(6, &filled(&|k| f32::from_bits(noise(k) as u32 * 251)));
    assert!(tracker.step(10, &good).is_ok());
    assert_eq!(tracker.step(10, &good), Err(NoEstimate::OutOfOrder));
    assert_eq!(tracker.step(9, &good), Err(NoEstimate::OutOfOrder));
    let _ = tracker.step(11, &filled(&|k| noise(k) / 1.2e7));
    assert!(tracker.step(12, &good).is_ok());
    assert!(tracker.step(i64::MAX, &good).is_ok());
    assert!(tracker.step(i64::MIN, &good).is_err());
}

#[test]
fn the_spread_of_a_joint_is_that_of_the_state() {
    let (state, _, _) = walking(0.5);
    let mut covariance = SMatrix::<f64, LEG_DIMENSION, LEG_DIMENSION>::zeros();
    covariance[(3, 3)] = 1e-4;
    for sd in joint_sd(&state, &covariance, &floor()) {
        assert!((sd - Vector3::new(0.01, 0.0, 0.0)).norm() < 1e-6, "{sd}");
    }
}
