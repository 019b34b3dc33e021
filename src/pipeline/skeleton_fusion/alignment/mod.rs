//! How units sit on their bones, where they head, and how the camera stands: one least-squares problem over the whole
//! recording.
//!
//! ```text
//! R_b(t) = T R_y(h_u(t)) E_u(t) A_u exp(a_u)
//! ```
//!
//! takes bone b into `subject`: E is the unit's own orientation, `A exp(a)` the constant mounting `imu_from_bone`, h the
//! heading, which drifts at a rate that wanders little, and T the tilt of the camera. What holds them:
//!
//! | equation | says |
//! |---|---|
//! | `c = (L + l) R_b d + o` | the camera's vector c between two joints, seen with a constant offset o and a posture's |
//! | `R_p k = R_d k` | a knee is a hinge: both bones share its axis k |
//! | `(R_p k) · (R_d d) = 0` | an elbow is one too, but the forearm turns about itself |
//! | `(R_b k) · c' = 0` | where the limb's other bone has no unit, the camera's vector c' of it stands on the hinge axis |
//! | `R_b d = −y` | a leg that is seen stood on is upright; for units that are not mounted by the scheme |
//! | `φ = φ₀ ± σ` | a person who stands still stands nearly straight |
//! | `A` is the scheme ± 5° | where the units are mounted by it |
//! | `A k` is the main axis of turning ± 10° | of a leg's unit that is not |
//! | headings agree on the plank | where there was one |
//!
//! The paper's remaining error is a constant offset from misaligned sensors; here it is an unknown with a covariance.

mod equations;
mod normal_equations;
mod start;
#[cfg(test)]
mod tests;
pub mod tuning;

use super::camera::{BoneVector, VectorKind};
use super::motion::{Stretch, UnitMotion};
use crate::assessment::Mounting;
use crate::body::{Bone, Limb, Skeleton};
use equations::Unknowns;
pub use equations::{TurnColumn, hinge_angle};
use nalgebra::{DMatrix, Rotation3, UnitQuaternion, Vector3};
use start::{Agreement, Start, common_heading};
use std::f64::consts::PI;
pub use tuning::AlignmentTuning;

/// Steps of Gauss and Newton at the most; five are usual.
const MAX_ITERATIONS: usize = 20;
/// Largest change of a rotation, radians, under which the steps have come to an end.
const CONVERGED: f64 = 5e-4;
/// Largest rotation of one step, radians: further away the equations are no longer what they were.
const LARGEST_STEP: f64 = 0.3;

/// Disagreement with the scheme, radians (40°), beyond which a unit is mounted in another way: straps slip by 10°, and a
/// camera sees a bone in a direction that is off by as much.
const SCHEME_WITHIN: f64 = 40.0 * PI / 180.0;

/// Weight of the scheme in the search for a free mounting, relative to all vectors: it decides only what they leave open.
const HINT_WEIGHT: f64 = 0.01;

/// Bend of a leg, radians (20°), at which half of the trust in its direction is gone. Sitting before a Kinect v1, a thigh
/// that turned by 78° is seen to turn by 43°.
const DISTRUSTED_BEND: f64 = 20.0 * PI / 180.0;

/// Bend of a leg and its angle to the vertical, radians (20°, 25°), up to which the camera sees somebody stand on it.
const STOOD_ON: [f64; 2] = [20.0 * PI / 180.0, 25.0 * PI / 180.0];

/// Bend of a limb, radians (40°), from which on a camera shows the sense of it: two joints that are 45 mm off each turn a
/// forearm by 20°.
const SURELY_BENT: f64 = 40.0 * PI / 180.0;

/// Flexion that knees and elbows can have, radians (−30° to 170°), with room for a mounting's error, and the share of
/// moments that may lie outside.
const POSSIBLE_HINGE: std::ops::RangeInclusive<f64> = -30.0 * PI / 180.0..=170.0 * PI / 180.0;
const IMPOSSIBLE_SHARE: f64 = 0.1;

/// Moments in which a limb must be seen bent for its hinge to be known.
const ENOUGH_BENT: usize = 8;

/// Weight of the main axis of turning in that search, relative to all vectors.
const FUNCTIONAL_WEIGHT: f64 = 0.5;

/// Time between two points of a heading's course, seconds, and the most of them that a recording has.
const HEADING_STEP_S: f64 = 10.0;
const MOST_HEADINGS: f64 = 20.0;

/// One moment at which camera and units are compared.
#[derive(Debug, Clone, PartialEq)]
pub struct Moment {
    /// Time on the camera's clock, nanoseconds.
    pub time_ns: i64,
    /// Time for which it stands, seconds.
    pub interval_s: f64,
    /// The camera's vectors in the order of [`BoneVector::all`], in `subject`, metres; NaN where not seen.
    pub vectors: Vec<Vector3<f64>>,
    /// Stretch and orientation of each unit; none where it has no samples.
    pub units: Vec<Option<(usize, UnitQuaternion<f64>)>>,
    /// The posture of a person who stands still, where that is known.
    pub standing: Option<Standing>,
}

impl Moment {
    /// Bend of a limb as the camera sees it, radians; none where a joint is not seen.
    pub fn bend(&self, vectors: &[BoneVector], limb: Limb) -> Option<f64> {
        let angle = self.along(vectors, Bone::Proximal(limb))?.angle(&self.along(vectors, Bone::Distal(limb))?);
        angle.is_finite().then_some(angle)
    }

    /// A limb bone's vector as the camera sees it, metres; none where a joint is not seen.
    pub fn along(&self, vectors: &[BoneVector], bone: Bone) -> Option<Vector3<f64>> {
        let place = vectors.iter().position(|v| v.bone == bone && v.kind == VectorKind::Along)?;
        Some(self.vectors[place]).filter(|vector| vector.x.is_finite())
    }

    /// True when the camera sees somebody stand on the leg that a bone belongs to.
    pub(super) fn stands_on(&self, vectors: &[BoneVector], bone: Bone) -> bool {
        let Some(leg) = bone.limb().filter(|limb| !limb.is_arm()) else { return false };
        let upright = |bone: Bone| self.along(vectors, bone).is_some_and(|v| v.angle(&-Vector3::y()) < STOOD_ON[1]);
        self.bend(vectors, leg).is_some_and(|bend| bend < STOOD_ON[0])
            && upright(Bone::Proximal(leg))
            && upright(Bone::Distal(leg))
    }

    /// How far the camera's direction of a bone is believed, 0 to 1: it sees a bent leg from its end and misplaces the
    /// joint behind.
    pub(super) fn trust(&self, vectors: &[BoneVector], bone: Bone) -> f64 {
        let leg = bone.limb().filter(|limb| !limb.is_arm());
        leg.and_then(|leg| self.bend(vectors, leg)).map_or(1.0, |bend| 1.0 / (1.0 + (bend / DISTRUSTED_BEND).powi(2)))
    }
}

/// A posture at rest in which the hinges are known.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Standing {
    /// Flexion of knees and elbows by limb, radians, and how sure that is; none where the limb is not at rest.
    pub hinges: [Option<(f64, f64)>; 4],
}

/// What the plank showed: the heading of each unit by which all units agree, radians, by unit; on the stretch named.
#[derive(Debug, Clone, PartialEq)]
pub struct PlankHeadings {
    /// Time at which they agree, nanoseconds.
    pub time_ns: i64,
    /// Stretch and heading of each unit; none where it did not lie there.
    pub units: Vec<Option<(usize, f64)>>,
}

/// How one unit's mounting was found.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum MountingFound {
    /// The paper's scheme was the starting point and agreed with the movement.
    Scheme,
    /// From movement alone.
    Movement,
}

/// A heading over time, linear between equally spaced points.
#[derive(Debug, Clone, PartialEq)]
pub struct HeadingCourse {
    /// Time of the first point, nanoseconds.
    pub start_ns: i64,
    /// Time between points, nanoseconds.
    pub step_ns: i64,
    /// Headings, radians.
    pub values: Vec<f64>,
    /// Mean drift, radians per second: what is left of the gyroscope's bias about the vertical.
    pub drift: f64,
}

impl HeadingCourse {
    fn spanning([first, last]: [i64; 2], step_s: f64, value: f64) -> Self {
        let seconds = (last - first) as f64 * 1e-9;
        let steps = (seconds / step_s).ceil().max(1.0) as usize;
        let step_ns = ((last - first) / steps as i64).max(1);
        Self { start_ns: first, step_ns, values: vec![value; steps + 1], drift: 0.0 }
    }

    /// The point before a time, and the share of the next one in the heading then.
    fn place(&self, time_ns: i64) -> (usize, f64) {
        let steps = (time_ns - self.start_ns) as f64 / self.step_ns as f64;
        let point = (steps.floor().max(0.0) as usize).min(self.values.len() - 2);
        (point, (steps - point as f64).clamp(0.0, 1.0))
    }

    /// The heading at a time, radians.
    pub fn at(&self, time_ns: i64) -> f64 {
        let (point, share) = self.place(time_ns);
        self.values[point] + share * (self.values[point + 1] - self.values[point])
    }
}

/// How one unit sits and heads.
#[derive(Debug, Clone, PartialEq)]
pub struct UnitAlignment {
    /// Its bone.
    pub bone: Bone,
    /// Its mounting.
    pub imu_from_bone: Rotation3<f64>,
    /// Its heading in each stretch.
    pub headings: Vec<HeadingCourse>,
    /// How the mounting was found.
    pub mounting: MountingFound,
    /// False where nothing tells how the unit is turned about its bone; such a unit is not followed.
    pub is_determined: bool,
    /// Angle between camera and unit where the search started, radians: what is left when everything is turned as well as
    /// one constant rotation can.
    pub start_disagreement: f64,
}

/// The solution, and how well it is determined.
#[derive(Debug, Clone, PartialEq)]
pub struct Alignment {
    /// `subject_from_level`: tilt of the camera.
    pub tilt: Rotation3<f64>,
    /// The units, in the order given.
    pub units: Vec<UnitAlignment>,
    /// Constant offsets of the camera's vectors, metres, in the order of [`BoneVector::all`].
    pub vector_offsets: Vec<Vector3<f64>>,
    /// Turn of the plank about the vertical against where it should have lain, radians, when there was one.
    pub plank_heading: Option<f64>,
    /// Covariance of the unknowns, ordered by `unknowns`.
    covariance: DMatrix<f64>,
    unknowns: Unknowns,
}

impl Alignment {
    /// `subject_from_bone` of a unit that has an orientation at a time.
    pub fn subject_from_bone(
        &self,
        unit: usize,
        time_ns: i64,
        stretch: usize,
        earth_from_imu: &UnitQuaternion<f64>,
    ) -> Rotation3<f64> {
        let found = &self.units[unit];
        let heading = Rotation3::from_axis_angle(&Vector3::y_axis(), found.headings[stretch].at(time_ns));
        self.tilt * heading * earth_from_imu.to_rotation_matrix() * found.imu_from_bone
    }

    /// True when every mounting was begun from the scheme.
    fn is_by_scheme(&self) -> bool {
        self.units.iter().all(|unit| unit.mounting == MountingFound::Scheme)
    }

    /// Covariance of two unknowns.
    pub(super) fn covariance_of(&self, i: usize, j: usize) -> f64 {
        self.covariance[(i, j)]
    }

    /// Standard deviation of a unit's mounting about the three axes of its bone, radians.
    pub fn mounting_sd(&self, unit: usize) -> Vector3<f64> {
        let first = self.unknowns.mounting(unit);
        Vector3::from_fn(|axis, _| self.covariance[(first + axis, first + axis)].max(0.0).sqrt())
    }

    /// Standard deviation of a unit's heading, radians, the largest of all points.
    pub fn heading_sd(&self, unit: usize) -> f64 {
        let courses = self.units[unit].headings.iter().enumerate();
        let points = courses.flat_map(|(stretch, course)| {
            let first = self.unknowns.heading(unit, stretch);
            first..first + course.values.len()
        });
        points.map(|i| self.covariance[(i, i)].max(0.0).sqrt()).fold(0.0, f64::max)
    }
}

/// What the alignment looks at.
#[derive(Debug, Clone, Copy)]
pub struct Evidence<'a> {
    /// The calibrated body.
    pub skeleton: &'a Skeleton,
    /// The units' motions.
    pub motions: &'a [UnitMotion],
    /// The moments.
    pub moments: &'a [Moment],
    /// The plank, when there was one.
    pub plank: Option<&'a PlankHeadings>,
    /// What is assumed of the mounting.
    pub mounting: Mounting,
}

/// Solves for mounting, heading and tilt. `None` when the equations have no solution, which only numbers that are not
/// finite can bring about.
///
/// `earlier` is a solution from more moments of the same units. It is begun from where the mountings are by the scheme; where
/// they had to be found, moments that do not count any more may have misled it.
pub fn align(evidence: &Evidence<'_>, tuning: &AlignmentTuning, earlier: Option<&Alignment>) -> Option<Alignment> {
    let vectors = BoneVector::all();
    let (starts, plank_heading) = starts(evidence, &vectors);
    let units = evidence.motions.iter().zip(&starts).enumerate().map(|(u, (motion, start))| UnitAlignment {
        bone: motion.bone,
        imu_from_bone: start.0.imu_from_bone,
        headings: first_headings(evidence, u, motion, start, plank_heading, &vectors),
        mounting: start.1,
        is_determined: start.1 == MountingFound::Scheme || shows_twist(evidence, u, &vectors),
        start_disagreement: start.0.agreement.clamp(-1.0, 1.0).acos(),
    });
    let units: Vec<UnitAlignment> = units.collect();
    let unknowns = Unknowns::of(&units, evidence.plank.is_some(), vectors.len());
    let mut alignment = Alignment {
        tilt: Rotation3::identity(),
        units,
        vector_offsets: vec![Vector3::zeros(); vectors.len()],
        plank_heading,
        covariance: DMatrix::zeros(0, 0),
        unknowns,
    };
    if let Some(earlier) = earlier.filter(|earlier| earlier.is_by_scheme() && alignment.is_by_scheme()) {
        alignment.tilt = earlier.tilt;
        alignment.plank_heading = earlier.plank_heading;
        for (unit, before) in alignment.units.iter_mut().zip(&earlier.units) {
            unit.imu_from_bone = before.imu_from_bone;
            unit.headings.clone_from(&before.headings);
        }
    }
    let mut stretch = vec![0.0; vectors.len()];
    let (mut iterations, mut may_begin_again) = (0, true);
    loop {
        let equations = equations::assemble(evidence, &vectors, &alignment, &stretch, tuning);
        let (factor, step) = equations.factor()?;
        let moved = equations::apply(&mut alignment, &mut stretch, &step, LARGEST_STEP);
        iterations += 1;
        if moved >= CONVERGED && iterations < MAX_ITERATIONS {
            continue;
        }
        if may_begin_again && headings_from_mountings(&mut alignment) {
            (iterations, may_begin_again) = (0, false);
            continue;
        }
        alignment.covariance = factor.inverse();
        break;
    }
    doubt_impossible_hinges(evidence, &mut alignment);
    Some(alignment)
}

/// Puts mountings by the scheme back that the steps have turned far away from it, and turns their headings instead; true when
/// there were any. A bone that hangs down is turned in the same way by either, and where its heading began far off, steps
/// may end with the wrong one.
fn headings_from_mountings(alignment: &mut Alignment) -> bool {
    let mut any = false;
    for unit in alignment.units.iter_mut().filter(|unit| unit.mounting == MountingFound::Scheme) {
        let scheme = unit.bone.scheme_from_imu().inverse();
        let away = UnitQuaternion::from_rotation_matrix(&(scheme.inverse() * unit.imu_from_bone));
        if away.angle() <= SCHEME_WITHIN {
            continue;
        }
        let about_bone = 2.0 * away.imag().dot(&unit.bone.direction()).atan2(away.w);
        unit.imu_from_bone = scheme;
        for course in &mut unit.headings {
            course.values.iter_mut().for_each(|heading| *heading -= about_bone);
        }
        any = true;
    }
    any
}

/// Marks both units of a limb as not determined whose hinge would leave what joints can do: their mountings, found from
/// movement alone, are turned about the bone.
fn doubt_impossible_hinges(evidence: &Evidence<'_>, alignment: &mut Alignment) {
    for limb in Limb::ALL {
        let of = |bone: Bone| alignment.units.iter().position(|unit| unit.bone == bone);
        let (Some(p), Some(d)) = (of(Bone::Proximal(limb)), of(Bone::Distal(limb))) else { continue };
        if [p, d].iter().all(|u| alignment.units[*u].mounting == MountingFound::Scheme) {
            continue;
        }
        let rotation = |moment: &Moment, u: usize| {
            let (stretch, earth) = moment.units[u].as_ref()?;
            Some(alignment.subject_from_bone(u, moment.time_ns, *stretch, earth))
        };
        let hinges =
            evidence.moments.iter().filter_map(|m| Some(hinge_angle(limb, &rotation(m, p)?, &rotation(m, d)?)));
        let hinges: Vec<f64> = hinges.collect();
        let n_impossible = hinges.iter().filter(|hinge| !POSSIBLE_HINGE.contains(hinge)).count();
        if n_impossible as f64 > IMPOSSIBLE_SHARE * hinges.len() as f64 {
            alignment.units[p].is_determined = false;
            alignment.units[d].is_determined = false;
        }
    }
}

/// Mounting and heading of every unit to start from, and the heading of the plank.
fn starts(evidence: &Evidence<'_>, vectors: &[BoneVector]) -> (Vec<(Start, MountingFound)>, Option<f64>) {
    let scheme = |bone: Bone| bone.scheme_from_imu().inverse();
    let main: Vec<usize> = (0..evidence.motions.len()).map(|u| main_stretch(evidence, u)).collect();
    let sums: Vec<Agreement> = main.iter().enumerate().map(|(u, s)| agreement(evidence, u, *s, vectors)).collect();
    // The plank knows the heading of the stretch that lay on it alone.
    let from_plank = |u: usize| {
        let (stretch, heading) = evidence.plank.and_then(|plank| plank.units[u])?;
        (stretch == main[u]).then_some(heading)
    };
    let plank_heading = evidence.plank.map(|_| {
        let counted = evidence.motions.iter().zip(&sums).enumerate();
        let counted: Vec<(Agreement, Rotation3<f64>)> =
            counted.filter_map(|(u, (motion, sum))| Some((sum.headed(from_plank(u)?), scheme(motion.bone)))).collect();
        common_heading(&counted, SCHEME_WITHIN.cos())
    });
    let starts = evidence.motions.iter().zip(&sums).enumerate().map(|(u, (motion, sum))| {
        let scheme = scheme(motion.bone);
        let known_heading = from_plank(u).map(|heading| heading + plank_heading.unwrap_or(0.0));
        if sum.is_empty() {
            let start = Start { heading: known_heading.unwrap_or(0.0), imu_from_bone: scheme, agreement: 1.0 };
            let is_scheme = match evidence.mounting {
                Mounting::Scheme => true,
                Mounting::Auto => motion.is_by_scheme || evidence.plank.is_some(),
                Mounting::Unknown => false,
            };
            return (start, if is_scheme { MountingFound::Scheme } else { MountingFound::Movement });
        }
        let by_scheme = match known_heading {
            Some(heading) => Start { heading, agreement: sum.agreement_of(heading, &scheme), imu_from_bone: scheme },
            None => sum.with_mounting(&scheme),
        };
        // Whoever lays the units on a plank follows the paper, whose scheme goes with it.
        let is_meant = motion.is_by_scheme || evidence.plank.is_some();
        let agrees = is_meant && by_scheme.agreement > SCHEME_WITHIN.cos();
        match evidence.mounting {
            Mounting::Scheme => (by_scheme, MountingFound::Scheme),
            Mounting::Auto if agrees => (by_scheme, MountingFound::Scheme),
            _ => {
                let free = |sum: &Agreement| match known_heading {
                    Some(heading) => sum.hinted(&scheme, HINT_WEIGHT).with_heading(heading),
                    None => sum.free(&scheme, HINT_WEIGHT),
                };
                let mut found = free(sum);
                if let Some((in_imu, in_bone)) = functional_axis(motion, &found.imu_from_bone) {
                    found = free(&sum.paired(&in_imu, &in_bone, FUNCTIONAL_WEIGHT));
                }
                (found, MountingFound::Movement)
            }
        }
    });
    (starts.collect(), plank_heading)
}

/// True when camera and unit show how the unit is turned about its bone: an arm must be seen bent for it. A trunk has two
/// vectors, and a leg's unit knows the plane that the leg swings in.
fn shows_twist(evidence: &Evidence<'_>, unit: usize, vectors: &[BoneVector]) -> bool {
    let Some(arm) = evidence.motions[unit].bone.limb().filter(|limb| limb.is_arm()) else { return true };
    let with_unit = evidence.moments.iter().filter(|moment| moment.units[unit].is_some());
    with_unit.filter(|moment| hinge_axis_seen(vectors, moment, arm).is_some()).count() >= ENOUGH_BENT
}

/// The main axis of a leg's unit, in the sense of a mounting, and the hinge axis that it should be.
fn functional_axis(motion: &UnitMotion, imu_from_bone: &Rotation3<f64>) -> Option<(Vector3<f64>, Vector3<f64>)> {
    let limb = motion.bone.limb().filter(|limb| !limb.is_arm())?;
    let axis = motion.main_axis?;
    let sense = (imu_from_bone * limb.hinge_axis()).dot(&axis).signum();
    Some((axis * sense, limb.hinge_axis()))
}

/// The stretch of a unit that most moments lie in: a heading belongs to one stretch, a mounting is looked for in one.
fn main_stretch(evidence: &Evidence<'_>, unit: usize) -> usize {
    let mut counts = vec![0_usize; evidence.motions[unit].stretches.len()];
    for (stretch, _) in evidence.moments.iter().filter_map(|moment| moment.units[unit].as_ref()) {
        counts[*stretch] += 1;
    }
    // Of equals the first.
    (0..counts.len()).rev().max_by_key(|stretch| counts[*stretch]).unwrap_or(0)
}

/// The course of a unit's heading in each of its stretches, constant at first.
fn first_headings(
    evidence: &Evidence<'_>,
    unit: usize,
    motion: &UnitMotion,
    start: &(Start, MountingFound),
    plank_heading: Option<f64>,
    vectors: &[BoneVector],
) -> Vec<HeadingCourse> {
    let main = main_stretch(evidence, unit);
    let of_stretch = |stretch: usize| {
        let sum = agreement(evidence, unit, stretch, vectors);
        let on_plank = evidence.plank.and_then(|plank| plank.units[unit]).filter(|(s, _)| *s == stretch);
        match on_plank {
            _ if stretch == main => start.0.heading,
            Some((_, heading)) => heading + plank_heading.unwrap_or(0.0),
            None if sum.is_empty() => start.0.heading,
            None => sum.with_mounting(&start.0.imu_from_bone).heading,
        }
    };
    let whole_s = motion.span_ns().map_or(0.0, |[first, last]| (last - first) as f64 * 1e-9);
    let step_s = HEADING_STEP_S.max(whole_s / MOST_HEADINGS);
    let course =
        |(s, stretch): (usize, &Stretch)| Some(HeadingCourse::spanning(stretch.span_ns()?, step_s, of_stretch(s)));
    motion.stretches.iter().enumerate().filter_map(course).collect()
}

/// Agreement of a unit with the camera over the moments of one stretch: the bone's own vectors, and the axis of its hinge
/// where the limb is bent.
fn agreement(evidence: &Evidence<'_>, unit: usize, stretch: usize, vectors: &[BoneVector]) -> Agreement {
    let bone = evidence.motions[unit].bone;
    let mut sum = Agreement::default();
    for moment in evidence.moments {
        let Some((s, orientation)) = &moment.units[unit] else { continue };
        if stretch != *s {
            continue;
        }
        for (vector, seen) in vectors.iter().zip(&moment.vectors).filter(|(vector, _)| vector.bone == bone) {
            let of_body = vector.of_skeleton(evidence.skeleton);
            if let (Some(seen), Some(of_body)) = (direction(seen), direction(&of_body)) {
                sum.add(orientation, &seen, &of_body, moment.trust(vectors, bone));
            }
        }
        if let Some((limb, axis)) = bone.limb().and_then(|limb| Some((limb, hinge_axis_seen(vectors, moment, limb)?))) {
            sum.add(orientation, &axis, &limb.hinge_axis(), 1.0);
        }
    }
    sum
}

/// Direction of a vector that was seen and has a length.
fn direction(vector: &Vector3<f64>) -> Option<Vector3<f64>> {
    // A norm that is not a number compares as false.
    let norm = vector.norm();
    (norm > 1e-6).then(|| vector / norm)
}

/// Axis of a limb's hinge as the camera sees it; none where a joint is not seen, or the limb is not bent enough for the
/// camera's error to leave the sense of the bend.
fn hinge_axis_seen(vectors: &[BoneVector], moment: &Moment, limb: Limb) -> Option<Vector3<f64>> {
    let of = |bone: Bone| {
        let place = vectors.iter().position(|v| v.bone == bone && v.kind == VectorKind::Along)?;
        direction(&moment.vectors[place])
    };
    let (proximal, distal) = (of(Bone::Proximal(limb))?, of(Bone::Distal(limb))?);
    let is_bent = proximal.dot(&distal) < SURELY_BENT.cos();
    is_bent.then(|| direction(&proximal.cross(&distal))).flatten()
}
