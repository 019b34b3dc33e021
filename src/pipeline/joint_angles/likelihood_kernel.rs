//! The likelihood of the particle filter: forward kinematics and Mahalanobis distance of a register of particles, `f32`.
//!
//! ```text
//! log g(y | θ) = −½ (y − K(θ))ᵀ Σy⁻¹ (y − K(θ)) + constant
//! ```
//!
//! The residual is whitened with the inverse Cholesky factor of Σy, restricted to the points that were seen. The plain
//! `f64` version stands in the tests of the model. No closures in what [`LikelihoodTask`] calls: they are not compiled
//! with the instruction set's features, and each operation in them would become a call.

use super::noise_model::ObservationCovariance;
use super::observation::SeenMask;
use crate::body::pose::{POSE_DIMENSION, attitude_offset, hinge_offset};
use crate::body::{OBSERVATION_DIMENSION, POINT_COUNT, Skeleton};
use crate::estimation::particle_filter::Particles;
use crate::geometry::lanes::{Lanes, sin_cos};
use nalgebra::DMatrix;
use pulp::{Simd, WithSimd};

/// Rows of the factor that are handled together, so that each residual is loaded once for all of them.
const TILE: usize = 4;

/// Inverse of the Cholesky factor of Σy restricted to the rows that were seen; the others are zero.
#[derive(Debug, Clone)]
pub(super) struct Whitening {
    /// One tile of rows after the other: column by column, up to the tile's last row, the factors of the tile's rows.
    factors: Vec<[f32; TILE]>,
}

impl Whitening {
    pub(super) fn new(observation: &ObservationCovariance, mask: SeenMask) -> Self {
        let rows: Vec<usize> = (0..OBSERVATION_DIMENSION).filter(|row| mask >> (row / 3) & 1 == 1).collect();
        let seen = DMatrix::from_fn(rows.len(), rows.len(), |i, j| observation[(rows[i], rows[j])]);
        // Σy is positive definite by construction, and so is every principal minor of it.
        let inverse = seen.cholesky().and_then(|c| c.l().try_inverse()).unwrap_or_else(|| DMatrix::zeros(0, 0));
        let mut whitening = DMatrix::zeros(OBSERVATION_DIMENSION, OBSERVATION_DIMENSION);
        for i in 0..inverse.nrows() {
            for j in 0..=i {
                whitening[(rows[i], rows[j])] = inverse[(i, j)] as f32;
            }
        }
        let mut factors = Vec::new();
        for tile in (0..OBSERVATION_DIMENSION).step_by(TILE) {
            factors.extend((0..tile + TILE).map(|column| std::array::from_fn(|row| whitening[(tile + row, column)])));
        }
        Self { factors }
    }
}

/// The likelihood of all particles, for any instruction set.
pub(super) struct LikelihoodTask<'a> {
    pub(super) kernel: &'a Kernel,
    pub(super) particles: &'a Particles,
    pub(super) observed: [[f32; 3]; POINT_COUNT],
    pub(super) whitening: &'a Whitening,
    pub(super) log_likelihood: &'a mut [f32],
}

impl WithSimd for LikelihoodTask<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        let Self { kernel, particles, observed, whitening, log_likelihood } = self;
        let mut theta: [&[S::f32s]; POSE_DIMENSION] = [&[]; POSE_DIMENSION];
        for (d, coordinate) in theta.iter_mut().enumerate() {
            *coordinate = S::as_simd_f32s(particles.coordinate(d)).0;
        }
        // Two registers share the loads of the factors; the widest registers may leave a single one.
        let (pairs, single) = S::as_mut_simd_f32s(log_likelihood).0.as_chunks_mut::<2>();
        let last = 2 * pairs.len();
        for (i, pair) in pairs.iter_mut().enumerate() {
            let first = kernel.residuals(simd, &theta, 2 * i, &observed);
            let second = kernel.residuals(simd, &theta, 2 * i + 1, &observed);
            *pair = log_likelihoods(simd, &[first, second], whitening);
        }
        if let [single] = single {
            [*single] = log_likelihoods(simd, &[kernel.residuals(simd, &theta, last, &observed)], whitening);
        }
    }
}

/// Points of a register of particles, or their distance from those observed.
type PointLanes<S> = [[Lanes<S>; 3]; POINT_COUNT];

/// `−½ rᵀ Σy⁻¹ r` of the residuals of some registers of particles, over the rows that were seen.
#[inline(always)]
fn log_likelihoods<S: Simd, const REGISTERS: usize>(
    simd: S,
    residuals: &[PointLanes<S>; REGISTERS],
    whitening: &Whitening,
) -> [S::f32s; REGISTERS] {
    let zero = Lanes::splat(simd, 0.0);
    let mut squared = [zero; REGISTERS];
    let mut next = 0;
    for last in (TILE..=OBSERVATION_DIMENSION).step_by(TILE) {
        let mut whitened = [[zero; REGISTERS]; TILE];
        for (column, factors) in whitening.factors[next..next + last].iter().enumerate() {
            for register in 0..REGISTERS {
                let residual = residuals[register].as_flattened()[column];
                for row in 0..TILE {
                    whitened[row][register] += residual * factors[row];
                }
            }
        }
        next += last;
        for whitened in &whitened {
            for register in 0..REGISTERS {
                squared[register] += whitened[register] * whitened[register];
            }
        }
    }
    let mut logs = [zero.values; REGISTERS];
    for register in 0..REGISTERS {
        logs[register] = (squared[register] * -0.5).values;
    }
    logs
}

/// Forward kinematics of a register of particles.
#[derive(Debug, Clone)]
pub(super) struct Kernel {
    offsets: [[f32; 3]; 4],
    proximal: [f32; 4],
    distal: [f32; 4],
}

/// Column of the limb's rotation matrix along its reference direction, with sign; the flexed direction is column X.
const REFERENCE_COLUMN: [(usize, f32); 4] = [(2, -1.0), (2, 1.0), (1, -1.0), (1, -1.0)];
/// Sign of the flexed direction on column X.
const FLEXED_SIGN: [f32; 4] = [1.0, 1.0, -1.0, -1.0];

impl Kernel {
    pub(super) fn new(skeleton: &Skeleton) -> Self {
        Self {
            offsets: skeleton.offsets.map(|o| [o.x as f32, o.y as f32, o.z as f32]),
            proximal: skeleton.proximal.map(|l| l as f32),
            distal: skeleton.distal.map(|l| l as f32),
        }
    }

    /// K(θ) − y of a register of particles.
    #[inline(always)]
    fn residuals<S: Simd>(
        &self,
        simd: S,
        theta: &[&[S::f32s]; POSE_DIMENSION],
        register: usize,
        observed: &[[f32; 3]; POINT_COUNT],
    ) -> PointLanes<S> {
        let trunk = rotation(simd, attitude(simd, theta, 0, register));
        let [a, b, c] = self.limb_points::<S, 0>(simd, &trunk, theta, register);
        let [d, e, f] = self.limb_points::<S, 1>(simd, &trunk, theta, register);
        let [g, h, i] = self.limb_points::<S, 2>(simd, &trunk, theta, register);
        let [j, k, l] = self.limb_points::<S, 3>(simd, &trunk, theta, register);
        let mut points = [a, b, c, d, e, f, g, h, i, j, k, l];
        for (point, observed) in points.iter_mut().zip(observed) {
            for axis in 0..3 {
                point[axis] = point[axis] - observed[axis];
            }
        }
        points
    }

    /// Root, middle and end of a limb. The limb is a constant, so that its columns and signs are, too.
    #[inline(always)]
    fn limb_points<S: Simd, const LIMB: usize>(
        &self,
        simd: S,
        trunk: &[[Lanes<S>; 3]; 3],
        theta: &[&[S::f32s]; POSE_DIMENSION],
        register: usize,
    ) -> [[Lanes<S>; 3]; 3] {
        let turn = rotation(simd, attitude(simd, theta, attitude_offset(LIMB), register));
        let (sine, cosine) = sin_cos(Lanes::new(simd, theta[hinge_offset(LIMB)][register]));
        let (column, sign) = REFERENCE_COLUMN[LIMB];
        let along = sign * self.proximal[LIMB];
        let cosine = cosine * (sign * self.distal[LIMB]);
        let sine = sine * (FLEXED_SIGN[LIMB] * self.distal[LIMB]);
        let mut offset = [Lanes::splat(simd, 0.0); 3];
        let (mut to_middle, mut to_end) = (offset, offset);
        for axis in 0..3 {
            offset[axis] = Lanes::splat(simd, self.offsets[LIMB][axis]);
            to_middle[axis] = turn[axis][column] * along;
            to_end[axis] = to_middle[axis] + turn[axis][column] * cosine + turn[axis][0] * sine;
        }
        let root = transform(trunk, &offset);
        [root, sum(&root, &transform(trunk, &to_middle)), sum(&root, &transform(trunk, &to_end))]
    }
}

/// The attitude vector that starts at a coordinate.
#[inline(always)]
fn attitude<S: Simd>(simd: S, theta: &[&[S::f32s]; POSE_DIMENSION], start: usize, register: usize) -> [Lanes<S>; 3] {
    [
        Lanes::new(simd, theta[start][register]),
        Lanes::new(simd, theta[start + 1][register]),
        Lanes::new(simd, theta[start + 2][register]),
    ]
}

/// Rodrigues' formula for attitude vectors: `matrix[row][column]`.
#[inline(always)]
fn rotation<S: Simd>(simd: S, [x, y, z]: [Lanes<S>; 3]) -> [[Lanes<S>; 3]; 3] {
    // The tiny term keeps the division finite at zero; it changes an angle of 1e-3 rad by 5e-13.
    let one = Lanes::splat(simd, 1.0);
    let squared = x * x + y * y + z * z + 1e-15;
    let angle = squared.sqrt();
    let (sine, cosine) = sin_cos(angle);
    let s = sine / angle;
    let c = (one - cosine) / squared;
    let (cx, cy, cz) = (c * x, c * y, c * z);
    let (sx, sy, sz) = (s * x, s * y, s * z);
    let (xx, yy, zz) = (cx * x, cy * y, cz * z);
    let (xy, xz, yz) = (cx * y, cx * z, cy * z);
    [[one - (yy + zz), xy - sz, xz + sy], [xy + sz, one - (xx + zz), yz - sx], [xz - sy, yz + sx, one - (xx + yy)]]
}

#[inline(always)]
fn transform<S: Simd>(m: &[[Lanes<S>; 3]; 3], v: &[Lanes<S>; 3]) -> [Lanes<S>; 3] {
    let mut out = *v;
    for axis in 0..3 {
        out[axis] = m[axis][0] * v[0] + m[axis][1] * v[1] + m[axis][2] * v[2];
    }
    out
}

#[inline(always)]
fn sum<S: Simd>(a: &[Lanes<S>; 3], b: &[Lanes<S>; 3]) -> [Lanes<S>; 3] {
    [a[0] + b[0], a[1] + b[1], a[2] + b[2]]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::lanes::LANES;
    use crate::pipeline::joint_angles::noise_model::NoiseModel;
    use crate::pipeline::joint_angles::observation::ALL_SEEN;

    #[test]
    fn every_instruction_set_gives_the_same_bits() {
        const COUNT: usize = 3 * LANES;
        let kernel = Kernel::new(&Skeleton::of_stature(1.7));
        let whitening = Whitening::new(&NoiseModel::nite_table1().observation, ALL_SEEN);
        let observed = std::array::from_fn(|p| [0, 1, 2].map(|axis| ((3 * p + axis) as f32 * 0.7).sin() * 0.5));
        let mut particles = Particles::at(&[0.0; POSE_DIMENSION], COUNT);
        for d in 0..POSE_DIMENSION {
            for (i, value) in particles.coordinate_mut(d).iter_mut().enumerate() {
                *value = ((d * COUNT + i) as f32 * 1.3).sin();
            }
        }
        let (mut wide, mut narrow) = ([0.0; COUNT], [0.0; COUNT]);
        let task = |log_likelihood| LikelihoodTask {
            kernel: &kernel,
            particles: &particles,
            observed,
            whitening: &whitening,
            log_likelihood,
        };
        pulp::Arch::new().dispatch(task(&mut wide));
        task(&mut narrow).with_simd(pulp::Scalar::new());
        assert_eq!(wide.map(f32::to_bits), narrow.map(f32::to_bits));
    }
}
