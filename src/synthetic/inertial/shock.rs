//! Impacts of landings: a vibration that goes up the body and gets weaker on the way.

use super::jump::Jump;
use super::path::grid_time;
use crate::body::Bone;
use crate::synthetic::sensor::standard_normals;
use nalgebra::Vector3;
use rand::Rng;
use std::f64::consts::TAU;

/// Frequency and decay of the vibration: shanks ring at 10 to 30 Hz after a landing, for a few hundredths of a second.
const FREQUENCY_HZ: f64 = 18.0;
const DECAY_S: f64 = 0.03;

/// After this many decays nothing is left.
const DECAYS: f64 = 8.0;

/// How far the direction leaves the vertical, standard deviation of each component.
const TILT: f64 = 0.15;

/// The impacts that one unit feels.
pub(super) struct Shocks {
    /// Touch-down, seconds, and the acceleration in `world` that the vibration starts from, m/s².
    impacts: Vec<(f64, Vector3<f64>)>,
}

impl Shocks {
    /// Impacts of some jumps on a bone; `strength` is a factor of all.
    pub(super) fn draw(jumps: &[Jump], bone: Bone, strength: f64, rng: &mut impl Rng) -> Self {
        let per_velocity = strength * amplitude_of(bone);
        let mut impact = |jump: &Jump| {
            let direction = Vector3::y() + standard_normals(rng) * TILT;
            (jump.touch_down_s, direction * (per_velocity * jump.take_off_velocity()))
        };
        Self { impacts: jumps.iter().map(&mut impact).collect() }
    }

    /// Acceleration at a place of the grid, in `world`, m/s².
    pub(super) fn at(&self, i: usize) -> Vector3<f64> {
        let t = grid_time(i);
        let ringing = self.impacts.iter().filter(|(start, _)| (0.0..DECAYS * DECAY_S).contains(&(t - start)));
        ringing
            .map(|(start, peak)| peak * ((-(t - start) / DECAY_S).exp() * (TAU * FREQUENCY_HZ * (t - start)).sin()))
            .sum()
    }
}

/// Acceleration (m/s²) for each m/s of impact: accelerometers on the shank show 5 to 8 g in small jumps, those on the
/// trunk a third of it.
fn amplitude_of(bone: Bone) -> f64 {
    match bone {
        Bone::Distal(limb) if !limb.is_arm() => 45.0,
        Bone::Proximal(limb) if !limb.is_arm() => 25.0,
        Bone::Trunk => 12.0,
        Bone::Proximal(_) | Bone::Distal(_) => 8.0,
    }
}
