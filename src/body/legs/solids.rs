//! The legs' six solids: tapered cylinders for thigh and calf, half cylinders with a flat sole for the feet.
//!
//! The axis of a foot runs in the sole from the heel to the toe.

use super::{LegPose, LegState};
use crate::geometry::tapered_cylinder::TaperedCylinder;
use nalgebra::Unit;

/// Solids of both legs.
pub const SOLID_COUNT: usize = 6;

/// Radii at a width of 1, metres, at both ends. Provisional: from girths of adults (thigh 53 cm, knee 38 cm, ankle 23 cm)
/// with a few millimetres of cloth; the widths scale them. Both have the same radius at the knee: there a point of either axis
/// stands for the other one in cue 1.
const THIGH_RADII: [f64; 2] = [0.080, 0.058];
const CALF_RADII: [f64; 2] = [0.058, 0.040];
/// Half the breadth of heel and toe of a shod foot, metres; a half cylinder is as high. Provisional.
const FOOT_RADII: [f64; 2] = [0.050, 0.038];

/// The heel lies behind the ankle by this share of the length from ankle to toe: a third, as the ankle divides the
/// foot 1 : 3 ([`LegState::upright`]).
pub const HEEL_SHARE: f64 = 1.0 / 3.0;

/// Thigh, calf and foot of the left leg, then of the right one, in `sensor`.
pub fn solids(state: &LegState, pose: &LegPose) -> [TaperedCylinder; SOLID_COUNT] {
    let scaled = |radii: [f64; 2], width: f64| radii.map(|radius| radius * width);
    let [left, right] = pose.sides.map(|side| {
        let heel = side.toe - side.forward * ((1.0 + HEEL_SHARE) * state.foot);
        let limb =
            |start, end, radii| TaperedCylinder { start, end, radii: scaled(radii, state.leg_width), dome: None };
        [
            limb(side.hip, side.knee, THIGH_RADII),
            limb(side.knee, side.ankle, CALF_RADII),
            TaperedCylinder {
                start: heel,
                end: side.toe,
                radii: scaled(FOOT_RADII, state.foot_width),
                dome: Some(Unit::new_unchecked(side.dorsal)),
            },
        ]
    });
    [left[0], left[1], left[2], right[0], right[1], right[2]]
}
