//! Soft tissue between a unit and the bone: the unit lags behind when the bone is accelerated, and rings.
//!
//! ```text
//! u″ + 2 ζ ω u′ + ω² u = −c a        displacement u in the unit's axes, acceleration a of the bone there
//! ```
//!
//! The displaced unit also tilts, by `u / L` about the axis across its displacement and the surface.

use super::path::{GRID_HZ, RigidPath, second_derivative};
use crate::body::Bone;
use nalgebra::{UnitQuaternion, Vector3};
use std::f64::consts::TAU;

/// How tissue gives way. Defaults are plausible, not measured: units on thighs ring near 10 Hz after foot strikes.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TissueSettings {
    /// Resonance, Hz. Default 10.
    pub frequency_hz: f64,
    /// Damping ratio. Default 0.3.
    pub damping: f64,
    /// Displacement that turns a unit by one radian, metres. Default 0.15.
    pub lever_m: f64,
    /// Factor of the displacement on all bones; 0 makes units rigid with their bones. Default 1.
    pub softness: f64,
}

impl Default for TissueSettings {
    fn default() -> Self {
        Self { frequency_hz: 10.0, damping: 0.3, lever_m: 0.15, softness: 1.0 }
    }
}

impl TissueSettings {
    /// Units that are rigid with their bones.
    pub const RIGID: TissueSettings = TissueSettings { frequency_hz: 10.0, damping: 0.3, lever_m: 0.15, softness: 0.0 };

    /// The way of a unit whose bone goes along `path`; `shock` is an acceleration in `world` on top of the path's, m/s².
    pub(super) fn wobble(&self, path: &RigidPath, bone: Bone, shock: impl Fn(usize) -> Vector3<f64>) -> RigidPath {
        let omega = TAU * self.frequency_hz;
        let interval_s = 1.0 / GRID_HZ;
        let compliance = self.softness * softness_of(bone);
        let (mut displacement, mut velocity) = (Vector3::zeros(), Vector3::zeros());
        let mut step = |i: usize, acceleration: Vector3<f64>| {
            let rotation = path.rotation[i];
            let force = -(rotation.inverse() * (acceleration + shock(i))) * compliance;
            // Velocity first: this order of Euler's method keeps an oscillation's energy.
            velocity += (force - displacement * (omega * omega) - velocity * (2.0 * self.damping * omega)) * interval_s;
            displacement += velocity * interval_s;
            let tilt = (-Vector3::z()).cross(&displacement) / self.lever_m;
            (path.position[i] + rotation * displacement, rotation * UnitQuaternion::new(tilt))
        };
        let accelerations = second_derivative(&path.position).into_iter().enumerate();
        let (position, rotation) = accelerations.map(|(i, a)| step(i, a)).unzip();
        RigidPath { position, rotation }
    }
}

/// Softness of the place under a unit against that of the thigh.
fn softness_of(bone: Bone) -> f64 {
    match bone {
        Bone::Proximal(limb) if !limb.is_arm() => 1.0,
        Bone::Proximal(_) => 0.6,
        Bone::Distal(_) | Bone::Trunk => 0.4,
    }
}
