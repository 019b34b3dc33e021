//! From tracked legs to an assessment: series, steps, and how far they can be trusted.

use super::floor_motion::FeetFrame;
use super::leg_model::LegPoint;
use super::steps::gait;
use super::{Legs, Track, TrackedFrame, seconds};
use crate::assessment::quality::{Event, EventCount};
use crate::assessment::series::FLAG_BRIDGED;
use crate::assessment::{
    Assessment, Gait, JointTrack, LegChannel, LegPoseSettings, Provenance, Quality, Series, Settings, Warning,
};
use crate::body::Side;
use crate::pipeline::PipelineError;
use nalgebra::{Matrix3, Vector2, Vector3};

/// 97.5 % point of the normal distribution.
const NORMAL_975: f64 = 1.96;
/// What differs from body to body between a fitted point and the joint: standard deviation of hip, knee, ankle and toe,
/// metres; from simulated walks.
const BODY_SD: [f64; 4] = [0.04, 0.025, 0.015, 0.020];
/// What of it does not cancel between the ankles, along x, y and z of `floor`, metres.
const APART_BODY_SD: Vector3<f64> = Vector3::new(0.006, 0.008, 0.008);
/// Points on neither leg, as a share of the foreground, from which on something else is in sight.
const FOREIGN_SHARE: f64 = 0.35;
/// Share of pixels as in the background below which the background is of another place. A person behind a walker hides
/// less than half of the image.
const LEAST_UNCHANGED: f64 = 0.15;
/// Share of frames with both legs below which the reader is told.
const LEAST_COVERAGE: f64 = 0.8;
/// Share of pixels without depth above which the reader is told.
const MOSTLY_MISSING: f64 = 0.6;
/// Thighs and shanks of people from 1.1 to 2.2 m (Winter: 0.245 of stature), metres.
const PLAUSIBLE_LENGTH: std::ops::Range<f64> = 0.26..0.54;

/// The assessment of a tracked recording.
///
/// # Errors
/// When there are no legs in it.
pub(super) fn assessment(track: &Track, settings: &LegPoseSettings) -> Result<Assessment, PipelineError> {
    if track.frames.iter().all(|frame| frame.legs.is_none()) {
        return Err(PipelineError::unsuitable(
            "no_legs",
            "in no frame two legs were found; the camera must see the user's lower legs and feet, between 0.3 and 1.9 m away, \
             and nothing may cover it",
        ));
    }
    let series = series(track);
    let gait = gait(&feet(track));
    let time_ns: Vec<i64> = track.frames.iter().map(|frame| frame.time_ns).collect();
    Ok(Assessment {
        pipeline: "leg_pose",
        // The camera's y points down and its z away.
        joints: JointTrack::of_series(&time_ns, &series, [1.0, -1.0, -1.0]),
        time_ns,
        summary: series.iter().map(Series::summarize).collect(),
        series,
        quality: quality(track, &gait),
        gait: Some(gait),
        performance: None,
        provenance: Provenance {
            software_version: env!("CARGO_PKG_VERSION").to_owned(),
            pipeline: "leg_pose".to_owned(),
            method: settings.mode.name().to_owned(),
            settings: Settings::LegPose(settings.clone()),
            seed: settings.seed,
            ..Provenance::default()
        },
    })
}

/// The feet of the frames with legs, for the steps.
fn feet(track: &Track) -> Vec<FeetFrame> {
    let along_floor = |v: &Vector3<f64>| Vector2::new(v.x, v.z);
    track
        .frames
        .iter()
        .filter_map(|frame| Some((frame.time_ns, frame.legs.as_ref()?)))
        .map(|(time_ns, legs)| {
            let ankles = Side::BOTH.map(|side| LegPoint::Ankle.index(side));
            FeetFrame {
                time: seconds(time_ns),
                ankle: ankles.map(|k| along_floor(&legs.points[k])),
                ankle_sd: ankles.map(|k| along_floor(&legs.deviations[k])),
                velocity: ankles.map(|k| along_floor(&legs.velocities[k])),
                height: ankles.map(|k| legs.points[k].y),
                seen: Side::BOTH.iter().all(|side| legs.is_seen(*side)),
            }
        })
        .collect()
}

fn series(track: &Track) -> Vec<Series> {
    let sensor_from_floor = track.floor.floor_from_sensor.inverse();
    let turn = sensor_from_floor.matrix();
    // Only variances are kept: their axes are turned as if the errors along them were independent.
    let squares: Matrix3<f64> = turn.component_mul(turn);
    LegChannel::all()
        .into_iter()
        .map(|channel| {
            let mut series = Series::empty(channel.name(), track.frames.len());
            for (t, frame) in track.frames.iter().enumerate() {
                let Some(legs) = &frame.legs else { continue };
                let Some((value, sd, is_seen)) = value(channel, legs, track, &squares) else { continue };
                series.value[t] = value as f32;
                series.low[t] = (value - NORMAL_975 * sd) as f32;
                series.high[t] = (value + NORMAL_975 * sd) as f32;
                series.flags[t] = if is_seen { 0 } else { FLAG_BRIDGED };
            }
            series
        })
        .collect()
}

/// Value, standard deviation, and whether it was seen; none of a leg that is lost.
fn value(channel: LegChannel, legs: &Legs, track: &Track, squares: &Matrix3<f64>) -> Option<(f64, f64, bool)> {
    let of_point = |side: Side, point: LegPoint, axis: usize| {
        if legs.lost[side as usize] {
            return None;
        }
        let k = point.index(side);
        let in_sensor = track.floor.sensor_from_point(&legs.points[k]);
        let variance = squares * legs.deviations[k].map(|sd| sd * sd);
        Some((in_sensor[axis], variance[axis].sqrt().hypot(BODY_SD[point as usize]), legs.is_seen(side)))
    };
    let apart = |axis: usize, in_sensor: bool| {
        if legs.lost != [false; 2] {
            return None;
        }
        let [left, right] = Side::BOTH.map(|side| LegPoint::Ankle.index(side));
        let mut between = legs.points[left] - legs.points[right];
        let mut variance = legs.deviations[left].map(|s| s * s) + legs.deviations[right].map(|s| s * s);
        variance += APART_BODY_SD.map(|s| s * s);
        if in_sensor {
            between = track.floor.floor_from_sensor.inverse() * between;
            variance = squares * variance;
        }
        Some((between[axis].abs(), variance[axis].sqrt(), Side::BOTH.iter().all(|side| legs.is_seen(*side))))
    };
    match channel {
        LegChannel::Ankle(side, axis) => of_point(side, LegPoint::Ankle, axis),
        LegChannel::Knee(side, axis) => of_point(side, LegPoint::Knee, axis),
        LegChannel::Hip(side, axis) => of_point(side, LegPoint::Hip, axis),
        LegChannel::StepLengthSensor => apart(2, true),
        LegChannel::StepWidthSensor => apart(0, true),
        LegChannel::StepLengthFloor => apart(2, false),
        LegChannel::StepWidthFloor => apart(0, false),
    }
}

fn quality(track: &Track, gait: &Gait) -> Quality {
    let times: Vec<f64> = track.frames.iter().map(|frame| seconds(frame.time_ns)).collect();
    let mut intervals: Vec<f64> = times.windows(2).map(|pair| pair[1] - pair[0]).collect();
    intervals.sort_by(f64::total_cmp);
    let n_seen = track.frames.iter().filter(|frame| sees_both(frame.legs.as_ref())).count();
    let coverage = n_seen as f64 / track.frames.len().max(1) as f64;
    let lost = |side: Side| {
        let is_lost = move |frame: &TrackedFrame| frame.legs.as_ref().is_none_or(|legs| legs.lost[side as usize]);
        stretches(track, &times, LOST_LEG, &format!("{}_leg", side.name()), is_lost)
    };
    let mut events: Vec<Event> = Side::BOTH.into_iter().flat_map(lost).collect();
    events.extend(stretches(track, &times, BLOCKED_CAMERA, "camera", |frame| frame.blocked));
    let event_counts = [LOST_LEG, BLOCKED_CAMERA].map(|kind| {
        let own = events.iter().filter(|event| event.kind == kind);
        EventCount {
            kind: kind.to_owned(),
            n_events: own.clone().count() as u64,
            n_frames: own.map(|event| event.n_frames).sum(),
        }
    });
    events.sort_by(|a, b| a.start_s.total_cmp(&b.start_s));
    Quality {
        n_frames: times.len() as u64,
        duration_s: times.last().map_or(0.0, |last| last - times[0]),
        median_interval_s: intervals.get(intervals.len() / 2).copied().unwrap_or(0.0),
        longest_gap_s: intervals.last().copied().unwrap_or(0.0),
        coverage,
        effective_sample_size: track.effective_sample_size,
        warnings: warnings(track, gait, coverage),
        events,
        event_counts: event_counts.to_vec(),
        ..Quality::default()
    }
}

/// Kind of event: a leg was not tracked.
const LOST_LEG: &str = "lost_leg";
/// Kind of event: the camera saw nothing, or something filled its image.
const BLOCKED_CAMERA: &str = "blocked_camera";

fn sees_both(legs: Option<&Legs>) -> bool {
    legs.is_some_and(|legs| Side::BOTH.iter().all(|side| legs.is_seen(*side)))
}

/// Stretches of frames of which something holds.
fn stretches(
    track: &Track,
    times: &[f64],
    kind: &str,
    subject: &str,
    holds: impl Fn(&TrackedFrame) -> bool,
) -> Vec<Event> {
    let frames: Vec<usize> = (0..track.frames.len()).collect();
    frames
        .chunk_by(|a, b| holds(&track.frames[*a]) == holds(&track.frames[*b]))
        .filter(|stretch| holds(&track.frames[stretch[0]]))
        .map(|stretch| Event {
            kind: kind.to_owned(),
            subject: subject.to_owned(),
            start_s: times[stretch[0]] - times[0],
            end_s: times[stretch[stretch.len() - 1]] - times[0],
            n_frames: stretch.len() as u64,
        })
        .collect()
}

fn warnings(track: &Track, gait: &Gait, coverage: f64) -> Vec<Warning> {
    let tracked: Vec<&Legs> = track.frames.iter().filter_map(|frame| frame.legs.as_ref()).collect();
    let misfit = tracked.iter().map(|legs| legs.misfit).sum::<f64>() / tracked.len().max(1) as f64;
    let percent = |share: f64| format!("{:.0} %", 100.0 * share);
    let implausible = track.shape.is_some_and(|shape| (0..2).any(|k| !PLAUSIBLE_LENGTH.contains(&shape[k])));
    let n_blocked = track.frames.iter().filter(|frame| frame.blocked).count();
    let off_mount = off_mount(track);
    let found = [
        (
            true,
            "in_evaluation",
            "the errors of this pipeline have been measured on simulated walks only, not yet on people".to_owned(),
        ),
        (
            track.unchanged.is_none(),
            "no_background",
            "there is no image of the floor without the person: what stands still before the camera, such as the walker's \
             frame, may be taken for a leg"
                .to_owned(),
        ),
        (
            track.unchanged.is_some_and(|share| share < LEAST_UNCHANGED),
            "background_mismatch",
            format!(
                "only {} of the pixels are as in the background; it may be of another room or another mounting",
                percent(track.unchanged.unwrap_or(0.0))
            ),
        ),
        (
            misfit > FOREIGN_SHARE,
            "foreign_points",
            format!(
                "{} of what stands before the camera is on neither leg: another person, a thing, or wide clothes; steps may \
                 be wrong",
                percent(misfit)
            ),
        ),
        (
            implausible,
            "implausible_lengths",
            "the legs' lengths are beyond what people have; check the camera's intrinsics".to_owned(),
        ),
        (
            off_mount.is_some(),
            "mount_mismatch",
            off_mount.unwrap_or_default(),
        ),
        (
            n_blocked > 0,
            "blocked_camera",
            format!(
                "in {n_blocked} of {} frames the camera saw nothing or something filled its image; the legs there are not \
                 measured",
                track.frames.len()
            ),
        ),
        (
            coverage < LEAST_COVERAGE,
            "legs_often_unseen",
            format!("both lower legs are seen in {} of the frames only", percent(coverage)),
        ),
        (
            track.missing > MOSTLY_MISSING,
            "mostly_missing",
            format!("{} of all pixels have no depth", percent(track.missing)),
        ),
        (
            gait.steps.is_empty(),
            "no_steps",
            "no step was found: the person stood, or the feet were not seen".to_owned(),
        ),
        (
            !gait.steps.is_empty() && gait.n_steps_used == 0,
            "no_steps_used",
            "all steps are at the ends of walks, in turns or badly seen; record a longer walk".to_owned(),
        ),
    ];
    found.into_iter().filter(|(is, ..)| *is).map(|(_, code, sentence)| Warning::new(code, sentence)).collect()
}

/// How the floor that was found differs from what the recording says of the camera's mount, when it does.
fn off_mount(track: &Track) -> Option<String> {
    /// What a tape measure and a spirit level on a walker are good for, metres and radians.
    const HEIGHT_TOLERANCE: f64 = 0.06;
    const TILT_TOLERANCE: f64 = 5.0 * std::f64::consts::PI / 180.0;
    let (height, tilt) = (track.floor.camera_height, track.floor.tilt());
    let is_off = track.declared_mount.height.is_some_and(|said| (said - height).abs() > HEIGHT_TOLERANCE)
        || track.declared_mount.tilt.is_some_and(|said| (said - tilt).abs() > TILT_TOLERANCE);
    is_off.then(|| {
        format!(
            "the camera is said to be mounted otherwise than {height:.2} m above the floor and tilted down by {:.0} degrees, as \
             its images show; the intrinsics may be those of another camera, and lengths wrong by as much",
            tilt.to_degrees()
        )
    })
}
