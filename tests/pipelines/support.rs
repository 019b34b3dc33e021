//! Recordings for the tests, and ways to spoil them.

use surefoot::assessment::{Assessment, Series};
use surefoot::body::Joint;
use surefoot::recording::{Recording, SkeletonRecording};
use surefoot::signal::interpolation::interpolate;
use surefoot::synthetic::{Exercise, Preset, SimulationSettings, simulate};

/// A simulated exercise, always of the same subject.
pub fn exercise(kind: Exercise, preset: Preset, duration_s: f64) -> Recording {
    let settings = SimulationSettings { duration_s, ..SimulationSettings::new(kind, preset, 1) };
    simulate(&settings).expect("settings in range").recording
}

/// The series of a channel.
pub fn series<'a>(found: &'a Assessment, channel: &str) -> &'a Series {
    found.series.iter().find(|s| s.channel == channel).expect("the channel")
}

/// Sample numbers at which the truth of a channel is known, and the truth.
pub fn truth_at<'a>(
    recording: &'a Recording,
    channel: &str,
    time_ns: &'a [i64],
) -> impl Iterator<Item = (usize, f64)> + 'a {
    let truth = recording.references.iter().find(|r| r.channel == channel).expect("the truth");
    let at = |(i, t): (usize, &i64)| (i, interpolate(&truth.time_ns, &truth.values, *t - truth.clock_offset_ns));
    time_ns.iter().enumerate().map(at).filter(|(_, value)| value.is_finite())
}

/// Mean absolute error of a channel, in its unit.
pub fn mean_absolute_error(found: &Assessment, recording: &Recording, channel: &str) -> f64 {
    let estimate = series(found, channel);
    let errors: Vec<f64> = truth_at(recording, channel, &found.time_ns)
        .map(|(i, truth)| (f64::from(estimate.value[i]) - truth).abs())
        .collect();
    errors.iter().sum::<f64>() / errors.len() as f64
}

fn with_skeleton(mut recording: Recording, change: impl FnOnce(&mut SkeletonRecording)) -> Recording {
    change(recording.skeleton.as_mut().expect("a skeleton"));
    recording
}

/// The recording as a left-handed client would send it that declares itself right-handed.
pub fn mirrored(recording: Recording) -> Recording {
    with_skeleton(recording, |skeleton| skeleton.positions.iter_mut().for_each(|p| p.x = -p.x))
}

/// The recording with positions in centimetres.
pub fn centimetres(recording: Recording) -> Recording {
    with_skeleton(recording, |skeleton| skeleton.positions.iter_mut().for_each(|p| *p *= 100.0))
}

/// The recording without one joint.
pub fn without(recording: Recording, joint: Joint) -> Recording {
    with_skeleton(recording, |skeleton| {
        let column = skeleton.column(joint).expect("the joint");
        let n = skeleton.joints.len();
        let keep = |i: &usize| i % n != column;
        let kept: Vec<usize> = (0..skeleton.positions.len()).filter(keep).collect();
        skeleton.positions = kept.iter().map(|i| skeleton.positions[*i]).collect();
        skeleton.confidence = kept.iter().map(|i| skeleton.confidence[*i]).collect();
        skeleton.orientations.clear();
        skeleton.joints.remove(column);
    })
}

/// The recording with one joint lost between two times, seconds.
pub fn lose(recording: Recording, joint: Joint, from_s: f64, to_s: f64) -> Recording {
    with_skeleton(recording, |skeleton| {
        let column = skeleton.column(joint).expect("the joint");
        for t in 0..skeleton.len() {
            if (from_s..to_s).contains(&(skeleton.time_ns[t] as f64 * 1e-9)) {
                let i = t * skeleton.joints.len() + column;
                skeleton.positions[i] = nalgebra::Vector3::repeat(f64::NAN);
                skeleton.confidence[i] = 0.0;
            }
        }
    })
}

/// The recording with every joint lost between two times, seconds.
pub fn lose_all(recording: Recording, from_s: f64, to_s: f64) -> Recording {
    let joints = recording.skeleton.as_ref().expect("a skeleton").joints.clone();
    joints.into_iter().fold(recording, |recording, joint| lose(recording, joint, from_s, to_s))
}

/// The part of a recording between two times, seconds, without its truth.
pub fn cut(recording: Recording, from_s: f64, to_s: f64) -> Recording {
    let mut part = with_skeleton(recording, |skeleton| {
        let n = skeleton.joints.len();
        let inside = |t: &usize| (from_s..to_s).contains(&(skeleton.time_ns[*t] as f64 * 1e-9));
        let frames: Vec<usize> = (0..skeleton.len()).filter(inside).collect();
        skeleton.positions = frames.iter().flat_map(|t| skeleton.frame(*t).to_vec()).collect();
        skeleton.confidence = frames.iter().flat_map(|t| skeleton.frame_confidence(*t).to_vec()).collect();
        skeleton.orientations.clear();
        skeleton.time_ns = frames.iter().map(|t| skeleton.time_ns[*t]).collect();
        debug_assert_eq!(skeleton.positions.len(), n * skeleton.len());
    });
    part.references.clear();
    part
}
