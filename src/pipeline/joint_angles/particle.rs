//! The paper's method: prior as the proposal, multinomial resampling at every frame, mean as the estimate (\[angles\]).

use super::calibration::Calibration;
use super::inverse_kinematics::pose_from_points;
use super::noise_model::NoiseModel;
use super::observation::Observations;
use super::particle_model::SkeletonParticleModel;
use super::posterior::{PoseCovariance, Posterior, error_covariance};
use crate::assessment::quality::EffectiveSampleSize;
use crate::body::Pose;
use crate::body::pose::PoseVector;
use crate::body::range_of_motion::RangeOfMotion;
use crate::estimation::particle_filter::ParticleFilter;
use crate::geometry::lanes::LANES;
use crate::pipeline::PipelineError;
use crate::progress::{Monitor, Step};

/// Runs the filter over a recording and hands each frame's posterior to `emit`. The paper starts all particles in the
/// calibration posture; here that is the first frame's posture by closed geometry, whatever the posture is.
///
/// # Errors
/// [`PipelineError::Cancelled`].
pub fn run(
    observations: &Observations,
    calibration: &Calibration,
    noise: NoiseModel,
    particles: u32,
    seed: u64,
    monitor: &Monitor,
    mut emit: impl FnMut(&Posterior),
) -> Result<EffectiveSampleSize, PipelineError> {
    monitor.begin(Step::Estimating, observations.len() as u64)?;
    let mut model = SkeletonParticleModel::new(&calibration.skeleton, noise, &observations.subject_from_world);
    let first =
        (0..observations.len()).find(|t| observations.seen(*t).count_ones() as usize == crate::body::POINT_COUNT);
    let start = first.map_or_else(Pose::reference, |t| {
        pose_from_points(&calibration.skeleton, &observations.points[t], &Pose::reference())
    });
    let initial = RangeOfMotion::healthy_adult().clamp(&start.to_vector(&PoseVector::zeros()));
    let count = (particles as usize).next_multiple_of(LANES);
    let mut filter = ParticleFilter::new(initial.as_slice(), count, seed);
    let mut sizes = Vec::with_capacity(observations.len());
    for t in 0..observations.len() {
        let seen = observations.seen(t);
        let observation = (seen != 0).then_some(&observations.points[t]);
        let moments = filter.step(&mut model, observations.interval_s(t), observation);
        sizes.push(moments.effective_sample_size);
        let mean = PoseVector::from_iterator(moments.mean.iter().copied());
        let covariance = PoseCovariance::from_iterator(moments.covariance.iter().copied());
        emit(&Posterior {
            pose: Pose::from_vector(&mean),
            covariance: Some(error_covariance(&mean, &covariance)),
            seen,
            limb_flags: [0; 4],
        });
        monitor.advance(1)?;
    }
    Ok(EffectiveSampleSize::of_frames(count as u32, sizes))
}
