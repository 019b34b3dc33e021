//! How long and thick the legs are, from a stretch of frames.

use super::foreground::ForegroundPoint;
use super::leg_model::{POSE, SHAPE, ShapePrior, ShapeVector};
use super::tracker::{DOUBTFUL_MISFIT, HOPELESS_MISFIT, PoseMatrix, Tracker};
use nalgebra::SMatrix;

/// Rounds over the frames.
const ROUNDS: usize = 5;
/// The first rounds are made with a shape that may be far off: frames that fit badly count in them.
const FREE_ROUNDS: usize = 3;
/// Frames of one body err alike: together they count as so many.
const INDEPENDENT_FRAMES: f64 = 12.0;

/// The shape that fits a stretch of frames best, from a start and what is known of bodies.
///
/// Each frame is fitted with the shape held; its normal equations, freed of the pose (Schur complement), then say how the
/// shape should change.
pub fn calibrate<'a>(
    camera_height: f64,
    frames: impl Iterator<Item = (i64, &'a [ForegroundPoint])> + Clone,
    prior: &ShapePrior,
) -> ShapeVector {
    let mut shape = prior.mean;
    for round in 0..ROUNDS {
        let worst = if round < FREE_ROUNDS { HOPELESS_MISFIT } else { DOUBTFUL_MISFIT };
        let mut tracker = Tracker::new(camera_height, shape);
        let mut matrix = SMatrix::<f64, SHAPE, SHAPE>::zeros();
        let mut gradient = ShapeVector::zeros();
        let mut count = 0.0;
        for (time_ns, points) in frames.clone() {
            let Some((fit, system)) = tracker.advance_with(time_ns, points) else { continue };
            if fit.misfit > worst {
                continue;
            }
            let cross = system.matrix.fixed_view::<SHAPE, POSE>(POSE, 0);
            let Some(factor) = (fit.information + PoseMatrix::identity() * 1.0).cholesky() else { continue };
            let freed = cross * factor.inverse();
            matrix += system.matrix.fixed_view::<SHAPE, SHAPE>(POSE, POSE) - freed * cross.transpose();
            gradient += system.gradient.fixed_rows::<SHAPE>(POSE) - freed * system.gradient.fixed_rows::<POSE>(0);
            count += 1.0;
        }
        let scale = INDEPENDENT_FRAMES / f64::max(count, INDEPENDENT_FRAMES);
        matrix = matrix * scale + prior.information;
        gradient = gradient * scale + prior.information * (shape - prior.mean);
        let Some(factor) = matrix.cholesky() else { break };
        shape = prior.bounded(shape - factor.solve(&gradient));
    }
    shape
}
