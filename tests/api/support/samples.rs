//! Recordings and results made in code.

use nalgebra::Vector3;
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use std::sync::Arc;
use surefoot::assessment::{Assessment, NoiseModelReference, Provenance, Quality, Series, Settings};
use surefoot::body::Joint;
use surefoot::recording::{Header, Recording, SkeletonRecording, encode};
use surefoot::synthetic::sensor::white_noise;
use surefoot::worker::Assess;

/// Time between two frames, nanoseconds: 30 Hz.
pub const FRAME_NS: i64 = 33_333_333;

/// A standing person of `n` frames who sways a little sideways.
pub fn recording(n: usize) -> Recording {
    let at = |x: f64, y: f64| Vector3::new(x, y, 2.0);
    let posture = [
        (Joint::Head, at(0.0, 0.75)),
        (Joint::Torso, at(0.0, 0.25)),
        (Joint::LeftShoulder, at(0.2, 0.5)),
        (Joint::RightShoulder, at(-0.2, 0.5)),
        (Joint::LeftElbow, at(0.45, 0.5)),
        (Joint::RightElbow, at(-0.45, 0.5)),
        (Joint::LeftHand, at(0.7, 0.5)),
        (Joint::RightHand, at(-0.7, 0.5)),
        (Joint::LeftHip, at(0.1, 0.0)),
        (Joint::RightHip, at(-0.1, 0.0)),
        (Joint::LeftKnee, at(0.1, -0.4)),
        (Joint::RightKnee, at(-0.1, -0.4)),
        (Joint::LeftFoot, at(0.1, -0.8)),
        (Joint::RightFoot, at(-0.1, -0.8)),
    ];
    let sway = |t: usize| Vector3::new(0.005 * (t as f64 * 0.1).sin(), 0.0, 0.0);
    Recording {
        header: Header { protocol: Some("standing".into()), ..Header::default() },
        skeleton: Some(SkeletonRecording {
            joints: posture.iter().map(|(joint, _)| *joint).collect(),
            time_ns: (0..n as i64).map(|t| t * FRAME_NS).collect(),
            positions: (0..n).flat_map(|t| posture.map(|(_, position)| position + sway(t))).collect(),
            confidence: vec![1.0; n * posture.len()],
            orientations: Vec::new(),
        }),
        inertial: None,
        references: Vec::new(),
    }
}

/// A person who stands still for some seconds before a sensor with the noise of Table 1.
pub fn standing_still(seconds: usize, seed: u64) -> Vec<u8> {
    let mut recording = recording(30 * seconds);
    let skeleton = recording.skeleton.as_mut().unwrap();
    white_noise::add(skeleton, white_noise::table1_sd_mm, &mut ChaCha8Rng::seed_from_u64(seed));
    encode::mcap(&recording).unwrap()
}

/// Two seconds as JSON.
pub fn json_recording() -> Vec<u8> {
    encode::json(&recording(60)).unwrap()
}

/// Two seconds as MCAP.
pub fn mcap_recording() -> Vec<u8> {
    encode::mcap(&recording(60)).unwrap()
}

/// Samples in the result of [`known_result`].
pub const KNOWN_SAMPLES: usize = 5000;

/// A computation whose result is known: a ramp in one channel, a constant with gaps in the other.
pub fn known_result() -> Arc<Assess> {
    Arc::new(|_, _, settings: &Settings, _, _| {
        let mut ramp = Series::empty("right_knee_flexion_deg", KNOWN_SAMPLES);
        let mut gaps = Series::empty("trunk_flexion_deg", KNOWN_SAMPLES);
        for t in 0..KNOWN_SAMPLES {
            ramp.value[t] = t as f32 * 0.01;
            ramp.low[t] = ramp.value[t] - 1.5;
            ramp.high[t] = ramp.value[t] + 1.5;
            if t % 10 != 0 {
                gaps.value[t] = 3.0;
            } else {
                gaps.flags[t] = surefoot::assessment::series::FLAG_NOT_OBSERVABLE;
            }
        }
        let series = vec![ramp, gaps];
        Ok(Assessment {
            gait: None,
            joints: None,
            performance: None,
            pipeline: "joint_angles",
            time_ns: (0..KNOWN_SAMPLES as i64).map(|t| t * 10_000_000).collect(),
            summary: series.iter().map(Series::summarize).collect(),
            series,
            quality: Quality { n_frames: KNOWN_SAMPLES as u64, coverage: 0.95, ..Quality::default() },
            provenance: Provenance {
                software_version: "test".into(),
                pipeline: "joint_angles".into(),
                method: method_of(settings),
                settings: settings.clone(),
                patient_assessment_id: None,
                noise_model: Some(NoiseModelReference::adaptive()),
                seed: 1,
                recording_sha256: String::new(),
            },
        })
    })
}

fn method_of(settings: &Settings) -> String {
    match settings {
        Settings::JointAngles(settings) => settings.method.name().to_owned(),
        Settings::SkeletonFusion(settings) => settings.method.name().to_owned(),
        Settings::LegPose(_) | Settings::NoiseModel(_) => panic!("not of the tests' samples"),
    }
}
