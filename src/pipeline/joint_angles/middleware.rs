//! The `nite` baseline: the middleware's own rotations, with 180° axial flips undone (\[angles\]).
//!
//! Middlewares disagree about which joint carries a segment's rotation and how its axes lie. Neither is assumed. Of
//! the candidate joints the one whose axes keep the segment's direction most constant is taken, and one constant
//! rotation per segment ties its axes to the model's: the mean over the calibration frames of the difference to closed
//! geometry. A flip is a frame-to-frame turn of more than 90° that half a turn about the long axis brings below 90°;
//! that half turn is taken back from there on.

use super::calibration::Calibration;
use super::inverse_kinematics::pose_from_points;
use super::observation::{Observations, seen_mask, sees_limb, sees_trunk};
use super::posterior::Posterior;
use crate::assessment::series::{FLAG_BRIDGED, FLAG_FLIP_CORRECTED};
use crate::body::skeleton::point_index;
use crate::body::{Joint, Limb, POINT_COUNT, Pose};
use crate::pipeline::PipelineError;
use crate::progress::{Monitor, Step};
use crate::recording::SkeletonRecording;
use nalgebra::{Matrix3, Rotation3, Unit, UnitQuaternion, Vector3};
use std::f64::consts::{FRAC_PI_2, PI};

/// Segments with a rotation of their own: the trunk, then the proximal and the distal segment of each limb.
const SEGMENT_COUNT: usize = 9;

/// Runs the baseline over a recording; `emit` gets the frames in order.
///
/// # Errors
/// `no_orientations` when the recording has none for a segment that joint angles need.
pub fn run(
    recording: &SkeletonRecording,
    observations: &Observations,
    calibration: &Calibration,
    monitor: &Monitor,
    mut emit: impl FnMut(&Posterior),
) -> Result<(), PipelineError> {
    monitor.begin(Step::Estimating, observations.len() as u64)?;
    let closed = closed_geometry(observations, calibration);
    let segments = (0..SEGMENT_COUNT)
        .map(|segment| SegmentRotations::new(recording, observations, &closed, segment))
        .collect::<Result<Vec<_>, _>>()?;
    for t in 0..observations.len() {
        emit(&posterior(&segments, observations, t));
        monitor.advance(1)?;
    }
    Ok(())
}

/// Postures by closed geometry, `None` where a frame does not show the whole body.
fn closed_geometry(observations: &Observations, calibration: &Calibration) -> Vec<Option<Pose>> {
    let complete = |points: &[Vector3<f64>; POINT_COUNT]| {
        let mask = seen_mask(points);
        sees_trunk(mask) && Limb::ALL.iter().all(|limb| sees_limb(mask, *limb))
    };
    let pose = |points| pose_from_points(&calibration.skeleton, points, &Pose::reference());
    observations.points.iter().map(|points| complete(points).then(|| pose(points))).collect()
}

/// `subject_from_segment` of one segment in every frame.
struct SegmentRotations {
    rotations: Vec<Rotation3<f64>>,
    flags: Vec<u8>,
}

impl SegmentRotations {
    fn new(
        recording: &SkeletonRecording,
        observations: &Observations,
        closed: &[Option<Pose>],
        segment: usize,
    ) -> Result<Self, PipelineError> {
        let candidates = candidate_joints(segment);
        let best = candidates
            .iter()
            .filter_map(|joint| recording.column(*joint))
            .filter_map(|column| {
                let rotations = rotations_of(recording, observations, column);
                let axis = long_axis(&rotations, observations, segment)?;
                Some((rotations, axis))
            })
            .max_by(|a, b| a.1.norm().total_cmp(&b.1.norm()));
        let Some((rotations, axis)) = best else {
            let names: Vec<&str> = candidates.iter().map(|joint| joint.name()).collect();
            let sentence = format!(
                "the `nite` method uses the middleware's own rotations, and the recording has none for {}; record \
                 orientations or choose another method",
                names.join(" or ")
            );
            return Err(PipelineError::unsuitable("no_orientations", sentence));
        };
        let (mut rotations, flags) = without_flips(&rotations, &Unit::new_normalize(axis));
        let alignment = alignment(&rotations, closed, segment);
        for rotation in &mut rotations {
            *rotation *= alignment;
        }
        Ok(Self { rotations, flags })
    }
}

/// Joints that may carry a segment's rotation: where it begins and where it ends.
fn candidate_joints(segment: usize) -> Vec<Joint> {
    if segment == 0 {
        return vec![Joint::Torso, Joint::SpineShoulder, Joint::Pelvis];
    }
    let (limb, distal) = limb_segment(segment);
    let joints = limb.joints();
    let (start, end) = (joints[distal], joints[distal + 1]);
    vec![start.0, end.0, end.1]
}

/// Limb of a segment, and 0 for its proximal or 1 for its distal segment.
fn limb_segment(segment: usize) -> (Limb, usize) {
    (Limb::ALL[(segment - 1) / 2], (segment - 1) % 2)
}

/// Direction of a segment in `subject`, from its points.
fn direction(points: &[Vector3<f64>; POINT_COUNT], segment: usize) -> Vector3<f64> {
    if segment == 0 {
        let at = |limb| points[point_index(limb, 0)];
        return at(Limb::LeftArm) + at(Limb::RightArm) - at(Limb::LeftLeg) - at(Limb::RightLeg);
    }
    let (limb, distal) = limb_segment(segment);
    points[point_index(limb, distal + 1)] - points[point_index(limb, distal)]
}

/// The recorded rotations of a joint in `subject`.
fn rotations_of(
    recording: &SkeletonRecording,
    observations: &Observations,
    column: usize,
) -> Vec<Option<Rotation3<f64>>> {
    let n = recording.joints.len();
    (0..recording.len())
        .map(|t| {
            let quaternion = recording.orientations.get(t * n + column)?.as_ref()?;
            Some(observations.subject_from_world * quaternion.to_rotation_matrix())
        })
        .collect()
}

/// Mean direction of the segment in the joint's own axes; its length (0 to 1) says how constant it is. A flip turns
/// about this very axis and leaves it where it is.
fn long_axis(
    rotations: &[Option<Rotation3<f64>>],
    observations: &Observations,
    segment: usize,
) -> Option<Vector3<f64>> {
    let mut sum = Vector3::zeros();
    let mut count = 0;
    for (rotation, points) in rotations.iter().zip(&observations.points) {
        // A missing point makes the direction NaN, whose norm is neither small nor large.
        let direction = direction(points, segment);
        if let (Some(rotation), Some(direction)) = (rotation, direction.try_normalize(1e-6))
            && direction.x.is_finite()
        {
            sum += rotation.inverse() * direction;
            count += 1;
        }
    }
    let mean = sum / f64::from(count.max(1));
    (mean.norm() > 1e-6).then_some(mean)
}

/// The rotations with flips taken back and gaps held, and the flags of each frame.
fn without_flips(rotations: &[Option<Rotation3<f64>>], axis: &Unit<Vector3<f64>>) -> (Vec<Rotation3<f64>>, Vec<u8>) {
    let half_turn = Rotation3::from_axis_angle(axis, PI);
    let first = rotations.iter().flatten().next().copied().unwrap_or_else(Rotation3::identity);
    let mut previous = first;
    let mut is_flipped = false;
    let mut kept = Vec::with_capacity(rotations.len());
    let mut flags = Vec::with_capacity(rotations.len());
    for rotation in rotations {
        let mut flag = if rotation.is_none() { FLAG_BRIDGED } else { 0 };
        if let Some(rotation) = rotation {
            let mut current = if is_flipped { rotation * half_turn } else { *rotation };
            let turned_back = current * half_turn;
            if previous.angle_to(&current) > FRAC_PI_2 && previous.angle_to(&turned_back) < FRAC_PI_2 {
                is_flipped = !is_flipped;
                current = turned_back;
            }
            previous = current;
        }
        if is_flipped {
            flag |= FLAG_FLIP_CORRECTED;
        }
        kept.push(previous);
        flags.push(flag);
    }
    (kept, flags)
}

/// The constant rotation that best turns the middleware's axes of a segment into the model's (chordal mean).
fn alignment(rotations: &[Rotation3<f64>], closed: &[Option<Pose>], segment: usize) -> Rotation3<f64> {
    let mut sum = Matrix3::zeros();
    for (rotation, pose) in rotations.iter().zip(closed) {
        if let Some(pose) = pose {
            sum += (rotation.inverse() * segment_rotation(pose, segment)).matrix();
        }
    }
    let svd = sum.svd(true, true);
    match (svd.u, svd.v_t) {
        (Some(u), Some(v_t)) => {
            let sign = (u * v_t).determinant().signum();
            let rotation = u * Matrix3::from_diagonal(&Vector3::new(1.0, 1.0, sign)) * v_t;
            Rotation3::from_matrix_unchecked(rotation)
        }
        _ => Rotation3::identity(),
    }
}

/// `subject_from_segment` of a posture; the axes of every segment are those of the trunk in the T-posture.
fn segment_rotation(pose: &Pose, segment: usize) -> Rotation3<f64> {
    if segment == 0 {
        return pose.trunk;
    }
    let (limb, distal) = limb_segment(segment);
    let proximal = pose.trunk * pose.limbs[limb.index()];
    if distal == 0 {
        return proximal;
    }
    let hinge = Unit::new_normalize(limb.hinge_axis());
    proximal * Rotation3::from_axis_angle(&hinge, pose.hinges[limb.index()])
}

fn posterior(segments: &[SegmentRotations], observations: &Observations, t: usize) -> Posterior {
    let trunk = segments[0].rotations[t];
    let mut pose = Pose { trunk, ..Pose::reference() };
    let mut limb_flags = [segments[0].flags[t]; 4];
    for limb in Limb::ALL {
        let i = limb.index();
        let (proximal, distal) = (&segments[1 + 2 * i], &segments[2 + 2 * i]);
        pose.limbs[i] = trunk.inverse() * proximal.rotations[t];
        let bend = UnitQuaternion::from_rotation_matrix(&(proximal.rotations[t].inverse() * distal.rotations[t]));
        let angle = 2.0 * bend.imag().dot(&limb.hinge_axis()).atan2(bend.w);
        pose.hinges[i] = angle - 2.0 * PI * (angle / (2.0 * PI)).round();
        limb_flags[i] |= proximal.flags[t] | distal.flags[t];
    }
    Posterior { pose, covariance: None, seen: observations.seen(t), limb_flags }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_flip_about_the_long_axis_is_taken_back_and_flagged_until_it_ends() {
        let axis = Vector3::y_axis();
        let slow = |t: usize| Rotation3::from_axis_angle(&Vector3::x_axis(), 0.02 * t as f64);
        let flip = Rotation3::from_axis_angle(&axis, PI);
        let recorded: Vec<_> =
            (0..30).map(|t| Some(if (10..20).contains(&t) { slow(t) * flip } else { slow(t) })).collect();
        let (kept, flags) = without_flips(&recorded, &axis);
        for (t, rotation) in kept.iter().enumerate() {
            assert!(rotation.angle_to(&slow(t)) < 1e-9, "frame {t}");
            assert_eq!(flags[t] == FLAG_FLIP_CORRECTED, (10..20).contains(&t), "frame {t}");
        }
    }

    #[test]
    fn a_fast_turn_about_another_axis_is_not_taken_for_a_flip() {
        let axis = Vector3::y_axis();
        let recorded = vec![Some(Rotation3::identity()), Some(Rotation3::from_axis_angle(&Vector3::x_axis(), 2.0))];
        let (kept, flags) = without_flips(&recorded, &axis);
        assert_eq!((kept[1], flags[1]), (recorded[1].expect("a rotation"), 0));
    }

    #[test]
    fn a_lost_joint_does_not_hide_the_long_axis() {
        let mut points = [Vector3::zeros(); POINT_COUNT];
        for limb in Limb::ALL {
            points[point_index(limb, 1)] = Vector3::new(0.0, -0.4, 0.0);
        }
        let mut lost = points;
        lost[point_index(Limb::LeftLeg, 1)] = Vector3::repeat(f64::NAN);
        let observations = Observations {
            time_ns: vec![0, 33_000_000],
            points: vec![lost, points],
            subject_from_world: Rotation3::identity(),
        };
        let left_thigh = 1 + 2 * Limb::LeftLeg.index();
        let axis = long_axis(&[Some(Rotation3::identity()); 2], &observations, left_thigh);
        assert_eq!(axis, Some(-Vector3::y()));
    }

    #[test]
    fn a_lost_rotation_is_held_and_flagged() {
        let turn = Rotation3::from_axis_angle(&Vector3::x_axis(), 0.3);
        let (kept, flags) = without_flips(&[Some(turn), None], &Vector3::y_axis());
        assert_eq!((kept[1], flags[1]), (turn, FLAG_BRIDGED));
    }
}
