use super::*;
use crate::body::Pose;
use crate::body::bones::bone_rotations;
use crate::body::kinematics::forward_kinematics;
use crate::body::pose::PoseVector;
use crate::pipeline::skeleton_fusion::motion::Stretch;

const STEP_NS: i64 = 100_000_000;

/// Bending knees and elbows, swinging hips and shoulders, a turning trunk.
fn pose(t: f64) -> Pose {
    let swing = |rate: f64, size: f64| size * (rate * t).sin();
    Pose::from_vector(&PoseVector::from_fn(|i, _| match i {
        0..3 => swing(0.5 + 0.2 * i as f64, 0.2),
        3..15 => swing(0.7 + 0.11 * i as f64, 0.4),
        _ => 0.8 + swing(0.9 + 0.13 * (i - 15) as f64, 0.7),
    }))
}

/// A minute of exact data: a unit on every bone, mounted and headed as given; headings drift.
struct Exact {
    skeleton: Skeleton,
    motions: Vec<UnitMotion>,
    moments: Vec<Moment>,
    imu_from_bone: Vec<Rotation3<f64>>,
}

impl Exact {
    fn new(imu_from_bone: impl Fn(Bone) -> Rotation3<f64>, drift: f64) -> Self {
        let skeleton = Skeleton::of_stature(1.7);
        let imu_from_bone: Vec<Rotation3<f64>> = Bone::ALL.into_iter().map(imu_from_bone).collect();
        let times: Vec<i64> = (0..600).map(|i| i * STEP_NS).collect();
        let motions: Vec<UnitMotion> = Bone::ALL
            .into_iter()
            .map(|bone| {
                let orientation = |time: &i64| {
                    let t = *time as f64 * 1e-9;
                    let heading = 0.3 * bone.index() as f64 + drift * t;
                    let turn = UnitQuaternion::from_axis_angle(&Vector3::y_axis(), -heading);
                    let subject_from_imu =
                        bone_rotations(&pose(t))[bone.index()] * imu_from_bone[bone.index()].inverse();
                    turn * UnitQuaternion::from_rotation_matrix(&subject_from_imu)
                };
                let stretch = Stretch {
                    time_ns: times.clone(),
                    earth_from_imu: times.iter().map(orientation).collect(),
                    angular_rate: vec![Vector3::repeat(1.0); times.len()],
                    inclination_sd: None,
                };
                UnitMotion { bone, is_by_scheme: true, main_axis: None, stretches: vec![stretch] }
            })
            .collect();
        let vectors = BoneVector::all();
        let moment = |time_ns: &i64| {
            let points = forward_kinematics(&skeleton, &pose(*time_ns as f64 * 1e-9));
            Moment {
                time_ns: *time_ns,
                interval_s: 0.1,
                vectors: vectors.iter().map(|vector| vector.of_points(&points)).collect(),
                units: motions.iter().map(|motion| motion.at(*time_ns)).collect(),
                standing: None,
            }
        };
        let moments = times.iter().map(moment).collect();
        Self { skeleton, motions, moments, imu_from_bone }
    }

    fn align(&self, mounting: Mounting) -> Alignment {
        let evidence = Evidence {
            skeleton: &self.skeleton,
            motions: &self.motions,
            moments: &self.moments,
            plank: None,
            mounting,
        };
        align(&evidence, &AlignmentTuning::default(), None).unwrap()
    }

    /// Largest error of a bone's attitude over the minute, degrees.
    fn worst_deg(&self, alignment: &Alignment) -> f64 {
        let errors = self.moments.iter().flat_map(|moment| {
            let truth = bone_rotations(&pose(moment.time_ns as f64 * 1e-9));
            moment.units.iter().enumerate().filter_map(move |(u, unit)| {
                let (stretch, earth) = unit.as_ref()?;
                let found = alignment.subject_from_bone(u, moment.time_ns, *stretch, earth);
                Some(found.angle_to(&truth[u]).to_degrees())
            })
        });
        errors.fold(0.0, f64::max)
    }
}

fn off_scheme(bone: Bone, degrees: f64) -> Rotation3<f64> {
    let axis = Vector3::new(1.0, bone.index() as f64 - 4.0, 0.5).normalize();
    bone.scheme_from_imu().inverse() * Rotation3::new(axis * degrees.to_radians())
}

#[test]
fn mounting_and_drifting_headings_come_back_from_exact_data() {
    let exact = Exact::new(|bone| off_scheme(bone, 8.0), 0.2_f64.to_radians());
    let alignment = exact.align(Mounting::Auto);
    assert!(alignment.units.iter().all(|unit| unit.mounting == MountingFound::Scheme));
    // A camera's minute is not believed to the last degree: the priors keep a third of the 8° at the worst moment.
    assert!(exact.worst_deg(&alignment) < 3.5, "{}", exact.worst_deg(&alignment));
    let drift = alignment.units[3].headings[0].drift.to_degrees();
    assert!((drift - 0.2).abs() < 0.05, "{drift}");
}

#[test]
fn units_mounted_in_any_way_are_found_from_movement() {
    let anyhow = |bone: Bone| {
        let axis = Vector3::new(0.3, 1.0 - 0.2 * bone.index() as f64, 0.7).normalize();
        Rotation3::new(axis * (1.0 + 0.2 * bone.index() as f64))
    };
    let exact = Exact::new(anyhow, 0.0);
    let alignment = exact.align(Mounting::Unknown);
    assert!(exact.worst_deg(&alignment) < 2.0, "{}", exact.worst_deg(&alignment));
    assert!(alignment.units.iter().all(|unit| unit.is_determined));
    let found = alignment.units[7].imu_from_bone.angle_to(&exact.imu_from_bone[7]).to_degrees();
    assert!(found < 2.0, "{found}");
}

#[test]
fn a_unit_upside_down_is_not_taken_for_one_by_the_scheme() {
    let upside_down = |bone: Bone| {
        let flip = if bone.index() == 5 { PI } else { 0.0 };
        Rotation3::from_axis_angle(&Vector3::z_axis(), flip) * off_scheme(bone, 0.0)
    };
    let exact = Exact::new(upside_down, 0.0);
    let alignment = exact.align(Mounting::Auto);
    let by_scheme: Vec<bool> = alignment.units.iter().map(|unit| unit.mounting == MountingFound::Scheme).collect();
    assert_eq!(by_scheme, [true, true, true, true, true, false, true, true, true]);
    assert!(exact.worst_deg(&alignment) < 2.0, "{}", exact.worst_deg(&alignment));
}

#[test]
fn what_nobody_saw_has_a_large_uncertainty() {
    let mut exact = Exact::new(|bone| off_scheme(bone, 0.0), 0.0);
    let seen = exact.align(Mounting::Auto);
    for moment in &mut exact.moments {
        moment.vectors.fill(Vector3::repeat(f64::NAN));
    }
    let unseen = exact.align(Mounting::Auto);
    assert!(unseen.heading_sd(0) > 5.0 * seen.heading_sd(0));
    assert!(unseen.mounting_sd(0).amax() > 1.2 * seen.mounting_sd(0).amax());
}

#[test]
fn a_heading_is_linear_between_its_points_and_constant_outside() {
    let course = HeadingCourse { start_ns: 0, step_ns: 10, values: vec![1.0, 2.0, 4.0], drift: 0.0 };
    assert_eq!([-5, 0, 5, 15, 20, 99].map(|t| course.at(t)), [1.0, 1.0, 1.5, 3.0, 4.0, 4.0]);
}
