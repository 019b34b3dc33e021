//! The plan of a walk: which foot comes down where and when.

use nalgebra::{Point3, Rotation3, Vector3};
use rand::RngExt;
use rand_chacha::ChaCha8Rng;
use rand_distr::StandardNormal;

/// Where a walk goes.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Course {
    /// Straight on, after a second of standing.
    Straight,
    /// Standing still.
    Standing,
    /// Walking and standing by turns, three seconds of standing in between.
    StopAndGo,
    /// Straight, a turn by a quarter, straight.
    Turn,
}

impl Course {
    /// Name of the course.
    pub fn name(self) -> &'static str {
        match self {
            Course::Straight => "straight",
            Course::Standing => "standing",
            Course::StopAndGo => "stop_and_go",
            Course::Turn => "turn",
        }
    }

    /// All courses.
    pub const ALL: [Course; 4] = [Course::Straight, Course::Standing, Course::StopAndGo, Course::Turn];
}

/// How somebody walks.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Stride {
    /// Mean step length from footprint to footprint, metres.
    pub step_m: f64,
    /// Half the difference between left and right step length, as a share of the mean; positive: longer left steps.
    pub asymmetry: f64,
    /// Mean distance of the footprints' lines, metres.
    pub width_m: f64,
    /// Time from one contact to the next, seconds.
    pub step_s: f64,
    /// Share of a step during which both feet are down.
    pub double_support: f64,
    /// Whether the left foot begins.
    pub left_first: bool,
}

/// A foot on the floor, from contact to the end of contact.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Footprint {
    /// The foot; 0 is the left.
    pub side: usize,
    /// Floor point below the ankle when the foot is flat, in `world`, metres.
    pub place: Point3<f64>,
    /// Turn of the foot to the left of the z axis, radians.
    pub heading: f64,
    /// Heel strike, seconds; −∞ for the feet on which the walk begins.
    pub contact_s: f64,
    /// Toe off, seconds; ∞ for the feet on which it ends.
    pub release_s: f64,
}

/// SD of the length and the width of a step about its mean, metres: step length variability of walking adults is 1.4 to
/// 1.6 cm and width variability 1.4 to 2.5 cm (Owings as cited by \[walker\]); a walker's handles lessen both.
const STEP_SD_M: f64 = 0.015;
/// See [`STEP_SD_M`].
const WIDTH_SD_M: f64 = 0.01;

/// SD of a step's time as a share of its mean.
const STEP_TIME_SD: f64 = 0.03;

const STAND_BEFORE_S: f64 = 1.0;
const STAND_BETWEEN_S: f64 = 3.0;
const WALK_BETWEEN_STANDS_S: f64 = 7.0;

/// A turn by a quarter, a sixth of it with each of six steps.
const TURN_STEPS: usize = 6;
const TURN_RAD: f64 = std::f64::consts::FRAC_PI_2;

/// Footprints of a walk of `duration_s`, in order of their contacts. It begins at the origin along z.
pub fn footprints(course: Course, stride: &Stride, duration_s: f64, random: &mut ChaCha8Rng) -> Vec<Footprint> {
    let mut walk = Plan::standing(stride);
    let mut time = STAND_BEFORE_S;
    match course {
        Course::Standing => {}
        Course::Straight => walk.bout(time, duration_s, None, random),
        Course::Turn => walk.bout(time, duration_s, Some(0.5 * duration_s), random),
        Course::StopAndGo => {
            while time < duration_s {
                let end = (time + WALK_BETWEEN_STANDS_S).min(duration_s);
                walk.bout(time, end, None, random);
                time = end + STAND_BETWEEN_S;
            }
        }
    }
    walk.footprints
}

struct Plan {
    stride: Stride,
    footprints: Vec<Footprint>,
    /// Where the line of progression is next to the foot that came down last, and its direction.
    middle: Point3<f64>,
    heading: f64,
    next_side: usize,
}

impl Plan {
    fn standing(stride: &Stride) -> Self {
        let foot = |side: usize| Footprint {
            side,
            place: Point3::new(lateral(side) * 0.5 * stride.width_m, 0.0, 0.0),
            heading: 0.0,
            contact_s: f64::NEG_INFINITY,
            release_s: f64::INFINITY,
        };
        Self {
            stride: *stride,
            footprints: vec![foot(0), foot(1)],
            middle: Point3::origin(),
            heading: 0.0,
            next_side: usize::from(!stride.left_first),
        }
    }

    /// Walks from `start` until about `end`, and closes the feet there; turns after `turn_at`.
    fn bout(&mut self, start: f64, end: f64, turn_at: Option<f64>, random: &mut ChaCha8Rng) {
        let stride = self.stride;
        let mut contact = start;
        let mut steps = 0;
        let mut turned = 0;
        loop {
            let step_s = stride.step_s * (1.0 + STEP_TIME_SD * normal(random));
            let lift = if steps == 0 { start } else { contact + stride.double_support * step_s };
            // The foot lifts; had the walk to end before it is down again, it would hang in the air.
            contact = lift + (1.0 - stride.double_support) * step_s;
            let closes = contact + stride.step_s > end;
            if turn_at.is_some_and(|at| contact > at) && turned < TURN_STEPS {
                turned += 1;
                self.heading += TURN_RAD / TURN_STEPS as f64;
            }
            let uneven = 1.0 + lateral(self.next_side) * stride.asymmetry;
            let mut length = stride.step_m * uneven + STEP_SD_M * normal(random);
            if steps == 0 {
                length *= 0.5;
            } else if closes {
                length = 0.0;
            }
            self.step(length, stride.width_m + WIDTH_SD_M * normal(random), lift, contact);
            steps += 1;
            if closes {
                return;
            }
        }
    }

    fn step(&mut self, length: f64, width: f64, lift: f64, contact: f64) {
        let axes = Rotation3::from_axis_angle(&Vector3::y_axis(), self.heading);
        self.middle += axes * Vector3::new(0.0, 0.0, length);
        let side = self.next_side;
        if let Some(last) = self.footprints.iter_mut().rev().find(|print| print.side == side) {
            last.release_s = lift;
        }
        self.footprints.push(Footprint {
            side,
            place: self.middle + axes * Vector3::new(lateral(side) * 0.5 * width, 0.0, 0.0),
            heading: self.heading,
            contact_s: contact,
            release_s: f64::INFINITY,
        });
        self.next_side = 1 - side;
    }
}

/// Sign of a side along x: the left is at +x.
pub fn lateral(side: usize) -> f64 {
    if side == 0 { 1.0 } else { -1.0 }
}

/// A standard normal number.
pub fn normal(random: &mut ChaCha8Rng) -> f64 {
    random.sample(StandardNormal)
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::SeedableRng;

    const STRIDE: Stride =
        Stride { step_m: 0.45, asymmetry: 0.1, width_m: 0.12, step_s: 0.8, double_support: 0.3, left_first: false };

    fn plan(course: Course) -> Vec<Footprint> {
        footprints(course, &STRIDE, 20.0, &mut ChaCha8Rng::seed_from_u64(3))
    }

    #[test]
    fn at_every_time_a_foot_is_down_and_no_foot_is_in_two_places() {
        for course in Course::ALL {
            let prints = plan(course);
            for k in 0..2000 {
                let time = 0.01 * f64::from(k);
                let down = |side| {
                    prints.iter().filter(|p| p.side == side && p.contact_s <= time && time < p.release_s).count()
                };
                assert!(down(0) <= 1 && down(1) <= 1 && down(0) + down(1) >= 1, "{course:?} {time}");
            }
        }
    }

    #[test]
    fn steps_have_the_length_width_and_asymmetry_that_were_asked_for() {
        let prints = plan(Course::Straight);
        let inner = &prints[4..prints.len() - 2];
        let lengths = |side: usize| {
            let steps: Vec<f64> =
                inner.windows(2).filter(|w| w[1].side == side).map(|w| w[1].place.z - w[0].place.z).collect();
            steps.iter().sum::<f64>() / steps.len() as f64
        };
        assert!((lengths(0) - 0.495).abs() < 0.02 && (lengths(1) - 0.405).abs() < 0.02);
        let width =
            inner.windows(2).map(|w| (w[1].place.x - w[0].place.x).abs()).sum::<f64>() / (inner.len() - 1) as f64;
        assert!((width - 0.12).abs() < 0.01, "{width}");
    }

    #[test]
    fn a_turn_ends_a_quarter_to_the_left_and_a_stop_closes_the_feet() {
        let turned = plan(Course::Turn);
        assert!((turned[turned.len() - 1].heading - TURN_RAD).abs() < 1e-9);
        let prints = plan(Course::StopAndGo);
        let pause = prints.windows(2).find(|w| w[1].contact_s - w[0].contact_s > 2.0 && w[0].contact_s > 2.0).unwrap();
        let other = prints.iter().rev().find(|p| p.side != pause[0].side && p.contact_s < pause[0].contact_s).unwrap();
        assert!((pause[0].place.z - other.place.z).abs() < 1e-9);
    }
}
