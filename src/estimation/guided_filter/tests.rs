use super::super::rate_smoother::tests::{LINE, Line, SETTINGS, batch, observations};
use super::super::rate_smoother::{Estimate, RateFilter};
use super::*;

impl GuidedModel<2> for Line {
    fn log_likelihood(&self, observation: &Option<(f64, f64)>, posture: &SVector<f64, 2>) -> f64 {
        observation.map_or(0.0, |(first, sum)| {
            let residual = SVector::<f64, 2>::new(first - posture[0], sum - posture[0] - posture[1]);
            -0.5 * residual.norm_squared() / self.noise
        })
    }
}

fn settings(particles: usize) -> GuidedSettings {
    GuidedSettings { particles, seed: 3, proposal_dof: 20, straight_within: 0.05, rates: SETTINGS }
}

fn interval(t: usize) -> f64 {
    if t == 0 { 0.0 } else { 0.03 + 0.01 * (t % 3) as f64 }
}

type Frames = Vec<GuidedFrame<SVector<f64, 2>, 2>>;

fn filtered(seen: &[Option<(f64, f64)>], particles: usize) -> Frames {
    let instant = Instant::new(&LINE, settings(particles));
    let mut filter = RateFilter::new(SVector::zeros(), RateSettings { iterations: 1, ..SETTINGS });
    let frames: Vec<_> = (0..seen.len()).map(|t| filter.step(&instant, &seen[t], interval(t))).collect();
    let sizes = instant.into_sizes();
    let found = |(frame, size): (Estimate<_, 2>, f64)| GuidedFrame {
        posture: frame.posture,
        covariance: frame.covariance,
        effective_sample_size: size,
    };
    frames.into_iter().zip(sizes).map(found).collect()
}

fn smoothed(seen: &[Option<(f64, f64)>], particles: usize) -> Frames {
    let path = vec![SVector::<f64, 2>::new(0.3, -0.2); seen.len()];
    let ahead = LookAhead::along(&LINE, &path, seen, interval, SETTINGS.rate_decay_s);
    let mut filter = GuidedFilter::new(SVector::zeros(), settings(particles));
    (0..seen.len()).map(|t| filter.step(&LINE, t, &seen[t], interval(t), &ahead)).collect()
}

/// Mean within `share` of the exact standard deviation, covariance within `share` of the exact variances.
fn assert_near(
    frame: &GuidedFrame<SVector<f64, 2>, 2>,
    mean: &SVector<f64, 2>,
    exact: &SMatrix<f64, 2, 2>,
    share: f64,
    at: usize,
) {
    for d in 0..2 {
        let sd = exact[(d, d)].sqrt();
        assert!((frame.posture[d] - mean[d]).abs() < share * sd, "frame {at}: {} for {}", frame.posture[d], mean[d]);
    }
    let off = (frame.covariance - exact).amax() / exact.amax();
    assert!(off < 2.0 * share, "frame {at}: covariance {} for {exact}", frame.covariance);
}

#[test]
fn on_a_linear_model_the_filter_agrees_with_the_kalman_filter_also_through_a_gap() {
    let seen = observations();
    let mut exact = RateFilter::new(SVector::zeros(), SETTINGS);
    // Pairs on either side of the mode have equal weights: what remains is rounding.
    for (t, frame) in filtered(&seen, 256).iter().enumerate() {
        let kalman = exact.step(&LINE, &seen[t], interval(t));
        assert_near(frame, &kalman.posture, &kalman.covariance, 1e-6, t);
    }
}

#[test]
fn looking_ahead_on_a_linear_model_gives_the_least_squares_solution_over_all_frames() {
    let seen = observations();
    let intervals: Vec<f64> = (0..seen.len()).map(interval).collect();
    let frames = smoothed(&seen, 8192);
    for (t, (mean, covariance)) in batch(&LINE, &seen, &intervals).iter().enumerate() {
        assert_near(&frames[t], mean, covariance, 0.08, t);
        // With an exact look ahead only the proposal's heavier tails cost particles.
        assert!(frames[t].effective_sample_size > 0.8 * 8192.0, "{}", frames[t].effective_sample_size);
    }
}

/// One coordinate seen by two sensors with Student-t errors that contradict each other: a posterior with two modes.
struct Contradiction;

const DOF: f64 = 3.0;
const SENSOR_SD: f64 = 0.3;

impl RateModel<1> for Contradiction {
    type Posture = f64;
    type Observation = [f64; 2];

    fn moved(&self, posture: &f64, step: &SVector<f64, 1>) -> f64 {
        posture + step[0]
    }

    fn step_between(&self, from: &f64, to: &f64) -> SVector<f64, 1> {
        SVector::<f64, 1>::new(to - from)
    }

    fn information(&self, seen: &[f64; 2], posture: &f64) -> (SMatrix<f64, 1, 1>, SVector<f64, 1>) {
        let (mut information, mut gradient) = (0.0, 0.0);
        for y in seen {
            let residual = (y - posture) / SENSOR_SD;
            let weight = (DOF + 1.0) / (DOF + residual * residual);
            information += weight / SENSOR_SD.powi(2);
            gradient += weight * residual / SENSOR_SD;
        }
        (SMatrix::<f64, 1, 1>::new(information), SVector::<f64, 1>::new(gradient))
    }

    fn acceleration_density(&self) -> SVector<f64, 1> {
        SVector::<f64, 1>::new(0.6)
    }
}

impl GuidedModel<1> for Contradiction {
    fn log_likelihood(&self, seen: &[f64; 2], posture: &f64) -> f64 {
        let one = |y: f64| -0.5 * (DOF + 1.0) * (((y - posture) / SENSOR_SD).powi(2) / DOF).ln_1p();
        one(seen[0]) + one(seen[1])
    }
}

const TOY_RATES: RateSettings =
    RateSettings { rate_decay_s: 0.8, initial_sd: 0.8, initial_rate_sd: 1.0, iterations: 3 };
const TOY_INTERVAL_S: f64 = 0.4;

/// Mean and variance of the second frame's posture given both, by numerical integration over both postures.
fn integrated(seen: &[[f64; 2]; 2]) -> (f64, f64) {
    let step = RateStep::over(TOY_INTERVAL_S, TOY_RATES.rate_decay_s);
    let variance = (step.reach * TOY_RATES.initial_rate_sd).powi(2) + 0.6 * step.to_posture;
    let grid = |i: usize| -5.0 + 0.01 * i as f64;
    let first: Vec<f64> = (0..1001)
        .map(|i| {
            (-0.5 * (grid(i) / TOY_RATES.initial_sd).powi(2) + Contradiction.log_likelihood(&seen[0], &grid(i))).exp()
        })
        .collect();
    let (mut mass, mut mean, mut square) = (0.0, 0.0, 0.0);
    for j in 0..1001 {
        let x = grid(j);
        let reached: f64 = (0..1001).map(|i| first[i] * (-0.5 * (x - grid(i)).powi(2) / variance).exp()).sum();
        let density = reached * Contradiction.log_likelihood(&seen[1], &x).exp();
        mass += density;
        mean += density * x;
        square += density * x * x;
    }
    (mean / mass, square / mass - (mean / mass).powi(2))
}

#[test]
fn weights_of_paths_are_exact_where_the_posterior_has_two_modes() {
    let seen = [[0.9, -0.9], [1.1, -0.8]];
    let (mean, variance) = integrated(&seen);
    // Two modes 1.5 apart: no normal distribution of the linearisation has this variance.
    assert!(variance > 0.4, "{variance}");
    let interval = |t: usize| if t == 0 { 0.0 } else { TOY_INTERVAL_S };
    let ahead = LookAhead::along(&Contradiction, &[0.1, 0.2], &seen, interval, TOY_RATES.rate_decay_s);
    let settings = GuidedSettings { rates: TOY_RATES, proposal_dof: 4, ..settings(100_000) };
    let mut filter = GuidedFilter::new(0.0, settings);
    filter.step(&Contradiction, 0, &seen[0], 0.0, &ahead);
    let last = filter.step(&Contradiction, 1, &seen[1], TOY_INTERVAL_S, &ahead);
    // The standard error of the mean over 100 000 particles, of which a third count, is 0.005.
    assert!((last.posture - mean).abs() < 0.02, "{} for {mean}", last.posture);
    assert!((last.covariance[0] / variance - 1.0).abs() < 0.03, "{} for {variance}", last.covariance[0]);
}

#[test]
fn weights_of_one_frame_are_exact_where_the_posterior_is_skew() {
    let seen = [2.5, 2.5];
    let prior_and_likelihood =
        |x: f64| (-0.5 * (x / TOY_RATES.initial_sd).powi(2) + Contradiction.log_likelihood(&seen, &x)).exp();
    let grid = || (0..10_001).map(|i| -5.0 + 1e-3 * f64::from(i));
    let mean = grid().map(|x| x * prior_and_likelihood(x)).sum::<f64>() / grid().map(prior_and_likelihood).sum::<f64>();
    let settings = GuidedSettings { rates: TOY_RATES, proposal_dof: 4, ..settings(100_000) };
    let instant = Instant::new(&Contradiction, settings);
    let mut filter = RateFilter::new(0.0, RateSettings { iterations: 1, ..TOY_RATES });
    let found = filter.step(&instant, &seen, 0.0).posture;
    assert!((found - mean).abs() < 0.01, "{found} for {mean}");
    // The mode is elsewhere, so it is the weights that lead to the mean.
    let mode =
        RateFilter::new(0.0, RateSettings { iterations: 30, ..TOY_RATES }).step(&Contradiction, &seen, 0.0).posture;
    assert!((mode - mean).abs() > 0.05, "mode {mode}, mean {mean}");
}

#[test]
fn the_same_seed_gives_the_same_bits_on_any_number_of_threads_and_another_seed_others() {
    let seen = observations();
    let run = |threads: usize, seed: u64| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("threads");
        pool.install(|| {
            let path = vec![SVector::zeros(); seen.len()];
            let ahead = LookAhead::along(&LINE, &path, &seen, interval, SETTINGS.rate_decay_s);
            let mut filter = GuidedFilter::new(SVector::zeros(), GuidedSettings { seed, ..settings(50) });
            let bits = |t: usize| filter.step(&LINE, t, &seen[t], interval(t), &ahead).posture.map(f64::to_bits);
            (0..seen.len()).map(bits).collect::<Vec<_>>()
        })
    };
    assert_eq!(run(1, 1), run(4, 1));
    assert_ne!(run(1, 1), run(1, 2));
}

#[test]
fn observations_without_a_number_leave_the_particles_equal_and_finite() {
    let frames = smoothed(&[Some((0.1, 0.1)), Some((f64::NAN, 0.0)), Some((0.1, 0.2))], 64);
    assert_eq!(frames[1].effective_sample_size, 64.0);
    for frame in &frames {
        assert!(frame.posture.iter().chain(frame.covariance.iter()).all(|v| v.is_finite()), "{frame:?}");
    }
}

#[test]
fn frames_of_one_instant_refine_each_other() {
    let seen = [Some((0.3, 0.3)); 3];
    let path = vec![SVector::zeros(); 3];
    let ahead = LookAhead::along(&LINE, &path, &seen, |_| 0.0, SETTINGS.rate_decay_s);
    let mut filter = GuidedFilter::new(SVector::zeros(), settings(2048));
    let last = (0..3).map(|t| filter.step(&LINE, t, &seen[t], 0.0, &ahead)).last().expect("three frames");
    // Three readings of one value: a third of the variance, the prior's share being small.
    assert!((last.covariance[(0, 0)] / (0.05 / 3.0) - 1.0).abs() < 0.15, "{}", last.covariance[(0, 0)]);
}
