use super::{KICK, by, error, fused, quality, simulated, with_only};
use crate::support::{series, truth_at};
use surefoot::assessment::FusionMethod;
use surefoot::assessment::series::FLAG_BRIDGED;
use surefoot::pipeline::assess;
use surefoot::progress::Monitor;
use surefoot::recording::Segment;
use surefoot::synthetic::{FusionSimulation, Movement};

/// Bars of the knee and the elbow over many subjects, degrees; one subject alone may be somewhat worse.
const KNEE_DEG: f64 = 2.5;
const ELBOW_DEG: f64 = 3.5;

#[test]
fn knees_of_a_kick_are_within_the_bar_with_a_usual_mounting_and_clocks_that_are_seconds_off() {
    let recording = &KICK.recording;
    let found = fused(recording);
    for channel in ["right_knee_flexion_deg", "left_knee_flexion_deg"] {
        let error = error(&found, recording, channel);
        assert!(error < KNEE_DEG, "{channel}: {error} degrees");
    }
    let quality = quality(&found);
    assert_eq!(quality.units.len(), 9);
    assert!(quality.plank_s.is_some() && quality.standing_s.is_some(), "{quality:?}");
    for unit in &quality.units {
        assert_eq!(unit.clock.evidence, "jumps", "{unit:?}");
        assert!(unit.off_scheme_deg < 20.0, "{unit:?}");
    }
}

#[test]
fn clocks_are_found_to_a_sensors_sample() {
    let found = fused(&KICK.recording);
    for truth in &KICK.units {
        let unit = super::unit(&found, Segment::of_bone(truth.bone));
        let clock = &unit.clock;
        let at_s = KICK.phases.movement.start - truth.clock.offset_s;
        let own = at_s + clock.offset_s + clock.drift_ppm * 1e-6 * (at_s - clock.reference_s);
        let error_s = own - truth.clock.camera_time(at_s);
        assert!(error_s.abs() < 0.01, "{}: {error_s} s", unit.segment);
    }
}

#[test]
fn elbows_are_within_the_bar() {
    let settings =
        FusionSimulation { movement_s: 8.0, unit_rate_hz: 100.0, ..FusionSimulation::new(Movement::Elbow, 2) };
    let truth = simulated(&settings);
    let found = fused(&truth.recording);
    for channel in ["right_elbow_flexion_deg", "left_elbow_flexion_deg"] {
        let error = error(&found, &truth.recording, channel);
        assert!(error < ELBOW_DEG, "{channel}: {error} degrees");
    }
}

#[test]
fn any_number_of_units_from_one_to_nine_gives_all_angles_and_places() {
    let order = [
        Segment::RightThigh,
        Segment::RightShank,
        Segment::Chest,
        Segment::LeftForearm,
        Segment::LeftThigh,
        Segment::LeftShank,
        Segment::RightUpperArm,
        Segment::RightForearm,
        Segment::LeftUpperArm,
    ];
    let knees = ["right_knee_flexion_deg", "left_knee_flexion_deg"];
    let camera = assess(&KICK.recording, &by(FusionMethod::Camera), &Monitor::default()).unwrap();
    let of_camera = knees.map(|channel| error(&camera, &KICK.recording, channel));
    for n in 1..=order.len() {
        let units = &order[..n];
        let recording = with_only(&KICK.recording, units);
        let found = fused(&recording);
        assert_eq!(quality(&found).units.len(), n);
        assert_eq!(found.series.len(), 34 + 39);
        let followed = |thigh, shank| units.contains(&thigh) && units.contains(&shank);
        let has_both =
            [followed(Segment::RightThigh, Segment::RightShank), followed(Segment::LeftThigh, Segment::LeftShank)];
        for ((channel, has_both), of_camera) in knees.into_iter().zip(has_both).zip(of_camera) {
            let error = error(&found, &recording, channel);
            // Without both of its units a knee rests on the camera; one unit may shift it by its own error.
            let limit = if has_both { KNEE_DEG } else { of_camera + 1.5 };
            assert!(error < limit, "{n} units, {channel}: {error} degrees, limit {limit}");
        }
        for line in found.summary.iter().filter(|line| line.channel.ends_with("flexion_deg")) {
            assert!(line.coverage > 0.9, "{n} units: {line:?}");
        }
    }
}

#[test]
fn intervals_hold_the_truth() {
    let recording = &KICK.recording;
    let found = fused(recording);
    for suffix in ["knee_flexion_deg", "hip_flexion_deg", "elbow_flexion_deg"] {
        let (mut inside, mut all) = (0.0, 0.0);
        for side in ["left", "right"] {
            let estimate = series(&found, &format!("{side}_{suffix}"));
            for (i, truth) in truth_at(recording, &estimate.channel, &found.time_ns) {
                assert_eq!(estimate.flags[i] & FLAG_BRIDGED, 0);
                let holds = f64::from(estimate.low[i]) <= truth && truth <= f64::from(estimate.high[i]);
                inside += f64::from(u8::from(holds));
                all += 1.0;
            }
        }
        // One subject: his own constant offset may take several points from the share over many subjects.
        assert!(inside / all > 0.8, "{suffix}: {}", inside / all);
    }
}
