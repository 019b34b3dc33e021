use super::*;
use crate::body::Side;
use crate::body::anatomical_angles::leg_offset;
use crate::recording::encode;

fn reference<'a>(recording: &'a Recording, channel: &str) -> &'a ReferenceSeries {
    recording.references.iter().find(|r| r.channel == channel).unwrap()
}

#[test]
fn without_noise_the_recording_is_forward_kinematics_of_the_truth() {
    for exercise in Exercise::ALL {
        let settings = SimulationSettings { yaw_deg: 20.0, ..SimulationSettings::new(exercise, Preset::Clean, 3) };
        let simulation = simulate(&settings).unwrap();
        let skeleton = simulation.recording.skeleton.as_ref().unwrap();
        let torso = skeleton.column(Joint::Torso).unwrap();
        let turn = world_from_subject(20.0);
        // The state is rebuilt from what the recording itself carries as truth.
        let all = AngleChannel::all();
        for t in (0..skeleton.len()).step_by(7) {
            let value = |i: usize| simulation.recording.references[i].values[t].to_radians();
            let mut theta = PoseVector::zeros();
            for i in 0..15 {
                theta[i] = value(ANGLE_COUNT + i);
            }
            for (i, side) in [(0, Side::Left), (1, Side::Right)] {
                theta[15 + i] = value(all.iter().position(|c| *c == AngleChannel::ElbowFlexion(side)).unwrap());
                theta[17 + i] = value(leg_offset(side) + 3);
            }
            let points = forward_kinematics(&simulation.subject.skeleton, &Pose::from_vector(&theta));
            for (column, joint) in skeleton.joints.iter().enumerate().skip(3) {
                let found = skeleton.frame(t)[column] - skeleton.frame(t)[torso];
                assert!((found - turn * points[column - 3]).norm() < 1e-9, "{exercise} {joint} in frame {t}");
            }
        }
    }
}

#[test]
fn the_subject_faces_the_sensor_with_the_right_side_at_positive_x_and_stands_on_the_floor() {
    let simulation = simulate(&SimulationSettings::new(Exercise::BackKnee, Preset::Clean, 1)).unwrap();
    let skeleton = simulation.recording.skeleton.as_ref().unwrap();
    let at = |t: usize, joint: Joint| skeleton.frame(t)[skeleton.column(joint).unwrap()];
    assert!(at(0, Joint::RightHand).x > 0.6 && at(0, Joint::LeftHand).x < -0.6);
    assert!((at(0, Joint::Torso).z - 2.5).abs() < 0.05);
    assert!((at(0, Joint::LeftFoot).y - (0.039 * 1.7 - 0.9)).abs() < 0.003);
    let knee = reference(&simulation.recording, "right_knee_flexion_deg");
    let most = (0..knee.values.len()).max_by(|a, b| knee.values[*a].total_cmp(&knee.values[*b])).unwrap();
    assert!(knee.values[most] > 60.0);
    assert!(at(most, Joint::RightFoot).z > at(most, Joint::RightKnee).z + 0.2, "the foot goes away from the sensor");
}

#[test]
fn every_channel_has_its_truth_on_the_recording_s_clock() {
    let simulation = simulate(&SimulationSettings::new(Exercise::Step, Preset::Failures, 1)).unwrap();
    let skeleton = simulation.recording.skeleton.as_ref().unwrap();
    let names: Vec<String> = simulation.recording.references.iter().map(|r| r.channel.clone()).collect();
    assert_eq!(names, AngleChannel::all().into_iter().map(AngleChannel::name).collect::<Vec<_>>());
    for reference in &simulation.recording.references {
        assert_eq!((reference.source.as_str(), reference.clock_offset_ns), (TRUTH_SOURCE, 0));
        assert_eq!(reference.time_ns, skeleton.time_ns);
        assert!(reference.values.iter().all(|v| v.is_finite()), "{}", reference.channel);
    }
}

#[test]
fn a_seed_is_one_recording_to_the_byte_and_another_seed_another() {
    for sensor in Preset::ALL {
        let bytes = |seed: u64| {
            let settings = SimulationSettings { jitter: true, ..SimulationSettings::new(Exercise::Step, sensor, seed) };
            encode::json(&simulate(&settings).unwrap().recording).unwrap()
        };
        assert!(bytes(5) == bytes(5), "{sensor}");
        assert!(bytes(5) != bytes(6), "{sensor}");
    }
}

#[test]
fn a_yaw_to_the_left_brings_the_right_hand_towards_the_sensor() {
    let settings = SimulationSettings { yaw_deg: 30.0, ..SimulationSettings::new(Exercise::Step, Preset::Clean, 1) };
    let simulation = simulate(&settings).unwrap();
    let skeleton = simulation.recording.skeleton.as_ref().unwrap();
    let hand = skeleton.frame(0)[skeleton.column(Joint::RightHand).unwrap()];
    assert!(hand.z < 2.3, "{hand}");
}

#[test]
fn settings_outside_their_range_are_refused_with_the_range() {
    let good = SimulationSettings::new(Exercise::Step, Preset::Clean, 1);
    let short = SimulationSettings { duration_s: 2.0, ..good.clone() };
    let refusal = simulate(&short).unwrap_err().to_string();
    assert_eq!(refusal, "seconds is 2, but must lie between 6 and 3600");
    for bad in [
        SimulationSettings { rate_hz: f64::NAN, ..good.clone() },
        SimulationSettings { stature_m: 0.1, ..good.clone() },
        SimulationSettings { yaw_deg: 200.0, ..good },
    ] {
        assert!(simulate(&bad).is_err());
    }
}
