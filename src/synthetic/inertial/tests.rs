use super::*;
use crate::body::{Limb, Side};
use crate::recording::inertial::world_from_plank;
use crate::recording::{Format, Limits, decode, encode};

const KICK: Movement = Movement::Kick(Side::Right);

fn short(settings: FusionSimulation) -> FusionTruth {
    simulate_fusion(&FusionSimulation { movement_s: 8.0, ..settings }).unwrap()
}

fn sensors(truth: &FusionTruth) -> &[InertialSensor] {
    &truth.recording.inertial.as_ref().unwrap().sensors
}

/// The camera's time of each sample of a unit, seconds.
fn times(truth: &FusionTruth, unit: usize) -> Vec<f64> {
    sensors(truth)[unit].time_ns.iter().map(|t| truth.units[unit].clock.camera_time(*t as f64 * 1e-9)).collect()
}

/// Samples of a unit within a span of the camera's time.
fn within(truth: &FusionTruth, unit: usize, span: Range<f64>) -> Vec<usize> {
    times(truth, unit).iter().enumerate().filter(|(_, t)| span.contains(t)).map(|(i, _)| i).collect()
}

fn mean(vectors: &[Vector3<f64>], of: &[usize]) -> Vector3<f64> {
    of.iter().map(|i| vectors[*i]).sum::<Vector3<f64>>() / of.len() as f64
}

#[test]
fn on_the_plank_all_units_read_gravity_along_z_and_the_gyroscope_its_bias() {
    let truth = short(FusionSimulation { plank_error_deg: 0.0, ..FusionSimulation::new(KICK, 3) });
    assert_eq!(truth.units.len(), 9);
    for (u, sensor) in sensors(&truth).iter().enumerate() {
        let still = within(&truth, u, 0.0..protocol::PLANK_S);
        let force = mean(&sensor.acceleration, &still);
        // Bias of 10 mg and scale of 0.5 %, each with a standard deviation of its own: 0.11 m/s² on the vertical.
        assert!((force - Vector3::z() * STANDARD_GRAVITY).amax() < 0.5, "{}: {force}", sensor.segment);
        let rate = mean(&sensor.angular_rate, &still);
        assert!((rate - truth.units[u].gyroscope_bias).norm() < 0.05f64.to_radians(), "{}", sensor.segment);
        let attitude = truth.units[u].world_from_imu[still[10]];
        assert!(attitude.angle_to(&UnitQuaternion::from_rotation_matrix(&world_from_plank())) < 1e-9);
    }
}

#[test]
fn at_rest_on_the_body_units_read_gravity_upwards_and_sit_as_their_mounting_says() {
    let truth = short(FusionSimulation { tissue: TissueSettings::RIGID, ..FusionSimulation::without_errors(KICK, 4) });
    for (u, sensor) in sensors(&truth).iter().enumerate() {
        for i in within(&truth, u, truth.phases.rest.clone()) {
            let unit = &truth.units[u];
            let up = unit.world_from_imu[i] * sensor.acceleration[i] / STANDARD_GRAVITY;
            assert!((up - Vector3::y()).norm() < 0.02, "{}: {up}", sensor.segment);
            let frame = &truth.stances[(times(&truth, u)[i] * TRUTH_HZ).round() as usize];
            let world_from_bone = world_from_subject(0.0) * bone_rotations(&frame.pose)[unit.bone.index()];
            let mounted = UnitQuaternion::from_rotation_matrix(&world_from_bone) * unit.bone_from_imu;
            assert!(mounted.angle_to(&unit.world_from_imu[i]) < 1f64.to_radians());
        }
        let scheme = UnitQuaternion::from_rotation_matrix(&truth.units[u].bone.scheme_from_imu());
        assert!(scheme.angle_to(&truth.units[u].bone_from_imu) < 1e-9);
    }
}

#[test]
fn in_flight_nothing_presses_on_anything() {
    let truth = short(FusionSimulation::without_errors(KICK, 5));
    assert_eq!(truth.phases.jumps.len(), 5);
    for jump in &truth.phases.jumps {
        assert!((0.25..0.35).contains(&(jump.touch_down_s - jump.take_off_s)));
        for (u, sensor) in sensors(&truth).iter().enumerate() {
            for i in within(&truth, u, jump.take_off_s + 0.03..jump.touch_down_s - 0.03) {
                let force = sensor.acceleration[i].norm();
                assert!(force < 1.0, "{} in flight: {force} m/s²", sensor.segment);
            }
        }
    }
}

#[test]
fn the_camera_sees_each_jump_where_the_truth_says() {
    let truth = short(FusionSimulation::without_errors(KICK, 6));
    let skeleton = truth.recording.skeleton.as_ref().unwrap();
    let torso = skeleton.column(crate::body::Joint::Torso).unwrap();
    let height = |t: f64| skeleton.frame(skeleton.time_ns.partition_point(|time| (*time as f64) < t * 1e9))[torso].y;
    let standing = height(truth.phases.rest.start);
    for jump in &truth.phases.jumps {
        let top = height((jump.take_off_s + jump.touch_down_s) / 2.0);
        assert!((0.1..0.3).contains(&(top - standing)), "{}", top - standing);
        assert!(height(jump.take_off_s - 0.4) < standing - 0.12);
    }
}

#[test]
fn landings_shake_the_shank_by_several_g_and_tilt_the_thigh_s_unit_by_degrees() {
    let truth = short(FusionSimulation::new(KICK, 7));
    let rigid = short(FusionSimulation { tissue: TissueSettings::RIGID, ..FusionSimulation::new(KICK, 7) });
    for jump in &truth.phases.jumps {
        let peak = |bone: Bone| {
            let unit = truth.units.iter().position(|unit| unit.bone == bone).unwrap();
            let after = within(&truth, unit, jump.touch_down_s..jump.touch_down_s + 0.2);
            after.iter().map(|i| sensors(&truth)[unit].acceleration[*i].norm()).fold(0.0, f64::max)
        };
        let [shank, trunk] = [peak(Bone::Distal(Limb::RightLeg)), peak(Bone::Trunk)];
        assert!((35.0..137.0).contains(&shank) && trunk < 0.8 * shank, "{shank} {trunk}");
        let thigh = truth.units.iter().position(|unit| unit.bone == Bone::Proximal(Limb::RightLeg)).unwrap();
        let after = within(&truth, thigh, jump.touch_down_s..jump.touch_down_s + 0.2);
        let tilt = |i: &usize| truth.units[thigh].world_from_imu[*i].angle_to(&rigid.units[thigh].world_from_imu[*i]);
        let most = after.iter().map(tilt).fold(0.0, f64::max).to_degrees();
        assert!((0.8..6.0).contains(&most), "{most}°");
    }
}

#[test]
fn integrating_the_ideal_gyroscope_reproduces_the_orientation_and_the_accelerometer_the_position() {
    for movement in [KICK, Movement::Elbow, Movement::Exercise(crate::synthetic::Exercise::Step)] {
        let truth = short(FusionSimulation::without_errors(movement, 8));
        for (u, sensor) in sensors(&truth).iter().enumerate() {
            let unit = &truth.units[u];
            let h = 1.0 / 256.0;
            let mut rotation = unit.world_from_imu[0];
            let (mut position, mut velocity) = (unit.position[0], (unit.position[1] - unit.position[0]) / h);
            let (mut turned, mut moved) = (0f64, 0f64);
            for i in 1..sensor.len() {
                let world =
                    |i: usize| unit.world_from_imu[i] * sensor.acceleration[i] - Vector3::y() * STANDARD_GRAVITY;
                if i > 1 {
                    velocity += world(i - 1) * h;
                }
                position += velocity * h;
                rotation *= UnitQuaternion::new((sensor.angular_rate[i - 1] + sensor.angular_rate[i]) * (h / 2.0));
                turned = turned.max(rotation.angle_to(&unit.world_from_imu[i]));
                moved = moved.max((position - unit.position[i]).norm());
            }
            // Samples at 256 Hz miss a little of the quickest parts; a minute of them adds up.
            assert!(turned < 0.3f64.to_radians(), "{}: {}°", sensor.segment, turned.to_degrees());
            assert!(moved < 0.1, "{}: {moved} m", sensor.segment);
        }
    }
}

#[test]
fn clocks_mounting_and_phases_of_the_recording_are_those_of_the_truth() {
    let truth = short(FusionSimulation::new(Movement::Elbow, 9));
    let value = |channel: &str| {
        let found = truth.recording.references.iter().find(|r| r.channel == channel);
        found.unwrap_or_else(|| panic!("{channel}")).values[0]
    };
    for unit in &truth.units {
        let segment = Segment::of_bone(unit.bone);
        assert_eq!(value(&format!("{segment}_clock_offset_s")), unit.clock.offset_s);
        assert_eq!(value(&format!("{segment}_clock_drift_ppm")), unit.clock.drift_ppm);
        assert_eq!(value(&format!("{segment}_mounting_w")), unit.bone_from_imu.w);
        assert!(unit.clock.offset_s.abs() <= 2.0 && unit.clock.drift_ppm.abs() <= 100.0);
        let scheme = UnitQuaternion::from_rotation_matrix(&unit.bone.scheme_from_imu());
        assert!((4.99..10.01).contains(&scheme.angle_to(&unit.bone_from_imu).to_degrees()));
        let back = unit.clock.unit_time(unit.clock.camera_time(12.0));
        assert!((back - 12.0).abs() < 1e-9);
    }
    let phase = truth.recording.references.iter().find(|r| r.channel == "protocol_phase_code").unwrap();
    assert_eq!(phase.values, [0.0, 1.0, 2.0, 3.0, 4.0]);
    assert_eq!(phase.time_ns[4], (truth.phases.movement.start * 1e9).round() as i64);
    for (u, sensor) in sensors(&truth).iter().enumerate() {
        assert_eq!(sensor.mounting.as_deref(), Some(MOUNTING_SCHEME));
        let times = times(&truth, u);
        assert!(times[0] < 0.005 && (times[times.len() - 1] - truth.phases.end_s).abs() < 0.5);
    }
}

#[test]
fn parts_of_the_protocol_can_be_left_out() {
    for (plank, jumps) in [(false, 0), (true, 0), (false, 2)] {
        let phases = Phases::of(Protocol { plank, jumps }, 10.0, 1.7, 4);
        assert_eq!((phases.plank.is_some(), phases.putting_on.is_some(), phases.jumps.len()), (plank, plank, jumps));
        assert_eq!(phases.starts().len(), 2 + 2 * usize::from(plank) + usize::from(jumps > 0));
        assert!(phases.starts().windows(2).all(|w| w[0].0 < w[1].0 && w[0].1 < w[1].1));
        assert_eq!(phases.rest.start == 0.0, !plank);
    }
}

#[test]
fn units_go_smoothly_from_the_plank_to_their_bones() {
    let truth = short(FusionSimulation { shock: 0.0, ..FusionSimulation::new(KICK, 12) });
    let putting_on = truth.phases.putting_on.clone().unwrap();
    for (u, sensor) in sensors(&truth).iter().enumerate() {
        let handled = within(&truth, u, putting_on.clone());
        let quickest = handled.iter().map(|i| sensor.angular_rate[*i].norm().to_degrees()).fold(0.0, f64::max);
        let hardest = handled.iter().map(|i| sensor.acceleration[*i].norm()).fold(0.0, f64::max);
        assert!((30.0..800.0).contains(&quickest), "{}: {quickest} °/s", sensor.segment);
        assert!((10.0..30.0).contains(&hardest), "{}: {hardest} m/s²", sensor.segment);
    }
}

#[test]
fn a_seed_is_one_recording_to_the_byte_which_decodes_to_itself() {
    let settings = FusionSimulation { occlusion_s: 3.0, protocol: Protocol::NONE, ..FusionSimulation::new(KICK, 2) };
    let truth = short(settings.clone());
    let bytes = encode::mcap(&truth.recording).unwrap();
    assert!(bytes == encode::mcap(&short(settings.clone()).recording).unwrap());
    assert!(bytes != encode::mcap(&short(FusionSimulation { seed: 3, ..settings }).recording).unwrap());
    let decoded = decode(&bytes[..], Format::Mcap, &Limits::default()).unwrap();
    assert_eq!(decoded.inertial, truth.recording.inertial);
    assert_eq!(decoded.references.len(), truth.recording.references.len());
    assert_eq!(decoded.header, truth.recording.header);
    let json = encode::json(&truth.recording).unwrap();
    let decoded = decode(&json[..], Format::Json, &Limits { max_json_bytes: usize::MAX, ..Limits::default() }).unwrap();
    assert_eq!(decoded.inertial, truth.recording.inertial);
}

#[test]
fn one_unit_s_errors_do_not_depend_on_the_others() {
    let nine = short(FusionSimulation { protocol: Protocol::NONE, ..FusionSimulation::new(KICK, 2) });
    let bone = Bone::Distal(Limb::LeftLeg);
    let one = FusionSimulation { units: vec![bone], protocol: Protocol::NONE, ..FusionSimulation::new(KICK, 2) };
    let one = short(one);
    assert_eq!(sensors(&one), &sensors(&nine)[bone.index()..=bone.index()]);
    assert_eq!(one.recording.skeleton, nine.recording.skeleton);
}

#[test]
fn occlusions_hide_joints_during_the_movement_for_the_time_asked_for() {
    let settings = FusionSimulation { movement_s: 30.0, occlusion_s: 20.0, ..FusionSimulation::new(KICK, 11) };
    let truth = simulate_fusion(&FusionSimulation { units: Vec::new(), ..settings }).unwrap();
    let skeleton = truth.recording.skeleton.as_ref().unwrap();
    let hides = |t: usize| skeleton.frame_confidence(t).contains(&0.0);
    let hidden = (0..skeleton.len()).filter(|t| hides(*t)).count() as f64 / 30.0;
    assert!((18.5..21.5).contains(&hidden), "{hidden} s");
    let first = (0..skeleton.len()).find(|t| hides(*t)).unwrap();
    assert!(skeleton.time_ns[first] as f64 * 1e-9 >= truth.phases.movement.start);
    assert!(truth.recording.inertial.is_none());
}

#[test]
fn an_upside_down_unit_points_up_the_bone() {
    let thigh = Bone::Proximal(Limb::LeftLeg);
    let settings = FusionSimulation { upside_down: vec![thigh], ..FusionSimulation::without_errors(KICK, 1) };
    let truth = short(settings);
    let x = truth.units[thigh.index()].bone_from_imu * Vector3::x();
    assert!((x + thigh.direction()).norm() < 1e-9);
}

#[test]
fn saturation_cuts_what_a_unit_cannot_measure() {
    let errors = UnitErrors { accelerometer_range_g: 2.0, gyroscope_range_deg_s: 50.0, ..UnitErrors::default() };
    let truth = short(FusionSimulation { errors, ..FusionSimulation::new(KICK, 1) });
    // Recordings hold six decimals.
    let (range, rate_range, step) = (2.0 * STANDARD_GRAVITY, 50f64.to_radians(), 1e-6);
    for sensor in sensors(&truth) {
        assert!(sensor.acceleration.iter().all(|a| a.amax() <= range + step));
        assert!(sensor.angular_rate.iter().all(|a| a.amax() <= rate_range + step));
    }
    let shank = &sensors(&truth)[Bone::Distal(Limb::RightLeg).index()];
    assert!(shank.angular_rate.iter().any(|rate| rate.amax() > rate_range - step));
}

#[test]
fn settings_outside_their_range_are_refused_with_the_range() {
    let refusal = |settings: FusionSimulation| simulate_fusion(&settings).unwrap_err().to_string();
    let good = FusionSimulation::new(KICK, 1);
    assert_eq!(
        refusal(FusionSimulation { movement_s: 2.0, ..good.clone() }),
        "seconds is 2, but must lie between 5 and 3600"
    );
    let mounting = Mounting::Scheme(10.0..5.0);
    assert!(refusal(FusionSimulation { mounting, ..good }).contains("misalignment-deg"));
}

#[test]
fn each_defect_changes_its_unit_alone() {
    use defect::Defect;
    let good = short(FusionSimulation { protocol: Protocol::NONE, ..FusionSimulation::new(KICK, 1) });
    let good = good.recording.inertial.unwrap();
    let (a, b) = (Segment::LeftThigh, Segment::LeftShank);
    for defect in [
        Defect::Swapped(a, b),
        Defect::MirroredAxes(a),
        Defect::GyroscopeInDegrees(a),
        Defect::AccelerometerInG(a),
        Defect::ConstantAccelerometer(a),
        Defect::Missing(a),
        Defect::ClockAhead(a, 5000.0),
        Defect::ClockBackwards(a),
    ] {
        let mut bad = good.clone();
        defect.apply(&mut bad);
        assert!(bad.sensor(a) != good.sensor(a), "{defect:?}");
        for sensor in good.sensors.iter().filter(|sensor| ![a, b].contains(&sensor.segment)) {
            assert_eq!(bad.sensor(sensor.segment), Some(sensor), "{defect:?}");
        }
    }
}
