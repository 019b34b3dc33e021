//! Live use: the forward pass frame by frame.

use surefoot::assessment::JointAngleSettings;
use surefoot::assessment::{AngleChannel, Method, Pass};
use surefoot::pipeline::joint_angles::assess;
use surefoot::pipeline::joint_angles::live::{LiveError, LiveJointAngles};
use surefoot::progress::Monitor;
use surefoot::recording::Recording;
use surefoot::synthetic::{Exercise, Preset, SimulationSettings, simulate};

fn recording() -> Recording {
    let settings = SimulationSettings { duration_s: 8.0, ..SimulationSettings::new(Exercise::Step, Preset::Table1, 3) };
    simulate(&settings).expect("valid settings").recording
}

#[test]
fn it_gives_the_bytes_of_the_forward_pass_over_the_same_frames() {
    let recording = recording();
    let settings = JointAngleSettings { method: Method::Iekf, pass: Some(Pass::Filter), ..Default::default() };
    let assessed = assess(&recording, &settings, &Monitor::default()).expect("an assessment");
    let skeleton = recording.skeleton.as_ref().expect("a skeleton");
    let mut live = LiveJointAngles::calibrated(skeleton, &settings).expect("calibrated");
    for t in 0..skeleton.len() {
        let readings =
            live.push(skeleton.time_ns[t], skeleton.frame(t), skeleton.frame_confidence(t)).expect("a frame");
        for (series, reading) in assessed.series.iter().zip(readings) {
            let batch = [series.value[t], series.low[t], series.high[t]].map(f32::to_bits);
            assert_eq!([reading.value, reading.low, reading.high].map(f32::to_bits), batch, "{}", series.channel);
        }
    }
    assert_eq!(assessed.series.len(), AngleChannel::all().len());
}

#[test]
fn a_frame_of_the_past_or_of_another_sensor_is_refused_and_changes_nothing() {
    let recording = recording();
    let skeleton = recording.skeleton.as_ref().expect("a skeleton");
    let mut live = LiveJointAngles::calibrated(skeleton, &JointAngleSettings::default()).expect("calibrated");
    let frame = |t: usize| (skeleton.time_ns[t], skeleton.frame(t), skeleton.frame_confidence(t));
    let (time_ns, positions, confidence) = frame(5);
    live.push(time_ns, positions, confidence).expect("a first frame");
    let mut undisturbed = live.clone();
    assert!(matches!(live.push(time_ns, positions, confidence), Err(LiveError::NotLater { .. })));
    assert!(matches!(live.push(i64::MAX, &positions[1..], confidence), Err(LiveError::WrongLength { .. })));
    let (time_ns, positions, confidence) = frame(6);
    let values =
        |live: &mut LiveJointAngles| live.push(time_ns, positions, confidence).expect("a frame").map(|r| r.value);
    assert_eq!(values(&mut live), values(&mut undisturbed));
}
