//! Segment lengths, trunk offsets and facing direction of the subject in one recording (\[angles\], calibration).
//!
//! The paper measures them in the first static instants. A window counts as static when the points drift by less than
//! `STILL_BELOW` in it; most real recordings have none, and are calibrated on robust averages over the whole.

use super::body_fusion::{Fused, fuse, fuse_trunk_offsets, root_mean_square, warn_of_asymmetry};
use super::body_knowledge::{BodyKnowledge, Estimate, FEW_FRAMES, SEGMENT_COUNT, segment_names};
use super::length_uncertainty::{MOVING_STRETCH_S, RESTING_STRETCH_S, standard_error, with_slow_offset};
use super::observation::Observations;
use crate::assessment::Warning;
use crate::assessment::quality::{CalibrationQuality, TrunkOffset};
use crate::body::skeleton::{PLAUSIBLE_SEGMENT_M, point_index};
use crate::body::{Limb, POINT_COUNT, Skeleton};
use crate::geometry::three_point::flexion_of_three_points;
use crate::pipeline::PipelineError;
use crate::signal::stillness::stillest_window;
use nalgebra::{Matrix3, Rotation3, Vector3};
use std::ops::Range;

/// Shortest static window, seconds (`methods.md` asks for at least 1 s).
const MIN_WINDOW_S: f64 = 1.0;
/// The static window is looked for in the first seconds.
const SEARCH_S: f64 = 5.0;
/// Mean drift of the points under which a window is static, m/s; a slow exercise moves a hand ten times as fast.
const STILL_BELOW: f64 = 0.03;
/// Knee flexion under which a leg counts as straight, radians (30°): a static window must show straight legs.
const STRAIGHT_BELOW_RAD: f64 = 30.0 * std::f64::consts::PI / 180.0;
/// Frames that a calibration needs at the least.
const MIN_FRAMES: usize = 5;

/// What calibration found.
#[derive(Debug, Clone, PartialEq)]
pub struct Calibration {
    /// Lengths and offsets.
    pub skeleton: Skeleton,
    /// How they were found.
    pub quality: CalibrationQuality,
    /// What the reader should know.
    pub warnings: Vec<Warning>,
}

/// Calibrates by the recording alone, and turns the observations into `subject`.
///
/// # Errors
/// See [`calibrate_with`].
pub fn calibrate(observations: &mut Observations) -> Result<Calibration, PipelineError> {
    calibrate_with(observations, &BodyKnowledge::default())
}

/// Calibrates by the recording and by what is known of the body, and turns the observations into `subject`.
///
/// # Errors
/// `too_few_frames` without enough frames in which the trunk was seen, or a segment that was not seen in enough and
/// that nothing else is known of; `implausible_body` when a segment is longer or shorter than a human one;
/// `handedness_mismatch` when the body bends the wrong way.
pub fn calibrate_with(
    observations: &mut Observations,
    knowledge: &BodyKnowledge<'_>,
) -> Result<Calibration, PipelineError> {
    let whole = 0..observations.len();
    let window = stillest_window(&observations.time_ns, &observations.points, MIN_WINDOW_S, SEARCH_S)
        .filter(|window| window.drift < STILL_BELOW)
        .filter(|window| complete_frames(observations, window.frames.clone()).len() >= MIN_FRAMES)
        .filter(|window| shows_straight_legs(observations, window.frames.clone()));
    let frames = complete_frames(observations, window.as_ref().map_or(whole, |w| w.frames.clone()));
    let is_partial = frames.len() < MIN_FRAMES;
    let frames = if is_partial { frames_of_a_part(observations, knowledge, frames.len())? } else { frames };
    observations.rotate(subject_from_world(observations, &frames));
    let (mut skeleton, measured) = match (&window, is_partial) {
        (Some(_), _) => measure_static(observations, &frames),
        (None, false) => measure_moving(observations, &frames),
        (None, true) => measure_partial(observations, &frames),
    };
    check_plausible(&measured)?;
    check_handedness(observations)?;
    let stretch_s = if window.is_some() { RESTING_STRETCH_S } else { MOVING_STRETCH_S };
    let offsets = measured_trunk_offsets(observations, &frames, &skeleton, stretch_s);
    let mut warnings = Vec::new();
    if window.is_none() && !is_partial {
        warnings.push(Warning::new(
            "no_static_window",
            "nobody stands still for a second at the start: segment lengths are robust averages over the whole \
             recording, and angles may carry a constant error of a few degrees",
        ));
    }
    let own = measured.iter().map(|segment| segment.own(observations, stretch_s)).collect::<Vec<_>>();
    let Fused { segments, sources } = fuse(&measured, &own, knowledge, &mut warnings);
    for (i, segment) in segments.iter().enumerate() {
        let part = if i % 2 == 0 { &mut skeleton.proximal } else { &mut skeleton.distal };
        part[i / 2] = segment.length_m;
    }
    fuse_trunk_offsets(&mut skeleton, &offsets, knowledge);
    warn_of_asymmetry(&segments, &mut warnings);
    let source = match (&window, is_partial) {
        (Some(_), _) => "static_window",
        (None, false) => "whole_recording",
        (None, true) => "incomplete_recording",
    };
    let quality = CalibrationQuality {
        source: source.to_owned(),
        window_s: window.map(|w| [seconds(observations, w.frames.start), seconds(observations, w.frames.end - 1)]),
        n_frames: frames.len() as u64,
        segments,
        measured_uncertainty_m: root_mean_square(&own),
        measured_trunk_offsets: offsets,
        knowledge: sources.into_iter().map(|source| source.name().to_owned()).collect(),
        patient_assessment_id: knowledge.patient().map(|patient| patient.assessment_id),
    };
    Ok(Calibration { skeleton, quality, warnings })
}

/// The frames that show the trunk, for a recording that shows the whole body in `n_complete` frames only.
///
/// # Errors
/// `too_few_frames` when they are too few, or when nothing is known of a segment that is seen in too few.
fn frames_of_a_part(
    observations: &Observations,
    knowledge: &BodyKnowledge<'_>,
    n_complete: usize,
) -> Result<Vec<usize>, PipelineError> {
    let trunk = |t: &usize| Limb::ALL.iter().all(|limb| observations.points[*t][point_index(*limb, 0)].x.is_finite());
    let frames: Vec<usize> = (0..observations.len()).filter(trunk).collect();
    let is_known = |segment: usize| {
        let n_seen = frames_of_segment(observations, &frames, segment).len();
        n_seen >= MIN_FRAMES || !knowledge.of_segment(segment, true).is_empty()
    };
    if knowledge.is_some() && frames.len() >= MIN_FRAMES && (0..SEGMENT_COUNT).all(is_known) {
        return Ok(frames);
    }
    let sentence = format!(
        "only {n_complete} frames show shoulders, elbows, hands, hips, knees, feet and torso together, and {MIN_FRAMES} \
         are needed to measure the body; record with the whole body in view, or give the subject's height"
    );
    Err(PipelineError::unsuitable("too_few_frames", sentence))
}

/// Those of some frames in which both ends of a segment are seen.
fn frames_of_segment(observations: &Observations, frames: &[usize], segment: usize) -> Vec<usize> {
    frames.iter().copied().filter(|t| segment_length(&observations.points[*t], segment).is_finite()).collect()
}

/// Distance between the two ends of a segment, metres; NaN when one is not seen.
fn segment_length(points: &[Vector3<f64>; POINT_COUNT], segment: usize) -> f64 {
    let at = |level| points[point_index(Limb::ALL[segment / 2], level)];
    (at(segment % 2 + 1) - at(segment % 2)).norm()
}

/// Frames of a range in which every point was seen.
fn complete_frames(observations: &Observations, range: Range<usize>) -> Vec<usize> {
    range.filter(|t| observations.points[*t].iter().all(|p| p.x.is_finite())).collect()
}

/// True when both knees are nearly straight in the median posture of a window. A subject who holds a bent posture rests
/// too, but sensors foreshorten bent segments, and lengths taken there would be wrong everywhere else.
fn shows_straight_legs(observations: &Observations, range: Range<usize>) -> bool {
    let rest = median_points(observations, &complete_frames(observations, range));
    [Limb::LeftLeg, Limb::RightLeg].iter().all(|limb| {
        let at = |level| &rest[point_index(*limb, level)];
        flexion_of_three_points(at(0), at(1), at(2)) < STRAIGHT_BELOW_RAD
    })
}

/// Turn about the vertical that brings the subject's mean right-hand direction to +Z.
fn subject_from_world(observations: &Observations, frames: &[usize]) -> Rotation3<f64> {
    let rightward: Vector3<f64> = frames.iter().map(|t| rightward(&observations.points[*t])).sum();
    // Ry(α) maps (x, z) to the direction atan2(x, z) + α; the right-hand direction must end at 0.
    Rotation3::from_axis_angle(&Vector3::y_axis(), -rightward.x.atan2(rightward.z))
}

/// From the left to the right side of the trunk: shoulders and hips together.
fn rightward(points: &[Vector3<f64>; POINT_COUNT]) -> Vector3<f64> {
    let at = |limb| points[point_index(limb, 0)];
    at(Limb::RightArm) - at(Limb::LeftArm) + at(Limb::RightLeg) - at(Limb::LeftLeg)
}

/// `subject_from_trunk` by the trunk's own points: Y from hips to shoulders, Z rightward, X forward.
fn trunk_axes(points: &[Vector3<f64>; POINT_COUNT]) -> Option<Rotation3<f64>> {
    let at = |limb| points[point_index(limb, 0)];
    let up = at(Limb::LeftArm) + at(Limb::RightArm) - at(Limb::LeftLeg) - at(Limb::RightLeg);
    let y = up.try_normalize(1e-6)?;
    let x = y.cross(&rightward(points)).try_normalize(1e-6)?;
    Some(Rotation3::from_matrix_unchecked(Matrix3::from_columns(&[x, y, x.cross(&y)])))
}

/// What a recording itself shows of one segment.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct MeasuredSegment {
    /// Its place among the segments.
    pub(super) segment: usize,
    /// Length, metres; NaN when it was seen in too few frames.
    pub(super) length_m: f64,
    /// Robust standard deviation over the frames, metres; NaN as the length.
    pub(super) spread_m: f64,
    /// The frames, in no particular order.
    pub(super) frames: Vec<usize>,
    /// True when the recording shows it in so few frames that stature is asked.
    pub(super) is_poor: bool,
}

impl MeasuredSegment {
    fn of(observations: &Observations, segment: usize, frames: Vec<usize>, is_poor: bool) -> Self {
        let mut all: Vec<f64> = frames.iter().map(|t| segment_length(&observations.points[*t], segment)).collect();
        let length_m = median(&mut all);
        let mut deviations: Vec<f64> = all.iter().map(|l| (l - length_m).abs()).collect();
        // 1.4826 makes the median absolute deviation a standard deviation for a normal distribution.
        Self { segment, length_m, spread_m: 1.4826 * median(&mut deviations), frames, is_poor }
    }

    /// The length with the standard deviation that stretches of time and the sensor's slow offset leave it.
    fn own(&self, observations: &Observations, stretch_s: f64) -> Option<Estimate> {
        if self.length_m.is_nan() {
            return None;
        }
        let mut frames = self.frames.clone();
        frames.sort_unstable();
        let length = |t: usize| segment_length(&observations.points[t], self.segment);
        let samples: Vec<(f64, f64)> = frames.iter().map(|t| (seconds(observations, *t), length(*t))).collect();
        Some(Estimate { length_m: self.length_m, sd_m: with_slow_offset(standard_error(&samples, stretch_s)) })
    }
}

/// Time of a frame since the first, seconds.
fn seconds(observations: &Observations, t: usize) -> f64 {
    (observations.time_ns[t] - observations.time_ns[0]) as f64 * 1e-9
}

/// Lengths of the median posture of a resting subject: averaging positions first leaves no bias of noise in lengths.
fn measure_static(observations: &Observations, frames: &[usize]) -> (Skeleton, Vec<MeasuredSegment>) {
    let rest = median_points(observations, frames);
    let axes = trunk_axes(&rest).unwrap_or_else(Rotation3::identity);
    let offsets = Limb::ALL.map(|limb| axes.inverse() * rest[point_index(limb, 0)]);
    let (_, mut segments) = measure_moving(observations, frames);
    for segment in &mut segments {
        segment.length_m = segment_length(&rest, segment.segment);
        segment.is_poor = false;
    }
    (skeleton_of(offsets, &segments), segments)
}

/// Share of a moving subject's frames, those in which a leg is straightest, in which its segments are measured. A sensor
/// sees a bent leg from its end and misplaces the joint behind; the straighter half shows the segments at their length.
const STRAIGHTER_SHARE: f64 = 0.5;

/// Median lengths over frames of a moving subject; those of a leg over the frames in which it is straighter.
fn measure_moving(observations: &Observations, frames: &[usize]) -> (Skeleton, Vec<MeasuredSegment>) {
    let measured = |segment: usize| {
        let limb = Limb::ALL[segment / 2];
        let used = if limb.is_arm() { frames.to_vec() } else { straighter_frames(observations, frames, limb) };
        MeasuredSegment::of(observations, segment, used, frames.len() < FEW_FRAMES)
    };
    let segments: Vec<MeasuredSegment> = (0..SEGMENT_COUNT).map(measured).collect();
    (skeleton_of(median_offsets(observations, frames), &segments), segments)
}

/// Median lengths over the frames that show both ends of each segment; NaN for those seen in too few.
fn measure_partial(observations: &Observations, frames: &[usize]) -> (Skeleton, Vec<MeasuredSegment>) {
    let measured = |segment: usize| {
        let used = frames_of_segment(observations, frames, segment);
        let (is_enough, is_poor) = (used.len() >= MIN_FRAMES, used.len() < FEW_FRAMES);
        let measured = MeasuredSegment::of(observations, segment, used, is_poor);
        if is_enough { measured } else { MeasuredSegment { length_m: f64::NAN, spread_m: f64::NAN, ..measured } }
    };
    let segments: Vec<MeasuredSegment> = (0..SEGMENT_COUNT).map(measured).collect();
    (skeleton_of(median_offsets(observations, frames), &segments), segments)
}

fn skeleton_of(offsets: [Vector3<f64>; 4], segments: &[MeasuredSegment]) -> Skeleton {
    let length = |limb: Limb, level: usize| segments[2 * limb.index() + level].length_m;
    Skeleton { offsets, proximal: Limb::ALL.map(|l| length(l, 0)), distal: Limb::ALL.map(|l| length(l, 1)) }
}

/// Shoulders and hips of a frame in its trunk's axes.
fn offset_in_trunk(points: &[Vector3<f64>; POINT_COUNT], limb: Limb) -> Option<Vector3<f64>> {
    trunk_axes(points).map(|axes| axes.inverse() * points[point_index(limb, 0)])
}

fn median_offsets(observations: &Observations, frames: &[usize]) -> [Vector3<f64>; 4] {
    Limb::ALL.map(|limb| median_vector(frames.iter().filter_map(|t| offset_in_trunk(&observations.points[*t], limb))))
}

/// The trunk offsets of the recording itself, their uncertainty averaged over the three axes; none when no frame shows
/// the trunk's axes.
fn measured_trunk_offsets(
    observations: &Observations,
    frames: &[usize],
    skeleton: &Skeleton,
    stretch_s: f64,
) -> Vec<TrunkOffset> {
    let of_limb = |limb: Limb| {
        let variance_of_axis = |axis: usize| {
            let in_trunk =
                |t: &usize| Some((seconds(observations, *t), offset_in_trunk(&observations.points[*t], limb)?[axis]));
            let samples: Vec<(f64, f64)> = frames.iter().filter_map(in_trunk).collect();
            standard_error(&samples, stretch_s).powi(2)
        };
        let standard_error = ((0..3).map(variance_of_axis).sum::<f64>() / 3.0).sqrt();
        TrunkOffset {
            joint: limb.joints()[0].0.name().to_owned(),
            position_m: skeleton.offsets[limb.index()].into(),
            uncertainty_m: with_slow_offset(standard_error),
        }
    };
    let offsets = Limb::ALL.map(of_limb);
    if offsets.iter().all(|offset| offset.uncertainty_m.is_finite()) { offsets.into() } else { Vec::new() }
}

/// The frames in which a limb is straightest, in no particular order.
fn straighter_frames(observations: &Observations, frames: &[usize], limb: Limb) -> Vec<usize> {
    let flexion = |t: &usize| {
        let at = |level| &observations.points[*t][point_index(limb, level)];
        flexion_of_three_points(at(0), at(1), at(2))
    };
    let mut ordered: Vec<(f64, usize)> = frames.iter().map(|t| (flexion(t), *t)).collect();
    ordered.sort_by(|a, b| a.0.total_cmp(&b.0));
    let kept = (ordered.len() as f64 * STRAIGHTER_SHARE).ceil() as usize;
    ordered.into_iter().take(kept).map(|(_, t)| t).collect()
}

fn check_plausible(segments: &[MeasuredSegment]) -> Result<(), PipelineError> {
    let is_odd = |s: &&MeasuredSegment| !s.length_m.is_nan() && !PLAUSIBLE_SEGMENT_M.contains(&s.length_m);
    let Some(odd) = segments.iter().find(is_odd) else { return Ok(()) };
    let name = segment_names()[odd.segment].clone();
    let sentence = format!(
        "{} measures {:.3} m, which no human one does; positions must be in metres and joints named as in the \
         recording format",
        name, odd.length_m
    );
    Err(PipelineError::Unsuitable { code: "implausible_body", place: Some(name), sentence })
}

/// Knees and elbows that are clearly bent (30°) must bend the human way in most frames.
fn check_handedness(observations: &Observations) -> Result<(), PipelineError> {
    const BENT_RAD: f64 = 0.52;
    const MIN_VOTES: i64 = 10;
    let (mut right_way, mut wrong_way) = (0_i64, 0_i64);
    for points in &observations.points {
        let Some(axes) = trunk_axes(points) else { continue };
        for limb in [Limb::LeftLeg, Limb::RightLeg] {
            let at = |level| points[point_index(limb, level)];
            let (thigh, shank) = (at(1) - at(0), at(2) - at(1));
            let bend = thigh.angle(&shank);
            if bend.is_nan() || bend < BENT_RAD {
                continue;
            }
            // The knee lies in front of the line from hip to foot, whatever the leg does.
            let line = at(2) - at(0);
            let aside = thigh - line * (thigh.dot(&line) / line.norm_squared().max(1e-9));
            let forward = (axes.inverse() * aside).normalize().x;
            if forward > 0.3 {
                right_way += 1;
            } else if forward < -0.3 {
                wrong_way += 1;
            }
        }
    }
    // A real recording has a few frames of legs confused by occlusion; a mirrored one has hardly any right way round.
    if wrong_way >= MIN_VOTES && wrong_way > 4 * right_way {
        let sentence = format!(
            "the knees bend backwards in {wrong_way} of {} bent-leg observations: the declared handedness of the \
             coordinates is wrong, or left and right joints are exchanged",
            wrong_way + right_way
        );
        return Err(PipelineError::Unsuitable {
            code: "handedness_mismatch",
            place: Some("coordinates.handedness".into()),
            sentence,
        });
    }
    Ok(())
}

/// Median of numbers, which are reordered; 0 of none.
fn median(values: &mut [f64]) -> f64 {
    if values.is_empty() {
        return 0.0;
    }
    let middle = values.len() / 2;
    *values.select_nth_unstable_by(middle, f64::total_cmp).1
}

/// Median position of each point over frames.
fn median_points(observations: &Observations, frames: &[usize]) -> [Vector3<f64>; POINT_COUNT] {
    std::array::from_fn(|p| median_vector(frames.iter().map(|t| observations.points[*t][p])))
}

fn median_vector(vectors: impl Iterator<Item = Vector3<f64>>) -> Vector3<f64> {
    let mut columns = [Vec::new(), Vec::new(), Vec::new()];
    for vector in vectors {
        for (column, value) in columns.iter_mut().zip(vector.iter()) {
            column.push(*value);
        }
    }
    let [mut x, mut y, mut z] = columns;
    Vector3::new(median(&mut x), median(&mut y), median(&mut z))
}
