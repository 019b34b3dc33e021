use super::*;
use ahrs::Ahrs;
use proptest::prelude::*;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rand_distr::StandardNormal;

const GRAVITY: f64 = 9.81;

/// Samples that own their memory, and the truth.
#[derive(Debug, Clone, Default)]
struct Simulated {
    time_ns: Vec<i64>,
    acceleration: Vec<Vector3<f64>>,
    angular_rate: Vec<Vector3<f64>>,
    truth: Vec<UnitQuaternion<f64>>,
}

impl Simulated {
    fn samples(&self) -> InertialSamples<'_> {
        InertialSamples { time_ns: &self.time_ns, acceleration: &self.acceleration, angular_rate: &self.angular_rate }
    }

    fn estimate(&self, method: OrientationMethod) -> OrientationEstimate {
        estimate(method, &self.samples()).unwrap()
    }
}

/// A sensor that turns about all axes at up to 4 rad/s and is shaken by up to 5 m/s², in earth with y up.
fn moving(times: impl Iterator<Item = f64>) -> Simulated {
    let attitude = |t: f64| {
        UnitQuaternion::from_scaled_axis(Vector3::new((0.9 * t).sin(), 0.4 * t, (1.3 * t).cos()))
            * UnitQuaternion::from_scaled_axis(Vector3::new(0.8 * (2.1 * t).sin(), 0.0, 0.7 * (1.7 * t).sin()))
    };
    let mut simulated = Simulated::default();
    for t in times {
        let h = 1e-5;
        let rate = (attitude(t - h).inverse() * attitude(t + h)).scaled_axis() / (2.0 * h);
        let shaking = Vector3::new(5.0 * (7.0 * t).sin(), 3.0 * (9.0 * t).cos(), 4.0 * (5.0 * t).sin());
        simulated.time_ns.push((t * 1e9).round() as i64);
        simulated.acceleration.push(attitude(t).inverse() * (shaking + Vector3::y() * GRAVITY));
        simulated.angular_rate.push(rate);
        simulated.truth.push(attitude(t));
    }
    simulated
}

fn moving_at(rate_hz: f64, seconds: f64) -> Simulated {
    moving((0..(rate_hz * seconds) as usize).map(|i| i as f64 / rate_hz))
}

/// Adds a bias to the rates and white noise of common sensors (0.005 rad/s and 0.05 m/s² at 100 Hz) to everything.
fn disturbed(mut simulated: Simulated, bias: &Vector3<f64>, seed: u64) -> Simulated {
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    let mut noise = |sd: f64| Vector3::from_fn(|_, _| sd * random.sample::<f64, _>(StandardNormal));
    for (rate, acceleration) in simulated.angular_rate.iter_mut().zip(&mut simulated.acceleration) {
        *rate += bias + noise(0.005);
        *acceleration += noise(0.05);
    }
    simulated
}

/// A sensor mounted at `mounting` that turns about the vertical at a constant rate for 20 s at 100 Hz.
fn turntable(mounting: &UnitQuaternion<f64>, rate: f64) -> Simulated {
    let mut simulated = Simulated::default();
    for i in 0..2000 {
        let turned = UnitQuaternion::from_axis_angle(&Vector3::y_axis(), rate * f64::from(i) * 0.01);
        simulated.time_ns.push(i64::from(i) * 10_000_000);
        simulated.acceleration.push(mounting.inverse() * Vector3::y() * GRAVITY);
        simulated.angular_rate.push(mounting.inverse() * Vector3::y() * rate);
        simulated.truth.push(turned * mounting);
    }
    simulated
}

/// Root mean square of the angle between estimated and true vertical from `from` seconds on, degrees.
fn inclination_error_deg(simulated: &Simulated, estimate: &OrientationEstimate, from: f64) -> f64 {
    let mut squares = Vec::new();
    for (i, truth) in simulated.truth.iter().enumerate() {
        if simulated.time_ns[i] as f64 * 1e-9 >= from {
            let vertical = estimate.earth_from_sensor[i] * truth.inverse() * Vector3::y();
            squares.push(vertical.angle(&Vector3::y()).powi(2));
        }
    }
    (squares.iter().sum::<f64>() / squares.len() as f64).sqrt().to_degrees()
}

fn rotation() -> impl Strategy<Value = UnitQuaternion<f64>> {
    prop::array::uniform3(-1.0..1.0f64).prop_map(|v| UnitQuaternion::from_scaled_axis(Vector3::from(v) * 1.8))
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(16))]

    #[test]
    fn a_sensor_at_rest_keeps_its_attitude_and_shows_gravity(mounting in rotation()) {
        let simulated = turntable(&mounting, 0.0);
        for method in OrientationMethod::ALL {
            let estimate = simulated.estimate(method);
            let first = estimate.earth_from_sensor[0];
            for q in &estimate.earth_from_sensor {
                // Madgwick's normalised gradient never settles: it steps by the gain times Δt, 0.033 · 0.01 s, about it.
                prop_assert!(q.angle_to(&first) < 2e-3, "{method:?} moved by {}", q.angle_to(&first));
            }
            prop_assert!(inclination_error_deg(&simulated, &estimate, 0.0) < 0.05, "{method:?}");
        }
    }

    #[test]
    fn a_turn_about_the_vertical_keeps_the_inclination_and_turns_the_heading_as_far(mounting in rotation()) {
        let simulated = turntable(&mounting, 1.0);
        let turn = simulated.truth[1999] * simulated.truth[1000].inverse();
        for method in OrientationMethod::ALL {
            let estimate = simulated.estimate(method);
            prop_assert!(inclination_error_deg(&simulated, &estimate, 0.0) < 0.05, "{method:?}");
            let estimated = estimate.earth_from_sensor[1999] * estimate.earth_from_sensor[1000].inverse();
            prop_assert!(estimated.angle_to(&turn) < 2e-3, "{method:?}: {} rad", estimated.angle_to(&turn));
        }
    }

    #[test]
    fn how_a_sensor_is_mounted_does_not_matter(mounting in rotation()) {
        let simulated = moving_at(50.0, 20.0);
        let mut remounted = simulated.clone();
        for v in remounted.acceleration.iter_mut().chain(&mut remounted.angular_rate) {
            *v = mounting * *v;
        }
        // VQF limits its bias axis by axis, and the gradient of Madgwick's filter has a part along q that depends on q.
        for method in [OrientationMethod::Gyroscope, OrientationMethod::Smoother] {
            let (a, b) = (simulated.estimate(method), remounted.estimate(method));
            let between = |i: usize| b.earth_from_sensor[i] * mounting * a.earth_from_sensor[i].inverse();
            for i in 0..simulated.time_ns.len() {
                prop_assert!((between(i) * Vector3::y() - Vector3::y()).norm() < 1e-6, "{method:?}: inclination");
                prop_assert!(between(i).angle_to(&between(0)) < 1e-6, "{method:?}: heading");
            }
        }
    }

    #[test]
    fn no_samples_break_a_method(values in prop::collection::vec(prop::array::uniform6(prop::num::f64::ANY), 0..40),
                                 step in 1..10_000_000_000i64) {
        let mut simulated = Simulated::default();
        for (i, v) in values.iter().enumerate() {
            simulated.time_ns.push(i as i64 * step);
            simulated.acceleration.push(Vector3::new(v[0], v[1], v[2]));
            simulated.angular_rate.push(Vector3::new(v[3], v[4], v[5]));
        }
        for method in OrientationMethod::ALL {
            let estimate = simulated.estimate(method);
            prop_assert_eq!(estimate.earth_from_sensor.len(), values.len());
            prop_assert!(estimate.earth_from_sensor.iter().all(|q| (q.norm() - 1.0).abs() < 1e-9), "{:?}", method);
            prop_assert!(estimate.bias.iter().all(|b| b.iter().all(|x| x.is_finite())), "{:?}", method);
        }
    }
}

#[test]
fn madgwick_is_the_filter_of_an_independent_implementation() {
    let simulated = disturbed(moving_at(256.0, 10.0), &Vector3::new(0.01, -0.02, 0.005), 3);
    let ours = madgwick::estimate(&simulated.samples(), 0.1, Some(earth_from_z_up())).unwrap();
    // The time stamps are whole nanoseconds, and 1/256 s is a whole number of them.
    let mut other = ahrs::Madgwick::new(1.0 / 256.0, 0.1);
    for i in 0..simulated.time_ns.len() {
        let [rate, acceleration] = [simulated.angular_rate[i], simulated.acceleration[i]].map(|v| [v.x, v.y, v.z]);
        other.update_imu(&rate.into(), &acceleration.into()).unwrap();
        let expected =
            UnitQuaternion::from_quaternion(Quaternion::new(other.quat.w, other.quat.i, other.quat.j, other.quat.k));
        let difference = ours.earth_from_sensor[i].angle_to(&(earth_from_z_up() * expected));
        assert!(difference < 1e-9, "sample {i} differs by {difference} rad");
    }
}

#[test]
fn truth_is_recovered_from_biased_and_noisy_samples() {
    let bias = Vector3::new(0.9_f64, -0.7, 0.8).map(f64::to_radians);
    let simulated = disturbed(moving_at(100.0, 120.0), &bias, 7);
    // Tolerances in degrees, from 20 s on, when a causal filter has learnt the bias; about twice what is reached.
    for (method, tolerance) in
        [(OrientationMethod::Madgwick, 8.0), (OrientationMethod::Vqf, 1.0), (OrientationMethod::Smoother, 0.3)]
    {
        let estimate = simulated.estimate(method);
        let error = inclination_error_deg(&simulated, &estimate, 20.0);
        assert!(error < tolerance, "{method:?}: {error} degrees");
        if let (Some(found), true) = (estimate.bias.last(), method != OrientationMethod::Madgwick) {
            // The sensor's y stays near the vertical, about which no drift is seen.
            assert!((found - bias).xz().norm().to_degrees() < 0.2, "{method:?}: bias {found}");
        }
    }
    let adrift = inclination_error_deg(&simulated, &simulated.estimate(OrientationMethod::Gyroscope), 20.0);
    assert!(adrift > 3.0, "the gyroscope alone should be lost, not {adrift} degrees off");
}

#[test]
fn a_bias_that_turns_the_whole_window_upside_down_is_still_found() {
    let bias = Vector3::new(1.2_f64, 1.2, -1.2).map(f64::to_radians);
    let simulated = disturbed(moving_at(100.0, 280.0), &bias, 11);
    let estimate = simulated.estimate(OrientationMethod::Smoother);
    // The sensor's y stays near the vertical, about which no drift is seen.
    assert!((estimate.bias[0] - bias).xz().norm().to_degrees() < 0.1, "bias {}", estimate.bias[0]);
    let error = inclination_error_deg(&simulated, &estimate, 0.0);
    assert!(error < 0.8, "{error} degrees");
}

#[test]
fn a_bias_that_changes_between_windows_is_followed() {
    let mut simulated = disturbed(moving_at(50.0, 900.0), &Vector3::zeros(), 5);
    for (i, rate) in simulated.angular_rate.iter_mut().enumerate() {
        rate.x += 0.5_f64.to_radians() * i as f64 / 45_000.0;
    }
    let estimate = simulated.estimate(OrientationMethod::Smoother);
    let middle = estimate.bias[22_500].x.to_degrees();
    assert!((middle - 0.25).abs() < 0.05, "{middle} degrees per second at the middle");
    assert!(inclination_error_deg(&simulated, &estimate, 0.0) < 0.5);
}

#[test]
fn a_late_gyroscope_is_noticed() {
    let mut simulated = moving_at(200.0, 60.0);
    // Four samples late: what the gyroscope says at t is what was at t − 20 ms.
    simulated.angular_rate.rotate_right(4);
    let simulated = disturbed(simulated, &Vector3::zeros(), 2);
    let error = |rate_delay_sd: f64| {
        // Movement is regular here, so that little of it is left after the low-pass.
        let known = smoother::SmootherSettings { acceleration_sd: 0.02, ..smoother::SmootherSettings::default() };
        let settings = smoother::SmootherSettings { rate_delay_sd, ..known };
        inclination_error_deg(&simulated, &smoother::estimate(&simulated.samples(), &settings).unwrap(), 5.0)
    };
    let (error, blind) = (error(0.01), error(1e-6));
    assert!(error < 0.75 * blind, "{error} degrees, and {blind} without knowing of delays");
}

#[test]
fn irregular_time_stamps_and_gaps_give_the_same_orientation() {
    let seconds = |i: usize| i as f64 * 0.01 + 0.003 * ((i * 7) % 3) as f64;
    let kept = (0..6000).filter(|i| i % 500 > 5).map(seconds);
    let simulated = disturbed(moving(kept), &Vector3::new(0.01, 0.005, -0.01), 4);
    let error = inclination_error_deg(&simulated, &simulated.estimate(OrientationMethod::Smoother), 5.0);
    assert!(error < 0.5, "{error} degrees");
}

#[test]
fn coning_is_integrated_to_fourth_order() {
    // Halving the step divides the error by 16; without the coning term it would divide by 4.
    let error = |rate_hz: f64| {
        let simulated = moving_at(rate_hz, 10.0);
        let estimate = simulated.estimate(OrientationMethod::Gyroscope);
        let last = simulated.truth.len() - 1;
        let between = |q: &[UnitQuaternion<f64>]| q[0].inverse() * q[last];
        between(&estimate.earth_from_sensor).angle_to(&between(&simulated.truth))
    };
    let (coarse, fine) = (error(50.0), error(200.0));
    assert!(fine < 2e-5 && coarse < 5e-3, "{coarse} rad at 50 Hz, {fine} rad at 200 Hz");
}

#[test]
fn without_gravity_in_the_acceleration_only_the_gyroscope_is_integrated() {
    let mut simulated = moving_at(256.0, 5.0);
    for (nothing, name) in [(0.0, "free fall"), (f64::NAN, "no number"), (f64::INFINITY, "no bound")] {
        simulated.acceleration.fill(Vector3::repeat(nothing));
        let by_gyroscope = simulated.estimate(OrientationMethod::Gyroscope);
        for method in OrientationMethod::ALL {
            let estimate = simulated.estimate(method);
            let last = simulated.truth.len() - 1;
            let turned = |e: &OrientationEstimate| e.earth_from_sensor[1].inverse() * e.earth_from_sensor[last];
            // Madgwick's step is of first order: at 256 Hz and 4 rad/s that is some hundredths of a radian in 5 s.
            let difference = turned(&estimate).angle_to(&turned(&by_gyroscope));
            assert!(difference < 0.1, "{method:?} in {name}: {difference} rad");
        }
    }
}

#[test]
fn a_rate_that_is_no_number_is_replaced_by_the_last_one() {
    let mut simulated = turntable(&UnitQuaternion::identity(), 1.0);
    let whole = simulated.estimate(OrientationMethod::Gyroscope);
    for i in (100..1900).step_by(7) {
        simulated.angular_rate[i] = Vector3::new(f64::NAN, 0.0, f64::INFINITY);
    }
    assert_eq!(simulated.estimate(OrientationMethod::Gyroscope), whole);
}

#[test]
fn repetition_gives_the_same_bytes() {
    let simulated = disturbed(moving_at(100.0, 30.0), &Vector3::new(0.01, 0.0, 0.01), 1);
    for method in OrientationMethod::ALL {
        assert_eq!(simulated.estimate(method), simulated.estimate(method), "{method:?}");
    }
}

#[test]
fn slices_that_do_not_fit_and_time_that_stands_still_are_refused() {
    let mut simulated = moving_at(100.0, 1.0);
    simulated.time_ns[40] = simulated.time_ns[39];
    for method in OrientationMethod::ALL {
        let error = estimate(method, &simulated.samples()).unwrap_err();
        assert_eq!(error, OrientationError::TimeNotIncreasing { sample: 40 });
        let short = InertialSamples { time_ns: &simulated.time_ns[..10], ..simulated.samples() };
        let expected = OrientationError::UnequalLengths { n_times: 10, n_accelerations: 100, n_rates: 100 };
        assert_eq!(estimate(method, &short).unwrap_err(), expected);
    }
}

#[test]
fn one_sample_has_the_inclination_that_its_acceleration_shows() {
    let truth = UnitQuaternion::from_scaled_axis(Vector3::new(0.7, 0.0, -0.4));
    let acceleration = [truth.inverse() * Vector3::y() * GRAVITY];
    let samples = InertialSamples { time_ns: &[5], acceleration: &acceleration, angular_rate: &[Vector3::zeros()] };
    for method in OrientationMethod::ALL {
        let q = estimate(method, &samples).unwrap().earth_from_sensor[0];
        assert!((q * acceleration[0] / GRAVITY - Vector3::y()).norm() < 0.02, "{method:?}");
    }
}
