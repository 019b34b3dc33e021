//! The default tracker: an iterated extended Kalman filter over the eight points of two legs and their velocities.
//!
//! Each frame's points pull the predicted pose towards the surfaces that they lie on ([`super::surface_fit`]); Gauss–Newton
//! steps from the prediction, with the prediction's covariance as the prior, end at the posterior mode. When the frame
//! does not fit the prediction, the pose found without a model ([`TwoLegs`]) starts a second attempt, and the better one is
//! kept.

use super::foreground::ForegroundPoint;
use super::leg_model::{LegPoint, LegSegment, POSE, PoseVector, ShapeVector, point_of, set_point};
use super::surface_fit::{NormalEquations, SEGMENTS, covered_pixels, linearise, side_and_segment};
use super::two_legs::TwoLegs;
use crate::body::Side;
use nalgebra::{SMatrix, SVector, Vector3};

/// Pose and its rate of change.
pub const STATE: usize = 2 * POSE;
/// Gauss–Newton steps per frame at most.
const STEPS: usize = 8;
/// A step shorter than this is the last, metres.
const CONVERGED: f64 = 2e-4;
/// Time in which an unseen point comes to rest before the camera, seconds.
const REST_TIME: f64 = 0.5;
/// The least time between frames that motion is predicted over, seconds.
const MIN_DT: f64 = 1e-4;
/// Spectral density of the acceleration of hip, knee, ankle and toe, m²/s³.
const ACCELERATION: [f64; 4] = [0.3, 2.0, 6.0, 8.0];
/// Standard deviation of a pose that rests on the points of one frame alone, metres.
const START_SD: f64 = 0.10;
/// Standard deviation of a velocity of which nothing is known, m/s.
const START_SPEED_SD: f64 = 1.0;
/// A frame that leaves this share of its points unexplained is compared with a fresh start.
pub(super) const DOUBTFUL_MISFIT: f64 = 0.20;
/// A fresh start is taken when it is better by this much.
const BETTER: f64 = 0.03;
/// Share of both shanks that is seen where a track has them when it is firm: what else is in the image then belongs to no leg,
/// and a fresh start would take it for one.
const FIRM_SHARE: f64 = 0.5;
/// A start that leaves more unexplained is no pair of legs.
pub(super) const HOPELESS_MISFIT: f64 = 0.55;
/// Pixels that a leg's shank and foot must have for the leg to count as seen.
const MIN_LEG_PIXELS: f64 = 250.0;
/// A leg unseen for longer is lost, seconds.
const LOST_AFTER: f64 = 0.5;

/// Covariance or information of a state.
pub type StateMatrix = SMatrix<f64, STATE, STATE>;
/// Covariance or information of a pose.
pub type PoseMatrix = SMatrix<f64, POSE, POSE>;

/// What is believed of pose and velocity.
#[derive(Debug, Clone)]
pub struct Belief {
    /// Pose and velocity in `floor`, metres and m/s.
    pub mean: SVector<f64, STATE>,
    /// Their covariance.
    pub covariance: StateMatrix,
}

/// What one frame said.
#[derive(Debug, Clone)]
pub struct FrameFit {
    /// Time of the frame, nanoseconds.
    pub time_ns: i64,
    /// Posterior given this frame and those before it.
    pub belief: Box<Belief>,
    /// Information of this frame alone about the pose (`Jᵀ W J` at `pose`), 1/m².
    pub information: PoseMatrix,
    /// The information's vector: `information · pose − gradient`.
    pub information_vector: PoseVector,
    /// Pixels that each segment explains.
    pub support: [f64; SEGMENTS],
    /// Share of the points that the pose leaves unexplained, 0 to 1.
    pub misfit: f64,
    /// True of a leg (left, right) that has not been seen for too long.
    pub lost: [bool; 2],
    /// True when the track begins anew with this frame.
    pub restarted: bool,
}

/// The tracker.
#[derive(Debug, Clone)]
pub struct Tracker {
    camera: Vector3<f64>,
    shape: ShapeVector,
    belief: Option<Belief>,
    last_time: f64,
    last_seen: [f64; 2],
}

impl Tracker {
    /// A tracker of legs of this shape before a camera at this height above the floor, metres.
    pub fn new(camera_height: f64, shape: ShapeVector) -> Self {
        let camera = Vector3::new(0.0, camera_height, 0.0);
        Self { camera, shape, belief: None, last_time: 0.0, last_seen: [0.0; 2] }
    }

    /// Takes one frame's points. `None` when there are no legs.
    pub fn advance(&mut self, time_ns: i64, points: &[ForegroundPoint]) -> Option<FrameFit> {
        self.advance_with(time_ns, points).map(|(fit, _)| fit)
    }

    /// As [`Tracker::advance`], with the normal equations for those who also want the shape.
    pub fn advance_with(&mut self, time_ns: i64, points: &[ForegroundPoint]) -> Option<(FrameFit, NormalEquations)> {
        let time = time_ns as f64 * 1e-9;
        let predicted = self.belief.as_ref().map(|belief| belief.predict(time - self.last_time));
        self.last_time = time;
        let mut best = predicted.map(|belief| (self.settle(&belief, points), belief, false));
        let doubtful =
            best.as_ref().is_none_or(|(settled, ..)| settled.system.misfit > DOUBTFUL_MISFIT && !self.is_firm(settled));
        if doubtful && let Some(start) = self.start(points) {
            let settled = self.settle(&start, points);
            let bar = best.as_ref().map_or(HOPELESS_MISFIT, |(old, ..)| old.system.misfit - BETTER);
            if settled.system.misfit < bar {
                best = Some((settled, start, true));
            }
        }
        let (settled, prior, restarted) = best?;
        if restarted {
            self.last_seen = [time; 2];
        }
        for (leg, seen) in self.last_seen.iter_mut().enumerate() {
            if settled.system.support[3 * leg + 1] + settled.system.support[3 * leg + 2] > MIN_LEG_PIXELS {
                *seen = time;
            }
        }
        let lost = self.last_seen.map(|seen| time - seen > LOST_AFTER);
        if lost == [true; 2] {
            self.belief = None;
            return None;
        }
        let belief = prior.updated(&settled.pose, &settled.covariance);
        let information = settled.system.matrix.fixed_view::<POSE, POSE>(0, 0).into_owned();
        let gradient = settled.system.gradient.fixed_rows::<POSE>(0).into_owned();
        let fit = FrameFit {
            time_ns,
            belief: Box::new(belief.clone()),
            information,
            information_vector: information * settled.pose - gradient,
            support: settled.system.support,
            misfit: settled.system.misfit,
            lost,
            restarted,
        };
        self.belief = Some(belief);
        Some((fit, settled.system))
    }

    /// The posterior mode of a frame from a prior belief.
    fn settle(&self, prior: &Belief, points: &[ForegroundPoint]) -> Settled {
        let prior_pose = prior.mean.fixed_rows::<POSE>(0).into_owned();
        let prior_information = inverse(&prior.covariance.fixed_view::<POSE, POSE>(0, 0).into_owned());
        let mut pose = prior_pose;
        let mut system = self.system(points, &pose);
        let mut total = prior_information;
        for _ in 0..STEPS {
            total = prior_information + system.matrix.fixed_view::<POSE, POSE>(0, 0);
            let gradient = system.gradient.fixed_rows::<POSE>(0) + prior_information * (pose - prior_pose);
            let Some(factor) = total.cholesky() else { break };
            let step = -factor.solve(&gradient);
            let longest = step.amax();
            // Associations change by a step: none is longer than what they hold for.
            pose += step * (0.08 / longest.max(0.08));
            system = self.system(points, &pose);
            if longest < CONVERGED {
                break;
            }
        }
        Settled { pose, covariance: inverse(&total), system }
    }

    /// True when both shanks are seen where the track has them.
    fn is_firm(&self, settled: &Settled) -> bool {
        Side::BOTH.into_iter().all(|side| {
            let shank = 3 * side as usize + LegSegment::Shank as usize;
            let share = seen_share(&settled.pose, &settled.system.support, &self.shape, shank, &self.camera);
            share >= FIRM_SHARE
        })
    }

    fn system(&self, points: &[ForegroundPoint], pose: &PoseVector) -> NormalEquations {
        let mut system = linearise(points, &self.camera, pose, &self.shape);
        system.add_body(pose, &self.shape);
        system
    }

    /// A belief that rests on one frame's points alone.
    fn start(&self, points: &[ForegroundPoint]) -> Option<Belief> {
        let legs = TwoLegs::find(points)?;
        let mut mean = SVector::<f64, STATE>::zeros();
        let mut pose = PoseVector::zeros();
        for side in Side::BOTH {
            let upright = upright_leg(&legs.points[side as usize], &self.camera, &self.shape);
            for (point, position) in LegPoint::ALL.into_iter().zip(upright) {
                set_point(&mut pose, side, point, &position);
            }
        }
        mean.fixed_rows_mut::<POSE>(0).copy_from(&pose);
        let mut covariance = StateMatrix::zeros();
        for k in 0..POSE {
            covariance[(k, k)] = START_SD * START_SD;
            covariance[(POSE + k, POSE + k)] = START_SPEED_SD * START_SPEED_SD;
        }
        Some(Belief { mean, covariance })
    }
}

struct Settled {
    pose: PoseVector,
    covariance: PoseMatrix,
    system: NormalEquations,
}

impl Belief {
    /// The belief `dt` seconds later: velocities decay, accelerations are white.
    pub(super) fn predict(&self, dt: f64) -> Self {
        let dt = dt.max(MIN_DT);
        let decay = (-dt / REST_TIME).exp();
        let mut mean = self.mean;
        let mut covariance = self.covariance;
        let reach = REST_TIME * (1.0 - decay);
        for k in 0..POSE {
            mean[k] += reach * mean[POSE + k];
            mean[POSE + k] *= decay;
        }
        // F P Fᵀ with F = [I reach; 0 decay], by blocks.
        let pp = covariance.fixed_view::<POSE, POSE>(0, 0).into_owned();
        let pv = covariance.fixed_view::<POSE, POSE>(0, POSE).into_owned();
        let vv = covariance.fixed_view::<POSE, POSE>(POSE, POSE).into_owned();
        let new_pv = (pv + vv * reach) * decay;
        covariance
            .fixed_view_mut::<POSE, POSE>(0, 0)
            .copy_from(&(pp + (pv + pv.transpose()) * reach + vv * (reach * reach)));
        covariance.fixed_view_mut::<POSE, POSE>(0, POSE).copy_from(&new_pv);
        covariance.fixed_view_mut::<POSE, POSE>(POSE, 0).copy_from(&new_pv.transpose());
        covariance.fixed_view_mut::<POSE, POSE>(POSE, POSE).copy_from(&(vv * (decay * decay)));
        for k in 0..POSE {
            let density = ACCELERATION[(k / 3) % 4];
            covariance[(k, k)] += density * dt.powi(3) / 3.0;
            covariance[(k, POSE + k)] += density * dt * dt / 2.0;
            covariance[(POSE + k, k)] += density * dt * dt / 2.0;
            covariance[(POSE + k, POSE + k)] += density * dt;
        }
        Self { mean, covariance }
    }

    /// The belief after a frame that told the pose: velocities follow by their correlation with it.
    pub(super) fn updated(&self, pose: &PoseVector, covariance: &PoseMatrix) -> Self {
        let pp = self.covariance.fixed_view::<POSE, POSE>(0, 0).into_owned();
        let vp = self.covariance.fixed_view::<POSE, POSE>(POSE, 0).into_owned();
        let vv = self.covariance.fixed_view::<POSE, POSE>(POSE, POSE).into_owned();
        let gain = vp * inverse(&pp);
        let mut mean = self.mean;
        let shift = pose - mean.fixed_rows::<POSE>(0);
        mean.fixed_rows_mut::<POSE>(0).copy_from(pose);
        let velocity = mean.fixed_rows::<POSE>(POSE) + gain * shift;
        mean.fixed_rows_mut::<POSE>(POSE).copy_from(&velocity);
        let new_vp = gain * covariance;
        let new_vv = vv - gain * (pp - covariance) * gain.transpose();
        let mut joint = StateMatrix::zeros();
        joint.fixed_view_mut::<POSE, POSE>(0, 0).copy_from(covariance);
        joint.fixed_view_mut::<POSE, POSE>(POSE, 0).copy_from(&new_vp);
        joint.fixed_view_mut::<POSE, POSE>(0, POSE).copy_from(&new_vp.transpose());
        joint.fixed_view_mut::<POSE, POSE>(POSE, POSE).copy_from(&((new_vv + new_vv.transpose()) * 0.5));
        Self { mean, covariance: joint }
    }

    /// The belief given all later frames, from the next frame's prediction and its own smoothed belief.
    pub(super) fn smoothed(&self, predicted: &Self, next: &Self, dt: f64) -> Self {
        let decay = (-dt.max(MIN_DT) / REST_TIME).exp();
        let reach = REST_TIME * (1.0 - decay);
        // P Fᵀ with F = [I reach; 0 decay].
        let mut cross = self.covariance;
        for k in 0..POSE {
            for r in 0..STATE {
                let (position, velocity) = (self.covariance[(r, k)], self.covariance[(r, POSE + k)]);
                cross[(r, k)] = position + reach * velocity;
                cross[(r, POSE + k)] = decay * velocity;
            }
        }
        let Some(factor) = predicted.covariance.cholesky() else { return self.clone() };
        let gain = factor.solve(&cross.transpose()).transpose();
        let mean = self.mean + gain * (next.mean - predicted.mean);
        let covariance = self.covariance + gain * (next.covariance - predicted.covariance) * gain.transpose();
        Self { mean, covariance: (covariance + covariance.transpose()) * 0.5 }
    }

    /// The pose.
    pub fn pose(&self) -> PoseVector {
        self.mean.fixed_rows::<POSE>(0).into_owned()
    }

    /// The pose's covariance, m².
    pub fn pose_covariance(&self) -> PoseMatrix {
        self.covariance.fixed_view::<POSE, POSE>(0, 0).into_owned()
    }
}

pub(super) fn inverse(matrix: &PoseMatrix) -> PoseMatrix {
    matrix.cholesky().map_or_else(PoseMatrix::identity, |factor| factor.inverse())
}

/// Hip, knee, ankle and toe of an upright leg behind these points of its lower part.
fn upright_leg(points: &[ForegroundPoint], camera: &Vector3<f64>, shape: &ShapeVector) -> [Vector3<f64>; 4] {
    /// Where the ankle's centre is above the floor, metres.
    const ANKLE_HEIGHT: f64 = 0.08;
    const TOE_HEIGHT: f64 = 0.04;
    let shank: Vec<&ForegroundPoint> = points.iter().filter(|p| p.position.y > 0.15).collect();
    let used: Vec<&ForegroundPoint> = if shank.len() > 8 { shank } else { points.iter().collect() };
    let count = used.len() as f64;
    let surface = used.iter().map(|p| p.position).sum::<Vector3<f64>>() / count;
    let mut behind = surface - camera;
    behind.y = 0.0;
    let centre = surface + behind.normalize() * 0.8 * shape[5];
    let at = |height: f64, forward: f64| Vector3::new(centre.x, height, centre.z + forward);
    let knee = ANKLE_HEIGHT + shape[1];
    [at(knee + shape[0], -0.05), at(knee, 0.0), at(ANKLE_HEIGHT, -0.02), at(TOE_HEIGHT, shape[2] - 0.02)]
}

/// How much of a segment that faces the camera was seen, 0 to 1: the pixels it explains of those it would cover.
pub fn visibility(fit: &FrameFit, shape: &ShapeVector, side: Side, segment: LegSegment, camera_height: f64) -> f64 {
    let camera = Vector3::new(0.0, camera_height, 0.0);
    let place = 3 * side as usize + segment as usize;
    seen_share(&fit.belief.pose(), &fit.support, shape, place, &camera)
}

fn seen_share(
    pose: &PoseVector,
    support: &[f64; SEGMENTS],
    shape: &ShapeVector,
    place: usize,
    camera: &Vector3<f64>,
) -> f64 {
    let (side, segment) = side_and_segment(place);
    let [start, end] = [segment.start(), segment.end()].map(|point| point_of(pose, side, point));
    let (_, [first, last]) = segment.shape_indices();
    let covered = covered_pixels(camera, [&start, &end], shape[first] + shape[last]);
    (support[place] / covered).min(1.0)
}
