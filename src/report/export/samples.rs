//! Samples of an assessment as exports read them.

use super::NotExportable;
use crate::assessment::{AngleChannel, Series};
use crate::body::{Limb, Pose, Side};
use crate::geometry::attitude::rotation_from_attitude;
use nalgebra::{Rotation3, Vector3};

/// Samples of the channels of an assessment.
#[derive(Debug, Clone)]
pub struct Samples {
    /// Time of each sample on the recording's clock, nanoseconds.
    pub time_ns: Vec<i64>,
    /// The channels, all as long as the times.
    pub series: Vec<Series>,
}

impl Samples {
    /// Time of a sample from the first one, seconds.
    pub fn seconds(&self, sample: usize) -> f64 {
        let first = self.time_ns.first().copied().unwrap_or_default();
        self.time_ns.get(sample).map_or(0.0, |t| (t - first) as f64 * 1e-9)
    }

    /// Samples per second.
    pub fn rate_hz(&self) -> f64 {
        let steps = self.time_ns.len().saturating_sub(1);
        let span = self.seconds(steps);
        if steps > 0 && span > 0.0 { steps as f64 / span } else { 0.0 }
    }

    /// Place of a channel among the series.
    fn channel(&self, channel: AngleChannel) -> Option<usize> {
        let name = channel.name();
        self.series.iter().position(|series| series.channel == name)
    }
}

/// Postures of an assessment of joint angles, from its attitude vectors and hinges.
pub(super) struct Postures {
    samples: Samples,
    /// Places of the channels.
    trunk: [usize; 3],
    limbs: [[usize; 3]; 4],
    hinges: [usize; 4],
}

impl Postures {
    pub(super) fn of(samples: Samples) -> Result<Self, NotExportable> {
        const NONE: NotExportable = NotExportable("this assessment holds no joint angles of the whole body");
        let attitude = |of: &dyn Fn(usize) -> AngleChannel| -> Result<[usize; 3], NotExportable> {
            let axis = |axis: usize| samples.channel(of(axis)).ok_or(NONE);
            Ok([axis(0)?, axis(1)?, axis(2)?])
        };
        let limb = |limb: Limb| {
            let side = limb.side();
            match limb.is_arm() {
                true => attitude(&|axis| AngleChannel::ShoulderAttitude(side, axis)),
                false => attitude(&|axis| AngleChannel::HipAttitude(side, axis)),
            }
        };
        let hinge = |limb: Limb| {
            let channel = match (limb.is_arm(), limb.side()) {
                (true, side) => AngleChannel::ElbowFlexion(side),
                (false, side) => AngleChannel::KneeFlexion(side),
            };
            samples.channel(channel).ok_or(NONE)
        };
        let [la, ra, ll, rl] = Limb::ALL;
        let trunk = attitude(&AngleChannel::TrunkAttitude)?;
        let limbs = [limb(la)?, limb(ra)?, limb(ll)?, limb(rl)?];
        let hinges = [hinge(la)?, hinge(ra)?, hinge(ll)?, hinge(rl)?];
        Ok(Self { samples, trunk, limbs, hinges })
    }

    /// The samples that the postures are from.
    pub(super) fn samples(&self) -> &Samples {
        &self.samples
    }

    /// The posture of a sample; parts that were never seen stay in the reference posture.
    pub(super) fn at(&self, sample: usize) -> Pose {
        let radians = |channel: usize| f64::from(self.samples.series[channel].value[sample]).to_radians();
        let rotation = |attitude: &[usize; 3]| {
            let vector = Vector3::from(attitude.map(radians));
            if vector.iter().all(|v| v.is_finite()) { rotation_from_attitude(&vector) } else { Rotation3::identity() }
        };
        let hinge = |channel: &usize| Some(radians(*channel)).filter(|angle| angle.is_finite()).unwrap_or(0.0);
        Pose {
            trunk: rotation(&self.trunk),
            limbs: std::array::from_fn(|limb| rotation(&self.limbs[limb])),
            hinges: std::array::from_fn(|limb| hinge(&self.hinges[limb])),
        }
    }
}

/// `r` or `l`.
pub(super) fn side_letter(side: Side) -> char {
    if side == Side::Left { 'l' } else { 'r' }
}
