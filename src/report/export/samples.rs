//! Samples of an assessment as exports read them.

use super::NotExportable;
use crate::assessment::{AngleChannel, Series};
use crate::body::{Limb, Pose, Side};
use crate::geometry::attitude::rotation_from_attitude;
use nalgebra::{Rotation3, Vector3};

/// Samples of the channels of an assessment.
#[derive(Debug, Clone, Copy)]
pub struct Samples<'a> {
    /// Time of each sample on the recording's clock, nanoseconds.
    pub time_ns: &'a [i64],
    /// The channels, all as long as the times.
    pub series: &'a [Series],
}

impl<'a> Samples<'a> {
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

    fn channel(&self, channel: AngleChannel) -> Option<&'a Series> {
        let name = channel.name();
        self.series.iter().find(|series| series.channel == name)
    }
}

/// Postures of an assessment of joint angles, from its attitude vectors and hinges.
pub(super) struct Postures<'a> {
    trunk: [&'a Series; 3],
    limbs: [[&'a Series; 3]; 4],
    hinges: [&'a Series; 4],
}

impl<'a> Postures<'a> {
    pub(super) fn of(samples: &Samples<'a>) -> Result<Self, NotExportable> {
        const NONE: NotExportable = NotExportable("this assessment holds no joint angles of the whole body");
        let attitude = |of: &dyn Fn(usize) -> AngleChannel| -> Result<[&'a Series; 3], NotExportable> {
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
        Ok(Self {
            trunk: attitude(&AngleChannel::TrunkAttitude)?,
            limbs: [limb(la)?, limb(ra)?, limb(ll)?, limb(rl)?],
            hinges: [hinge(la)?, hinge(ra)?, hinge(ll)?, hinge(rl)?],
        })
    }

    /// The posture of a sample; parts that were never seen stay in the reference posture.
    pub(super) fn at(&self, sample: usize) -> Pose {
        let radians = |series: &Series| f64::from(series.value[sample]).to_radians();
        let rotation = |attitude: &[&Series; 3]| {
            let vector = Vector3::from(attitude.map(radians));
            if vector.iter().all(|v| v.is_finite()) { rotation_from_attitude(&vector) } else { Rotation3::identity() }
        };
        let hinge = |series: &&Series| Some(radians(series)).filter(|angle| angle.is_finite()).unwrap_or(0.0);
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
