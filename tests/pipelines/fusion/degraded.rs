use super::{KICK, error, fused, unit, warnings, with_units};
use crate::support::{lose_all, series};
use surefoot::assessment::Assessment;
use surefoot::assessment::series::FLAG_BRIDGED;
use surefoot::recording::import::{Dataset, list};
use surefoot::recording::{Recording, Segment};

const KNEE: &str = "right_knee_flexion_deg";

/// A stretch of the movement, seconds.
fn stretch() -> [f64; 2] {
    let start = KICK.phases.movement.start;
    [start + 2.0, start + 5.0]
}

/// Share of samples with a flag, and mean width of the interval, within a stretch.
fn within(found: &Assessment, channel: &str, [from_s, to_s]: [f64; 2]) -> (f64, f64) {
    let estimate = series(found, channel);
    let inside = |i: &usize| (from_s..to_s).contains(&(found.time_ns[*i] as f64 * 1e-9));
    let samples: Vec<usize> = (0..found.time_ns.len()).filter(inside).collect();
    let n = samples.len() as f64;
    let bridged = samples.iter().filter(|i| estimate.flags[**i] & FLAG_BRIDGED != 0).count() as f64;
    let width: f64 = samples.iter().map(|i| f64::from(estimate.high[*i] - estimate.low[*i])).sum();
    (bridged / n, width / n)
}

/// The recording without a unit's samples in a stretch.
fn silent(recording: &Recording, segment: Segment, [from_s, to_s]: [f64; 2]) -> Recording {
    let truth = KICK.units.iter().find(|unit| Segment::of_bone(unit.bone) == segment).expect("the unit");
    with_units(recording, |inertial| {
        let unit = inertial.sensors.iter_mut().find(|unit| unit.segment == segment).expect("the unit");
        let heard = |time: i64| !(from_s..to_s).contains(&truth.clock.camera_time(time as f64 * 1e-9));
        let kept: Vec<usize> = (0..unit.len()).filter(|i| heard(unit.time_ns[*i])).collect();
        unit.acceleration = kept.iter().map(|i| unit.acceleration[*i]).collect();
        unit.angular_rate = kept.iter().map(|i| unit.angular_rate[*i]).collect();
        unit.time_ns = kept.iter().map(|i| unit.time_ns[*i]).collect();
    })
}

#[test]
fn what_the_camera_does_not_see_the_units_do() {
    let recording = lose_all(KICK.recording.clone(), stretch()[0], stretch()[1]);
    let found = fused(&recording);
    let (bridged, _) = within(&found, KNEE, stretch());
    assert_eq!(bridged, 0.0, "both units of the knee were there");
    assert!(error(&found, &recording, KNEE) < 2.5);
    // The place of the knee is the camera's: nobody saw it.
    let torso = within(&found, "torso_x_m", stretch());
    let before = within(&found, "torso_x_m", [stretch()[0] - 1.5, stretch()[0] - 0.2]);
    assert!(torso.1 > 2.0 * before.1, "{torso:?} {before:?}");
}

#[test]
fn what_a_unit_does_not_tell_the_camera_does() {
    let recording = silent(&KICK.recording, Segment::RightShank, stretch());
    let found = fused(&recording);
    let coverage = unit(&found, Segment::RightShank).coverage;
    assert!(coverage < 0.95 && coverage > 0.5, "{coverage}");
    assert!(!warnings(&found, "unit_drop_out").is_empty());
    let (inside, before) = (within(&found, KNEE, stretch()), within(&found, KNEE, [stretch()[0] - 1.5, stretch()[0]]));
    assert!(inside.1 > 1.5 * before.1, "the camera alone knows less: {inside:?} {before:?}");
    assert!(error(&found, &recording, KNEE) < 5.0);
}

#[test]
fn what_neither_tells_is_bridged() {
    let both = silent(&KICK.recording, Segment::RightShank, stretch());
    let both = silent(&both, Segment::RightThigh, stretch());
    let recording = lose_all(both, stretch()[0], stretch()[1]);
    let found = fused(&recording);
    let [from, to] = stretch();
    let (bridged, _) = within(&found, KNEE, [from + 0.2, to - 0.2]);
    assert_eq!(bridged, 1.0);
    let (other, _) = within(&found, "left_knee_flexion_deg", stretch());
    assert_eq!(other, 0.0);
    let line = found.summary.iter().find(|line| line.channel == KNEE).unwrap();
    assert!(line.coverage < 0.95, "{line:?}");
}

#[test]
fn a_few_real_seconds_that_do_not_show_the_clock_are_fused_on_the_declared_one_and_say_so() {
    let data = std::env::var_os("SUREFOOT_DATA").map_or("../shared/data".into(), std::path::PathBuf::from);
    let Ok(sources) = list(Dataset::Utdmhad, &data) else {
        println!("skipped: no recordings of utdmhad below {}", data.display());
        return;
    };
    // One of each movement and person is enough to meet every refusal.
    for source in sources.iter().step_by(5) {
        let recording = source.read().expect("a trial").recording;
        let found = fused(&recording);
        let is_told = found.quality.warnings.iter().any(|warning| warning.code == "clock_not_identified");
        assert!(is_told || unit(&found, Segment::RightThigh).clock.evidence != "declared", "{}", source.name);
    }
}
