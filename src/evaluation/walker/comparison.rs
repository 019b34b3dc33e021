//! Methods beside each other on the same images of one simulated walk.

use super::method::WalkerMethod;
use super::{Errors, MethodErrors, true_ankles};
use crate::body::Side;
use crate::pipeline::PipelineError;
use crate::pipeline::leg_pose::foreground::Foreground;
use crate::pipeline::leg_pose::leg_model::LegPoint;
use crate::pipeline::leg_pose::two_legs::TwoLegs;
use crate::pipeline::leg_pose::{Legs, track};
use crate::progress::Monitor;
use crate::recording::Limits;
use crate::recording::depth::DepthReader;
use crate::recording::encode::EncodeError;
use crate::synthetic::walker::{FrameTruth, WalkerSimulation};
use nalgebra::Vector3;
use std::io::Cursor;

/// Why a walk could not be evaluated.
#[derive(Debug, thiserror::Error)]
pub enum WalkError {
    /// The walk cannot be tracked at all.
    #[error(transparent)]
    Untracked(#[from] PipelineError),
    /// The walk could not be written or read again.
    #[error(transparent)]
    Unwritten(#[from] EncodeError),
}

/// What each of some methods made of one simulated walk, in the order in which they are asked for. All of them see the
/// same images, which are rendered once and kept as a recording.
///
/// # Errors
/// See [`WalkError`].
pub fn compare(
    simulation: &WalkerSimulation,
    methods: &[WalkerMethod],
    particles: u32,
) -> Result<Vec<MethodErrors>, WalkError> {
    let truth: Vec<FrameTruth> = (0..simulation.len()).map(|k| simulation.truth(k)).collect();
    let needs_colour = methods.iter().any(|method| matches!(method, WalkerMethod::Paper(cues) if cues.has_colour()));
    let out = Cursor::new(Vec::new());
    let written = if needs_colour { simulation.write_with_sides(out, |_| {}) } else { simulation.write(out, |_| {}) };
    let recording = written?.into_inner();
    methods.iter().map(|method| Ok(errors_of(&recording, &truth, *method, particles)?)).collect()
}

fn errors_of(
    recording: &[u8],
    truth: &[FrameTruth],
    method: WalkerMethod,
    particles: u32,
) -> Result<MethodErrors, PipelineError> {
    let mut feet: Vec<Option<[Vector3<f64>; 2]>> = Vec::new();
    let mut watch = |_: i64, foreground: &Foreground| {
        let legs = TwoLegs::find(&foreground.points);
        feet.push(legs.map(|legs| Side::BOTH.map(|side| legs.foot(side))));
    };
    let frames = DepthReader::open(recording, &Limits::default())?;
    let track = track(frames, &method.settings(particles), &mut watch, &Monitor::default())?;
    let mut errors = Errors::default();
    for (k, truth) in truth.iter().enumerate() {
        let ankles = true_ankles(truth);
        if method == WalkerMethod::Baseline {
            if let Some(Some(feet)) = feet.get(k) {
                errors.add(truth, &ankles, feet);
            }
            continue;
        }
        let legs: Option<&Legs> = track.frames.get(k).and_then(|frame| frame.legs.as_ref());
        let Some(legs) = legs.filter(|legs| legs.lost == [false; 2]) else {
            errors.n_lost += 1;
            continue;
        };
        let found = Side::BOTH.map(|side| *legs.point(side, LegPoint::Ankle));
        errors.add(truth, &ankles, &found);
        for (side, found) in Side::BOTH.into_iter().zip(&found) {
            let point = truth.legs[side as usize].ankle.coords;
            errors.ankles.push((track.floor.sensor_from_point(found) - point).norm());
        }
    }
    Ok(errors.summary(method.name(), truth.len()))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::assessment::LegCues;
    use crate::synthetic::walker::trousers::trousers;
    use crate::synthetic::walker::{Course, WalkerSettings};

    #[test]
    fn methods_come_in_the_order_asked_for_and_only_those_with_ankles_have_their_error() {
        let settings = WalkerSettings { duration_s: 1.0, rate_hz: 6.0, ..WalkerSettings::of_seed(Course::Straight, 2) };
        let simulation = WalkerSimulation::new(&settings, trousers()).unwrap();
        let methods = [WalkerMethod::Paper(LegCues::Rgb), WalkerMethod::Baseline, WalkerMethod::Paper(LegCues::Both)];
        let found = compare(&simulation, &methods, 128).unwrap();
        let names: Vec<&str> = found.iter().map(|errors| errors.method).collect();
        assert_eq!(names, ["rgb", "baseline", "both"]);
        let has_ankles: Vec<bool> = found.iter().map(|errors| errors.ankle_m.is_some()).collect();
        assert_eq!(has_ankles, [true, false, true]);
        for errors in &found {
            assert_eq!(errors.n_frames, [6, 6], "{errors:?}");
            // Nobody's step is half a metre off, however few particles there are.
            assert!(errors.all_frames_m.iter().all(|error| (0.0..0.5).contains(error)), "{errors:?}");
        }
        // Colour sees something else than depth does.
        assert_ne!(found[0].all_frames_m, found[2].all_frames_m);
    }

    #[test]
    fn every_method_is_found_by_its_name() {
        for method in WalkerMethod::ALL {
            assert_eq!(method.name().parse(), Ok(method));
        }
        assert!("cue3".parse::<WalkerMethod>().is_err());
    }
}
