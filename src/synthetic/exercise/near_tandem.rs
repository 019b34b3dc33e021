//! Standing with one foot in front of the other, the heel beside the other foot's toes, with sway.

use super::{ActiveTime, outward};
use crate::synthetic::motion::{between, pulse};
use crate::synthetic::posture::Posture;
use crate::synthetic::subject::Subject;

/// Sway against that of normal standing.
pub(super) const SWAY: f64 = 2.2;
/// Way of the front foot for a stature of 1.7 m, metres.
const REACH_M: f64 = 0.27;
/// Distance of each ankle from the midline, metres.
const HALF_WIDTH_M: f64 = 0.03;
/// How high a foot swings, metres.
const CLEARANCE_M: f64 = 0.05;
/// Time of each of the two steps into the stance at normal tempo, seconds.
const STEP_S: f64 = 1.3;

pub(super) fn shape(posture: &mut Posture, subject: &Subject, active: ActiveTime, t: f64) {
    let front = subject.leading;
    let step = STEP_S * subject.slowness;
    let reach = REACH_M * subject.stature_m / 1.7 * subject.amplitude;
    let first = active.start_s + 0.3;
    let starts = [(front, first, reach), (front.opposite(), first + step + 0.3, 0.0)];
    for (side, start, forward) in starts {
        let (u, end) = ((t - start) / step, start + step);
        let placed = between(start, end, t);
        let shift = pulse([start - 0.3, start + 0.15 * step], [end - 0.15 * step, end + 0.3], t);
        let leg = &mut posture.legs[side as usize];
        leg.ankle.x += forward * placed;
        leg.ankle.z += (outward(side) * HALF_WIDTH_M - leg.ankle.z) * placed;
        let inside = u.clamp(0.0, 1.0);
        leg.ankle.y += CLEARANCE_M * (4.0 * inside * (1.0 - inside)).powi(4);
        posture.pelvis[1] -= outward(side) * 0.03 * shift;
    }
    let settled = between(first, first + step, t);
    posture.pelvis[0] += 0.45 * reach * settled;
    for arm in &mut posture.arms {
        arm.abduction += (10.0 * settled).to_radians();
    }
}
