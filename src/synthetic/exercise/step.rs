//! Alternate stepping forward onto a low step, weight over it, and back.

use super::{ActiveTime, outward};
use crate::synthetic::motion::{Schedule, between, pulse};
use crate::synthetic::posture::Posture;
use crate::synthetic::subject::Subject;

/// Length of a repetition at normal tempo, seconds.
const PERIOD_S: f64 = 3.8;
/// Length of the step for a stature of 1.7 m, metres.
const REACH_M: f64 = 0.32;
/// Height of the step, metres.
const RISE_M: f64 = 0.12;
/// How much higher the foot swings, metres.
const CLEARANCE_M: f64 = 0.10;
/// Way of the pelvis over the standing leg, metres.
const SHIFT_M: f64 = 0.035;
/// The swing onto the step and the swing back, shares of the repetition.
const SWINGS: [[f64; 2]; 2] = [[0.10, 0.40], [0.66, 0.96]];

pub(super) fn shape(posture: &mut Posture, subject: &Subject, active: ActiveTime, t: f64) {
    let schedule = Schedule::filling(active.start_s, active.end_s, PERIOD_S * subject.slowness);
    let Some((repetition, phase)) = schedule.at(t) else { return };
    let side = subject.side_of(repetition);
    let amplitude = subject.amplitude_of(repetition);
    let reach = REACH_M * subject.stature_m / 1.7 * amplitude;
    let [out, back] = SWINGS;
    let place = between(out[0], out[1], phase) - between(back[0], back[1], phase);
    let shift = pulse([0.0, 0.14], [0.36, 0.5], phase) + pulse([0.54, 0.68], [0.9, 1.0], phase);
    let over = pulse([0.2, 0.52], [0.56, 0.86], phase);

    posture.pelvis[0] += 0.5 * reach * over;
    posture.pelvis[1] -= outward(side) * SHIFT_M * shift;
    posture.trunk.flexion += (5.0 * over).to_radians();
    posture.trunk.lateral -= outward(side) * (1.5 * shift).to_radians();
    posture.trunk.axial += outward(side) * (3.0 * over * amplitude).to_radians();
    // The arm of the other side swings along.
    posture.arms[side.opposite() as usize].flexion += (14.0 * place * amplitude).to_radians();
    posture.arms[side as usize].flexion -= (6.0 * place * amplitude).to_radians();

    let leg = &mut posture.legs[side as usize];
    leg.ankle.x += reach * place;
    leg.ankle.y +=
        RISE_M * place + CLEARANCE_M * amplitude * SWINGS.iter().map(|swing| arch(*swing, phase)).sum::<f64>();
    leg.axial -= (2.0 * place).to_radians();
}

/// Smooth arch of height 1 over an interval. It begins so gently because a nearly straight knee must bend as the square
/// root of the way its ankle comes up.
fn arch([start, end]: [f64; 2], phase: f64) -> f64 {
    let u = ((phase - start) / (end - start)).clamp(0.0, 1.0);
    (4.0 * u * (1.0 - u)).powi(4)
}
