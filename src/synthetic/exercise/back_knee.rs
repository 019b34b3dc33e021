//! Alternate knee flexion in standing: the heel comes towards the buttock, the thigh hangs.

use super::{ActiveTime, outward};
use crate::synthetic::motion::{Schedule, pulse};
use crate::synthetic::posture::{LegAngles, Posture};
use crate::synthetic::subject::{Habit, Subject};

/// Length of a repetition at normal tempo, seconds.
const PERIOD_S: f64 = 3.4;
/// Knee flexion of a full repetition.
const KNEE_DEG: f64 = 86.0;
/// Hip extension that comes along.
const HIP_EXTENSION_DEG: f64 = 5.0;
/// Way of the pelvis over the standing leg, metres.
const SHIFT_M: f64 = 0.035;

pub(super) fn shape(posture: &mut Posture, subject: &Subject, active: ActiveTime, t: f64) {
    let schedule = Schedule::filling(active.start_s, active.end_s, PERIOD_S * subject.slowness);
    let Some((repetition, phase)) = schedule.at(t) else { return };
    let side = subject.side_of(repetition);
    let amplitude = subject.amplitude_of(repetition);
    let shift = pulse([0.0, 0.25], [0.78, 1.0], phase);
    let lift = pulse([0.12, 0.48], [0.56, 0.9], phase);

    posture.pelvis[1] -= outward(side) * SHIFT_M * shift;
    posture.trunk.lateral -= outward(side) * (2.0 * shift).to_radians();
    posture.trunk.flexion += (4.0 * lift * amplitude).to_radians();
    let leg = &mut posture.legs[side as usize];
    leg.support = 1.0 - lift;
    leg.lift = lift;
    let wander = subject.wander(Habit::FreeLeg(side), t).to_radians();
    leg.lifted = LegAngles {
        // Hip angles are against the trunk, so the trunk's own bending belongs to them.
        flexion: posture.trunk.flexion - HIP_EXTENSION_DEG.to_radians() + wander,
        abduction: 2f64.to_radians(),
        axial: leg.axial + 2.0 * wander,
        knee: (KNEE_DEG * amplitude).to_radians(),
    };
}
