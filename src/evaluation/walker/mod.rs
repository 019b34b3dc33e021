//! Tracked legs beside the truth of simulated walks, and beside the baseline.

pub mod comparison;
pub mod method;
pub mod scores;
pub mod sequences;

use crate::geometry::camera::Intrinsics;
use crate::pipeline::leg_pose::DepthFrames;
use crate::recording::DecodeError;
use crate::recording::depth::DepthImage;
use crate::synthetic::walker::{FrameTruth, WalkerFrame, WalkerSimulation};
use nalgebra::Vector3;

/// Errors of one method on one sequence, over the frames with both feet on the floor unless said otherwise.
#[derive(Debug, Clone, PartialEq)]
pub struct MethodErrors {
    /// `baseline` or the mode of the tracker.
    pub method: &'static str,
    /// Frames of the sequence that have an estimate, and all.
    pub n_frames: [usize; 2],
    /// Step length in floor axes: mean absolute error and its standard deviation, metres.
    pub length_m: [f64; 2],
    /// Step width in floor axes: the same.
    pub width_m: [f64; 2],
    /// The same two over all frames: mean absolute errors, metres.
    pub all_frames_m: [f64; 2],
    /// Mean distance of the ankles from the true ones, metres; none of a method without ankles.
    pub ankle_m: Option<f64>,
    /// Frames in which a leg was lost.
    pub n_lost: usize,
}

/// The ankles on axes of the floor as the truth has them: right in the image, up, towards the camera.
fn true_ankles(truth: &FrameTruth) -> [Vector3<f64>; 2] {
    let up = truth.floor_normal;
    let towards = -(Vector3::z() - up * up.z).normalize();
    let right = up.cross(&towards);
    [0, 1].map(|side| {
        let point = truth.legs[side].ankle.coords;
        Vector3::new(point.dot(&right), point.dot(&up), point.dot(&towards))
    })
}

#[derive(Default)]
struct Errors {
    double: [Vec<f64>; 2],
    all: [Vec<f64>; 2],
    ankles: Vec<f64>,
    n_lost: usize,
}

impl Errors {
    fn add(&mut self, truth: &FrameTruth, ankles: &[Vector3<f64>; 2], found: &[Vector3<f64>; 2]) {
        let [true_between, between] = [ankles[0] - ankles[1], found[0] - found[1]];
        for (measure, axis) in [2, 0].into_iter().enumerate() {
            let error = (between[axis].abs() - true_between[axis].abs()).abs();
            self.all[measure].push(error);
            if truth.contacts == [true; 2] {
                self.double[measure].push(error);
            }
        }
    }

    fn summary(self, method: &'static str, n_frames: usize) -> MethodErrors {
        let [length_m, width_m] = self.double.each_ref().map(|errors| mean_and_deviation(errors));
        MethodErrors {
            method,
            n_frames: [self.all[0].len(), n_frames],
            length_m,
            width_m,
            all_frames_m: self.all.each_ref().map(|errors| mean_and_deviation(errors)[0]),
            ankle_m: (!self.ankles.is_empty()).then(|| mean_and_deviation(&self.ankles)[0]),
            n_lost: self.n_lost,
        }
    }
}

fn mean_and_deviation(values: &[f64]) -> [f64; 2] {
    let n = values.len().max(1) as f64;
    let mean = values.iter().sum::<f64>() / n;
    [mean, (values.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / (n - 1.0).max(1.0)).sqrt()]
}

/// The images of a simulated walk, rendered as they are asked for.
struct SimulatedFrames<'a> {
    frames: Box<dyn Iterator<Item = WalkerFrame> + 'a>,
    background: Option<DepthImage>,
    camera: Intrinsics,
}

impl<'a> SimulatedFrames<'a> {
    fn new(simulation: &'a WalkerSimulation) -> Self {
        Self {
            frames: Box::new(simulation.frames()),
            background: Some(simulation.background()),
            camera: *simulation.intrinsics(),
        }
    }
}

impl DepthFrames for SimulatedFrames<'_> {
    fn next_into(&mut self, image: &mut DepthImage) -> Result<Option<i64>, DecodeError> {
        Ok(self.frames.next().map(|frame| {
            *image = frame.image;
            frame.truth.time_ns
        }))
    }

    fn intrinsics(&self) -> Option<Intrinsics> {
        Some(self.camera)
    }

    fn background(&self) -> Option<&DepthImage> {
        self.background.as_ref()
    }
}
