//! The leg model as a particle model.
//!
//! ```text
//! angles        X(t+1) = 2 X(t) − X(t−1) + ε        constant velocity (\[walker\] Eq. 3)
//! all others    X(t+1) = X(t) + ε
//! weight        P1 · P2 = exp(−d1 / 5 mm − d2 / 3 mm)
//! ```
//!
//! A particle is the state with the rates of its angles, so that frames may come at uneven times: over an interval Δt an
//! angle moves by `rate · Δt`, and ε has the variance of 1/30 s times Δt · 30. States are cut to their bounds and lifted
//! or lowered until a foot stands on the floor; legs that go through each other have no weight.

use super::colour_cue::{self, ColourCue};
use super::distance_cue::{self, DistanceCue, Distances};
use super::foreground::Foreground;
use super::projection_cue::{self, ProjectionCue, Scratch};
use super::settings::TransitionNoise;
use crate::assessment::LegCues;
use crate::body::legs::bounds::bounds;
use crate::body::legs::constraints::{legs_intersect, stand};
use crate::body::legs::solids::SOLID_COUNT;
use crate::body::legs::{FIRST_ANGLE, LEG_DIMENSION, LegState, LegVector, RIGHT_HIP};
use crate::estimation::particle_filter::{ParticleModel, Particles};
use crate::estimation::random::RandomStreams;
use crate::geometry::camera::Intrinsics;
use crate::geometry::floor::Floor;
use crate::geometry::tapered_cylinder::TaperedCylinder;
use nalgebra::Vector3;
use pulp::{Arch, Simd, WithSimd};
use rayon::prelude::*;

/// Coordinates of a particle: the state, then the rates of its angles, rad/s.
pub const PARTICLE_DIMENSION: usize = LEG_DIMENSION + (LEG_DIMENSION - FIRST_ANGLE);

/// Particles that one task weighs. Fixed, but results do not depend on it: each particle is weighed by itself.
const CHUNK: usize = 16;

/// Frame rate that the transition's noise is given for, 1/s.
const NOMINAL_RATE: f64 = 30.0;

/// One frame, ready to weigh particles.
#[derive(Debug)]
pub struct Observation {
    foreground: Foreground,
    camera: Intrinsics,
    distance: DistanceCue,
    colour: Option<ColourCue>,
}

impl Observation {
    /// The observation that a foreground is; `None` when it has too few points for cue 1.
    pub fn new(foreground: Foreground, camera: Intrinsics) -> Option<Self> {
        let distance = DistanceCue::new(&foreground.points)?;
        Some(Self { foreground, camera, distance, colour: None })
    }

    /// The same with what the cameras at the sides see.
    #[must_use]
    pub fn with_colour(self, colour: Option<ColourCue>) -> Self {
        Self { colour, ..self }
    }

    /// The foreground.
    pub fn foreground(&self) -> &Foreground {
        &self.foreground
    }

    fn projection(&self) -> ProjectionCue<'_> {
        ProjectionCue::new(&self.foreground, &self.camera)
    }
}

/// How far a model is from the image.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Fit {
    /// Cue 1: both directed distances, metres.
    pub distances: Distances,
    /// Cue 2: `d2`, metres; `None` when the model reaches behind the camera.
    pub projection: Option<f64>,
}

/// The transition and the likelihood.
#[derive(Debug, Clone)]
pub struct LegParticleModel {
    floor: Floor,
    /// What weighs particles.
    pub cues: LegCues,
    sd: [f64; LEG_DIMENSION],
    bounds: [[f32; 2]; LEG_DIMENSION],
    drawn: Vec<f32>,
    rates: Vec<f32>,
    bodies: Vec<Body>,
    arch: Arch,
    /// Factor of the noise: wide while the filter searches.
    pub noise_factor: f64,
    /// Power of the likelihood: below 1 while the filter searches.
    pub likelihood_power: f64,
    /// False while the filter searches in one frame: angles then have no rates.
    pub moves: bool,
}

/// A particle's solids.
#[derive(Debug, Clone)]
struct Body {
    solids: [TaperedCylinder; SOLID_COUNT],
    right_hip: [f32; 3],
    intersects: bool,
}

impl Default for Body {
    fn default() -> Self {
        let nothing = TaperedCylinder { start: Vector3::zeros(), end: Vector3::zeros(), radii: [0.0; 2], dome: None };
        Self { solids: [nothing; SOLID_COUNT], right_hip: [0.0; 3], intersects: true }
    }
}

impl LegParticleModel {
    /// The model over a floor.
    pub fn new(floor: Floor, cues: LegCues, noise: &TransitionNoise) -> Self {
        Self {
            floor,
            cues,
            sd: noise.by_element(),
            bounds: std::array::from_fn(|i| bounds(i).map(|bound| bound as f32)),
            drawn: Vec::new(),
            rates: Vec::new(),
            bodies: Vec::new(),
            arch: Arch::new(),
            noise_factor: 1.0,
            likelihood_power: 1.0,
            moves: true,
        }
    }

    /// The model on a given instruction set, for measurements; results do not depend on it.
    #[must_use]
    pub fn with_arch(self, arch: Arch) -> Self {
        Self { arch, ..self }
    }

    /// How well a state fits a frame.
    pub fn fit(&self, observation: &Observation, state: &LegState) -> Fit {
        let (_, _, solids) = stand(state, &self.floor);
        self.arch.dispatch(FitTask { observation, solids: &solids })
    }

    /// Moves every coordinate by itself.
    fn drift(&mut self, interval_s: f64, particles: &mut Particles) {
        let count = particles.count();
        let mut rates = std::mem::take(&mut self.rates);
        let (interval, spread) = (interval_s as f32, (interval_s * NOMINAL_RATE).sqrt() * self.noise_factor);
        for (d, noise) in self.drawn.chunks_exact(count).enumerate() {
            let ([low, high], step) = (self.bounds[d], (self.sd[d] * spread) as f32);
            if d < FIRST_ANGLE {
                for (value, noise) in particles.coordinate_mut(d).iter_mut().zip(noise) {
                    *value = (*value + step * noise).clamp(low, high);
                }
                continue;
            }
            rates.clear();
            rates.extend_from_slice(particles.coordinate(rate_of(d)));
            for ((value, rate), noise) in particles.coordinate_mut(d).iter_mut().zip(&mut rates).zip(noise) {
                let before = *value;
                *value = (before + *rate * interval + step * noise).clamp(low, high);
                *rate = if self.moves { (*value - before) / interval } else { 0.0 };
            }
            particles.coordinate_mut(rate_of(d)).copy_from_slice(&rates);
        }
        self.rates = rates;
    }

    /// Puts every particle on its feet.
    fn stand(&mut self, particles: &mut Particles) {
        let (floor, count, all) = (&self.floor, particles.count(), &*particles);
        self.bodies.resize(count, Body::default());
        self.bodies.par_iter_mut().with_min_len(CHUNK).enumerate().for_each(|(i, body)| {
            let x = LegVector::from_fn(|d, _| f64::from(all.coordinate(d)[i]));
            let (state, _, solids) = stand(&LegState::from_vector(&x), floor);
            let right_hip = state.right_hip.map(|coordinate| coordinate as f32).into();
            *body = Body { intersects: legs_intersect(&solids), solids, right_hip };
        });
        for d in RIGHT_HIP {
            for (value, body) in particles.coordinate_mut(d).iter_mut().zip(&self.bodies) {
                *value = body.right_hip[d - RIGHT_HIP.start];
            }
        }
    }
}

/// Coordinate that holds the rate of an angle.
const fn rate_of(element: usize) -> usize {
    element + LEG_DIMENSION - FIRST_ANGLE
}

impl ParticleModel for LegParticleModel {
    type Observation = Observation;

    fn propagate(&mut self, interval_s: f64, streams: &mut RandomStreams, particles: &mut Particles) {
        self.drawn.resize(LEG_DIMENSION * particles.count(), 0.0);
        streams.fill_normal(&mut self.drawn);
        self.drift(interval_s, particles);
        self.stand(particles);
    }

    fn log_likelihood(&mut self, observation: &Observation, _: &Particles, log_likelihood: &mut [f32]) {
        let (cues, power, arch) = (self.cues, self.likelihood_power, self.arch);
        log_likelihood
            .par_chunks_mut(CHUNK)
            .zip(self.bodies.par_chunks(CHUNK))
            .for_each_init(Scratch::default, |scratch, (out, bodies)| {
                arch.dispatch(WeighTask { observation, cues, power, bodies, scratch, out })
            });
    }
}

/// Log-likelihoods of some particles, for any instruction set.
struct WeighTask<'a> {
    observation: &'a Observation,
    cues: LegCues,
    power: f64,
    bodies: &'a [Body],
    scratch: &'a mut Scratch,
    out: &'a mut [f32],
}

impl WithSimd for WeighTask<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        let projection = self.observation.projection();
        for i in 0..self.bodies.len() {
            let body = &self.bodies[i];
            self.out[i] = f32::NEG_INFINITY;
            if body.intersects {
                continue;
            }
            let mut log = 0.0;
            if self.cues.has_distance() {
                let distances = self.observation.distance.distances(simd, &body.solids);
                log -= distance_cue::LAMBDA_PER_M * distances.mean();
            }
            if self.cues.has_projection() {
                let Some(distance) = projection.distance(simd, &body.solids, self.scratch) else { continue };
                log -= projection_cue::LAMBDA_PER_M * distance;
            }
            if self.cues.has_colour()
                && let Some(colour) = &self.observation.colour
            {
                let Some(distance) = colour.distance(simd, &body.solids) else { continue };
                log -= colour_cue::LAMBDA * distance;
            }
            if log.is_finite() {
                self.out[i] = (self.power * log) as f32;
            }
        }
    }
}

/// Both cues of one model, for any instruction set.
struct FitTask<'a> {
    observation: &'a Observation,
    solids: &'a [TaperedCylinder; SOLID_COUNT],
}

impl WithSimd for FitTask<'_> {
    type Output = Fit;

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) -> Fit {
        let mut scratch = Scratch::default();
        Fit {
            distances: self.observation.distance.distances(simd, self.solids),
            projection: self.observation.projection().distance(simd, self.solids, &mut scratch),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::scene::{CAMERA, floor, foreground, image, walking};
    use super::*;
    use crate::body::legs::constraints::clearance;
    use crate::geometry::lanes::LANES;

    fn particles_around(state: &LegState, count: usize) -> (LegParticleModel, Particles) {
        let mut start = state.to_vector().as_slice().to_vec();
        start.resize(PARTICLE_DIMENSION, 0.0);
        let mut particles = Particles::at(&start, count);
        let mut model = LegParticleModel::new(floor(), LegCues::Both, &TransitionNoise::default());
        model.propagate(1.0 / NOMINAL_RATE, &mut RandomStreams::new(1), &mut particles);
        (model, particles)
    }

    #[test]
    fn particles_stand_on_the_floor_inside_their_bounds() {
        let (model, particles) = particles_around(&walking(1.0).0, 20 * LANES);
        for (i, body) in model.bodies.iter().enumerate() {
            assert!(clearance(&body.solids, &floor()).abs() < 1e-9);
            for d in 0..LEG_DIMENSION {
                let value = particles.coordinate(d)[i];
                let [low, high] = model.bounds[d];
                // The vertical position of the hip is given by the floor.
                assert!(RIGHT_HIP.contains(&d) || (low..=high).contains(&value), "{d}: {value}");
            }
        }
    }

    #[test]
    fn angles_keep_their_rate_and_lengths_do_not() {
        let (mut model, mut particles) = particles_around(&walking(1.0).0, LANES);
        model.sd = [0.0; LEG_DIMENSION];
        for d in [6, FIRST_ANGLE] {
            particles.coordinate_mut(rate_of(FIRST_ANGLE)).fill(0.6);
            let before = particles.coordinate(d)[0];
            model.propagate(0.05, &mut RandomStreams::new(1), &mut particles);
            let moved = particles.coordinate(d)[0] - before;
            let expected = if d == FIRST_ANGLE { 0.03 } else { 0.0 };
            assert!((moved - expected).abs() < 1e-6, "{d} moved by {moved}");
        }
    }

    #[test]
    fn the_truth_is_heavier_than_what_the_transition_makes_of_it() {
        let (state, _, solids) = walking(1.0);
        let observation = Observation::new(foreground(&image(&solids)), CAMERA).expect("legs in view");
        let (mut model, particles) = particles_around(&state, 4 * LANES);
        let mut logs = vec![0.0; 4 * LANES];
        for cues in [LegCues::Distance, LegCues::Projection, LegCues::Both] {
            model.cues = cues;
            model.log_likelihood(&observation, &particles, &mut logs);
            let fit = model.fit(&observation, &state);
            let mut truth = 0.0;
            if cues.has_distance() {
                truth -= distance_cue::LAMBDA_PER_M * fit.distances.mean();
            }
            if cues.has_projection() {
                truth -= projection_cue::LAMBDA_PER_M * fit.projection.expect("in front of the camera");
            }
            let heavier = logs.iter().filter(|log| f64::from(**log) > truth).count();
            assert!(heavier <= 3, "{cues:?}: {heavier} of {} are heavier", logs.len());
        }
    }
}
