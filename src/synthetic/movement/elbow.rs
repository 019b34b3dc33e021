//! Flexing the elbows in turn; the shoulder comes along a little.

use crate::synthetic::exercise::ActiveTime;
use crate::synthetic::motion::{Schedule, pulse};
use crate::synthetic::posture::Posture;
use crate::synthetic::subject::Subject;

/// Length of a repetition at normal tempo, seconds.
const PERIOD_S: f64 = 2.2;
/// Elbow flexion that a full repetition adds to the hanging arm's.
const ELBOW_DEG: f64 = 105.0;
/// Flexion and abduction of the shoulder that come along.
const SHOULDER_FLEXION_DEG: f64 = 18.0;
const SHOULDER_ABDUCTION_DEG: f64 = 8.0;

pub(super) fn shape(posture: &mut Posture, subject: &Subject, active: ActiveTime, t: f64) {
    let schedule = Schedule::filling(active.start_s, active.end_s, PERIOD_S * subject.slowness);
    let Some((repetition, phase)) = schedule.at(t) else { return };
    let side = subject.side_of(repetition);
    let lift = subject.amplitude_of(repetition) * pulse([0.04, 0.46], [0.52, 0.96], phase);
    // The upper arm starts later and comes back earlier than the forearm.
    let along = subject.amplitude * pulse([0.12, 0.5], [0.52, 0.9], phase);
    let arm = &mut posture.arms[side as usize];
    arm.elbow += (ELBOW_DEG * lift).to_radians();
    arm.flexion += (SHOULDER_FLEXION_DEG * along).to_radians();
    arm.abduction += (SHOULDER_ABDUCTION_DEG * along).to_radians();
    posture.trunk.flexion -= (1.5 * lift).to_radians();
}
