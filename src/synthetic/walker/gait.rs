//! From footprints to the motion of the whole lower body.
//!
//! A foot that is down rolls: over the heel after contact, flat, over the ball before it leaves. A foot in the air goes
//! from where it left to where it comes down. The pelvis follows the middle of the two feet smoothly, sways towards the
//! foot that stands, and is as high as the more stretched leg allows. Knees follow by the lengths of the legs.

use super::bones::{FootPose, Posture, RestLeg};
use super::course::Footprint;
use super::noise::smoothstep;
use nalgebra::{Isometry3, Point3, Rotation3, Translation3, UnitQuaternion, Vector3};

/// Time step of the pelvis's path, seconds.
pub const GRID_S: f64 = 0.01;

/// Toes up at contact and heel up at release, radians per metre of step length: 15 and 40 degrees at 0.6 m.
const STRIKE_RAD_PER_M: f64 = 15.0 / 0.6 * std::f64::consts::PI / 180.0;
/// See [`STRIKE_RAD_PER_M`].
const RISE_RAD_PER_M: f64 = 40.0 / 0.6 * std::f64::consts::PI / 180.0;

/// Part of the stance until the foot is flat, and from which on the heel rises.
const FLAT_FROM: f64 = 0.12;
/// See [`FLAT_FROM`].
const RISE_FROM: f64 = 0.62;

/// A stance counts as no longer than this, seconds, so that a foot that stood long rolls as quickly as others do.
const LONGEST_ROLLING_STANCE_S: f64 = 1.2;

/// Lowest point of the sole in mid swing above the floor, metres.
const CLEARANCE_M: f64 = 0.012;

/// Sway of the pelvis to each side, metres.
const SWAY_M: f64 = 0.02;

/// Turn of the pelvis about the vertical for each metre by which one foot is ahead, radians.
const PELVIC_TURN_PER_M: f64 = 0.15;

/// Time over which the height of the pelvis is the least of what the legs allow, seconds to each side.
const HEIGHT_WINDOW_S: f64 = 0.12;

/// The motion of one figure's legs.
#[derive(Debug, Clone)]
pub struct Gait {
    rest: [RestLeg; 2],
    footprints: Vec<Footprint>,
    step_m: f64,
    /// `world_from_rest` of the pelvis every [`GRID_S`].
    pelvis: Vec<PelvisPose>,
}

/// Place and heading of a pelvis.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PelvisPose {
    /// Floor point below it, and by how much it is raised above rest (y), metres.
    pub place: Vector3<f64>,
    /// Turn to the left of the z axis, radians.
    pub heading: f64,
}

/// What each foot does at an instant.
#[derive(Debug, Clone, Copy, PartialEq)]
struct FootState {
    pose: FootPose,
    heading: f64,
    is_down: bool,
}

impl Gait {
    /// The motion over `duration_s` of legs that are stretched to `stretch` of their length at most.
    pub fn new(
        rest: [RestLeg; 2],
        footprints: Vec<Footprint>,
        step_m: f64,
        step_s: f64,
        stretch: f64,
        duration_s: f64,
    ) -> Self {
        let mut gait = Self { rest, footprints, step_m, pelvis: Vec::new() };
        let n = (duration_s / GRID_S).ceil() as usize + 2;
        let feet: Vec<[FootState; 2]> = (0..n).map(|k| gait.feet(k as f64 * GRID_S)).collect();
        let smooth = |value: &dyn Fn(&[FootState; 2]) -> f64| {
            smoothed(&feet.iter().map(value).collect::<Vec<_>>(), 0.5 * step_s)
        };
        let mean = |axis: usize| smooth(&|feet| 0.5 * (feet[0].pose.ankle[axis] + feet[1].pose.ankle[axis]));
        let (x, z) = (mean(0), mean(2));
        let heading = smooth(&|feet| 0.5 * (feet[0].heading + feet[1].heading));
        let load = smooth(&|feet| f64::from(u8::from(feet[0].is_down)) - f64::from(u8::from(feet[1].is_down)));
        let ahead = smooth(&|feet| {
            let between = feet[0].pose.ankle - feet[1].pose.ankle;
            let direction = 0.5 * (feet[0].heading + feet[1].heading);
            between.x * direction.sin() + between.z * direction.cos()
        });
        // Above the middle of the feet at rest, not above the origin of the rest posture.
        let ankles = (gait.rest[0].points.ankle.coords + gait.rest[1].points.ankle.coords) * 0.5;
        let mut pelvis: Vec<PelvisPose> = (0..n)
            .map(|k| {
                let turn = heading[k] - PELVIC_TURN_PER_M * ahead[k];
                let sway = Vector3::new(heading[k].cos(), 0.0, -heading[k].sin()) * SWAY_M * load[k];
                let offset =
                    Rotation3::from_axis_angle(&Vector3::y_axis(), turn) * Vector3::new(ankles.x, 0.0, ankles.z);
                PelvisPose { place: Vector3::new(x[k], 0.0, z[k]) + sway - offset, heading: turn }
            })
            .collect();
        let allowed: Vec<f64> =
            pelvis.iter().zip(&feet).map(|(pose, feet)| gait.highest(pose, feet, stretch)).collect();
        for (pose, height) in pelvis.iter_mut().zip(lower_envelope(&allowed)) {
            pose.place.y = height;
        }
        gait.pelvis = pelvis;
        gait
    }

    /// The footprints, in order of their contacts.
    pub fn footprints(&self) -> &[Footprint] {
        &self.footprints
    }

    /// The pelvis every [`GRID_S`].
    pub fn pelvis_path(&self) -> &[PelvisPose] {
        &self.pelvis
    }

    /// The posture at a time, seconds.
    pub fn posture(&self, time: f64) -> Posture {
        let pose = self.pelvis_at(time);
        let turn = UnitQuaternion::from_axis_angle(&Vector3::y_axis(), pose.heading);
        let pelvis = Isometry3::from_parts(Translation3::from(pose.place), turn);
        Posture::of_pelvis_and_feet(&self.rest, &pelvis, &self.feet(time).map(|foot| foot.pose))
    }

    /// Which feet are in contact with the floor at a time.
    pub fn contacts(&self, time: f64) -> [bool; 2] {
        self.feet(time).map(|foot| foot.is_down)
    }

    fn pelvis_at(&self, time: f64) -> PelvisPose {
        let place = (time / GRID_S).clamp(0.0, (self.pelvis.len() - 2) as f64);
        let (k, part) = (place as usize, place.fract());
        let (before, after) = (&self.pelvis[k], &self.pelvis[k + 1]);
        PelvisPose {
            place: before.place.lerp(&after.place, part),
            heading: before.heading + part * (after.heading - before.heading),
        }
    }

    /// By how much the pelvis may be raised above rest for the legs to reach their feet.
    fn highest(&self, pelvis: &PelvisPose, feet: &[FootState; 2], stretch: f64) -> f64 {
        let turn = Rotation3::from_axis_angle(&Vector3::y_axis(), pelvis.heading);
        let heights = feet.iter().zip(&self.rest).map(|(foot, rest)| {
            let hip = pelvis.place + turn * rest.points.hip.coords;
            let ankle = foot.pose.ankle;
            let reach = stretch * (rest.thigh_m() + rest.shank_m());
            let aside = (hip.x - ankle.x).hypot(hip.z - ankle.z);
            ankle.y + (reach * reach - aside * aside).max(0.0).sqrt() - rest.points.hip.y
        });
        heights.fold(f64::INFINITY, f64::min)
    }

    fn feet(&self, time: f64) -> [FootState; 2] {
        std::array::from_fn(|side| {
            let mut own = self.footprints.iter().filter(|print| print.side == side).peekable();
            let mut last = None;
            while let Some(print) = own.next_if(|print| print.contact_s <= time) {
                last = Some(print);
            }
            match (last, own.peek()) {
                (Some(from), Some(to)) if time >= from.release_s => self.swinging(from, to, time),
                (Some(print), _) => self.standing(print, time),
                // The first footprints have been there for ever.
                (None, _) => self.standing(&self.footprints[side], time),
            }
        })
    }

    fn standing(&self, print: &Footprint, time: f64) -> FootState {
        let stance = (print.release_s - print.contact_s).min(LONGEST_ROLLING_STANCE_S);
        let strike = STRIKE_RAD_PER_M * self.step_m;
        let toes_up = strike * (1.0 - smoothstep((time - print.contact_s) / (FLAT_FROM * stance)));
        let rising = 1.0 - (print.release_s - time) / ((1.0 - RISE_FROM) * stance);
        let heel_up = RISE_RAD_PER_M * self.step_m * rising.clamp(0.0, 1.0).powi(2);
        let pose = self.rolled(print, toes_up, heel_up);
        FootState { pose, heading: print.heading, is_down: true }
    }

    /// A foot on its footprint, turned about its heel or about its ball.
    fn rolled(&self, print: &Footprint, toes_up: f64, heel_up: f64) -> FootPose {
        let rest = &self.rest[print.side];
        let heading = UnitQuaternion::from_axis_angle(&Vector3::y_axis(), print.heading);
        let pitch = UnitQuaternion::from_axis_angle(&Vector3::x_axis(), heel_up - toes_up);
        let pivot = if toes_up > 0.0 { rest.points.heel } else { rest.ball };
        let ground = Point3::new(rest.points.ankle.x, 0.0, rest.points.ankle.z);
        let ankle = print.place + heading * (pivot - ground + pitch * (rest.points.ankle - pivot));
        let toes = if toes_up > 0.0 { heading * pitch } else { heading };
        FootPose { ankle, foot: heading * pitch, toes }
    }

    fn swinging(&self, from: &Footprint, to: &Footprint, time: f64) -> FootState {
        let duration = to.contact_s - from.release_s;
        let u = (time - from.release_s) / duration;
        let (rise, strike) = (RISE_RAD_PER_M * self.step_m, STRIKE_RAD_PER_M * self.step_m);
        let start = self.standing(from, from.release_s).pose.ankle;
        // The foot leaves with the speed that rolling gave it, and comes down softly.
        let before = self.standing(from, from.release_s - GRID_S).pose.ankle;
        let velocity = (start - before) / GRID_S;
        let end = self.rolled(to, strike, 0.0).ankle;
        let h = smoothstep(u);
        let ankle = start + (end - start) * h + velocity * (duration * u * (1.0 - u) * (1.0 - u));
        let heading = from.heading + (to.heading - from.heading) * h;
        let turn = UnitQuaternion::from_axis_angle(&Vector3::y_axis(), heading);
        let pitch = rise * (1.0 - smoothstep(1.4 * u)) - strike * smoothstep((u - 0.3) / 0.7);
        let foot = turn * UnitQuaternion::from_axis_angle(&Vector3::x_axis(), pitch);
        // The toes straighten soon after they have left the floor.
        let toes = foot.slerp(&turn, 1.0 - smoothstep(4.0 * u));
        let mut pose = FootPose { ankle, foot, toes };
        let lowest = self.lowest_point(from.side, &pose);
        // The first and last part of the swing may touch what the stance touches: the floor.
        let clearance = CLEARANCE_M * (4.0 * u * (1.0 - u)).sqrt();
        pose.ankle.y += (clearance - lowest).max(0.0);
        FootState { pose, heading, is_down: false }
    }

    fn lowest_point(&self, side: usize, pose: &FootPose) -> f64 {
        let rest = &self.rest[side];
        let of_foot = |point: &Point3<f64>| pose.ankle + pose.foot * (point - rest.points.ankle);
        let ball = of_foot(&rest.ball);
        let toe = ball + pose.toes * (rest.points.toe - rest.ball);
        ball.y.min(toe.y).min(of_foot(&rest.points.heel).y)
    }
}

/// A series on the grid, smoothed by a Gaussian kernel of an SD in seconds; its ends continue as they are.
pub fn smoothed(values: &[f64], sd_s: f64) -> Vec<f64> {
    let radius = (3.0 * sd_s / GRID_S).ceil() as isize;
    let kernel: Vec<f64> = (-radius..=radius).map(|k| (-0.5 * (k as f64 * GRID_S / sd_s).powi(2)).exp()).collect();
    let total: f64 = kernel.iter().sum();
    let last = values.len() as isize - 1;
    let at = |k: isize| values[k.clamp(0, last) as usize];
    (0..=last)
        .map(|k| kernel.iter().zip(-radius..).map(|(weight, d)| weight * at(k + d)).sum::<f64>() / total)
        .collect()
}

/// A smooth series that is nowhere above the given one: the least in a window, then a mean over the same window.
fn lower_envelope(values: &[f64]) -> Vec<f64> {
    let radius = (HEIGHT_WINDOW_S / GRID_S) as usize;
    let window = |k: usize| k.saturating_sub(radius)..(k + radius + 1).min(values.len());
    let least: Vec<f64> =
        (0..values.len()).map(|k| values[window(k)].iter().copied().fold(f64::INFINITY, f64::min)).collect();
    (0..values.len()).map(|k| least[window(k)].iter().sum::<f64>() / window(k).len() as f64).collect()
}
