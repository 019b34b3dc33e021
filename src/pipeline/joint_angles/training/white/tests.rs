use super::*;
use crate::estimation::random::RandomStreams;
use nalgebra::Rotation3;

/// Frames of a subject at rest whose points move as `movement` says and have noise of an SD in metres.
fn standing(seconds: usize, sd: f64, movement: impl Fn(f64) -> f64) -> Observations {
    let mut streams = RandomStreams::new(7);
    let mut frame = |t: usize| {
        std::array::from_fn(|p| {
            let place = Vector3::new(p as f64 * 0.1, 1.0, movement(t as f64 / 30.0));
            place + Vector3::from_fn(|_, _| sd * streams.normal())
        })
    };
    let n = 30 * seconds;
    let points = (0..n).map(&mut frame).collect();
    let time_ns = (0..n as i64).map(|t| t * 33_333_333).collect();
    Observations { time_ns, points, subject_from_world: Rotation3::identity() }
}

fn trained(observations: &Observations) -> (f64, WhiteNoise) {
    let mut still = WhiteNoise::default();
    let white = crate::pipeline::joint_angles::sensor_noise::white_noise(observations);
    (still.add_still(observations, &white), still)
}

#[test]
fn every_second_of_a_resting_subject_counts_and_shows_the_noise() {
    for sd in [0.001, 0.1] {
        let (seconds, still) = trained(&standing(40, sd, |t| 0.01 * (0.8 * t).sin()));
        assert!(seconds >= 36.0, "{seconds}");
        let found = still.covariance();
        // 1080 degrees of freedom and their mirror image: a standard error of 1.5 to 2 %.
        assert!((found.sd / sd - Coordinates::repeat(1.0)).amax() < 0.07, "{}", found.sd / sd);
    }
}

#[test]
fn a_movement_does_not_pass_for_noise() {
    for period_s in [1.0, 2.0, 4.0] {
        let (seconds, _) = trained(&standing(20, 0.001, |t| 0.1 * (std::f64::consts::TAU * t / period_s).sin()));
        assert_eq!(seconds, 0.0, "period {period_s} s");
    }
}

#[test]
fn independent_noise_loses_its_chance_correlations_and_common_noise_keeps_most_of_its_own() {
    let independent = trained(&standing(20, 0.01, |_| 0.0)).1.covariance();
    assert!(independent.shrinkage > 0.7, "{}", independent.shrinkage);
    let mut observations = standing(20, 0.01, |_| 0.0);
    let mut streams = RandomStreams::new(8);
    for frame in &mut observations.points {
        let common = Vector3::from_fn(|_, _| 0.02 * streams.normal());
        frame.iter_mut().for_each(|point| *point += common);
    }
    let common = trained(&observations).1.covariance();
    assert!(common.shrinkage < 0.1, "{}", common.shrinkage);
    // 4 : 1 of common to own variance, within a side and between the sides.
    for (row, column) in [(0, 3), (1, 4), (0, 9), (2, 11)] {
        let found = common.correlation[(row, column)];
        assert!((found - 0.8).abs() < 0.08, "({row}, {column}): {found}");
    }
    assert!(common.correlation[(0, 4)].abs() < 0.1, "{}", common.correlation[(0, 4)]);
}

#[test]
fn the_covariance_is_positive_definite_however_few_and_poor_the_samples_are() {
    // Twelve equal points: a covariance of rank 3.
    let mut observations = standing(10, 0.01, |_| 0.0);
    observations.points.iter_mut().for_each(|frame| *frame = [frame[0]; POINT_COUNT]);
    let (seconds, still) = trained(&observations);
    assert_eq!(seconds, 10.0);
    let found = still.covariance();
    assert!(found.correlation.cholesky().is_some() && found.shrinkage >= MIN_SHRINKAGE);
    let eigenvalues = found.correlation.symmetric_eigenvalues();
    assert!(eigenvalues.min() > 0.99 * found.shrinkage, "{}", eigenvalues.min());
    let nothing = WhiteNoise::default().covariance();
    assert!(nothing.correlation.cholesky().is_some());
}

#[test]
fn the_mirror_image_of_the_mirror_image_is_the_covariance() {
    let covariance = ObservationCovariance::from_fn(|row, column| (row * column) as f64 + row as f64 + column as f64);
    assert_eq!(mirrored(&mirrored(&covariance)), covariance);
    // The left elbow's x with the left hand's y becomes minus the right elbow's with the right hand's.
    assert_eq!(mirrored(&covariance)[(12, 16)], -covariance[(3, 7)]);
}

#[test]
fn third_differences_show_the_noise_under_a_movement_and_in_spite_of_jumps() {
    let mut moving = standing(60, 0.001, |t| 0.25 * (std::f64::consts::PI * t).sin());
    for t in (0..moving.len()).step_by(45) {
        moving.points[t][2] += Vector3::repeat(0.3);
    }
    let mut noise = WhiteNoise::default();
    assert!(noise.add_moving(&moving) > 55.0);
    let found = noise.covariance();
    // 1800 differences, a median, and jumps in a tenth of the hand's.
    assert!((found.sd / 0.001 - Coordinates::repeat(1.0)).amax() < 0.2, "{}", found.sd / 0.001);
    assert!(found.correlation.cholesky().is_some());
    assert_eq!(WhiteNoise::default().add_moving(&standing(1, 0.001, |_| 0.0)), 0.0);
}

#[test]
fn a_second_with_lost_points_does_not_count() {
    let mut observations = standing(30, 0.001, |_| 0.0);
    observations.points[40..70].iter_mut().for_each(|frame| frame[4] = Vector3::repeat(f64::NAN));
    let (seconds, _) = trained(&observations);
    // One second before them is no stretch.
    assert_eq!(seconds, 27.0);
}
