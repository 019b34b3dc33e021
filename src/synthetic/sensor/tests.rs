use super::*;
use crate::synthetic::{Exercise, Simulation, SimulationSettings, simulate};

fn simulated(sensor: Preset, seed: u64, duration_s: f64) -> Simulation {
    let settings = SimulationSettings { duration_s, ..SimulationSettings::new(Exercise::BackKnee, sensor, seed) };
    simulate(&settings).unwrap()
}

fn skeleton(simulation: &Simulation) -> &SkeletonRecording {
    simulation.recording.skeleton.as_ref().unwrap()
}

/// Error of a joint in each frame where it was seen, in `world`, millimetres.
fn errors_mm(noisy: &SkeletonRecording, clean: &SkeletonRecording, joint: Joint) -> Vec<Vector3<f64>> {
    let column = noisy.column(joint).unwrap();
    assert_eq!(clean.column(joint), Some(column));
    let seen = (0..noisy.len()).filter(|t| noisy.frame_confidence(*t)[column] > 0.0);
    seen.map(|t| (noisy.frame(t)[column] - clean.frame(t)[column]) * 1000.0).collect()
}

#[test]
fn table1_noise_has_the_paper_s_standard_deviations_and_no_bias() {
    let (noisy, clean) = (simulated(Preset::Table1, 4, 300.0), simulated(Preset::Clean, 4, 300.0));
    for (joint, sd_mm) in [
        (Joint::LeftShoulder, [9.1, 6.7, 12.7]),
        (Joint::RightElbow, [29.8, 25.2, 20.3]),
        (Joint::LeftHand, [151.5, 181.7, 14.5]),
        (Joint::RightHip, [6.0, 6.5, 10.1]),
        (Joint::LeftKnee, [8.8, 16.8, 35.1]),
        (Joint::RightFoot, [19.8, 25.2, 38.1]),
    ] {
        let errors = errors_mm(skeleton(&noisy), skeleton(&clean), joint);
        let n = errors.len() as f64;
        assert!(n > 8900.0);
        for axis in 0..3 {
            let mean = errors.iter().map(|e| e[axis]).sum::<f64>() / n;
            let sd = (errors.iter().map(|e| (e[axis] - mean).powi(2)).sum::<f64>() / n).sqrt();
            // Of 9000 draws the standard error is 0.75 % of the standard deviation and 1.05 % of it for the mean.
            assert!((sd / sd_mm[axis] - 1.0).abs() < 0.03, "{joint} axis {axis}: {sd} mm");
            assert!(mean.abs() < 0.042 * sd_mm[axis], "{joint} axis {axis}: mean {mean} mm");
        }
    }
    assert!(errors_mm(skeleton(&noisy), skeleton(&clean), Joint::Torso).iter().all(|e| e.norm() == 0.0));
}

#[test]
fn a_kinect_jitters_by_a_millimetre_and_errs_by_centimetres() {
    // √(32² + 46²) = 56 and √(45² + 30²) = 54; forty people leave them uncertain by about 10 %.
    for (sensor, expected_mm) in [(Preset::KinectV2, 56.0), (Preset::KinectOffset, 54.0)] {
        let mut squares = 0.0;
        let people = 40;
        for seed in 0..people {
            let simulation = simulated(sensor, seed, 12.0);
            let noisy = skeleton(&simulation);
            let column = noisy.column(Joint::LeftAnkle).unwrap();
            let truth: Vec<Vector3<f64>> = simulation
                .stances
                .iter()
                .map(|stance| {
                    let points =
                        crate::body::kinematics::forward_kinematics(&simulation.subject.skeleton, &stance.pose);
                    let at = stance.torso + points[point_index(Limb::LeftLeg, 2)];
                    Vector3::new(0.0, -0.9, 2.5) + crate::synthetic::world_from_subject(0.0) * at
                })
                .collect();
            let errors: Vec<Vector3<f64>> = (0..noisy.len()).map(|t| noisy.frame(t)[column] - truth[t]).collect();
            squares += errors.iter().map(Vector3::norm_squared).sum::<f64>() / errors.len() as f64;
            // At rest in the T-posture only the jitter is left: differences of neighbours have √2 of its 1 mm.
            let steps: Vec<f64> =
                (1..50).flat_map(|t| (errors[t] - errors[t - 1]).iter().copied().collect::<Vec<_>>()).collect();
            let jitter_mm = 1000.0 * (steps.iter().map(|s| s * s).sum::<f64>() / steps.len() as f64 / 2.0).sqrt();
            assert!((0.8..1.25).contains(&jitter_mm), "seed {seed}: {jitter_mm} mm");
        }
        let rms_mm = 1000.0 * (squares / people as f64).sqrt();
        assert!((rms_mm / expected_mm - 1.0f64).abs() < 0.22, "{sensor}: {rms_mm} mm");
    }
}

#[test]
fn failures_lose_joints_jump_hands_and_exchange_limbs() {
    let simulation = simulated(Preset::Failures, 2, 120.0);
    let noisy = skeleton(&simulation);
    let lost = noisy.confidence.iter().filter(|c| **c == 0.0).count() as f64 / noisy.confidence.len() as f64;
    // Four ends of limbs at 0.04/s and four hinges at 0.02/s, each 0.65 s, over 15 joints: about 1 %.
    assert!((0.003..0.03).contains(&lost), "{lost}");
    for (position, confidence) in noisy.positions.iter().zip(&noisy.confidence) {
        assert_eq!(position.iter().all(|x| x.is_nan()), *confidence == 0.0);
        assert_eq!(position.iter().any(|x| x.is_nan()), *confidence == 0.0);
    }
    let [left, right] = [Joint::LeftFoot, Joint::RightFoot].map(|joint| noisy.column(joint).unwrap());
    let exchanged = (0..noisy.len()).filter(|t| noisy.frame(*t)[left].x > noisy.frame(*t)[right].x + 0.05).count();
    assert!(exchanged > 10, "the subject's left foot stands at −x, except where it was taken for the right one");
    assert!(noisy.time_ns.windows(2).any(|w| w[1] - w[0] > 70_000_000), "frames are missing");
}

#[test]
fn middleware_flips_are_half_turns_about_the_segment() {
    let (noisy, clean) = (simulated(Preset::Failures, 2, 120.0), simulated(Preset::Clean, 2, 120.0));
    let (noisy, clean) = (skeleton(&noisy), skeleton(&clean));
    let column = noisy.column(Joint::RightKnee).unwrap();
    let n = noisy.joints.len();
    let mut flipped = 0;
    for t in 0..noisy.len() {
        // Frames are missing in one of them: compare at the same time.
        let Some(same) = clean.time_ns.iter().position(|time| *time == noisy.time_ns[t]) else { continue };
        let (Some(found), Some(truth)) = (noisy.orientations[t * n + column], clean.orientations[same * n + column])
        else {
            continue;
        };
        flipped += usize::from(found.angle_to(&truth) > 2.0);
    }
    assert!(flipped > 10, "{flipped} flipped frames");
}

#[test]
fn names_parse_back_and_unknown_ones_are_refused() {
    for preset in Preset::ALL {
        assert_eq!(preset.name().parse(), Ok(preset));
    }
    assert_eq!("kinect".parse::<Preset>(), Err(UnknownPreset("kinect".into())));
}
