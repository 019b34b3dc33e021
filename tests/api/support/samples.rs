//! Recordings and results made in code.

pub use crate::common::FRAME_NS;
use crate::common::standing;
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use std::sync::Arc;
use surefoot::assessment::{Assessment, NoiseModelReference, Provenance, Quality, Series, Settings};
use surefoot::recording::{Recording, encode};
use surefoot::synthetic::sensor::white_noise;
use surefoot::worker::Assess;

/// A standing person of `n` frames who sways a little sideways.
pub fn recording(n: usize) -> Recording {
    standing(n, 0.1)
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
