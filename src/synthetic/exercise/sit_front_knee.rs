//! Sitting down on a chair, then alternate elevation of the shank until the knee is nearly straight.

use super::{ActiveTime, outward};
use crate::body::Limb;
use crate::synthetic::motion::{Schedule, between, pulse};
use crate::synthetic::posture::{ANKLE_HEIGHT_SHARE, LegAngles, Posture};
use crate::synthetic::subject::{Habit, Subject};

/// Time to sit down at normal tempo, seconds.
const SIT_S: f64 = 2.4;
/// Length of a repetition at normal tempo, seconds.
const PERIOD_S: f64 = 3.2;
/// Knee flexion that a full elevation takes away from the 88° of sitting.
const EXTENSION_DEG: f64 = 68.0;
/// Bending of the trunk half-way down: the body balances over its feet.
const BOW_DEG: f64 = 36.0;

pub(super) fn shape(posture: &mut Posture, subject: &Subject, active: ActiveTime, t: f64) {
    let seated_at = active.start_s + SIT_S * subject.slowness;
    let seated = between(active.start_s, seated_at, t);
    let way = seated_at - active.start_s;
    let bow = pulse([active.start_s, active.start_s + 0.55 * way], [active.start_s + 0.5 * way, seated_at + 0.6], t);
    let thigh = subject.skeleton.proximal[Limb::RightLeg.index()];
    let shank = subject.skeleton.distal[Limb::RightLeg.index()];
    posture.pelvis[0] -= 0.97 * thigh * seated;
    // The chair holds the pelvis still.
    posture.pelvis[1] *= 1.0 - 0.8 * seated;
    posture.seat = (ANKLE_HEIGHT_SHARE * subject.stature_m + shank + 0.01, seated);
    posture.trunk.flexion += (BOW_DEG * subject.amplitude * bow + 5.0 * seated).to_radians();
    for arm in &mut posture.arms {
        arm.flexion += (22.0 * seated + 20.0 * bow).to_radians();
        arm.elbow += (48.0 * seated).to_radians();
    }

    let schedule = Schedule::filling(seated_at + 0.4, active.end_s, PERIOD_S * subject.slowness);
    let Some((repetition, phase)) = schedule.at(t) else { return };
    let side = subject.side_of(repetition);
    let amplitude = subject.amplitude_of(repetition);
    let lift = pulse([0.05, 0.45], [0.55, 0.95], phase);
    posture.trunk.flexion -= (4.0 * lift * amplitude).to_radians();
    posture.trunk.lateral -= outward(side) * (1.5 * lift).to_radians();
    let leg = &mut posture.legs[side as usize];
    leg.support = 1.0 - lift;
    leg.lift = lift;
    let wander = subject.wander(Habit::FreeLeg(side), t).to_radians();
    leg.lifted = LegAngles {
        flexion: (88.0 + 7.0 * amplitude).to_radians() + posture.trunk.flexion + wander,
        abduction: 3f64.to_radians(),
        axial: leg.axial + 2.0 * wander,
        knee: (88.0 - EXTENSION_DEG * amplitude).to_radians() + wander,
    };
}
