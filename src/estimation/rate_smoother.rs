//! Gaussian smoothing of a posture whose rates change at random: an iterated extended Kalman filter and the backward
//! pass of Bryson and Frazier, on any space where small steps form a vector of length `D`.
//!
//! ```text
//! x' = x ⊞ a v            a = τ (1 − e^{−Δt/τ})
//! v' = b v + w            b = e^{−Δt/τ},  w from white acceleration of spectral density q
//! ```
//!
//! The rate decays with time constant τ, so that a posture that is not seen comes to rest instead of flying off, and
//! the interval grows to a bound. The model supplies, at a posture `x`, the information `H = JᵀR⁻¹J` and gradient
//! `g = JᵀR⁻¹(y − h(x))` of the observation; the driver knows no body.
//!
//! The backward pass needs no inverse of the predicted covariance, which becomes singular when a direction is known
//! exactly. All matrices are kept as `D × D` blocks of posture (p) and rate (r); the history keeps symmetric ones as
//! triangles, `2.5 D² + 3.5 D` numbers a frame.

use super::rate_dynamics::RateStep;
use nalgebra::{SMatrix, SVector};

/// A space of postures, and what an observation says at one of them.
pub trait RateModel<const D: usize> {
    /// A posture.
    type Posture: Clone;
    /// What is seen in one frame.
    type Observation;

    /// The posture after a small step.
    fn moved(&self, posture: &Self::Posture, step: &SVector<f64, D>) -> Self::Posture;

    /// The step that leads from `from` to `to`.
    fn step_between(&self, from: &Self::Posture, to: &Self::Posture) -> SVector<f64, D>;

    /// Information and gradient of an observation at a posture.
    fn information(
        &self,
        observation: &Self::Observation,
        posture: &Self::Posture,
    ) -> (SMatrix<f64, D, D>, SVector<f64, D>);

    /// The same around a posture that is known up to a covariance; asked once in each iteration of a frame. A method that
    /// looks at more than the tangent at the posture asks for the covariance.
    fn information_around(
        &self,
        observation: &Self::Observation,
        posture: &Self::Posture,
        _covariance: impl Fn() -> SMatrix<f64, D, D>,
    ) -> (SMatrix<f64, D, D>, SVector<f64, D>) {
        self.information(observation, posture)
    }

    /// Spectral density of the acceleration in each direction, rad²/s³.
    fn acceleration_density(&self) -> SVector<f64, D>;
}

/// How the smoother runs.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct RateSettings {
    /// Time constant with which a rate decays, seconds.
    pub rate_decay_s: f64,
    /// Standard deviation of the first posture around its guess, in the unit of a step.
    pub initial_sd: f64,
    /// Standard deviation of the first rates, step units per second.
    pub initial_rate_sd: f64,
    /// Gauss–Newton iterations of each frame.
    pub iterations: usize,
}

type Block<const D: usize> = SMatrix<f64, D, D>;

/// Posture, rate and their covariance.
#[derive(Debug, Clone)]
struct Belief<P, const D: usize> {
    posture: P,
    rate: SVector<f64, D>,
    pp: Block<D>,
    pr: Block<D>,
    rr: Block<D>,
}

/// Estimate of one frame.
#[derive(Debug, Clone)]
pub struct Estimate<P, const D: usize> {
    /// Posture.
    pub posture: P,
    /// Rate, step units per second.
    pub rate: SVector<f64, D>,
    /// Covariance of the posture's error.
    pub covariance: SMatrix<f64, D, D>,
}

/// Filters forwards, frame by frame. Its size does not depend on the number of frames.
#[derive(Debug, Clone)]
pub struct RateFilter<P, const D: usize> {
    settings: RateSettings,
    belief: Belief<P, D>,
    /// `H` at the last frame's posture: with the updated covariance it gives the gain again, for less memory.
    information: Block<D>,
    weighted_innovation: SVector<f64, D>,
    /// Coefficients (a, b) of the step that led to the last frame.
    step: (f64, f64),
}

impl<P: Clone, const D: usize> RateFilter<P, D> {
    /// A filter that starts around a posture at rest.
    pub fn new(initial: P, settings: RateSettings) -> Self {
        let variance = |sd: f64| Block::identity() * sd.powi(2);
        let belief = Belief {
            posture: initial,
            rate: SVector::zeros(),
            pp: variance(settings.initial_sd),
            pr: Block::zeros(),
            rr: variance(settings.initial_rate_sd),
        };
        Self { settings, belief, information: Block::zeros(), weighted_innovation: SVector::zeros(), step: (0.0, 1.0) }
    }

    /// The next frame, `interval_s` seconds after the last. Returns the forward estimate.
    pub fn step<M: RateModel<D, Posture = P>>(
        &mut self,
        model: &M,
        observation: &M::Observation,
        interval_s: f64,
    ) -> Estimate<P, D> {
        self.predict(model, interval_s);
        self.update(model, observation);
        Estimate { posture: self.belief.posture.clone(), rate: self.belief.rate, covariance: self.belief.pp }
    }

    fn predict<M: RateModel<D, Posture = P>>(&mut self, model: &M, interval_s: f64) {
        if interval_s <= 0.0 {
            self.step = (0.0, 1.0);
            return;
        }
        let step = RateStep::over(interval_s, self.settings.rate_decay_s);
        let (a, b) = (step.reach, step.decay);
        let belief = &mut self.belief;
        belief.posture = model.moved(&belief.posture, &(belief.rate * a));
        belief.rate *= b;
        belief.pp += (belief.pr + belief.pr.transpose()) * a + belief.rr * (a * a);
        belief.pr = (belief.pr + belief.rr * a) * b;
        belief.rr *= b * b;
        let density = model.acceleration_density();
        for d in 0..D {
            belief.pp[(d, d)] += density[d] * step.to_posture;
            belief.pr[(d, d)] += density[d] * step.to_both;
            belief.rr[(d, d)] += density[d] * step.to_rate;
        }
        self.step = (a, b);
    }

    /// Gauss–Newton on the posterior: `δ = P (I + H P)⁻¹ (g + H e)` with `e` from the prediction to the iterate.
    fn update<M: RateModel<D, Posture = P>>(&mut self, model: &M, observation: &M::Observation) {
        let belief = &mut self.belief;
        let predicted = belief.posture.clone();
        let mut posture = predicted.clone();
        let mut information = Block::zeros();
        let mut weight = Block::zeros();
        let mut innovation = SVector::zeros();
        for _ in 0..self.settings.iterations {
            let gradient;
            // `weight` is that of the iteration before, so this is the covariance around its posture.
            let covariance = || belief.pp - belief.pp * weight * belief.pp;
            (information, gradient) = model.information_around(observation, &posture, covariance);
            let from_prediction = model.step_between(&predicted, &posture);
            let system = Block::identity() + information * belief.pp;
            // I + H P has only eigenvalues ≥ 1, since H and P are positive semi-definite: the solution exists.
            let Some(inverse) = system.try_inverse() else { break };
            innovation = inverse * (gradient + information * from_prediction);
            weight = inverse * information;
            let correction = belief.pp * innovation;
            posture = model.moved(&predicted, &correction);
        }
        symmetrize(&mut weight);
        let rate_gain = belief.pr.transpose() * weight;
        belief.rate += belief.pr.transpose() * innovation;
        belief.posture = posture;
        belief.rr -= rate_gain * belief.pr;
        let to_posture = belief.pp * weight;
        belief.pr -= to_posture * belief.pr;
        belief.pp -= to_posture * belief.pp;
        symmetrize(&mut belief.pp);
        symmetrize(&mut belief.rr);
        self.information = information;
        self.weighted_innovation = innovation;
    }
}

/// What the backward pass needs of the frames that a filter has been through.
#[derive(Debug)]
pub struct RateHistory<P, const D: usize> {
    frames: Vec<Stored<P, D>>,
}

#[derive(Debug)]
struct Stored<P, const D: usize> {
    posture: P,
    rate: SVector<f64, D>,
    weighted_innovation: SVector<f64, D>,
    step: (f64, f64),
    /// Triangles of pp, rr and the information, then all of pr.
    blocks: Box<[f64]>,
}

impl<P: Clone, const D: usize> RateHistory<P, D> {
    /// A history with room for a number of frames.
    pub fn with_capacity(frames: usize) -> Self {
        Self { frames: Vec::with_capacity(frames) }
    }

    /// Keeps the frame that the filter has just been through.
    pub fn push(&mut self, filter: &RateFilter<P, D>) {
        let belief = &filter.belief;
        let mut blocks = Vec::with_capacity(D * (D + 1) * 3 / 2 + D * D);
        for block in [&belief.pp, &belief.rr, &filter.information] {
            for column in 0..D {
                blocks.extend((column..D).map(|row| block[(row, column)]));
            }
        }
        blocks.extend_from_slice(belief.pr.as_slice());
        self.frames.push(Stored {
            posture: belief.posture.clone(),
            rate: belief.rate,
            weighted_innovation: filter.weighted_innovation,
            step: filter.step,
            blocks: blocks.into_boxed_slice(),
        });
    }

    /// The backward pass: estimates of all frames given all observations, last frame first.
    pub fn smooth<M: RateModel<D, Posture = P>>(self, model: &M, mut emit: impl FnMut(Estimate<P, D>)) {
        let (mut lp, mut lr) = (SVector::<f64, D>::zeros(), SVector::<f64, D>::zeros());
        let (mut pp, mut pr, mut rr) = (Block::<D>::zeros(), Block::<D>::zeros(), Block::<D>::zeros());
        for frame in self.frames.into_iter().rev() {
            let [u_pp, u_rr, information] = std::array::from_fn(|i| unpacked(&frame.blocks, i));
            let u_pr = Block::<D>::from_column_slice(&frame.blocks[D * (D + 1) * 3 / 2..]);
            let from_left = (u_pp * pp + u_pr * pr.transpose(), u_pp * pr + u_pr * rr);
            let reduction = from_left.0 * u_pp + from_left.1 * u_pr.transpose();
            let mut covariance = u_pp - reduction;
            symmetrize(&mut covariance);
            emit(Estimate {
                posture: model.moved(&frame.posture, &-(u_pp * lp + u_pr * lr)),
                rate: frame.rate - (u_pr.transpose() * lp + u_rr * lr),
                covariance,
            });
            // Through the update: C = I − K, with C_pp = I − P_pp H and C_rp = −P_rp H after the update.
            let c = Block::identity() - u_pp * information;
            let k = u_pr.transpose() * information;
            let weight = information * c;
            let cp = c.transpose() * pp - k.transpose() * pr.transpose();
            let cr = c.transpose() * pr - k.transpose() * rr;
            pp = cp * c - cr * k + weight;
            pr = cr;
            lp = c.transpose() * lp - k.transpose() * lr - frame.weighted_innovation;
            // Through the prediction: F = [I aI; 0 bI].
            let (a, b) = frame.step;
            lr = lp * a + lr * b;
            rr = pp * (a * a) + (pr + pr.transpose()) * (a * b) + rr * (b * b);
            pr = pp * a + pr * b;
            symmetrize(&mut pp);
            symmetrize(&mut rr);
        }
    }
}

/// The symmetric block whose lower triangle stands at place `index` of a packed history.
fn unpacked<const D: usize>(blocks: &[f64], index: usize) -> Block<D> {
    let mut block = Block::zeros();
    let mut next = index * D * (D + 1) / 2;
    for column in 0..D {
        for row in column..D {
            block[(row, column)] = blocks[next];
            block[(column, row)] = blocks[next];
            next += 1;
        }
    }
    block
}

fn symmetrize<const D: usize>(matrix: &mut Block<D>) {
    for column in 0..D {
        for row in 0..column {
            let mean = 0.5 * (matrix[(row, column)] + matrix[(column, row)]);
            matrix[(row, column)] = mean;
            matrix[(column, row)] = mean;
        }
    }
}

#[cfg(test)]
pub(super) mod tests {
    use super::*;
    use nalgebra::{DMatrix, DVector};

    /// Two independent coordinates, the first seen, the second seen together with the first.
    pub(crate) struct Line {
        pub(crate) density: f64,
        pub(crate) noise: f64,
    }

    impl RateModel<2> for Line {
        type Posture = SVector<f64, 2>;
        type Observation = Option<(f64, f64)>;

        fn moved(&self, posture: &Self::Posture, step: &SVector<f64, 2>) -> Self::Posture {
            posture + step
        }

        fn step_between(&self, from: &Self::Posture, to: &Self::Posture) -> SVector<f64, 2> {
            to - from
        }

        fn information(
            &self,
            observation: &Self::Observation,
            posture: &Self::Posture,
        ) -> (SMatrix<f64, 2, 2>, SVector<f64, 2>) {
            let Some((first, sum)) = *observation else { return (SMatrix::zeros(), SVector::zeros()) };
            let j = SMatrix::<f64, 2, 2>::new(1.0, 0.0, 1.0, 1.0);
            let residual = SVector::<f64, 2>::new(first, sum) - j * posture;
            (j.transpose() * j / self.noise, j.transpose() * residual / self.noise)
        }

        fn acceleration_density(&self) -> SVector<f64, 2> {
            SVector::repeat(self.density)
        }
    }

    pub(crate) const SETTINGS: RateSettings =
        RateSettings { rate_decay_s: 0.8, initial_sd: 2.0, initial_rate_sd: 1.5, iterations: 1 };

    pub(crate) const LINE: Line = Line { density: 0.7, noise: 0.05 };

    /// Twelve frames, of which three are not seen.
    pub(crate) fn observations() -> Vec<Option<(f64, f64)>> {
        let value = |t: usize| (t as f64 * 0.4).sin();
        (0..12).map(|t| (!(5..8).contains(&t)).then(|| (value(t), value(t) + 0.1 * t as f64))).collect()
    }

    /// The same model solved as one least-squares problem over all frames: the exact posterior of a linear model.
    pub(crate) fn batch(
        model: &Line,
        seen: &[Option<(f64, f64)>],
        intervals: &[f64],
    ) -> Vec<(SVector<f64, 2>, SMatrix<f64, 2, 2>)> {
        let n = intervals.len();
        let mut information = DMatrix::<f64>::zeros(4 * n, 4 * n);
        let mut gradient = DVector::<f64>::zeros(4 * n);
        for d in 0..2 {
            information[(d, d)] += 1.0 / SETTINGS.initial_sd.powi(2);
            information[(2 + d, 2 + d)] += 1.0 / SETTINGS.initial_rate_sd.powi(2);
        }
        for t in 0..n {
            let (h, g) = model.information(&seen[t], &SVector::zeros());
            for i in 0..2 {
                gradient[4 * t + i] += g[i];
                for j in 0..2 {
                    information[(4 * t + i, 4 * t + j)] += h[(i, j)];
                }
            }
            if t == 0 {
                continue;
            }
            let (tau, s) = (SETTINGS.rate_decay_s, intervals[t] / SETTINGS.rate_decay_s);
            let (a, b) = (tau * (1.0 - (-s).exp()), (-s).exp());
            let qpp = 0.5 * tau.powi(3) * (2.0 * s - 3.0 + 4.0 * (-s).exp() - (-2.0 * s).exp());
            let qpr = 0.5 * tau.powi(2) * (1.0 - (-s).exp()).powi(2);
            let qrr = 0.5 * tau * (1.0 - (-2.0 * s).exp());
            let q = SMatrix::<f64, 2, 2>::new(qpp, qpr, qpr, qrr) * model.density;
            let q_inverse = q.try_inverse().expect("positive definite");
            for d in 0..2 {
                // Residual of (p, r): [x_t − x_{t−1} − a v_{t−1}, v_t − b v_{t−1}].
                let rows = [4 * (t - 1) + d, 4 * (t - 1) + 2 + d, 4 * t + d, 4 * t + 2 + d];
                let j = SMatrix::<f64, 2, 4>::new(-1.0, -a, 1.0, 0.0, 0.0, -b, 0.0, 1.0);
                let block = j.transpose() * q_inverse * j;
                for (i, row) in rows.iter().enumerate() {
                    for (k, column) in rows.iter().enumerate() {
                        information[(*row, *column)] += block[(i, k)];
                    }
                }
            }
        }
        let covariance = information.try_inverse().expect("observable");
        let mean = &covariance * gradient;
        let frame = |t: usize| {
            let m = SVector::<f64, 2>::new(mean[4 * t], mean[4 * t + 1]);
            (m, covariance.fixed_view::<2, 2>(4 * t, 4 * t).into_owned())
        };
        (0..n).map(frame).collect()
    }

    #[test]
    fn the_smoother_is_the_least_squares_solution_over_all_frames_also_through_a_gap() {
        let (model, seen) = (LINE, observations());
        let intervals: Vec<f64> = (0..12).map(|t| if t == 0 { 0.0 } else { 0.03 + 0.01 * (t % 3) as f64 }).collect();
        let mut filter = RateFilter::new(SVector::zeros(), SETTINGS);
        let mut history = RateHistory::with_capacity(12);
        for (observation, interval) in seen.iter().zip(&intervals) {
            filter.step(&model, observation, *interval);
            history.push(&filter);
        }
        let mut smoothed = Vec::new();
        history.smooth(&model, |frame| smoothed.push(frame));
        smoothed.reverse();
        for (t, (mean, covariance)) in batch(&model, &seen, &intervals).into_iter().enumerate() {
            assert!((smoothed[t].posture - mean).norm() < 1e-9, "frame {t}");
            assert!((smoothed[t].covariance - covariance).norm() < 1e-9, "covariance of frame {t}");
        }
    }

    #[test]
    fn an_unseen_posture_comes_to_rest_and_its_uncertainty_stays_bounded_in_rate() {
        let model = Line { density: 0.5, noise: 1e-6 };
        let mut filter = RateFilter::new(SVector::zeros(), SETTINGS);
        filter.step(&model, &Some((0.0, 0.0)), 0.0);
        filter.step(&model, &Some((0.1, 0.1)), 0.1);
        let after = filter.step(&model, &None, 100.0);
        assert!(after.rate.norm() < 1e-12);
        // One metre per second decaying over 0.8 s goes on by at most 0.8.
        assert!(after.posture[0] < 0.1 + 1.2 * SETTINGS.rate_decay_s);
        assert!(filter.belief.rr[(0, 0)] < 0.5 * 0.5 * SETTINGS.rate_decay_s + 1e-9);
    }
}
