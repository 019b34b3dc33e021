//! What legs cannot do: float, sink into the floor, go through each other (\[walker\], section 4.1).

use super::solids::{SOLID_COUNT, solids};
use super::{LegPose, LegState, forward_kinematics};
use crate::geometry::floor::Floor;
use crate::geometry::tapered_cylinder::{TaperedCylinder, closest_shares};

/// Overlap that cloth and soft tissue allow before two solids count as intersecting, metres. Provisional: thighs touch.
const SOFT_TISSUE: f64 = 0.02;

/// Solids of different legs that can meet: any of the left one with any of the right one.
const LEFT: std::ops::Range<usize> = 0..SOLID_COUNT / 2;
const RIGHT: std::ops::Range<usize> = SOLID_COUNT / 2..SOLID_COUNT;

/// Height of the lowest point of both soles above the floor, metres.
pub fn clearance(solids: &[TaperedCylinder; SOLID_COUNT], floor: &Floor) -> f64 {
    [2, 5].map(|foot| lowest_of_sole(&solids[foot], floor)).into_iter().fold(f64::INFINITY, f64::min)
}

/// Height of the lowest point of a foot's flat side above the floor, metres.
///
/// The sole's corners are the ends of the two diameters in it.
pub fn lowest_of_sole(foot: &TaperedCylinder, floor: &Floor) -> f64 {
    let dorsal = foot.dome.map_or_else(|| floor.up.into_inner(), |dome| dome.into_inner());
    let sideways = foot.axis().cross(&dorsal).dot(&floor.up).abs();
    let corner = |centre, radius: f64| floor.height(centre) - radius * sideways;
    corner(&foot.start, foot.radii[0]).min(corner(&foot.end, foot.radii[1]))
}

/// The state lifted or lowered until the lower foot stands on the floor, with its joints and solids: at least one foot is
/// on the ground, and none below it.
pub fn stand(state: &LegState, floor: &Floor) -> (LegState, LegPose, [TaperedCylinder; SOLID_COUNT]) {
    let pose = forward_kinematics(state, floor);
    let mut solids = solids(state, &pose);
    let lift = -clearance(&solids, floor) * floor.up.into_inner();
    for solid in &mut solids {
        solid.start += lift;
        solid.end += lift;
    }
    let sides = pose.sides.map(|side| super::SidePose {
        hip: side.hip + lift,
        knee: side.knee + lift,
        ankle: side.ankle + lift,
        toe: side.toe + lift,
        ..side
    });
    (LegState { right_hip: state.right_hip + lift, ..*state }, LegPose { sides }, solids)
}

/// True when a solid of one leg is inside one of the other leg by more than soft tissue allows.
///
/// Measured at the closest points of the axes, where the radii are added; exact for cylinders side by side.
pub fn legs_intersect(solids: &[TaperedCylinder; SOLID_COUNT]) -> bool {
    for a in &solids[LEFT] {
        for b in &solids[RIGHT] {
            let [s, t] = closest_shares(a, b);
            let on_a = a.start + (a.end - a.start) * s;
            let on_b = b.start + (b.end - b.start) * t;
            let reach = a.radius_at(s) + b.radius_at(t) - SOFT_TISSUE;
            if (on_a - on_b).norm_squared() < reach * reach {
                return true;
            }
        }
    }
    false
}
