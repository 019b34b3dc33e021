//! Simulated kicking: standing on one leg, the knee of the other flexes and extends, the hip comes along a little.

use crate::body::Side;
use crate::synthetic::exercise::{ActiveTime, outward};
use crate::synthetic::motion::{Schedule, between, pulse};
use crate::synthetic::posture::{LegAngles, Posture};
use crate::synthetic::subject::{Habit, Subject};

/// Time to shift the weight and lift the foot, and to put it down again, seconds.
const LIFT_S: f64 = 1.6;
/// Length of a kick at normal tempo, seconds.
const PERIOD_S: f64 = 2.0;
/// Knee flexion before a kick, and what a full kick takes away from it.
const KNEE_DEG: f64 = 85.0;
const EXTENSION_DEG: f64 = 68.0;
/// Hip flexion before a kick, and what a kick adds.
const HIP_DEG: f64 = 12.0;
const HIP_KICK_DEG: f64 = 22.0;
/// Way of the pelvis over the standing leg for a stature of 1.7 m, metres.
const SHIFT_M: f64 = 0.055;

pub(super) fn shape(posture: &mut Posture, subject: &Subject, side: Side, active: ActiveTime, t: f64) {
    let lift = pulse([active.start_s, active.start_s + LIFT_S], [active.end_s - LIFT_S, active.end_s], t);
    let shift = pulse(
        [active.start_s - 0.2, active.start_s + 0.7 * LIFT_S],
        [active.end_s - 0.7 * LIFT_S, active.end_s + 0.2],
        t,
    );
    let schedule = Schedule::filling(active.start_s + LIFT_S, active.end_s - LIFT_S, PERIOD_S * subject.slowness);
    let kick = schedule.at(t).map_or(0.0, |(repetition, phase)| {
        subject.amplitude_of(2 * repetition) * pulse([0.04, 0.46], [0.5, 0.96], phase)
    });

    posture.pelvis[1] -= outward(side) * SHIFT_M * subject.stature_m / 1.7 * shift;
    posture.trunk.lateral -= outward(side) * (3.0 * shift).to_radians();
    posture.trunk.flexion -= (3.0 * kick).to_radians();
    // Arms go out for balance, and the one of the other side swings along.
    for arm in &mut posture.arms {
        arm.abduction += (12.0 * lift).to_radians();
    }
    posture.arms[side.opposite() as usize].flexion += (8.0 * kick).to_radians();
    let wander = subject.wander(Habit::FreeLeg(side), t).to_radians();
    let leg = &mut posture.legs[side as usize];
    leg.support = 1.0 - between(active.start_s, active.start_s + 0.5 * LIFT_S, t)
        + between(active.end_s - 0.5 * LIFT_S, active.end_s, t);
    leg.lift = lift;
    leg.lifted = LegAngles {
        // Hip angles are against the trunk, so the trunk's own bending belongs to them.
        flexion: posture.trunk.flexion + (HIP_DEG + HIP_KICK_DEG * kick).to_radians() + wander,
        abduction: 5f64.to_radians(),
        axial: leg.axial + 2.0 * wander + (3.0 * kick).to_radians(),
        knee: (KNEE_DEG - EXTENSION_DEG * kick).to_radians() + wander,
    };
}
