//! From motions to the alignment: when the units were put on, which moments count, how they sit.

use super::alignment::{Alignment, AlignmentTuning, Evidence, Moment, PlankHeadings, align};
use super::camera::{BoneVector, CameraBody};
use super::evidence::{moments, rest_of_all};
use super::motion::UnitMotion;
use super::synchronization::CommonRest;
use crate::assessment::Mounting;
use crate::body::Skeleton;
use crate::recording::inertial::world_from_plank;
use nalgebra::{Rotation3, UnitQuaternion, Vector3};
use std::f64::consts::PI;

/// Angle between the camera's and a unit's direction of a bone, radians (50°), beyond which the unit is not on the bone. A
/// camera that sees a bone end-on is off by half of it.
const NOT_WORN_BEYOND: f64 = 50.0 * PI / 180.0;
/// Time in which the first unit leaves the plank, seconds.
const LEAVING_S: f64 = 1.0;
/// Time over which units agree with the camera once they are worn, seconds.
const WORN_FOR_S: f64 = 1.5;

/// The plank: when the units lay on it, and how.
#[derive(Debug, Clone, PartialEq)]
pub struct Plank {
    /// First and last time on the camera's clock, nanoseconds.
    pub span_ns: [i64; 2],
    /// `subject_from_imu` of a unit on the plank, as it should have lain.
    pub subject_from_imu: UnitQuaternion<f64>,
}

impl Plank {
    /// That of a rest on it.
    pub fn of(rest: &CommonRest, camera: Option<&CameraBody>) -> Self {
        let subject_from_world = camera.map_or_else(Rotation3::identity, |c| c.observations.subject_from_world);
        Self {
            span_ns: [rest.camera_ns.start, rest.camera_ns.end],
            subject_from_imu: UnitQuaternion::from_rotation_matrix(&(subject_from_world * world_from_plank())),
        }
    }
}

/// What was found out before the posture is estimated.
#[derive(Debug, Clone, PartialEq)]
pub struct Setup {
    /// The plank, when there was one.
    pub plank: Option<Plank>,
    /// Time from which on the units are worn, nanoseconds.
    pub worn_from_ns: i64,
    /// The moments that the alignment looked at.
    pub moments: Vec<Moment>,
    /// The alignment.
    pub alignment: Alignment,
    /// Headings by which the units agreed on the plank.
    pub plank_headings: Option<PlankHeadings>,
}

impl Setup {
    /// Finds all of it; `None` when the alignment has no solution.
    pub fn of(
        camera: Option<&CameraBody>,
        skeleton: &Skeleton,
        motions: &[UnitMotion],
        plank: Option<Plank>,
        mounting: Mounting,
    ) -> Option<Self> {
        let plank_headings = plank.as_ref().map(|plank| headings_on(plank, motions));
        let solve = |from_ns: i64, earlier: Option<&Alignment>| {
            let moments = moments(camera, motions, from_ns);
            let evidence = Evidence { skeleton, motions, moments: &moments, plank: plank_headings.as_ref(), mounting };
            let alignment = align(&evidence, &AlignmentTuning::default(), earlier);
            alignment.map(|alignment| (moments, alignment))
        };
        // Between the plank and the body the units move in ways that no bone does. A person who has put them on stands
        // still for a moment; where nobody does, the time is found by what the camera sees.
        let left_ns = plank.as_ref().map(|plank| plank.span_ns[1] + (LEAVING_S * 1e9) as i64);
        let mut worn_from_ns = left_ns.map_or(i64::MIN, |left| rest_of_all(motions, left).unwrap_or(left));
        let (mut moments, mut alignment) = solve(worn_from_ns, None)?;
        if left_ns.is_some() && camera.is_some() {
            let agreed = first_agreement(&moments, &alignment).unwrap_or(worn_from_ns);
            if agreed > worn_from_ns {
                worn_from_ns = agreed;
                (moments, alignment) = solve(worn_from_ns, Some(&alignment))?;
            }
        }
        Some(Self { plank, worn_from_ns, moments, alignment, plank_headings })
    }

    /// First and last time at which the person stood still, nanoseconds.
    pub fn standing_ns(&self) -> Option<[i64; 2]> {
        let mut standing = self.moments.iter().filter(|m| m.standing.is_some()).map(|m| m.time_ns);
        let first = standing.next()?;
        Some([first, standing.next_back().unwrap_or(first)])
    }

    /// Root mean square angle between camera and unit over the moments in which both know the bone, radians.
    pub fn disagreement(&self, unit: usize) -> Option<f64> {
        let angles: Vec<f64> = self.moments.iter().filter_map(|m| largest_angle(m, &self.alignment, unit)).collect();
        let n = angles.len();
        (n > 0).then(|| (angles.iter().map(|a| a * a).sum::<f64>() / n as f64).sqrt())
    }
}

/// The heading of each unit that makes it lie on the plank as it should.
fn headings_on(plank: &Plank, motions: &[UnitMotion]) -> PlankHeadings {
    let time_ns = plank.span_ns[0] / 2 + plank.span_ns[1] / 2;
    let units = motions.iter().map(|motion| {
        let (stretch, earth_from_imu) = motion.at(time_ns)?;
        let turn = plank.subject_from_imu * earth_from_imu.inverse();
        // The twist about the vertical; what is left is the plank's slope.
        Some((stretch, 2.0 * turn.j.atan2(turn.w)))
    });
    PlankHeadings { time_ns, units: units.collect() }
}

/// Largest angle between the vectors of a unit's bone as the camera sees and as the unit turns them, radians.
fn largest_angle(moment: &Moment, alignment: &Alignment, unit: usize) -> Option<f64> {
    let (stretch, earth_from_imu) = moment.units[unit].as_ref()?;
    let bone = alignment.units[unit].bone;
    let rotation = alignment.subject_from_bone(unit, moment.time_ns, *stretch, earth_from_imu);
    let vectors = BoneVector::all();
    let own = vectors.iter().zip(&moment.vectors).zip(&alignment.vector_offsets);
    let angles =
        own.filter(|((vector, seen), _)| vector.bone == bone && seen.x.is_finite()).map(|((vector, seen), o)| {
            let direction: Vector3<f64> = rotation * vector.direction();
            (seen - o).angle(&direction)
        });
    angles.fold(None, |largest: Option<f64>, angle| Some(largest.map_or(angle, |l| l.max(angle))))
}

/// The first time from which on, for a while, no unit is far from what the camera sees.
fn first_agreement(moments: &[Moment], alignment: &Alignment) -> Option<i64> {
    let agrees = |moment: &Moment| {
        let angles = || (0..alignment.units.len()).filter_map(|u| largest_angle(moment, alignment, u));
        angles().next().is_some() && angles().all(|angle| angle < NOT_WORN_BEYOND)
    };
    let mut since: Option<i64> = None;
    for moment in moments {
        if !agrees(moment) {
            since = None;
            continue;
        }
        let start = *since.get_or_insert(moment.time_ns);
        if (moment.time_ns - start) as f64 * 1e-9 >= WORN_FOR_S {
            return Some(start);
        }
    }
    None
}
