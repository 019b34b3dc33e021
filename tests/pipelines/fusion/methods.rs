use super::{KICK, by, errors, fused, quality, refusal, warnings, with_only};
use crate::support::series;
use surefoot::assessment::{Assessment, FusionMethod, JointAngleSettings, Settings, SkeletonFusionSettings};
use surefoot::estimation::orientation_filter::OrientationMethod;
use surefoot::pipeline::assess;
use surefoot::progress::Monitor;
use surefoot::recording::{Recording, Segment};

fn run(recording: &Recording, settings: &Settings) -> Assessment {
    assess(recording, settings, &Monitor::default()).expect("an assessment")
}

#[test]
fn the_same_recording_and_settings_give_the_same_bits_on_any_number_of_threads() {
    for method in FusionMethod::ALL {
        let on = |threads: usize| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            let found = pool.install(|| run(&KICK.recording, &by(method)));
            let bits = |values: &[f32]| values.iter().map(|v| v.to_bits()).collect::<Vec<_>>();
            let series = found.series.iter().map(|s| (bits(&s.value), bits(&s.low), bits(&s.high), s.flags.clone()));
            (series.collect::<Vec<_>>(), found.time_ns, serde_json::to_string(&found.quality).unwrap())
        };
        assert!(on(1) == on(3), "{method}");
    }
}

#[test]
fn the_result_has_the_units_rate_or_the_one_that_was_asked_for() {
    let own = fused(&KICK.recording);
    let settings = SkeletonFusionSettings { rate_hz: Some(25.0), ..SkeletonFusionSettings::default() };
    let asked = run(&KICK.recording, &Settings::SkeletonFusion(settings));
    assert!((quality(&own).rate_hz - 100.0).abs() < 1.0 && quality(&asked).rate_hz == 25.0);
    let ratio = own.time_ns.len() as f64 / asked.time_ns.len() as f64;
    assert!((ratio - 4.0).abs() < 0.05, "{ratio}");
    assert!(asked.time_ns.windows(2).all(|pair| pair[1] - pair[0] == 40_000_000));
    let knee = |found: &Assessment| series(found, "right_knee_flexion_deg").value.clone();
    let (fine, coarse) = (knee(&own), knee(&asked));
    let apart = |i: usize| {
        let nearest = own.time_ns.partition_point(|time| *time < asked.time_ns[i]).min(fine.len() - 1);
        (fine[nearest] - coarse[i]).abs()
    };
    assert!((0..coarse.len()).all(|i| apart(i) < 6.0), "the same movement");
}

#[test]
fn the_papers_hierarchy_has_its_constant_offset_and_no_intervals() {
    let recording = &KICK.recording;
    let paper = run(recording, &by(FusionMethod::Hierarchy));
    let fused = fused(recording);
    assert_eq!(warnings(&paper, "no_interval").len(), 1);
    assert!(quality(&paper).reference_frame_s.is_some() && quality(&fused).reference_frame_s.is_none());
    for side in ["left", "right"] {
        let channel = format!("{side}_knee_flexion_deg");
        assert!(series(&paper, &channel).low.iter().all(|low| low.is_nan()));
        let ((all, varying), default) = (errors(&paper, recording, &channel), errors(&fused, recording, &channel));
        assert!(all > default.0, "{channel}: {all} against {}", default.0);
        assert!(varying < 0.7 * all, "{channel}: {all}, of which {varying} varies");
    }
    assert_eq!(paper.summary[0].interval_width, None);
}

#[test]
fn the_camera_alone_is_the_joint_angle_pipeline() {
    let camera = run(&KICK.recording, &by(FusionMethod::Camera));
    let angles = run(&KICK.recording, &Settings::JointAngles(JointAngleSettings::default()));
    assert!(camera.series == angles.series || format!("{:?}", camera.series) == format!("{:?}", angles.series));
    assert_eq!((camera.pipeline, camera.provenance.method.as_str()), ("skeleton_fusion", "camera"));
    assert_eq!(camera.quality.fusion, None);
}

#[test]
fn units_alone_give_angles_of_joints_between_two_of_them_and_no_places() {
    let found = run(&KICK.recording, &by(FusionMethod::Inertial));
    for side in ["left", "right"] {
        let channel = format!("{side}_knee_flexion_deg");
        let error = errors(&found, &KICK.recording, &channel);
        assert!(error.0 < 8.0, "{channel}: {error:?}");
    }
    assert_eq!(found.series.len(), 34);
    let two = with_only(&KICK.recording, &[Segment::RightThigh, Segment::RightShank]);
    let found = run(&two, &by(FusionMethod::Inertial));
    let known = |channel: &str| series(&found, channel).value.iter().any(|value| value.is_finite());
    assert!(known("right_knee_flexion_deg") && !known("left_knee_flexion_deg") && !known("right_hip_flexion_deg"));
}

#[test]
fn every_orientation_filter_can_be_chosen_and_the_choice_is_in_the_provenance() {
    let recording = with_only(&KICK.recording, &[Segment::RightThigh, Segment::RightShank]);
    for orientation in OrientationMethod::ALL {
        let settings = SkeletonFusionSettings { orientation: Some(orientation), ..SkeletonFusionSettings::default() };
        let settings = Settings::SkeletonFusion(settings);
        let found = run(&recording, &settings);
        assert_eq!((&found.provenance.settings, found.provenance.seed), (&settings, 0));
        let error = errors(&found, &recording, "right_knee_flexion_deg");
        // Integrated rates alone drift with their bias; they are there to be compared with.
        let limit = if orientation == OrientationMethod::Gyroscope { 30.0 } else { 8.0 };
        assert!(error.0 < limit, "{orientation}: {error:?}");
    }
}

#[test]
fn the_hierarchy_needs_a_skeleton_and_every_method_a_unit_on_the_body() {
    let without_camera = Recording { skeleton: None, ..KICK.recording.clone() };
    assert_eq!(refusal(&without_camera, FusionMethod::Hierarchy).0, "no_skeleton");
    let without_units = Recording { inertial: None, ..KICK.recording.clone() };
    for method in [FusionMethod::Fused, FusionMethod::Hierarchy, FusionMethod::Inertial] {
        assert_eq!(refusal(&without_units, method).0, "no_inertial_units", "{method}");
    }
    let one_unit = with_only(&without_camera, &[Segment::LeftThigh]);
    assert_eq!(refusal(&one_unit, FusionMethod::Fused).0, "no_joint_between_units");
}
