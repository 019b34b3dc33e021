use super::trousers::trousers;
use super::*;
use crate::recording::depth::MISSING_RAW;
use std::path::PathBuf;

fn settings(course: Course, seed: u64) -> WalkerSettings {
    WalkerSettings { duration_s: 12.0, ..WalkerSettings::of_seed(course, seed) }
}

fn simulation(settings: &WalkerSettings) -> WalkerSimulation {
    WalkerSimulation::new(settings, trousers()).unwrap()
}

/// The figure of the shared data, where there is any.
fn cesium() -> Option<Body> {
    let root = std::env::var_os("SUREFOOT_DATA").map_or_else(|| PathBuf::from("../shared/data"), PathBuf::from);
    let path = root.join("depth/assets/CesiumMan.glb");
    let Ok(bytes) = std::fs::read(&path) else {
        println!("skipped: no {}", path.display());
        return None;
    };
    Some(cesium::body_from_glb(&bytes).unwrap())
}

#[test]
fn legs_keep_their_lengths_and_no_foot_goes_through_the_floor() {
    for (course, seed) in Course::ALL.into_iter().zip(1..) {
        let simulation = simulation(&settings(course, seed));
        let rest = simulation.body.legs[0];
        for k in 0..simulation.len() {
            let truth = simulation.truth(k);
            for leg in &truth.legs {
                let height = |p: &Point3<f64>| truth.floor_normal.dot(&p.coords) + truth.camera_height_m;
                assert!(((leg.hip - leg.knee).norm() - rest.thigh_m()).abs() < 1e-6);
                // Were the pelvis too high, the shank would have to stretch.
                assert!(((leg.knee - leg.ankle).norm() - rest.shank_m()).abs() < 1e-6, "{course:?} frame {k}");
                assert!(height(&leg.heel) > -1e-9 && height(&leg.toe) > -1e-9, "{course:?} frame {k}");
            }
        }
    }
}

#[test]
fn a_foot_in_contact_keeps_a_point_of_its_sole_where_it_is() {
    let simulation = simulation(&settings(Course::Straight, 5));
    let in_world = |k: usize| {
        let truth = simulation.truth(k);
        truth.legs.map(|leg| [leg.heel, leg.toe].map(|p| truth.world_from_sensor * p))
    };
    let mut fixed = 0;
    for k in 1..simulation.len() {
        let (before, after) = (in_world(k - 1), in_world(k));
        for side in 0..2 {
            if simulation.truth(k - 1).contacts[side] && simulation.truth(k).contacts[side] {
                let moved = (0..2).map(|p| (after[side][p] - before[side][p]).norm()).fold(f64::INFINITY, f64::min);
                // A frame in which rolling over the heel passes into the flat foot moves both points a little.
                assert!(moved < 0.004, "frame {k} side {side}: {moved}");
                fixed += 1;
            }
        }
    }
    assert!(fixed > simulation.len());
}

#[test]
fn feet_move_without_jumps() {
    for course in Course::ALL {
        let settings = settings(course, 11);
        let simulation = simulation(&settings);
        let speed = settings.stride.step_m / settings.stride.step_s;
        for k in 1..1100 {
            let (before, after) =
                (simulation.gait.posture(0.01 * f64::from(k - 1)), simulation.gait.posture(0.01 * f64::from(k)));
            for side in 0..2 {
                let moved = (after.legs[side].ankle - before.legs[side].ankle).norm() / 0.01;
                assert!(moved < 7.0 * speed.max(0.3), "{course:?} {k}: {moved} m/s at {speed} m/s");
                let hip = (after.legs[side].hip - before.legs[side].hip).norm() / 0.01;
                assert!(hip < 2.0 * speed + 0.3, "{course:?} {k}: {hip} m/s");
            }
        }
    }
}

#[test]
fn steps_are_as_long_and_wide_as_asked_and_ankles_are_closer_than_footprints() {
    let mut settings = settings(Course::Straight, 3);
    (settings.duration_s, settings.mount.yaw) = (30.0, 0.0);
    let steps = simulation(&settings).steps();
    let inner: Vec<_> = steps.iter().filter(|s| s.place_in_bout > 0 && s.steps_to_come > 0).collect();
    let mean = |value: fn(&StepTruth) -> f64| inner.iter().map(|s| value(s)).sum::<f64>() / inner.len() as f64;
    assert!((mean(|s| s.footprint_length_m) - settings.stride.step_m).abs() < 0.02);
    assert!((mean(|s| s.footprint_width_m) - settings.stride.width_m).abs() < 0.01);
    let shorter = mean(|s| s.footprint_length_m - s.ankle_length_m);
    assert!((0.005..0.12).contains(&shorter), "{shorter}");
    assert!(steps.iter().all(|s| !s.is_turning));
    assert!(steps.windows(2).all(|w| w[0].side != w[1].side && w[0].contact_s < w[1].contact_s));
}

#[test]
fn the_image_shows_the_legs_where_the_truth_says() {
    for body in [Some(trousers()), cesium()].into_iter().flatten() {
        let settings = WalkerSettings {
            errors: kinect::SensorErrors { is_noisy: false, missing_share: 0.0, code_noise: 1.0 },
            ..settings(Course::Straight, 2)
        };
        let simulation = WalkerSimulation::new(&settings, body).unwrap();
        let mut seen = 0;
        for k in (0..simulation.len()).step_by(90) {
            let WalkerFrame { image, truth } = simulation.frame(k);
            let map = image.to_depth_map();
            for leg in &truth.legs {
                for point in [leg.knee, leg.ankle] {
                    let Some([i, j]) = simulation.intrinsics().pixel_of_point(&point.coords) else { continue };
                    let (i, j) = (i.round(), j.round());
                    if !(0.0..640.0).contains(&i) || !(0.0..480.0).contains(&j) {
                        continue;
                    }
                    let z = f64::from(map.depth[j as usize * 640 + i as usize]);
                    // The surface is in front of the joint; another leg may be in front of that.
                    assert!(z > 0.4 && z < point.z + 0.02, "frame {k}: {z} for a joint at {}", point.z);
                    seen += usize::from(point.z - z < 0.12);
                }
            }
        }
        assert!(seen > 8, "{seen}");
    }
}

#[test]
fn the_background_is_what_the_frames_show_beside_the_person() {
    let settings = WalkerSettings { has_things: false, ..settings(Course::StopAndGo, 4) };
    let simulation = simulation(&settings);
    let (background, frame) = (simulation.background(), simulation.frame(150).image);
    let corner = (400..480).flat_map(|j| (0..100).map(move |i| j * 640 + i));
    let both = corner.filter(|p| background.values[*p] != MISSING_RAW && frame.values[*p] != MISSING_RAW);
    let near = |p: &usize| background.values[*p].abs_diff(frame.values[*p]) <= 4;
    let (n, same) = (both.clone().count(), both.filter(near).count());
    assert!(n > 5000 && same as f64 > 0.99 * n as f64, "{same} of {n}");
}

#[test]
fn frames_are_the_same_one_by_one_in_batches_and_on_any_number_of_threads() {
    let settings = WalkerSettings { duration_s: 1.0, rate_hz: 9.0, ..settings(Course::Straight, 8) };
    let simulation = simulation(&settings);
    let pool = rayon::ThreadPoolBuilder::new().num_threads(1).build().unwrap();
    let alone: Vec<WalkerFrame> = pool.install(|| simulation.frames().collect());
    assert_eq!(alone.len(), 9);
    assert!(simulation.frames().eq(alone.iter().cloned()));
    assert_eq!(simulation.frame(7), alone[7]);
}

#[test]
fn settings_that_make_no_sense_are_refused_by_name() {
    let mut bad = settings(Course::Straight, 1);
    bad.errors.missing_share = 1.5;
    let refusal = WalkerSimulation::new(&bad, trousers()).err().map(|e| e.to_string()).unwrap_or_default();
    assert!(refusal.starts_with("missing is 1.5"), "{refusal}");
}
