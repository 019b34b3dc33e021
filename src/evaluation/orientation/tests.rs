use super::alignment::align;
use super::trial::ReferencePoint;
use super::*;

/// A unit that turns about all its axes for 20 s at 100 Hz, with its exact reference.
fn trial() -> (OrientationTrial, Vec<UnitQuaternion<f64>>) {
    let attitude = |t: f64| {
        UnitQuaternion::from_scaled_axis(Vector3::new((2.0 * t).sin(), 0.3 * t.cos(), (3.1 * t).cos()))
            * UnitQuaternion::from_scaled_axis(Vector3::new(0.0, (1.7 * t).sin(), 0.0))
    };
    let times: Vec<f64> = (0..2000).map(|i| f64::from(i) * 0.01).collect();
    let truth: Vec<_> = times.iter().map(|t| attitude(*t)).collect();
    let rate = |t: f64| (attitude(t - 1e-5).inverse() * attitude(t + 1e-5)).scaled_axis() / 2e-5;
    let time_ns: Vec<i64> = (0..2000).map(|i| i * 10_000_000).collect();
    let point = |(time_ns, q): (&i64, &UnitQuaternion<f64>)| ReferencePoint {
        time_ns: *time_ns,
        earth_from_sensor: *q,
        is_scored: true,
    };
    let trial = OrientationTrial {
        set: "simulated".into(),
        name: "one".into(),
        acceleration: truth.iter().map(|q| q.inverse() * Vector3::y() * 9.81).collect(),
        angular_rate: times.iter().map(|t| rate(*t)).collect(),
        reference: time_ns.iter().zip(&truth).map(point).collect(),
        time_ns,
    };
    (trial, truth)
}

#[test]
fn a_constant_heading_is_no_error_and_a_tilt_is_both_errors() {
    let (trial, truth) = trial();
    let heading = UnitQuaternion::from_axis_angle(&Vector3::y_axis(), 2.5);
    let tilt = UnitQuaternion::from_axis_angle(&Vector3::x_axis(), 2.0_f64.to_radians());
    let turned: Vec<_> = truth.iter().map(|q| heading * q).collect();
    let found = errors(&trial, &turned).unwrap();
    assert!(found.total_deg < 1e-6 && found.inclination_deg < 1e-6, "{found:?}");
    let tilted: Vec<_> = truth.iter().map(|q| heading * tilt * q).collect();
    let found = errors(&trial, &tilted).unwrap();
    assert!((found.total_deg - 2.0).abs() < 1e-6 && (found.inclination_deg - 2.0).abs() < 1e-6, "{found:?}");
}

#[test]
fn a_heading_that_drifts_is_a_total_error_and_none_of_inclination() {
    let (trial, truth) = trial();
    let drift = |i: usize| UnitQuaternion::from_axis_angle(&Vector3::y_axis(), 0.1 * i as f64 / 2000.0);
    let drifted: Vec<_> = truth.iter().enumerate().map(|(i, q)| drift(i) * q).collect();
    let found = errors(&trial, &drifted).unwrap();
    // A ramp of 0.1 rad has the standard deviation 0.1 / sqrt(12).
    assert!((found.total_deg - (0.1_f64 / 12.0_f64.sqrt()).to_degrees()).abs() < 0.01, "{found:?}");
    assert!(found.inclination_deg < 1e-5, "{found:?}");
}

#[test]
fn lag_mounting_and_tilt_of_a_reference_are_found_and_undone() {
    let (mut trial, truth) = trial();
    let body = UnitQuaternion::from_scaled_axis(Vector3::new(0.1, -0.2, 0.05));
    let tilt = UnitQuaternion::from_axis_angle(&Vector3::z_axis(), 0.03);
    for point in &mut trial.reference {
        point.time_ns -= 12_000_000;
        point.earth_from_sensor = tilt * point.earth_from_sensor * body;
    }
    let before = errors(&trial, &truth).unwrap();
    let alignment = align(&mut trial).unwrap();
    assert_eq!(alignment.lag_ns, 12_000_000);
    assert!(alignment.sensor_from_body.angle_to(&body) < 1e-3);
    let after = errors(&trial, &truth).unwrap();
    // Rates taken over 10 ms are not quite those at the middle.
    assert!(before.total_deg > 5.0 && after.total_deg < 0.1, "{before:?} became {after:?}");
}

#[test]
fn nothing_to_compare_is_no_error_of_zero() {
    let (mut trial, truth) = trial();
    for point in &mut trial.reference {
        point.is_scored = false;
    }
    assert_eq!(errors(&trial, &truth), None);
    trial.reference.clear();
    assert_eq!(align(&mut trial), None);
}
