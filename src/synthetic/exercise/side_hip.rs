//! Alternate elevation of the straight leg to the side, in standing; the trunk leans to the other side.

use super::{ActiveTime, outward};
use crate::synthetic::motion::{Schedule, pulse};
use crate::synthetic::posture::{LegAngles, Posture};
use crate::synthetic::subject::{Habit, Subject};

/// Length of a repetition at normal tempo, seconds.
const PERIOD_S: f64 = 3.6;
/// Hip abduction of a full repetition.
const ABDUCTION_DEG: f64 = 32.0;
/// Lean of the trunk to the standing side.
const LEAN_DEG: f64 = 6.0;
/// Way of the pelvis over the standing leg, metres.
const SHIFT_M: f64 = 0.04;

pub(super) fn shape(posture: &mut Posture, subject: &Subject, active: ActiveTime, t: f64) {
    let schedule = Schedule::filling(active.start_s, active.end_s, PERIOD_S * subject.slowness);
    let Some((repetition, phase)) = schedule.at(t) else { return };
    let side = subject.side_of(repetition);
    let amplitude = subject.amplitude_of(repetition);
    let shift = pulse([0.0, 0.28], [0.75, 1.0], phase);
    let lift = pulse([0.14, 0.48], [0.56, 0.88], phase);
    // The lean follows the foot's leaving the floor: before, it would pull the planted leg.
    let lean = pulse([0.22, 0.5], [0.54, 0.8], phase);

    posture.pelvis[1] -= outward(side) * SHIFT_M * shift;
    posture.trunk.lateral -= outward(side) * (LEAN_DEG * lean * amplitude).to_radians();
    for arm in &mut posture.arms {
        arm.abduction += (8.0 * lift).to_radians();
    }
    let leg = &mut posture.legs[side as usize];
    leg.support = 1.0 - lift;
    leg.lift = lift;
    let wander = subject.wander(Habit::FreeLeg(side), t).to_radians();
    leg.lifted = LegAngles {
        flexion: 3f64.to_radians() + posture.trunk.flexion + wander,
        abduction: (ABDUCTION_DEG * amplitude).to_radians(),
        axial: leg.axial - 4f64.to_radians() + 2.0 * wander,
        knee: 7f64.to_radians() + wander,
    };
}
