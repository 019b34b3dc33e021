//! The fusion of a camera skeleton with inertial units, on simulated recordings.

mod accuracy;
mod bad_input;
mod degraded;
mod methods;

use super::support::{series, truth_at};
use std::sync::LazyLock;
use surefoot::assessment::{Assessment, FusionMethod, FusionQuality, Settings, SkeletonFusionSettings, UnitQuality};
use surefoot::body::Side;
use surefoot::pipeline::{PipelineError, assess};
use surefoot::progress::Monitor;
use surefoot::recording::{InertialRecording, Recording, Segment};
use surefoot::synthetic::inertial::errors::UnitErrors;
use surefoot::synthetic::{FusionSimulation, FusionTruth, Movement, simulate_fusion};

/// Nine units through the whole protocol, then eight seconds of kicking with the right leg before a Kinect.
static KICK: LazyLock<FusionTruth> = LazyLock::new(|| simulated(&kick()));

/// What [`KICK`] is made with: the usual errors, but no sample lost, so that a test decides which are.
fn kick() -> FusionSimulation {
    FusionSimulation {
        movement_s: 8.0,
        unit_rate_hz: 100.0,
        errors: UnitErrors { gaps: UnitErrors::NONE.gaps, ..UnitErrors::default() },
        ..FusionSimulation::new(Movement::Kick(Side::Right), 1)
    }
}

fn simulated(settings: &FusionSimulation) -> FusionTruth {
    simulate_fusion(settings).expect("settings within their ranges")
}

fn by(method: FusionMethod) -> Settings {
    Settings::SkeletonFusion(SkeletonFusionSettings { method, ..SkeletonFusionSettings::default() })
}

fn fused(recording: &Recording) -> Assessment {
    assess(recording, &by(FusionMethod::Fused), &Monitor::default()).expect("an assessment")
}

/// Code and sentence with which a recording is refused.
fn refusal(recording: &Recording, method: FusionMethod) -> (&'static str, String) {
    match assess(recording, &by(method), &Monitor::default()) {
        Err(PipelineError::Unsuitable { code, sentence, .. }) => (code, sentence),
        other => panic!("not refused: {:?}", other.map(|a| a.quality)),
    }
}

fn quality(found: &Assessment) -> &FusionQuality {
    found.quality.fusion.as_ref().expect("a fusion")
}

fn unit(found: &Assessment, segment: Segment) -> &UnitQuality {
    quality(found).units.iter().find(|unit| unit.segment == segment).expect("the unit")
}

/// Messages of the warnings with a code.
fn warnings<'a>(found: &'a Assessment, code: &str) -> Vec<&'a str> {
    found.quality.warnings.iter().filter(|w| w.code == code).map(|w| w.message.as_str()).collect()
}

/// Root mean square error of a channel, and what remains of it without its constant part.
fn errors(found: &Assessment, recording: &Recording, channel: &str) -> (f64, f64) {
    let estimate = series(found, channel);
    let truth = truth_at(recording, channel, &found.time_ns);
    let errors: Vec<f64> = truth.map(|(i, t)| f64::from(estimate.value[i]) - t).filter(|e| e.is_finite()).collect();
    let n = errors.len() as f64;
    let (mean, square) = (errors.iter().sum::<f64>() / n, errors.iter().map(|e| e * e).sum::<f64>() / n);
    (square.sqrt(), (square - mean * mean).max(0.0).sqrt())
}

fn error(found: &Assessment, recording: &Recording, channel: &str) -> f64 {
    errors(found, recording, channel).0
}

/// The recording with a change to its units.
fn with_units(recording: &Recording, change: impl FnOnce(&mut InertialRecording)) -> Recording {
    let mut recording = recording.clone();
    change(recording.inertial.as_mut().expect("units"));
    recording
}

/// The recording with some of its units only.
fn with_only(recording: &Recording, segments: &[Segment]) -> Recording {
    with_units(recording, |inertial| inertial.sensors.retain(|unit| segments.contains(&unit.segment)))
}
