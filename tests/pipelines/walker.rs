//! Legs and steps from depth images of a simulated walker's user, whose truth is known.

use crate::support::series;
use std::collections::BTreeSet;
use std::io::Cursor;
use std::sync::LazyLock;
use surefoot::assessment::{Assessment, LegCues, LegPoseMode, LegPoseSettings};
use surefoot::body::Side;
use surefoot::geometry::camera::Intrinsics;
use surefoot::pipeline::PipelineError;
use surefoot::pipeline::leg_pose::floor::Floor;
use surefoot::pipeline::leg_pose::foreground::{Preparation, Region};
use surefoot::pipeline::leg_pose::two_legs::TwoLegs;
use surefoot::pipeline::leg_pose::{DeclaredMount, DepthFrames, assess};
use surefoot::progress::Monitor;
use surefoot::recording::depth::{DepthImage, DepthReader, DepthUnit, MISSING_RAW};
use surefoot::recording::import::{CameraFile, import_depth};
use surefoot::recording::{DecodeError, Limits};
use surefoot::synthetic::walker::trousers::trousers;
use surefoot::synthetic::walker::{Course, WalkerFrame, WalkerSettings, WalkerSimulation};

fn simulation(course: Course, duration_s: f64) -> WalkerSimulation {
    let settings = WalkerSettings::of_seed(course, 2).with_speed(0.6);
    let settings = WalkerSettings { duration_s, rate_hz: 20.0, ..settings };
    WalkerSimulation::new(&settings, trousers()).expect("settings in range")
}

fn recorded(simulation: &WalkerSimulation) -> Vec<u8> {
    simulation.write(Cursor::new(Vec::new()), |_| {}).expect("a file in memory").into_inner()
}

static WALK: LazyLock<WalkerSimulation> = LazyLock::new(|| simulation(Course::Straight, 6.5));
static WALK_BYTES: LazyLock<Vec<u8>> = LazyLock::new(|| recorded(&WALK));

fn read(bytes: &[u8]) -> DepthReader<&[u8]> {
    DepthReader::open(bytes, &Limits::default()).expect("a whole recording")
}

/// The first images of the walk, changed.
struct Changed<F> {
    reader: DepthReader<&'static [u8]>,
    background: Option<DepthImage>,
    camera: Intrinsics,
    mount: DeclaredMount,
    left: usize,
    change: F,
}

impl<F: FnMut(&mut DepthImage)> Changed<F> {
    fn new(n_frames: usize, change: F) -> Self {
        let reader = read(&WALK_BYTES);
        let background = DepthReader::background(&reader).cloned();
        let (camera, mount) = (*WALK.intrinsics(), DeclaredMount::default());
        Self { reader, background, camera, mount, left: n_frames, change }
    }
}

impl<F: FnMut(&mut DepthImage)> DepthFrames for Changed<F> {
    fn next_into(&mut self, image: &mut DepthImage) -> Result<Option<i64>, DecodeError> {
        if self.left == 0 {
            return Ok(None);
        }
        self.left -= 1;
        let time = DepthReader::next_into(&mut self.reader, image)?;
        (self.change)(image);
        Ok(time)
    }

    fn intrinsics(&self) -> Option<Intrinsics> {
        Some(self.camera)
    }

    fn background(&self) -> Option<&DepthImage> {
        self.background.as_ref()
    }

    fn declared_mount(&self) -> DeclaredMount {
        self.mount
    }
}

fn assessed(frames: impl DepthFrames) -> Result<Assessment, PipelineError> {
    assess(frames, &LegPoseSettings::default(), &Monitor::default())
}

fn codes(found: &Assessment) -> BTreeSet<&str> {
    found.quality.warnings.iter().map(|warning| warning.code.as_str()).collect()
}

fn refusal(frames: impl DepthFrames) -> &'static str {
    match assessed(frames) {
        Err(PipelineError::Unsuitable { code, .. }) => code,
        other => panic!("not refused: {:?}", other.map(|a| (a.gait, a.quality.warnings))),
    }
}

/// When and with which foot contacts began, seconds.
fn true_contacts(simulation: &WalkerSimulation) -> Vec<(Side, f64)> {
    let truth: Vec<_> = (0..simulation.len()).map(|k| simulation.truth(k)).collect();
    let mut contacts = Vec::new();
    for pair in truth.windows(2) {
        for side in Side::BOTH {
            if !pair[0].contacts[side as usize] && pair[1].contacts[side as usize] {
                contacts.push((side, pair[1].time_ns as f64 * 1e-9));
            }
        }
    }
    contacts
}

/// Mean distance of the ankles that were found from the true ones, metres.
fn mean_ankle_error(simulation: &WalkerSimulation, found: &Assessment) -> f64 {
    let mut errors = Vec::new();
    for k in 0..simulation.len() {
        let truth = simulation.truth(k);
        for side in Side::BOTH {
            let ankle = truth.legs[side as usize].ankle;
            let estimate = ["x", "y", "z"].map(|axis| {
                let name = format!("{}_ankle_{axis}_m", side.name());
                f64::from(series(found, &name).value[k])
            });
            errors.push((ankle - nalgebra::Point3::from(estimate)).norm());
        }
    }
    errors.iter().sum::<f64>() / errors.len() as f64
}

#[test]
fn a_walk_gives_the_true_ankles_and_steps_and_no_step_that_did_not_happen() {
    let found = assessed(read(&WALK_BYTES)).unwrap();
    let mean = mean_ankle_error(&WALK, &found);
    assert!(mean < 0.025, "ankles: {mean} m");

    let gait = found.gait.as_ref().unwrap();
    let contacts = true_contacts(&WALK);
    let strikes: Vec<(Side, f64)> = gait.steps.iter().map(|step| (step.side, step.heel_strike_s)).collect();
    for (side, time) in &strikes {
        let is_true = contacts.iter().any(|(foot, contact)| foot == side && (contact - time).abs() < 0.2);
        assert!(is_true, "{side:?} at {time} s: {contacts:.2?}");
    }
    // The swing that the recording cuts off may be missing.
    assert!(strikes.len() <= contacts.len() && strikes.len() + 1 >= contacts.len(), "{strikes:.2?}: {contacts:.2?}");
    let used: Vec<_> = gait.steps.iter().filter(|step| step.excluded_because.is_empty()).collect();
    assert!(used.len() as u64 == gait.n_steps_used && !used.is_empty());
    for step in used {
        let truth = WALK.steps();
        let truth = truth.iter().find(|t| (t.contact_s - step.heel_strike_s).abs() < 0.2).unwrap();
        let measure = step.measures.iter().find(|m| m.definition == "ankle_to_ankle_mid_double_support").unwrap();
        assert!((measure.length_m - truth.ankle_length_m).abs() < 0.03, "{measure:?}: {truth:?}");
    }
    assert!(codes(&found).contains("in_evaluation"));
    assert!(found.quality.coverage > 0.8, "{}", found.quality.coverage);
}

#[test]
fn legs_of_every_size_are_followed_before_a_camera_that_is_mounted_for_adults() {
    for stature_m in [1.2, 2.0] {
        let mut settings = WalkerSettings::of_seed(Course::Straight, 2).with_speed(0.6);
        settings = WalkerSettings { duration_s: 4.0, rate_hz: 15.0, stature_m, ..settings };
        settings.clothes.flare_m = if stature_m > 1.7 { 0.03 } else { 0.0 };
        let simulation = WalkerSimulation::new(&settings, trousers()).unwrap();
        let found = assessed(read(&recorded(&simulation))).unwrap();
        let mean = mean_ankle_error(&simulation, &found);
        assert!(mean < 0.03, "{stature_m} m: ankles {mean} m");
        assert!(!codes(&found).contains("implausible_lengths"), "{stature_m} m: {:?}", codes(&found));
        assert_eq!(found.quality.events, [], "{stature_m} m");
    }
}

#[test]
fn somebody_who_stands_takes_no_step_and_the_quality_says_so() {
    let found = assessed(read(&recorded(&simulation(Course::Standing, 3.0)))).unwrap();
    let gait = found.gait.as_ref().unwrap();
    assert!(gait.steps.is_empty(), "{:?}", gait.steps);
    assert!(codes(&found).contains("no_steps") && gait.cadence_per_min.is_none() && gait.summary.is_empty());
    assert!((gait.standing_s - found.quality.duration_s).abs() < 1e-9);
}

#[test]
fn the_same_images_give_the_same_bits_again_and_on_any_number_of_threads() {
    let on = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        let found = pool.install(|| assessed(Changed::new(50, |_| {}))).unwrap();
        let bits = |values: &[f32]| values.iter().map(|v| v.to_bits()).collect::<Vec<_>>();
        let series = found.series.iter().map(|s| (bits(&s.value), bits(&s.low), bits(&s.high), s.flags.clone()));
        (series.collect::<Vec<_>>(), serde_json::to_string(&(&found.gait, &found.quality)).unwrap())
    };
    let once = on(1);
    assert!(once == on(1) && once == on(3));
}

fn paper(cues: LegCues, particles: u32) -> LegPoseSettings {
    LegPoseSettings { mode: LegPoseMode::Paper, cues, particles, ..LegPoseSettings::default() }
}

#[test]
fn the_papers_filter_follows_the_true_ankles_on_any_number_of_threads() {
    const N_FRAMES: usize = 14;
    let on = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        let frames = Changed::new(N_FRAMES, |_| {});
        pool.install(|| assess(frames, &paper(LegCues::Both, 256), &Monitor::default())).unwrap()
    };
    let found = on(1);
    let bits = |found: &Assessment| {
        let series = found.series.iter().map(|s| s.value.iter().map(|v| v.to_bits()).collect::<Vec<_>>());
        (series.collect::<Vec<_>>(), serde_json::to_string(&(&found.gait, &found.quality)).unwrap())
    };
    assert!(bits(&found) == bits(&on(3)));
    let (mut ankles, mut lengths) = (Vec::new(), Vec::new());
    for k in 0..N_FRAMES {
        let truth = WALK.truth(k);
        let true_ankles = Side::BOTH.map(|side| truth.legs[side as usize].ankle);
        let found_ankles = Side::BOTH.map(|side| {
            nalgebra::Point3::from(
                ["x", "y", "z"]
                    .map(|axis| f64::from(series(&found, &format!("{}_ankle_{axis}_m", side.name())).value[k])),
            )
        });
        ankles.extend((0..2).map(|side| (true_ankles[side] - found_ankles[side]).norm()));
        let apart = |ankles: &[nalgebra::Point3<f64>; 2]| (ankles[0].z - ankles[1].z).abs();
        lengths.push((apart(&true_ankles) - apart(&found_ankles)).abs());
    }
    let mean = |errors: &[f64]| errors.iter().sum::<f64>() / errors.len() as f64;
    // Few particles wander, and a leg's width is not known from its front: both ankles are centimetres too near. A leg in
    // the other one's place would be 20 cm off.
    assert!(mean(&ankles) < 0.13 && mean(&lengths) < 0.08, "ankles: {} m, length: {} m", mean(&ankles), mean(&lengths));
    assert!(found.quality.effective_sample_size.is_some_and(|size| size.particles == 256 && size.min >= 1.0));
    assert_eq!(found.provenance.method, "paper");
}

#[test]
fn the_colour_cue_follows_where_there_are_cameras_at_the_sides_and_is_refused_where_not() {
    let settings = WalkerSettings { duration_s: 1.0, ..*WALK.settings() };
    let simulation = WalkerSimulation::new(&settings, trousers()).unwrap();
    let bytes = simulation.write_with_sides(Cursor::new(Vec::new()), |_| {}).unwrap().into_inner();
    let frames = read(&bytes);
    let settings = paper(LegCues::Rgb, 256);
    let found = assess(frames, &settings, &Monitor::default()).unwrap();
    let depths = &series(&found, "left_ankle_z_m").value;
    // The first pose is that of depth; in a tenth of a second colour does not lose it.
    assert!(
        depths.iter().zip(0..4).all(|(z, k)| (f64::from(*z) - simulation.truth(k).legs[0].ankle.z).abs() < 0.25),
        "{depths:?}"
    );
    let refused = assess(Changed::new(4, |_| {}), &settings, &Monitor::default());
    assert!(matches!(refused, Err(PipelineError::Unsuitable { code: "no_side_images", .. })));
}

#[test]
fn images_without_legs_are_refused() {
    let background = DepthReader::background(&read(&WALK_BYTES)).cloned().unwrap();
    assert_eq!(refusal(Changed::new(25, |image| image.values.fill(MISSING_RAW))), "no_legs", "nothing is seen");
    assert_eq!(refusal(Changed::new(25, |image| image.values.clone_from(&background.values))), "no_legs", "nobody");
    assert_eq!(refusal(Changed::new(0, |_| {})), "no_legs", "no image");
}

#[test]
fn a_thing_that_fills_the_image_has_no_legs() {
    // 0.4 m away, over the whole image.
    assert_eq!(refusal(Changed::new(25, |image| image.values.fill(300))), "no_legs");
}

#[test]
fn a_thing_before_the_camera_for_a_while_is_an_event_and_takes_no_steps() {
    let mut k = 0;
    let filled = 60..100;
    let cover = |image: &mut DepthImage| {
        if filled.contains(&k) {
            image.values.fill(300);
        }
        k += 1;
    };
    let found = assessed(Changed::new(WALK.len(), cover)).unwrap();
    assert!(codes(&found).contains("blocked_camera"), "{:?}", codes(&found));
    let event = found.quality.events.iter().find(|event| event.kind == "blocked_camera").unwrap();
    assert_eq!((event.n_frames, event.subject.as_str()), (40, "camera"));
    for step in &found.gait.as_ref().unwrap().steps {
        assert!(!(3.2..4.9).contains(&step.heel_strike_s), "{step:?}");
    }
}

#[test]
fn somebody_who_leaves_takes_no_steps_afterwards() {
    let background = DepthReader::background(&read(&WALK_BYTES)).cloned().unwrap();
    let mut k = 0;
    let leave = |image: &mut DepthImage| {
        if k >= 80 {
            image.values.clone_from(&background.values);
        }
        k += 1;
    };
    let found = assessed(Changed::new(WALK.len(), leave)).unwrap();
    assert!(found.gait.as_ref().unwrap().steps.iter().all(|step| step.heel_strike_s < 4.3));
    assert!(found.quality.events.iter().any(|e| e.kind == "lost_leg" && e.start_s < 4.8), "{:?}", found.quality.events);
    assert!(codes(&found).contains("legs_often_unseen"), "{:?}", codes(&found));
}

#[test]
fn somebody_else_behind_adds_no_step_to_the_means() {
    let other = WalkerSettings::of_seed(Course::Standing, 5);
    let mut other = WalkerSettings { rate_hz: 20.0, duration_s: 6.5, ..other };
    other.mount = WALK.settings().mount;
    other.mount.distance_m += 0.5;
    let other = WalkerSimulation::new(&other, trousers()).unwrap().frame(30).image;
    let both = |image: &mut DepthImage| {
        // Codes grow with depth: the nearer one hides the other.
        for (value, behind) in image.values.iter_mut().zip(&other.values) {
            *value = (*value).min(*behind);
        }
    };
    let found = assessed(Changed::new(WALK.len(), both)).unwrap();
    let contacts = true_contacts(&WALK);
    for step in found.gait.as_ref().unwrap().steps.iter().filter(|step| step.excluded_because.is_empty()) {
        let is_true = contacts.iter().any(|(side, t)| *side == step.side && (t - step.heel_strike_s).abs() < 0.25);
        assert!(is_true, "{step:?}: {contacts:.2?}");
    }
}

#[test]
fn intrinsics_of_another_camera_are_refused_or_reported() {
    let mut frames = Changed::new(60, |_| {});
    // A Kinect v2, whose images are 512 pixels wide.
    frames.camera = Intrinsics { fx: 365.0, fy: 365.0, cx: 190.0, cy: 106.0 };
    assert_eq!(refusal(frames), "intrinsics_mismatch");
    let mut frames = Changed::new(60, |_| {});
    frames.camera.fx *= 1.3;
    frames.camera.fy *= 1.3;
    let mount = &WALK.settings().mount;
    frames.mount = DeclaredMount { height: Some(mount.height_m), tilt: Some(mount.tilt) };
    let found = assessed(frames).unwrap();
    assert!(codes(&found).contains("mount_mismatch"), "{:?}", codes(&found));
    assert!(!codes(&assessed(read(&WALK_BYTES)).unwrap()).contains("mount_mismatch"));
}

#[test]
fn without_a_background_what_stands_still_is_learned_and_the_walk_is_tracked_as_well() {
    let mut frames = Changed::new(WALK.len(), |_| {});
    frames.background = None;
    let found = assessed(frames).unwrap();
    let mut errors: Vec<f64> = Vec::new();
    for k in 0..WALK.len() {
        let truth = WALK.truth(k);
        let apart = truth.legs[0].ankle.x - truth.legs[1].ankle.x;
        errors.push((f64::from(series(&found, "step_width_sensor_m").value[k]) - apart).abs());
    }
    let mean = errors.iter().sum::<f64>() / errors.len() as f64;
    assert!(mean < 0.015, "step width: {mean} m");
    assert!(codes(&found).contains("no_background"));
}

#[test]
fn real_images_of_bodies_without_a_floor_give_no_steps_and_say_so() {
    let root = std::env::var_os("SUREFOOT_DATA").map_or_else(|| "../shared/data".into(), std::path::PathBuf::from);
    for (name, unit) in [("raw11", DepthUnit::Raw11), ("mm", DepthUnit::Millimetres)] {
        let path = root.join(format!("depth/kinect_v1_people/skeltrack_{name}.u16le.xz"));
        let Ok(stream) = std::fs::read(&path) else {
            println!("skipped: no {}", path.display());
            continue;
        };
        let camera = r#"{"fx": 580, "fy": 580, "cx": 319.5, "cy": 239.5, "rate_hz": 30}"#;
        let camera = CameraFile { unit: Some(unit), ..serde_json::from_str(camera).unwrap() };
        let mut recording = Cursor::new(Vec::new());
        assert_eq!(import_depth(&stream[..], None, &camera, &mut recording).unwrap(), 8);
        let recording = recording.into_inner();
        let reader = DepthReader::open(&recording[..], &Limits::default()).unwrap();
        match assessed(reader) {
            Err(PipelineError::Unsuitable { code, .. }) => assert!(["no_floor", "no_legs"].contains(&code), "{code}"),
            Err(other) => panic!("{other}"),
            // A body's flat front may pass for a floor, and arms for legs; they do not step.
            Ok(found) => {
                assert!(found.gait.as_ref().unwrap().steps.is_empty(), "{:?}", found.gait);
                assert!(
                    codes(&found).is_superset(&BTreeSet::from(["no_background", "no_steps"])),
                    "{:?}",
                    codes(&found)
                );
            }
        }
    }
}

#[test]
fn random_values_give_no_steps() {
    let mut state = 1_u64;
    let noise = move |image: &mut DepthImage| {
        for value in &mut image.values {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            *value = (state >> 53) as u16;
        }
    };
    match assessed(Changed::new(40, noise)) {
        Ok(found) => {
            let gait = found.gait.as_ref().unwrap();
            assert_eq!(gait.n_steps_used, 0, "{:?}", gait.steps);
            assert!(gait.steps.is_empty(), "{:?} {:?}", gait.steps, codes(&found));
            assert!(codes(&found).len() > 1, "{:?}", codes(&found));
        }
        Err(error) => assert!(matches!(error, PipelineError::Unsuitable { .. }), "{error}"),
    }
}

#[test]
fn a_camera_that_is_covered_during_the_walk_takes_no_steps_in_the_dark() {
    let mut k = 0;
    let hidden = 60..100;
    let cover = |image: &mut DepthImage| {
        if hidden.contains(&k) {
            image.values.fill(MISSING_RAW);
        }
        k += 1;
    };
    let found = assessed(Changed::new(WALK.len(), cover)).unwrap();
    let contacts = true_contacts(&WALK);
    for step in &found.gait.as_ref().unwrap().steps {
        assert!(!(3.2..4.9).contains(&step.heel_strike_s), "{step:?}");
        let near = contacts.iter().any(|(side, t)| *side == step.side && (t - step.heel_strike_s).abs() < 0.25);
        assert!(near || !step.excluded_because.is_empty(), "{step:?}: {contacts:.2?}");
    }
    assert!(codes(&found).contains("legs_often_unseen"), "{:?}", codes(&found));
    assert!(found.quality.events.iter().any(|event| event.kind == "lost_leg"));
}

#[test]
fn a_background_of_another_mounting_is_reported_and_steps_of_it_are_true_or_left_out() {
    let other = WALK.settings().with_tilt(35.0_f64.to_radians());
    let other = WalkerSimulation::new(&other, trousers()).unwrap().background();
    let mut frames = Changed::new(80, |_| {});
    frames.background = Some(other);
    match assessed(frames) {
        Ok(found) => {
            assert!(codes(&found).contains("background_mismatch"), "{:?}", codes(&found));
            assert_eq!(found.gait.as_ref().unwrap().n_steps_used, 0, "{:?}", found.gait);
        }
        Err(error) => assert!(matches!(error, PipelineError::Unsuitable { .. }), "{error}"),
    }
}

#[test]
fn images_whose_camera_is_not_described_are_refused() {
    struct Unknown(Changed<fn(&mut DepthImage)>);
    impl DepthFrames for Unknown {
        fn next_into(&mut self, image: &mut DepthImage) -> Result<Option<i64>, DecodeError> {
            self.0.next_into(image)
        }
        fn intrinsics(&self) -> Option<Intrinsics> {
            None
        }
        fn background(&self) -> Option<&DepthImage> {
            self.0.background()
        }
    }
    assert_eq!(refusal(Unknown(Changed::new(3, |_| {}))), "no_calibration");
}

#[test]
fn without_a_model_two_heaps_of_points_are_the_feet_and_one_leg_alone_is_no_pair() {
    let camera = *WALK.intrinsics();
    let background = WALK.background().to_depth_map();
    let floor = Floor::find(&background, &camera).unwrap();
    assert!((floor.camera_height - WALK.settings().mount.height_m).abs() < 0.01, "{}", floor.camera_height);
    assert!((floor.tilt() - WALK.settings().mount.tilt).abs() < 0.01, "{}", floor.tilt());
    let settings = LegPoseSettings::default();
    let region = Region { depth: settings.depth_m, x: settings.x_m };
    let preparation = Preparation::new(camera, floor.clone(), region, Some(&background));
    let WalkerFrame { image, truth } = WALK.frame(30);
    let points = preparation.prepare(&image.to_depth_map()).points;
    let legs = TwoLegs::find(&points).unwrap();
    for side in Side::BOTH {
        let ankle = floor.point_from_sensor(&truth.legs[side as usize].ankle.coords);
        let apart = legs.foot(side) - ankle;
        // The middle of a foot is ahead of its ankle.
        assert!(apart.x.abs() < 0.05 && apart.z.abs() < 0.15, "{side:?}: {apart:?}");
    }
    let left = legs.points[Side::Left as usize].clone();
    assert_eq!(TwoLegs::find(&left[..20.min(left.len())]), None);
    assert_eq!(TwoLegs::find(&[]), None);
}
