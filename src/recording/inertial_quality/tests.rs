use super::*;
use InertialWarningKind as Kind;
use nalgebra::UnitQuaternion;

/// A unit that is turned gently about all axes for 20 s at 100 Hz, each sample changed by `change`.
fn unit(change: impl Fn(usize, &mut i64, &mut Vector3<f64>, &mut Vector3<f64>) -> bool) -> UnitStatistics {
    let mut statistics = UnitStatistics::default();
    let mut world_from_imu = UnitQuaternion::identity();
    for i in 0..2000 {
        let t = i as f64 * 0.01;
        let mut rate = Vector3::new((1.3 * t).sin(), 0.8 * (0.9 * t + 1.0).cos(), 0.7 * (1.7 * t).sin());
        let mut force = world_from_imu.inverse() * Vector3::new(0.0, GRAVITY_M_S2, 0.0);
        world_from_imu *= UnitQuaternion::from_scaled_axis(rate * 0.01);
        let mut time_ns = i as i64 * 10_000_000;
        if change(i, &mut time_ns, &mut force, &mut rate) {
            statistics.push(time_ns, &force, &rate);
        }
    }
    statistics
}

fn kinds(statistics: &UnitStatistics) -> Vec<Kind> {
    statistics.warnings(Some(100.0)).into_iter().map(|warning| warning.kind).collect()
}

#[test]
fn a_sound_unit_raises_no_doubt() {
    let sound = unit(|_, _, _, _| true);
    assert_eq!(kinds(&sound), []);
    assert_eq!((sound.wrong_unit(), sound.n(), sound.n_missing()), (None, 2000, 0));
    assert!((sound.rate_hz().unwrap() - 100.0).abs() < 1e-9 && (sound.duration_s() - 19.99).abs() < 1e-9);
}

#[test]
fn a_unit_in_g_without_gravity_or_in_degrees_is_certain() {
    let in_g = unit(|_, _, force, _| {
        *force /= GRAVITY_M_S2;
        true
    });
    assert!(matches!(in_g.wrong_unit(), Some(WrongUnit::Acceleration(median)) if (median - 1.0).abs() < 0.02));
    let without_gravity = unit(|i, _, force, _| {
        *force = Vector3::new(0.3 * (i as f64).sin(), 0.0, 0.0);
        true
    });
    assert!(matches!(without_gravity.wrong_unit(), Some(WrongUnit::Acceleration(_))));
    let degrees = unit(|_, _, _, rate| {
        *rate = rate.map(f64::to_degrees);
        true
    });
    assert!(matches!(degrees.wrong_unit(), Some(WrongUnit::AngularRateInDegrees)), "{:?}", degrees.wrong_unit());
}

#[test]
fn every_defect_that_leaves_the_data_usable_is_a_warning_of_its_own_kind() {
    let mirrored = unit(|_, _, _, rate| {
        rate.y = -rate.y;
        true
    });
    assert_eq!(kinds(&mirrored), [Kind::MirroredAxis]);
    let left_handed = unit(|_, _, _, rate| {
        *rate = -*rate;
        true
    });
    assert!(left_handed.warnings(None)[0].sentence.contains("about every axis"));
    let lost = unit(|i, _, _, _| i % 10 != 5);
    assert_eq!((kinds(&lost), lost.n_missing()), (vec![Kind::DropOut, Kind::Jitter], 200));
    let one_gap = unit(|i, _, _, _| !(700..760).contains(&i));
    assert_eq!(kinds(&one_gap), [Kind::DropOut]);
    // A bin of the histogram is 2 % wide.
    assert!((59..=61).contains(&one_gap.n_missing()), "{}", one_gap.n_missing());
    let jittery = unit(|i, time_ns, _, _| {
        *time_ns += [0, 3_000_000, 1_000_000][i % 3];
        true
    });
    assert_eq!(kinds(&jittery), [Kind::Jitter]);
    let stuck = unit(|i, _, force, _| {
        *force = if (500..700).contains(&i) { Vector3::new(0.0, 0.0, 9.8) } else { *force };
        true
    });
    assert_eq!(kinds(&stuck), [Kind::ConstantAcceleration]);
    let dead = unit(|_, _, _, rate| {
        *rate = Vector3::zeros();
        true
    });
    assert_eq!(kinds(&dead), [Kind::ConstantAngularRate]);
    let clipped = unit(|i, _, force, _| {
        force.x += (60.0 * (i as f64 * 0.03).sin().powi(21)).clamp(-30.0, 30.0);
        force.x = force.x.clamp(-20.0, 20.0);
        true
    });
    assert!(kinds(&clipped).contains(&Kind::Saturation));
    let weak = unit(|_, _, force, _| {
        *force *= 0.8;
        true
    });
    assert_eq!(kinds(&weak), [Kind::AccelerationScale]);
    assert_eq!(unit(|_, _, _, _| true).warnings(Some(128.0))[0].kind, Kind::RateDiffers);
    assert_eq!(kinds(&UnitStatistics::default()), [Kind::NoSamples]);
}

#[test]
fn times_at_the_ends_of_the_range_do_not_overflow() {
    let mut statistics = UnitStatistics::default();
    for time_ns in [i64::MIN, -1, i64::MAX] {
        statistics.push(time_ns, &Vector3::new(0.0, 9.8, 0.0), &Vector3::zeros());
    }
    assert_eq!((statistics.n(), statistics.wrong_unit()), (3, None));
    let _ = (statistics.warnings(Some(1.0)), statistics.n_missing());
}
