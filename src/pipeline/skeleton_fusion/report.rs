//! What is said of a fusion beside its series: quality block and warnings.

use super::clocks::ClockedUnit;
use super::motion::UnitMotion;
use super::series::Grid;
use super::setup::Setup;
use crate::assessment::{FusionQuality, UnitQuality, Warning};
use crate::geometry::attitude::attitude_from_rotation;
use crate::pipeline::skeleton_fusion::alignment::MountingFound;
use crate::recording::Segment;
use std::f64::consts::PI;

/// Angle between a mounting and the scheme, radians (30°), from which on it is told: a strap slips by 10°.
const OFF_SCHEME_TOLD: f64 = 30.0 * PI / 180.0;
/// Standard deviation of a mounting, radians (8°), from which on its angles have a doubtful zero.
const UNSURE_MOUNTING: f64 = 8.0 * PI / 180.0;
/// Root mean square angle between camera and unit, radians (25°), from which on they do not see the same bone.
const DISAGREEMENT_TOLD: f64 = 25.0 * PI / 180.0;

/// The quality block of a fusion.
pub fn fusion_quality(
    units: &[ClockedUnit<'_>],
    setup: &Setup,
    grid: &Grid,
    motions: &[UnitMotion],
    has_camera: bool,
    start_ns: i64,
) -> FusionQuality {
    let seconds = |time_ns: i64| (time_ns - start_ns) as f64 * 1e-9;
    let span = |[first, last]: [i64; 2]| [seconds(first), seconds(last)];
    let alignment = &setup.alignment;
    let qualities = motions.iter().enumerate().map(|(u, motion)| {
        let found = &alignment.units[u];
        let drift = |course: &super::alignment::HeadingCourse| {
            course.values.last().zip(course.values.first()).map_or(0.0, |(last, first)| last - first)
        };
        let covered = (0..grid.len).filter(|i| motion.at(grid.time_ns(*i)).is_some()).count();
        UnitQuality {
            segment: Segment::of_bone(motion.bone),
            clock: units[u].quality.clone(),
            mounting: match found.mounting {
                MountingFound::Scheme => "scheme".to_owned(),
                MountingFound::Movement => "movement".to_owned(),
            },
            off_scheme_deg: off_scheme(found).to_degrees(),
            mounting_sd_deg: alignment.mounting_sd(u).map(f64::to_degrees).into(),
            heading_sd_deg: alignment.heading_sd(u).to_degrees(),
            heading_drift_deg: found
                .headings
                .iter()
                .map(drift)
                .fold(0.0, |a: f64, b: f64| if b.abs() > a.abs() { b } else { a })
                .to_degrees(),
            coverage: covered as f64 / grid.len.max(1) as f64,
            disagreement_deg: setup.disagreement(u).map(f64::to_degrees),
        }
    });
    FusionQuality {
        units: qualities.collect(),
        worn_from_s: seconds(grid.time_ns(0)),
        plank_s: setup.plank.as_ref().map(|plank| span(plank.span_ns)),
        standing_s: setup.standing_ns().map(span),
        reference_frame_s: None,
        camera_tilt_deg: has_camera.then(|| alignment.tilt.angle().to_degrees()),
        rate_hz: grid.rate_hz(),
    }
}

fn off_scheme(unit: &super::alignment::UnitAlignment) -> f64 {
    attitude_from_rotation(&(unit.bone.scheme_from_imu() * unit.imu_from_bone)).norm()
}

/// What the reader should know of mounting, plank and standing.
pub fn warnings(setup: &Setup) -> Vec<Warning> {
    let mut warnings = Vec::new();
    for (u, unit) in setup.alignment.units.iter().enumerate() {
        let segment = Segment::of_bone(unit.bone);
        let off = off_scheme(unit);
        if off > OFF_SCHEME_TOLD {
            let turned = if off > 0.75 * PI { ": it may be upside down, or on another segment" } else { "" };
            warnings.push(Warning::new(
                "mounting_differs",
                format!(
                    "the unit on {segment} sits {:.0} degrees away from the mounting scheme{turned}; its mounting was \
                     taken from the movement",
                    off.to_degrees()
                ),
            ));
        }
        let unsure = setup.alignment.mounting_sd(u).amax();
        if !unit.is_determined {
            warnings.push(Warning::new(
                "mounting_not_determined",
                format!(
                    "nothing shows how the unit on {segment} is turned about it, so it was left out; mount it by the scheme, or \
                     let the person bend that limb in view of the camera"
                ),
            ));
        } else if unsure > UNSURE_MOUNTING {
            warnings.push(Warning::new(
                "mounting_uncertain",
                format!(
                    "how the unit on {segment} sits is known to {:.0} degrees only, which its joints' angles carry as a \
                     constant offset; let the person stand still for two seconds and bend each joint a few times",
                    unsure.to_degrees()
                ),
            ));
        }
        if let Some(angle) = setup.disagreement(u).filter(|angle| *angle > DISAGREEMENT_TOLD) {
            warnings.push(Warning::new(
                "unit_contradicts_camera",
                format!(
                    "camera and unit disagree about the direction of {segment} by {:.0} degrees; the unit may be loose, on \
                     another segment, or the camera may not have seen it",
                    angle.to_degrees()
                ),
            ));
        }
    }
    if setup.plank.is_none() {
        warnings.push(Warning::new(
            "no_plank",
            "the units never lay at rest side by side: their headings come from gravity and movement",
        ));
    }
    if setup.standing_ns().is_none() {
        warnings.push(Warning::new(
            "no_standing",
            "nobody stands still for a second: the zero of knees and elbows comes from the camera and the mounting alone",
        ));
    }
    warnings
}
