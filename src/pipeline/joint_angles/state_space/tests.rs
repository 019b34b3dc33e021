use super::*;
use nalgebra::DMatrix;

/// The covariance of a limb's three points as it is written in the module's documentation.
fn limb_covariance(model: &StateSpace, pose: &Pose, limb: Limb, observed: &Points) -> DMatrix<f64> {
    let points = forward_kinematics(&model.skeleton, pose);
    let slack_precision = model.slack_precision.expect("slacks");
    let at = |level| points[point_index(limb, level)];
    let direction = |level| (at(level) - at(level - 1)).normalize();
    DMatrix::from_fn(9, 9, |row, column| {
        let ((a, i), (b, j)) = ((row / 3, row % 3), (column / 3, column % 3));
        let mut covariance = if i == j { 1.0 / slack_precision[0] } else { 0.0 };
        for segment in 1..=a.min(b) {
            covariance += direction(segment)[i] * direction(segment)[j] / slack_precision[2 + segment];
        }
        if row == column {
            let p = point_index(limb, a);
            covariance += 1.0 / (model.precision[p][i] * model.weight(p, &(observed[p] - points[p])));
        }
        covariance
    })
}

#[test]
fn the_information_is_that_of_the_full_covariance_of_each_limb() {
    let skeleton = Skeleton::of_stature(1.7);
    let truth = Pose::from_vector(&PoseVector::from_fn(|i, _| 0.1 * (i as f64).sin() + 0.2));
    let mut observed = forward_kinematics(&skeleton, &truth);
    for (p, point) in observed.iter_mut().enumerate() {
        *point += Vector3::new(0.01, -0.02, 0.015) * (p as f64).cos();
    }
    let noise = SensorNoise { white: [Vector3::new(0.01, 0.02, 0.03); POINT_COUNT], slow_offset: 0.04 };
    let model = StateSpace::new(&skeleton, &noise, &Tuning { twist_sd: 1e6, ..Tuning::default() });
    let (_, jacobian) = forward_kinematics_with_jacobian(&skeleton, &truth);
    let points = forward_kinematics(&skeleton, &truth);
    let (information, gradient) = model.information(&Frame { points: observed, interval_s: 0.0 }, &truth);
    let (mut expected, mut expected_gradient) = (PoseCovariance::zeros(), PoseVector::zeros());
    for limb in Limb::ALL {
        let inverse = limb_covariance(&model, &truth, limb, &observed).try_inverse().expect("positive definite");
        let rows = jacobian.fixed_rows::<9>(9 * limb.index()).into_owned();
        let residual = SVector::<f64, 9>::from_fn(|row, _| {
            let p = 3 * limb.index() + row / 3;
            (observed[p] - points[p])[row % 3]
        });
        expected += rows.transpose() * &inverse * rows;
        expected_gradient += rows.transpose() * &inverse * residual;
    }
    let scale = expected.amax();
    assert!((information - expected).amax() < 1e-9 * scale, "{}", (information - expected).amax() / scale);
    assert!((gradient - expected_gradient).amax() < 1e-9 * expected_gradient.amax());
}

#[test]
fn a_knee_near_its_limit_is_the_mean_of_what_the_range_of_motion_leaves() {
    let skeleton = Skeleton::of_stature(1.7);
    let noise = SensorNoise { white: [Vector3::repeat(0.01); POINT_COUNT], slow_offset: 0.0 };
    let model = StateSpace::new(&skeleton, &noise, &Tuning::default());
    let at = |degrees: f64| {
        let mut pose = Pose::reference();
        pose.hinges[2] = degrees.to_radians();
        let observed = forward_kinematics(&skeleton, &pose);
        let covariance = PoseCovariance::identity() * 5f64.to_radians().powi(2);
        model.posterior(&observed, pose, &covariance).pose.hinges[2].to_degrees()
    };
    assert!((at(40.0) - 40.0).abs() < 1e-9, "far from the limit nothing changes");
    // At the limit of −10° half of a normal distribution is left, whose mean is √(2/π) of its SD.
    assert!((at(-10.0) - (-10.0 + 5.0 * 0.79788)).abs() < 1e-3, "{}", at(-10.0));
}

#[test]
fn the_slope_of_the_log_likelihood_is_the_gradient_also_where_points_are_off_or_lost() {
    let skeleton = Skeleton::of_stature(1.7);
    let truth = Pose::from_vector(&PoseVector::from_fn(|i, _| 0.3 * (i as f64).sin() + 0.2));
    let mut points = forward_kinematics(&skeleton, &truth);
    points[2] += Vector3::new(0.4, -0.2, 0.1);
    points[4] = Vector3::repeat(f64::NAN);
    let frame = Frame { points, interval_s: 1.0 / 30.0 };
    let noise = SensorNoise { white: [Vector3::zeros(); POINT_COUNT], slow_offset: 0.0 };
    let model = StateSpace::new(&skeleton, &noise, &Tuning::rigid());
    let pose = truth.perturbed(&PoseVector::from_fn(|i, _| 0.05 * (i as f64).cos()));
    let (_, gradient) = model.information(&frame, &pose);
    for d in 0..POSE_DIMENSION {
        let step = PoseVector::from_fn(|i, _| if i == d { 1e-5 } else { 0.0 });
        let ahead = model.log_likelihood(&frame, &pose.perturbed(&step));
        let behind = model.log_likelihood(&frame, &pose.perturbed(&-step));
        let slope = (ahead - behind) / 2e-5;
        // The gradient takes a limb's own axis as the direction of twist, which holds for limbs that hardly swing.
        let is_swung = (3..15).contains(&d);
        let tolerance = if is_swung { 0.05 * gradient.amax() } else { 1e-4 * gradient.amax() };
        assert!((slope - gradient[d]).abs() < tolerance, "{d}: {slope} for {}", gradient[d]);
    }
}

#[test]
fn the_rigid_variant_is_the_limit_of_slacks_that_vanish() {
    let skeleton = Skeleton::of_stature(1.7);
    let pose = Pose::from_vector(&PoseVector::from_fn(|i, _| 0.1 * (i as f64).sin() + 0.2));
    let mut points = forward_kinematics(&skeleton, &pose);
    for (p, point) in points.iter_mut().enumerate() {
        *point += Vector3::new(0.01, -0.02, 0.015) * (p as f64).cos();
    }
    let frame = Frame { points, interval_s: 1.0 / 30.0 };
    let noise = SensorNoise { white: [Vector3::repeat(0.01); POINT_COUNT], slow_offset: 0.02 };
    let of = |tuning: &Tuning| StateSpace::new(&skeleton, &noise, tuning).information(&frame, &pose);
    let (rigid, rigid_gradient) = of(&Tuning::rigid());
    let share = 1e-3;
    let (slack, slack_gradient) = of(&Tuning { root_slack: share, length_slack: share, ..Tuning::default() });
    // Slacks of 0.02 mm beside 13 mm of error: a few millionths.
    assert!((rigid - slack).amax() < 2e-5 * rigid.amax(), "{}", (rigid - slack).amax() / rigid.amax());
    assert!((rigid_gradient - slack_gradient).amax() < 2e-5 * rigid_gradient.amax());
}
