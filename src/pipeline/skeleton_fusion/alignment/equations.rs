//! The equations of the alignment, linearised at an estimate.
//!
//! A small turn δ of a bone, in `subject`, moves a vector w on it by `δ × w`; each unknown turns its bones about a column:
//! the tilt about X and Z, a heading about the tilted vertical, a mounting about the bone's own axes.

use super::normal_equations::NormalEquations;
use super::tuning::AlignmentTuning;
use super::{Alignment, Evidence, Moment, MountingFound, UnitAlignment, functional_axis};
use crate::body::{Bone, Limb};
use crate::geometry::attitude::attitude_from_rotation;
use crate::pipeline::skeleton_fusion::camera::{BoneVector, VectorKind};
use nalgebra::{DVector, Rotation3, Vector3};

/// Standard deviation of a heading of which nothing is known, radians; it keeps every unknown determined.
const UNKNOWN_HEADING_SD: f64 = 2.0;
/// Standard deviation of a segment's length against its calibration, as a share of it.
const LENGTH_SHARE_SD: f64 = 0.05;

/// Where each unknown stands in the vector of them.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Unknowns {
    plank: Option<usize>,
    units: Vec<UnitUnknowns>,
    offsets: usize,
    n: usize,
}

#[derive(Debug, Clone, PartialEq, Eq)]
struct UnitUnknowns {
    mounting: usize,
    /// First point of each stretch's heading; after its points follows its drift.
    headings: Vec<usize>,
}

/// The tilt's two unknowns come first.
const TILT: usize = 0;
/// Unknowns of one camera vector: three of its constant offset and one of its length.
const PER_VECTOR: usize = 4;

impl Unknowns {
    pub(super) fn of(units: &[UnitAlignment], has_plank: bool, n_vectors: usize) -> Self {
        let mut next = TILT + 2;
        let plank = has_plank.then_some(next);
        next += usize::from(has_plank);
        let units = units.iter().map(|unit| {
            let mounting = next;
            next += 3;
            let headings = unit.headings.iter().map(|course| {
                let first = next;
                next += course.values.len() + 1;
                first
            });
            UnitUnknowns { mounting, headings: headings.collect() }
        });
        let units = units.collect();
        Self { plank, units, offsets: next, n: next + PER_VECTOR * n_vectors }
    }

    /// First of the three unknowns of a unit's mounting.
    pub(super) fn mounting(&self, unit: usize) -> usize {
        self.units[unit].mounting
    }

    /// First point of a unit's heading in a stretch.
    pub(super) fn heading(&self, unit: usize, stretch: usize) -> usize {
        self.units[unit].headings[stretch]
    }
}

/// An unknown, and the axis in `subject` about which it turns a bone.
pub type TurnColumn = (usize, Vector3<f64>);

impl Alignment {
    /// The unknowns that turn a unit's bone at a time, with their axes.
    pub fn turn_columns(
        &self,
        unit: usize,
        stretch: usize,
        time_ns: i64,
        subject_from_bone: &Rotation3<f64>,
    ) -> [TurnColumn; 7] {
        let found = &self.unknowns.units[unit];
        let (point, share) = self.units[unit].headings[stretch].place(time_ns);
        let up = self.tilt * Vector3::y();
        let bone = subject_from_bone.matrix();
        [
            (TILT, Vector3::x()),
            (TILT + 1, Vector3::z()),
            (found.headings[stretch] + point, up * (1.0 - share)),
            (found.headings[stretch] + point + 1, up * share),
            (found.mounting, bone.column(0).into_owned()),
            (found.mounting + 1, bone.column(1).into_owned()),
            (found.mounting + 2, bone.column(2).into_owned()),
        ]
    }
}

/// A bone whose unit has an orientation at a moment.
struct TurnedBone {
    rotation: Rotation3<f64>,
    columns: [TurnColumn; 7],
}

/// All equations at an estimate; `stretch` is by how much each vector is longer than the skeleton's, metres.
pub(super) fn assemble(
    evidence: &Evidence<'_>,
    vectors: &[BoneVector],
    alignment: &Alignment,
    stretch: &[f64],
    tuning: &AlignmentTuning,
) -> NormalEquations {
    let mut equations = NormalEquations::new(alignment.unknowns.n);
    add_priors(&mut equations, evidence, vectors, alignment, stretch, tuning);
    let n_standing = evidence.moments.iter().filter(|moment| moment.standing.is_some()).count().max(1) as f64;
    for moment in evidence.moments {
        let mut bones: [Option<TurnedBone>; crate::body::BONE_COUNT] = [const { None }; crate::body::BONE_COUNT];
        for (u, orientation) in moment.units.iter().enumerate() {
            let Some((s, earth_from_imu)) = orientation else { continue };
            let rotation = alignment.subject_from_bone(u, moment.time_ns, *s, earth_from_imu);
            let columns = alignment.turn_columns(u, *s, moment.time_ns, &rotation);
            bones[alignment.units[u].bone.index()] = Some(TurnedBone { rotation, columns });
        }
        let instant = Instant { moment, bones: &bones, vectors, alignment, stretch, tuning, evidence };
        instant.add_camera_vectors(&mut equations);
        instant.add_upright(&mut equations);
        for limb in Limb::ALL {
            instant.add_hinge(&mut equations, limb);
            instant.add_standing(&mut equations, limb, n_standing);
        }
    }
    equations
}

struct Instant<'a> {
    moment: &'a Moment,
    bones: &'a [Option<TurnedBone>; crate::body::BONE_COUNT],
    vectors: &'a [BoneVector],
    alignment: &'a Alignment,
    stretch: &'a [f64],
    tuning: &'a AlignmentTuning,
    evidence: &'a Evidence<'a>,
}

impl Instant<'_> {
    fn bone(&self, bone: Bone) -> Option<&TurnedBone> {
        self.bones[bone.index()].as_ref()
    }

    /// Share of a whole observation that the moment counts, when errors last for `time` seconds.
    fn share(&self, time: f64) -> f64 {
        (self.moment.interval_s / time).min(1.0)
    }

    /// The camera's vectors on bones that have a unit.
    fn add_camera_vectors(&self, equations: &mut NormalEquations) {
        let variance = self.tuning.posture_offset.powi(2);
        for (v, (vector, seen)) in self.vectors.iter().zip(&self.moment.vectors).enumerate() {
            let (Some(bone), true) = (self.bone(vector.bone), seen.x.is_finite()) else { continue };
            let of_body = vector.of_skeleton(self.evidence.skeleton);
            let Some(direction) = of_body.try_normalize(1e-6) else { continue };
            let along = bone.rotation * direction;
            let predicted = along * (of_body.norm() + self.stretch[v]);
            let residual = seen - predicted - self.alignment.vector_offsets[v];
            let dof = self.tuning.student_t_dof;
            let robust = (dof + 3.0) / (dof + residual.norm_squared() / variance);
            let mut columns = Vec::with_capacity(7 + PER_VECTOR);
            columns.extend(bone.columns.iter().map(|(i, axis)| (*i, axis.cross(&predicted))));
            let first = self.alignment.unknowns.offsets + PER_VECTOR * v;
            let axes = [Vector3::x(), Vector3::y(), Vector3::z(), along];
            columns.extend(axes.into_iter().enumerate().map(|(i, axis)| (first + i, axis)));
            let weight = robust * self.moment.trust(self.vectors, vector.bone) * self.share(self.tuning.offset_time);
            equations.add_vector(&columns, &residual, weight / variance);
        }
    }

    /// The bones of a leg that is stood on are upright; for units of whose mounting nothing better is known.
    fn add_upright(&self, equations: &mut NormalEquations) {
        let free = self.alignment.units.iter().filter(|unit| unit.mounting == MountingFound::Movement);
        for bone in free.map(|unit| unit.bone).filter(|bone| self.moment.stands_on(self.vectors, *bone)) {
            let Some(turned) = self.bone(bone) else { continue };
            let along = turned.rotation * bone.direction();
            let columns: Vec<TurnColumn> = turned.columns.iter().map(|(i, a)| (*i, a.cross(&along))).collect();
            let weight = self.share(self.tuning.offset_time) / self.tuning.upright_sd.powi(2);
            equations.add_vector(&columns, &(-Vector3::y() - along), weight);
        }
    }

    /// What joins the two bones of a limb.
    fn add_hinge(&self, equations: &mut NormalEquations, limb: Limb) {
        let share = self.share(self.tuning.hinge_time);
        let axis = limb.hinge_axis();
        match (self.bone(Bone::Proximal(limb)), self.bone(Bone::Distal(limb))) {
            (Some(proximal), Some(distal)) => {
                let (k, k_distal) = (proximal.rotation * axis, distal.rotation * axis);
                let mut columns: Vec<TurnColumn> = proximal.columns.iter().map(|(i, a)| (*i, a.cross(&k))).collect();
                columns.extend(distal.columns.iter().map(|(i, a)| (*i, -a.cross(&k_distal))));
                let sd = if limb.is_arm() { self.tuning.pronation_sd } else { self.tuning.hinge_sd };
                equations.add_vector(&columns, &(k_distal - k), share / sd.powi(2));
                if limb.is_arm() {
                    let along = distal.rotation * limb.reference_direction();
                    let mut terms: Vec<(usize, f64)> =
                        proximal.columns.iter().map(|(i, a)| (*i, a.cross(&k).dot(&along))).collect();
                    terms.extend(distal.columns.iter().map(|(i, a)| (*i, k.dot(&a.cross(&along)))));
                    equations.add(&terms, -k.dot(&along), share / self.tuning.hinge_sd.powi(2));
                }
            }
            (Some(proximal), None) => self.add_seen_across(equations, proximal, Bone::Distal(limb), &axis),
            // A forearm turns about itself, so its hinge axis is not the elbow's.
            (None, Some(distal)) if !limb.is_arm() => {
                self.add_seen_across(equations, distal, Bone::Proximal(limb), &axis);
            }
            _ => {}
        }
    }

    /// The camera's vector of a bone without a unit stands on the hinge axis of the one that has one.
    fn add_seen_across(&self, equations: &mut NormalEquations, bone: &TurnedBone, other: Bone, axis: &Vector3<f64>) {
        let place = self.vectors.iter().position(|v| v.bone == other && v.kind == VectorKind::Along);
        let Some(v) = place.filter(|v| self.moment.vectors[*v].x.is_finite()) else { return };
        let seen = self.moment.vectors[v] - self.alignment.vector_offsets[v];
        let k = bone.rotation * axis;
        let error = k.dot(&seen);
        let variance = self.tuning.posture_offset.powi(2);
        let dof = self.tuning.student_t_dof;
        let robust = (dof + 1.0) / (dof + error * error / variance);
        let mut terms: Vec<(usize, f64)> = bone.columns.iter().map(|(i, a)| (*i, a.cross(&k).dot(&seen))).collect();
        let first = self.alignment.unknowns.offsets + PER_VECTOR * v;
        terms.extend((0..3).map(|i| (first + i, -k[i])));
        equations.add(&terms, -error, robust * self.share(self.tuning.offset_time) / variance);
    }

    /// The hinge of a person who stands still.
    fn add_standing(&self, equations: &mut NormalEquations, limb: Limb, n_standing: f64) {
        let known = self.moment.standing.and_then(|standing| standing.hinges[limb.index()]);
        let bones = (self.bone(Bone::Proximal(limb)), self.bone(Bone::Distal(limb)));
        let (Some((flexion, sd)), (Some(proximal), Some(distal))) = (known, bones) else { return };
        let k = proximal.rotation * limb.hinge_axis();
        let mut terms: Vec<(usize, f64)> = proximal.columns.iter().map(|(i, a)| (*i, -a.dot(&k))).collect();
        terms.extend(distal.columns.iter().map(|(i, a)| (*i, a.dot(&k))));
        let found = hinge_angle(limb, &proximal.rotation, &distal.rotation);
        equations.add(&terms, flexion - found, 1.0 / (sd * sd * n_standing));
    }
}

/// Flexion of a limb's hinge from the rotations of its bones, radians: the turn about the hinge axis that comes nearest.
pub fn hinge_angle(limb: Limb, proximal: &Rotation3<f64>, distal: &Rotation3<f64>) -> f64 {
    let relative = nalgebra::UnitQuaternion::from_rotation_matrix(&(proximal.inverse() * distal));
    let angle = 2.0 * relative.imag().dot(&limb.hinge_axis()).atan2(relative.w);
    angle - std::f64::consts::TAU * (angle / std::f64::consts::TAU).round()
}

fn add_priors(
    equations: &mut NormalEquations,
    evidence: &Evidence<'_>,
    vectors: &[BoneVector],
    alignment: &Alignment,
    stretch: &[f64],
    tuning: &AlignmentTuning,
) {
    let unknowns = &alignment.unknowns;
    let single = |equations: &mut NormalEquations, index: usize, value: f64, sd: f64| {
        equations.add(&[(index, 1.0)], value, 1.0 / (sd * sd));
    };
    let tilt = attitude_from_rotation(&alignment.tilt);
    single(equations, TILT, -tilt.x, tuning.tilt_sd);
    single(equations, TILT + 1, -tilt.z, tuning.tilt_sd);
    if let (Some(index), Some(heading)) = (unknowns.plank, alignment.plank_heading) {
        single(equations, index, -heading, tuning.plank_heading_sd);
    }
    for (u, unit) in alignment.units.iter().enumerate() {
        let sd = if unit.mounting == MountingFound::Scheme { tuning.scheme_sd } else { tuning.free_sd };
        let away = attitude_from_rotation(&(unit.bone.scheme_from_imu() * unit.imu_from_bone));
        for axis in 0..3 {
            let value = if unit.mounting == MountingFound::Scheme { -away[axis] } else { 0.0 };
            single(equations, unknowns.mounting(u) + axis, value, sd);
        }
        let functional = functional_axis(&evidence.motions[u], &unit.imu_from_bone);
        if let (MountingFound::Movement, Some((in_imu, in_bone))) = (unit.mounting, functional) {
            let columns: Vec<TurnColumn> = (0..3)
                .map(|axis| {
                    let moved = unit.imu_from_bone * Vector3::ith_axis(axis).cross(&in_bone);
                    (unknowns.mounting(u) + axis, moved)
                })
                .collect();
            let error = in_imu - unit.imu_from_bone * in_bone;
            equations.add_vector(&columns, &error, tuning.main_axis_sd.powi(-2));
        }
        for (course, first) in unit.headings.iter().zip(&unknowns.units[u].headings) {
            single(equations, *first, 0.0, UNKNOWN_HEADING_SD);
            let (rate, step_s) = (first + course.values.len(), course.step_ns as f64 * 1e-9);
            single(equations, rate, -course.drift, tuning.heading_drift);
            for point in 0..course.values.len() - 1 {
                let change = course.values[point + 1] - course.values[point] - course.drift * step_s;
                let terms = [(first + point, -1.0), (first + point + 1, 1.0), (rate, -step_s)];
                equations.add(&terms, -change, 1.0 / (tuning.heading_walk.powi(2) * step_s));
            }
        }
    }
    add_plank(equations, evidence, alignment, tuning);
    for (v, vector) in vectors.iter().enumerate() {
        let first = unknowns.offsets + PER_VECTOR * v;
        for axis in 0..3 {
            single(equations, first + axis, -alignment.vector_offsets[v][axis], tuning.constant_offset);
        }
        let length = vector.of_skeleton(evidence.skeleton).norm();
        single(equations, first + 3, -stretch[v], LENGTH_SHARE_SD * length.max(0.05));
    }
}

/// On the plank all headings agree, but for one that is common.
fn add_plank(
    equations: &mut NormalEquations,
    evidence: &Evidence<'_>,
    alignment: &Alignment,
    tuning: &AlignmentTuning,
) {
    let (Some(plank), Some(index), Some(common)) = (evidence.plank, alignment.unknowns.plank, alignment.plank_heading)
    else {
        return;
    };
    for (u, on_plank) in plank.units.iter().enumerate() {
        let Some((stretch, heading)) = on_plank else { continue };
        let course = &alignment.units[u].headings[*stretch];
        let first = alignment.unknowns.units[u].headings[*stretch];
        let (point, share) = course.place(plank.time_ns);
        let terms = [(first + point, 1.0 - share), (first + point + 1, share), (index, -1.0)];
        let error = wrapped(heading + common - course.at(plank.time_ns));
        equations.add(&terms, error, 1.0 / tuning.plank_sd.powi(2));
    }
}

/// An angle brought into ±π.
fn wrapped(angle: f64) -> f64 {
    angle - std::f64::consts::TAU * (angle / std::f64::consts::TAU).round()
}

/// Moves the estimate by a step in which no rotation is larger than `limit`; returns the largest rotation of the step.
///
/// Each rotation is cut off by itself: the heading of a stretch in which nothing tells it would otherwise hold up all others.
pub(super) fn apply(alignment: &mut Alignment, stretch: &mut [f64], step: &DVector<f64>, limit: f64) -> f64 {
    let unknowns = alignment.unknowns.clone();
    let within = |angle: f64| angle.clamp(-limit, limit);
    let turn_within = |turn: Vector3<f64>| turn.cap_magnitude(limit);
    alignment.tilt = Rotation3::new(turn_within(Vector3::new(step[TILT], 0.0, step[TILT + 1]))) * alignment.tilt;
    if let (Some(index), Some(heading)) = (unknowns.plank, alignment.plank_heading.as_mut()) {
        *heading = wrapped(*heading + within(step[index]));
    }
    for (unit, found) in alignment.units.iter_mut().zip(&unknowns.units) {
        let turn = Vector3::from_fn(|axis, _| step[found.mounting + axis]);
        unit.imu_from_bone *= Rotation3::new(turn_within(turn));
        for (course, first) in unit.headings.iter_mut().zip(&found.headings) {
            for (point, heading) in course.values.iter_mut().enumerate() {
                *heading += within(step[first + point]);
            }
            course.drift += step[first + course.values.len()];
        }
    }
    for (v, offset) in alignment.vector_offsets.iter_mut().enumerate() {
        let first = unknowns.offsets + PER_VECTOR * v;
        *offset += Vector3::from_fn(|axis, _| step[first + axis]);
        stretch[v] += step[first + 3];
    }
    step.rows(0, unknowns.offsets).amax()
}
