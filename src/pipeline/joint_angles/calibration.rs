//! Segment lengths, trunk offsets and facing direction of the subject in one recording (\[angles\], calibration).
//!
//! The paper measures them in the first static instants. A window counts as static when the points drift by less than
//! `STILL_BELOW` in it; most real recordings have none, and are calibrated on robust averages over the whole.

use super::observation::Observations;
use crate::assessment::Warning;
use crate::assessment::quality::{CalibrationQuality, SegmentLength};
use crate::body::skeleton::point_index;
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
/// Segment lengths that a human body can have, metres; outside them the unit or the joints must be wrong.
const PLAUSIBLE_SEGMENT_M: Range<f64> = 0.05..0.90;

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

/// Calibrates, and turns the observations into `subject`.
///
/// # Errors
/// `too_few_frames` without enough frames in which the trunk and the limbs were seen; `implausible_body` when a
/// segment is longer or shorter than a human one; `handedness_mismatch` when the body bends the wrong way.
pub fn calibrate(observations: &mut Observations) -> Result<Calibration, PipelineError> {
    let whole = 0..observations.len();
    let window = stillest_window(&observations.time_ns, &observations.points, MIN_WINDOW_S, SEARCH_S)
        .filter(|window| window.drift < STILL_BELOW)
        .filter(|window| complete_frames(observations, window.frames.clone()).len() >= MIN_FRAMES)
        .filter(|window| shows_straight_legs(observations, window.frames.clone()));
    let frames = complete_frames(observations, window.as_ref().map_or(whole, |w| w.frames.clone()));
    if frames.len() < MIN_FRAMES {
        let sentence = format!(
            "only {} frames show shoulders, elbows, hands, hips, knees, feet and torso together, and {MIN_FRAMES} are \
             needed to measure the body; record with the whole body in view",
            frames.len()
        );
        return Err(PipelineError::unsuitable("too_few_frames", sentence));
    }
    observations.rotate(subject_from_world(observations, &frames));
    let (skeleton, segments) = match &window {
        Some(_) => measure_static(observations, &frames),
        None => measure_moving(observations, &frames),
    };
    check_plausible(&segments)?;
    check_handedness(observations)?;
    let mut warnings = Vec::new();
    if window.is_none() {
        warnings.push(Warning::new(
            "no_static_window",
            "nobody stands still for a second at the start: segment lengths are robust averages over the whole \
             recording, and angles may carry a constant error of a few degrees",
        ));
    }
    let seconds = |t: usize| (observations.time_ns[t] - observations.time_ns[0]) as f64 * 1e-9;
    let quality = CalibrationQuality {
        source: if window.is_some() { "static_window" } else { "whole_recording" }.to_owned(),
        window_s: window.map(|w| [seconds(w.frames.start), seconds(w.frames.end - 1)]),
        n_frames: frames.len() as u64,
        segments,
    };
    Ok(Calibration { skeleton, quality, warnings })
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

/// Lengths of the median posture of a resting subject: averaging positions first leaves no bias of noise in lengths.
fn measure_static(observations: &Observations, frames: &[usize]) -> (Skeleton, Vec<SegmentLength>) {
    let rest = median_points(observations, frames);
    let axes = trunk_axes(&rest).unwrap_or_else(Rotation3::identity);
    let offsets = Limb::ALL.map(|limb| axes.inverse() * rest[point_index(limb, 0)]);
    let (_, segments) = measure_moving(observations, frames);
    let length = |limb, level| (rest[point_index(limb, level)] - rest[point_index(limb, level - 1)]).norm();
    let skeleton =
        Skeleton { offsets, proximal: Limb::ALL.map(|l| length(l, 1)), distal: Limb::ALL.map(|l| length(l, 2)) };
    (skeleton.clone(), with_lengths(segments, &skeleton))
}

/// Share of a moving subject's frames, those in which a leg is straightest, in which its segments are measured. A sensor
/// sees a bent leg from its end and misplaces the joint behind; the straighter half shows the segments at their length.
const STRAIGHTER_SHARE: f64 = 0.5;

/// Median lengths over frames of a moving subject; those of a leg over the frames in which it is straighter.
fn measure_moving(observations: &Observations, frames: &[usize]) -> (Skeleton, Vec<SegmentLength>) {
    let lengths = |limb: Limb, level: usize| {
        let of = |t: &usize| {
            let points = &observations.points[*t];
            (points[point_index(limb, level)] - points[point_index(limb, level - 1)]).norm()
        };
        let measured = if limb.is_arm() { frames } else { &straighter_frames(observations, frames, limb)[..] };
        let mut all: Vec<f64> = measured.iter().map(of).collect();
        let median = median(&mut all);
        let mut deviations: Vec<f64> = all.iter().map(|l| (l - median).abs()).collect();
        // 1.4826 makes the median absolute deviation a standard deviation for a normal distribution.
        (median, 1.4826 * self::median(&mut deviations))
    };
    let offsets = Limb::ALL.map(|limb| {
        let in_trunk = |t: &usize| {
            let points = &observations.points[*t];
            trunk_axes(points).map(|axes| axes.inverse() * points[point_index(limb, 0)])
        };
        median_vector(frames.iter().filter_map(in_trunk))
    });
    let mut segments = Vec::with_capacity(8);
    for limb in Limb::ALL {
        for (level, segment) in limb.segment_names().into_iter().enumerate() {
            let (length_m, spread_m) = lengths(limb, level + 1);
            segments.push(SegmentLength { segment, length_m, spread_m });
        }
    }
    let length = |limb: Limb, level: usize| segments[2 * limb.index() + level].length_m;
    let skeleton =
        Skeleton { offsets, proximal: Limb::ALL.map(|l| length(l, 0)), distal: Limb::ALL.map(|l| length(l, 1)) };
    (skeleton, segments)
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

fn with_lengths(mut segments: Vec<SegmentLength>, skeleton: &Skeleton) -> Vec<SegmentLength> {
    for limb in Limb::ALL {
        segments[2 * limb.index()].length_m = skeleton.proximal[limb.index()];
        segments[2 * limb.index() + 1].length_m = skeleton.distal[limb.index()];
    }
    segments
}

fn check_plausible(segments: &[SegmentLength]) -> Result<(), PipelineError> {
    let Some(odd) = segments.iter().find(|s| !PLAUSIBLE_SEGMENT_M.contains(&s.length_m)) else { return Ok(()) };
    let sentence = format!(
        "{} measures {:.3} m, which no human one does; positions must be in metres and joints named as in the \
         recording format",
        odd.segment, odd.length_m
    );
    Err(PipelineError::Unsuitable { code: "implausible_body", place: Some(odd.segment.clone()), sentence })
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
