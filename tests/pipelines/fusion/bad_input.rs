use super::{KICK, error, fused, quality, refusal, simulated, unit, warnings, with_units};
use surefoot::assessment::{Assessment, Clocks, FusionMethod, Settings, SkeletonFusionSettings};
use surefoot::body::{Bone, Limb};
use surefoot::pipeline::{PipelineError, assess};
use surefoot::progress::Monitor;
use surefoot::recording::decode::{Limits, decode};
use surefoot::recording::{Format, InertialSensor, Recording, Segment, encode};
use surefoot::synthetic::FusionSimulation;
use surefoot::synthetic::inertial::defect::Defect;

const KNEE: &str = "right_knee_flexion_deg";
/// Error of the camera alone in these recordings, degrees, and a margin: what a knee without its units may have.
const CAMERA_DEG: f64 = 8.0;

fn with(defect: Defect) -> Recording {
    with_units(&KICK.recording, |inertial| defect.apply(inertial))
}

/// Code with which the service refuses an upload.
fn refused_upload(recording: &Recording) -> &'static str {
    let bytes = encode::mcap(recording).expect("a recording that can be written");
    decode(&bytes[..], Format::Mcap, &Limits::default()).expect_err("a defect").code
}

fn told(found: &Assessment) -> Vec<&str> {
    found.quality.warnings.iter().map(|w| w.code.as_str()).collect()
}

#[test]
fn a_segment_without_a_unit_follows_the_camera() {
    let recording = with(Defect::Missing(Segment::RightShank));
    let found = fused(&recording);
    assert_eq!(quality(&found).units.len(), 8);
    assert!(error(&found, &recording, KNEE) < CAMERA_DEG);
}

#[test]
fn a_unit_upside_down_is_told_and_its_knee_is_right() {
    let shank = Bone::Distal(Limb::RightLeg);
    let settings = FusionSimulation { upside_down: vec![shank], ..super::kick() };
    let recording = simulated(&settings).recording;
    let found = fused(&recording);
    assert!(warnings(&found, "mounting_differs").iter().any(|w| w.contains("right_shank")), "{:?}", told(&found));
    assert!(error(&found, &recording, KNEE) < 5.0);
}

#[test]
fn a_unit_with_a_mirrored_axis_is_left_out_by_name() {
    let recording = with(Defect::MirroredAxes(Segment::RightShank));
    let found = fused(&recording);
    assert!(warnings(&found, "unit_left_out").iter().any(|w| w.contains("right_shank")), "{:?}", told(&found));
    assert!(error(&found, &recording, KNEE) < CAMERA_DEG);
}

#[test]
fn a_unit_whose_movement_is_too_small_to_show_its_defect_is_told_by_the_plank() {
    // The chest hardly turns in a kick: neither its axes nor its unit of measurement show in the data by themselves.
    for defect in [Defect::MirroredAxes(Segment::Chest), Defect::GyroscopeInDegrees(Segment::Chest)] {
        let recording = with(defect);
        let found = fused(&recording);
        assert!(warnings(&found, "unit_left_out").iter().any(|w| w.contains("chest")), "{defect:?} {:?}", told(&found));
        assert!(error(&found, &recording, KNEE) < 2.5, "{defect:?}");
    }
}

#[test]
fn rates_in_degrees_are_refused_at_the_upload_and_in_the_pipeline() {
    let recording = with(Defect::GyroscopeInDegrees(Segment::RightShank));
    assert_eq!(refused_upload(&recording), "angular_rate_unit");
    let (code, sentence) = refusal(&recording, FusionMethod::Fused);
    assert_eq!(code, "angular_rate_unit");
    assert!(sentence.contains("right_shank"), "{sentence}");
}

#[test]
fn accelerations_in_g_are_refused_at_the_upload_and_in_the_pipeline() {
    let recording = with(Defect::AccelerometerInG(Segment::LeftThigh));
    assert_eq!(refused_upload(&recording), "acceleration_unit");
    let (code, sentence) = refusal(&recording, FusionMethod::Fused);
    assert_eq!(code, "acceleration_unit");
    assert!(sentence.contains("left_thigh"), "{sentence}");
}

#[test]
fn a_constant_accelerometer_is_left_out_by_name() {
    let recording = with(Defect::ConstantAccelerometer(Segment::RightThigh));
    let found = fused(&recording);
    assert!(warnings(&found, "unit_left_out").iter().any(|w| w.contains("right_thigh")), "{:?}", told(&found));
    assert!(error(&found, &recording, KNEE) < CAMERA_DEG);
}

#[test]
fn a_clock_that_runs_backwards_is_refused_at_the_upload_and_left_out_by_the_pipeline() {
    let recording = with(Defect::ClockBackwards(Segment::RightShank));
    assert_eq!(refused_upload(&recording), "time_not_increasing");
    let found = fused(&recording);
    assert!(warnings(&found, "unit_left_out").iter().any(|w| w.contains("right_shank")), "{:?}", told(&found));
    assert!(error(&found, &recording, KNEE) < CAMERA_DEG);
}

#[test]
fn a_clock_an_hour_off_is_found_by_the_jumps() {
    let recording = with(Defect::ClockAhead(Segment::RightShank, 3600.0));
    let found = fused(&recording);
    assert!((unit(&found, Segment::RightShank).clock.offset_s + 3600.0).abs() < 3.0);
    assert!(error(&found, &recording, KNEE) < 2.5);
}

#[test]
fn a_unit_that_did_not_see_the_movement_is_left_out_and_all_of_them_are_refused() {
    // What it recorded ends before the first jump, and its clock says that it was at another time.
    let until_ns = (KICK.phases.rest.start * 1e9) as i64;
    let elsewhere = |unit: &mut InertialSensor| {
        let kept = unit.time_ns.partition_point(|time| *time < until_ns);
        unit.time_ns.truncate(kept);
        unit.acceleration.truncate(kept);
        unit.angular_rate.truncate(kept);
        unit.time_ns.iter_mut().for_each(|time| *time += 3_600_000_000_000);
    };
    let one = with_units(&KICK.recording, |inertial| {
        inertial.sensors.iter_mut().filter(|unit| unit.segment == Segment::RightShank).for_each(elsewhere);
    });
    let found = fused(&one);
    assert!(warnings(&found, "unit_not_aligned").iter().any(|w| w.contains("right_shank")), "{:?}", told(&found));
    assert!(error(&found, &one, KNEE) < CAMERA_DEG);

    let all = with_units(&KICK.recording, |inertial| inertial.sensors.iter_mut().for_each(elsewhere));
    assert_eq!(refusal(&all, FusionMethod::Fused).0, "clocks_not_aligned");
    let declared = SkeletonFusionSettings { clocks: Clocks::Declared, ..SkeletonFusionSettings::default() };
    match assess(&all, &Settings::SkeletonFusion(declared), &Monitor::default()) {
        Err(PipelineError::Unsuitable { code: "no_overlap", .. }) => {}
        other => panic!("not refused: {:?}", other.map(|a| a.quality)),
    }
}

#[test]
fn two_units_whose_names_were_exchanged_are_told() {
    for (a, b) in [
        (Segment::RightThigh, Segment::RightShank),
        (Segment::RightShank, Segment::LeftShank),
        (Segment::LeftForearm, Segment::RightShank),
        (Segment::Chest, Segment::RightThigh),
    ] {
        let recording = with(Defect::Swapped(a, b));
        let found = fused(&recording);
        let suspicious = ["units_exchanged", "unit_not_aligned", "mounting_differs", "unit_contradicts_camera"];
        for segment in [a, b] {
            let named = found
                .quality
                .warnings
                .iter()
                .any(|w| suspicious.contains(&w.code.as_str()) && w.message.contains(segment.name()));
            assert!(named, "{a} and {b}: nothing is said of {segment}: {:?}", found.quality.warnings);
        }
    }
}

#[test]
fn two_units_of_one_name_are_refused_at_the_upload() {
    let document = |recording: &Recording| encode::json(recording).unwrap();
    let twice = with_units(&KICK.recording, |inertial| {
        let second: InertialSensor = inertial.sensor(Segment::RightShank).unwrap().clone();
        inertial.sensors.push(second);
    });
    let error = decode(&document(&twice)[..], Format::Json, &Limits::default()).unwrap_err();
    assert_eq!(error.code, "duplicate_channel");
}

#[test]
fn a_unit_on_no_segment_of_the_model_is_told_and_not_used() {
    let recording = with_units(&KICK.recording, |inertial| {
        let unit = inertial.sensors.iter_mut().find(|unit| unit.segment == Segment::RightShank).unwrap();
        unit.segment = Segment::RightFoot;
    });
    let found = fused(&recording);
    assert!(warnings(&found, "unit_not_used").iter().any(|w| w.contains("right_foot")), "{:?}", told(&found));
    assert_eq!(quality(&found).units.len(), 8);
    let _ = unit(&found, Segment::RightThigh);
}
