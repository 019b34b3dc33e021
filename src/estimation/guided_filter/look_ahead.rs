//! What the frames to come say of a posture and its rate: an information filter that runs backwards over a linearised
//! model.
//!
//! ```text
//! log ψ_t(e, v) = −½ [e v] J_t [e v]ᵀ + j_t [e v]ᵀ,   e = posture ⊟ reference_t,  v = rate
//! ψ_t(x_t, v_t) ≈ p(y_{t+1}, …, y_T | x_t, v_t)
//! J_t = Fᵀ (I + J⁺ Q)⁻¹ J⁺ F                           J⁺ = J_{t+1} + H_{t+1}
//! ```
//!
//! A filter whose particles look ahead through ψ goes where the later frames will be explained, and is told so by its
//! weights (Whiteley and Lee 2014; Guarniero, Johansen and Lee 2017).

use super::super::rate_dynamics::RateStep;
use super::super::rate_smoother::RateModel;
use nalgebra::{DMatrix, DVector, SMatrix, SVector};

type Block<const D: usize> = SMatrix<f64, D, D>;

/// One frame's look ahead: information of posture and rate, in blocks.
#[derive(Debug, Clone)]
struct Ahead<P, const D: usize> {
    reference: P,
    ee: Block<D>,
    ev: Block<D>,
    vv: Block<D>,
    e: SVector<f64, D>,
    v: SVector<f64, D>,
}

/// What the later frames say, for every frame of a recording.
#[derive(Debug, Clone)]
pub struct LookAhead<P, const D: usize> {
    frames: Vec<Ahead<P, D>>,
}

impl<P: Clone, const D: usize> LookAhead<P, D> {
    /// Linearises the model along a path (one posture for each observation), last frame first. `interval_s` gives the time
    /// from the previous frame to each.
    ///
    /// Where a system has no factor, which takes an observation without a number, the look ahead ends: earlier frames see
    /// only up to there.
    pub fn along<M: RateModel<D, Posture = P>>(
        model: &M,
        path: &[P],
        observations: &[M::Observation],
        interval_s: impl Fn(usize) -> f64,
        rate_decay_s: f64,
    ) -> Self {
        let mut frames = Vec::with_capacity(path.len());
        let mut information = DMatrix::<f64>::zeros(2 * D, 2 * D);
        let mut linear = DVector::<f64>::zeros(2 * D);
        for (t, (reference, observation)) in path.iter().zip(observations).enumerate().rev() {
            frames.push(Ahead {
                reference: reference.clone(),
                ee: information.fixed_view::<D, D>(0, 0).into_owned(),
                ev: information.fixed_view::<D, D>(0, D).into_owned(),
                vv: information.fixed_view::<D, D>(D, D).into_owned(),
                e: linear.fixed_rows::<D>(0).into_owned(),
                v: linear.fixed_rows::<D>(D).into_owned(),
            });
            if t == 0 {
                break;
            }
            let (seen, gradient) = model.information(observation, reference);
            let mut view = information.fixed_view_mut::<D, D>(0, 0);
            view += seen;
            let mut view = linear.fixed_rows_mut::<D>(0);
            view += gradient;
            // The reference moves too: e' = e + a v + w − (step of the reference).
            let moved = model.step_between(&path[t - 1], reference);
            linear += information.fixed_columns::<D>(0) * moved;
            let step = RateStep::over(interval_s(t), rate_decay_s);
            let through = through_noise(&information, &linear, &step, &model.acceleration_density());
            (information, linear) = through.unwrap_or_else(|| (DMatrix::zeros(2 * D, 2 * D), DVector::zeros(2 * D)));
            through_dynamics::<D>(&mut information, &mut linear, &step);
        }
        frames.reverse();
        Self { frames }
    }

    /// The look ahead from frame `t` for a rate that is known up to a variance, and a posture that is drawn as a step whose
    /// `gain` moves the rate. `None` past the last frame, and where a variance has no factor.
    pub(super) fn guide(
        &self,
        t: usize,
        rate_variance: &SVector<f64, D>,
        gain: &SVector<f64, D>,
    ) -> Option<Guide<'_, P, D>> {
        let ahead = self.frames.get(t)?;
        // ∫ ψ(e, v) N(v; m, P) dv with v = m + P^½ u; S = P^½ (I + P^½ J_vv P^½)⁻¹ P^½.
        let root = rate_variance.map(f64::sqrt);
        let mut system = Block::<D>::from_fn(|i, j| root[i] * ahead.vv[(i, j)] * root[j]);
        system += Block::identity();
        let inverse = system.cholesky()?.inverse();
        let s = Block::<D>::from_fn(|i, j| root[i] * inverse[(i, j)] * root[j]);
        let ev_s = ahead.ev * s;
        let vv_s = ahead.vv * s;
        let ee = ahead.ee - ev_s * ahead.ev.transpose();
        let em = ahead.ev - ev_s * ahead.vv;
        let mm = ahead.vv - vv_s * ahead.vv;
        let mut mixed = em;
        for (column, mut values) in mixed.column_iter_mut().enumerate() {
            values *= gain[column];
        }
        let rates = Block::<D>::from_fn(|i, j| gain[i] * mm[(i, j)] * gain[j]);
        let curvature = ee + mixed + mixed.transpose() + rates;
        let (e, m) = (ahead.e - ev_s * ahead.v, ahead.v - vv_s * ahead.v);
        Some(Guide { reference: &ahead.reference, ee, em, mm, e, m, curvature })
    }
}

/// `log ∫ ψ(e, v) N(v; m, P) dv`: a quadratic in the posture's error `e` and the rate's mean `m`.
pub(super) struct Guide<'a, P, const D: usize> {
    /// Posture from which `e` is counted.
    pub(super) reference: &'a P,
    ee: Block<D>,
    em: Block<D>,
    mm: Block<D>,
    e: SVector<f64, D>,
    m: SVector<f64, D>,
    /// Negative second derivative along a step of the posture, which moves the rate by the gain.
    pub(super) curvature: Block<D>,
}

impl<P, const D: usize> Guide<'_, P, D> {
    /// Value, up to a constant of the frame.
    pub(super) fn value(&self, e: &SVector<f64, D>, m: &SVector<f64, D>) -> f64 {
        let from_e = self.e - self.ee * e * 0.5 - self.em * m;
        let from_m = self.m - self.mm * m * 0.5;
        from_e.dot(e) + from_m.dot(m)
    }

    /// Derivative along a step of the posture.
    pub(super) fn gradient(&self, e: &SVector<f64, D>, m: &SVector<f64, D>, gain: &SVector<f64, D>) -> SVector<f64, D> {
        let along_e = self.e - self.ee * e - self.em * m;
        let along_m = self.m - self.em.tr_mul(e) - self.mm * m;
        along_e + gain.component_mul(&along_m)
    }
}

/// `((I + J Q)⁻¹ J, (I + J Q)⁻¹ j)` with `Q = L Lᵀ`: through `I + Lᵀ J L`, whose eigenvalues are at least 1. `None` without
/// a number.
fn through_noise<const D: usize>(
    information: &DMatrix<f64>,
    linear: &DVector<f64>,
    step: &RateStep,
    density: &SVector<f64, D>,
) -> Option<(DMatrix<f64>, DVector<f64>)> {
    // Each coordinate's noise is [l 0; c r] times two independent numbers.
    let (l, c, r) = noise_factor(step);
    let mut spread = DMatrix::<f64>::zeros(2 * D, 2 * D);
    for d in 0..D {
        let root = density[d].max(0.0).sqrt();
        spread[(d, d)] = l * root;
        spread[(D + d, d)] = c * root;
        spread[(D + d, D + d)] = r * root;
    }
    let right = information * &spread;
    let system = DMatrix::identity(2 * D, 2 * D) + spread.tr_mul(&right);
    let factor = system.cholesky()?;
    let whitened = factor.l_dirty().solve_lower_triangular(&right.transpose())?;
    let target = factor.l_dirty().solve_lower_triangular(&spread.tr_mul(linear))?;
    Some((information - whitened.tr_mul(&whitened), linear - whitened.tr_mul(&target)))
}

/// Lower triangular factor of one coordinate's noise for an acceleration of density 1.
fn noise_factor(step: &RateStep) -> (f64, f64, f64) {
    let posture = step.to_posture.max(0.0).sqrt();
    let both = if posture > 0.0 { step.to_both / posture } else { 0.0 };
    (posture, both, (step.to_rate - both * both).max(0.0).sqrt())
}

/// `(Fᵀ J F, Fᵀ j)` with `F = [I aI; 0 bI]`.
fn through_dynamics<const D: usize>(information: &mut DMatrix<f64>, linear: &mut DVector<f64>, step: &RateStep) {
    let (a, b) = (step.reach, step.decay);
    let ee = information.fixed_view::<D, D>(0, 0).into_owned();
    let ev = information.fixed_view::<D, D>(0, D).into_owned();
    let vv = information.fixed_view::<D, D>(D, D).into_owned();
    let new_ev = ee * a + ev * b;
    let new_vv = ee * (a * a) + (ev + ev.transpose()) * (a * b) + vv * (b * b);
    information.fixed_view_mut::<D, D>(0, D).copy_from(&new_ev);
    information.fixed_view_mut::<D, D>(D, 0).copy_from(&new_ev.transpose());
    information.fixed_view_mut::<D, D>(D, D).copy_from(&((new_vv + new_vv.transpose()) * 0.5));
    let v = linear.fixed_rows::<D>(0) * a + linear.fixed_rows::<D>(D) * b;
    linear.fixed_rows_mut::<D>(D).copy_from(&v);
}
