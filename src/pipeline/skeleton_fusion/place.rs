//! Where the fused skeleton stands: the torso joint and each limb's root over time.
//!
//! Units say nothing of places, so these are the camera's. Bones turned by units need not end where the camera saw their
//! joints; each limb is therefore moved as a whole towards the points that the camera sees of it. Lengths stay constant.

use super::camera::CameraBody;
use crate::body::kinematics::{Points, forward_kinematics};
use crate::body::skeleton::point_index;
use crate::body::{Limb, Pose};
use crate::estimation::rate_smoother::{RateFilter, RateHistory, RateModel, RateSettings};
use nalgebra::{Matrix3, Vector3};

/// Spectral density of the acceleration of the torso and of a limb's displacement, m²/s³: a jump's 10 m/s² for a tenth of
/// a second, and a displacement that follows the posture.
const TORSO_DENSITY: f64 = 10.0;
const LIMB_DENSITY: f64 = 0.5;
/// Least error of a point from frame to frame, metres.
const LEAST_SD: f64 = 0.002;
/// Standard deviation of a limb's displacement against the trunk, metres: the offset of the camera's hips and shoulders.
const LIMB_SD: f64 = 0.06;
/// Standard deviation of one frame's evidence for it, metres: the posture's offset of a camera.
const LIMB_NOISE: f64 = 0.025;
/// Weights of a limb's root, middle and end. Units turn bones away from where the camera has them, and lengths are constant:
/// not all three points can stay where they were seen. The knee (or elbow) stays, which belongs to both bones; the root lies
/// inside the body, where no camera sees it, and the end is the farthest.
const POINT_WEIGHTS: [f64; 3] = [1.0, 5.0, 1.0];

/// A place over time, smoothed over the camera's frames.
#[derive(Debug, Clone, PartialEq)]
struct PlaceTrack {
    /// Place (metres), velocity (m/s) and standard deviation (metres) at each frame.
    frames: Vec<(Vector3<f64>, Vector3<f64>, f64)>,
}

/// A place that is seen, with the standard deviation of each coordinate.
type Seen = Option<(Vector3<f64>, f64)>;

struct PlaceModel {
    density: f64,
}

impl RateModel<3> for PlaceModel {
    type Posture = Vector3<f64>;
    type Observation = Seen;

    fn moved(&self, place: &Vector3<f64>, step: &Vector3<f64>) -> Vector3<f64> {
        place + step
    }

    fn step_between(&self, from: &Vector3<f64>, to: &Vector3<f64>) -> Vector3<f64> {
        to - from
    }

    fn information(&self, seen: &Seen, place: &Vector3<f64>) -> (Matrix3<f64>, Vector3<f64>) {
        seen.map_or((Matrix3::zeros(), Vector3::zeros()), |(point, sd)| {
            let precision = sd.powi(-2);
            (Matrix3::identity() * precision, (point - place) * precision)
        })
    }

    fn acceleration_density(&self) -> Vector3<f64> {
        Vector3::repeat(self.density)
    }
}

impl PlaceTrack {
    fn of(time_ns: &[i64], seen: &[Seen], density: f64, initial_sd: f64) -> Self {
        let model = PlaceModel { density };
        let first = seen.iter().find_map(|s| s.map(|(point, _)| point)).unwrap_or_default();
        let settings = RateSettings { rate_decay_s: 0.7, initial_sd, initial_rate_sd: 1.0, iterations: 1 };
        let mut filter = RateFilter::new(first, settings);
        let mut history = RateHistory::with_capacity(seen.len());
        for (t, seen) in seen.iter().enumerate() {
            let interval_s = if t == 0 { 0.0 } else { (time_ns[t] - time_ns[t - 1]) as f64 * 1e-9 };
            filter.step(&model, seen, interval_s);
            history.push(&filter);
        }
        let mut frames = Vec::with_capacity(seen.len());
        history.smooth(&model, |e| frames.push((e.posture, e.rate, (e.covariance.trace() / 3.0).max(0.0).sqrt())));
        frames.reverse();
        Self { frames }
    }

    /// Place and standard deviation between two frames, by the cubic that has both velocities; constant outside.
    fn between(&self, before: usize, after: usize, share: f64, seconds: f64) -> (Vector3<f64>, f64) {
        let ((p0, v0, sd0), (p1, v1, sd1)) = (self.frames[before], self.frames[after]);
        let s = share;
        let (s2, s3) = (s * s, s * s * s);
        let place = p0 * (2.0 * s3 - 3.0 * s2 + 1.0)
            + v0 * (seconds * (s3 - 2.0 * s2 + s))
            + p1 * (3.0 * s2 - 2.0 * s3)
            + v1 * (seconds * (s3 - s2));
        (place, sd0 + (sd1 - sd0) * s)
    }
}

/// Places of torso and limbs, in `subject` up to the camera's origin.
#[derive(Debug, Clone, PartialEq)]
pub struct Places {
    time_ns: Vec<i64>,
    torso: PlaceTrack,
    limbs: [PlaceTrack; 4],
    /// Offset of the camera that smoothing does not take away, metres.
    offset_sd: f64,
}

impl Places {
    /// From the camera's frames; `pose` is the fused posture at a time.
    pub fn of(camera: &CameraBody, pose: impl Fn(i64) -> Pose) -> Self {
        let observations = &camera.observations;
        let white = camera.noise.white.iter().map(|sd| sd.amax()).fold(LEAST_SD, f64::max);
        let seen: Vec<Seen> = camera.torso.iter().map(|p| p.x.is_finite().then_some((*p, white))).collect();
        let mut displacements: [Vec<Seen>; 4] = std::array::from_fn(|_| Vec::with_capacity(observations.len()));
        for (time_ns, points) in observations.time_ns.iter().zip(&observations.points) {
            let own = forward_kinematics(camera.skeleton(), &pose(*time_ns));
            for limb in Limb::ALL {
                displacements[limb.index()].push(displacement(points, &own, limb));
            }
        }
        let limbs = displacements.map(|seen| PlaceTrack::of(&observations.time_ns, &seen, LIMB_DENSITY, LIMB_SD));
        Self {
            torso: PlaceTrack::of(&observations.time_ns, &seen, TORSO_DENSITY, 1.0),
            limbs,
            time_ns: observations.time_ns.clone(),
            offset_sd: camera.noise.slow_offset,
        }
    }

    /// The torso joint and the twelve points at a time for a posture, in `subject` up to the camera's origin, metres, and
    /// the standard deviation of each coordinate.
    pub fn at(&self, time_ns: i64, own: &Points) -> (Vector3<f64>, Points, f64) {
        let after = self.time_ns.partition_point(|t| *t < time_ns).min(self.time_ns.len() - 1);
        let before = after.saturating_sub(1);
        let seconds = (self.time_ns[after] - self.time_ns[before]).max(1) as f64 * 1e-9;
        let share = ((time_ns - self.time_ns[before]) as f64 * 1e-9 / seconds).clamp(0.0, 1.0);
        let (torso, sd) = self.torso.between(before, after, share, seconds);
        let mut points = *own;
        for limb in Limb::ALL {
            let (moved, _) = self.limbs[limb.index()].between(before, after, share, seconds);
            for level in 0..3 {
                points[point_index(limb, level)] += torso + moved;
            }
        }
        (torso, points, sd.hypot(self.offset_sd))
    }
}

/// How far the camera sees a limb from where the posture has it: the weighted mean over its points, drawn towards zero by
/// what is known of hips and shoulders. None where no point is seen.
fn displacement(seen: &Points, own: &Points, limb: Limb) -> Seen {
    let residual = |level: usize| seen[point_index(limb, level)] - own[point_index(limb, level)];
    let residuals = POINT_WEIGHTS.iter().enumerate().map(|(level, weight)| (residual(level), *weight));
    let residuals = residuals.filter(|(residual, _)| residual.x.is_finite());
    let (sum, weight) =
        residuals.fold((Vector3::zeros(), 0.0), |(sum, total), (residual, w)| (sum + residual * w, total + w));
    if weight == 0.0 {
        return None;
    }
    let share = LIMB_SD.powi(2) / (LIMB_SD.powi(2) + LIMB_NOISE.powi(2) / weight);
    Some((sum / weight * share, LIMB_NOISE))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::body::Skeleton;

    #[test]
    fn a_limb_is_moved_towards_where_the_camera_sees_it_as_a_whole() {
        let own = forward_kinematics(&Skeleton::of_stature(1.7), &Pose::reference());
        let aside = Vector3::new(0.0, 0.0, 0.05);
        let mut seen = own;
        for level in 0..3 {
            seen[point_index(Limb::LeftLeg, level)] += aside;
        }
        let (moved, _) = displacement(&seen, &own, Limb::LeftLeg).unwrap();
        assert!(moved.z > 0.8 * aside.z && moved.z < aside.z && moved.xy().norm() < 1e-12, "{moved}");
        assert!(displacement(&seen, &own, Limb::RightLeg).unwrap().0.norm() < 1e-12);
        seen.fill(Vector3::repeat(f64::NAN));
        assert_eq!(displacement(&seen, &own, Limb::LeftLeg), None);
    }

    #[test]
    fn a_place_between_frames_lies_on_a_smooth_course_and_a_gap_is_bridged_with_growing_uncertainty() {
        let time_ns: Vec<i64> = (0..90).map(|i| i * 33_333_333).collect();
        let course = |t: f64| Vector3::new(t.sin(), 0.9, 2.0 * t);
        let at = |i: usize| course(time_ns[i] as f64 * 1e-9);
        let seen: Vec<Seen> = (0..90).map(|i| (!(40..50).contains(&i)).then(|| (at(i), LEAST_SD))).collect();
        let track = PlaceTrack::of(&time_ns, &seen, TORSO_DENSITY, 1.0);
        let (between, sd) = track.between(20, 21, 0.5, 0.033_333_333);
        assert!((between - course(20.5 * 0.033_333_333)).norm() < 0.002, "{between}");
        // A third of a second without a frame: 10 m/s² for that time would be 0.1 m and more.
        let (bridged, bridged_sd) = track.between(44, 45, 0.5, 0.033_333_333);
        assert!((bridged - course(44.5 * 0.033_333_333)).norm() < 0.05, "{bridged}");
        assert!(bridged_sd > 3.0 * sd);
    }
}
