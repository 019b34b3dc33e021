//! The recording's own measurement of the body together with what else is known of it.

use super::body_knowledge::{BodyKnowledge, Estimate, Source, segment_names};
use super::calibration::MeasuredSegment;
use crate::assessment::Warning;
use crate::assessment::quality::{SegmentLength, TrunkOffset};
use crate::body::{Limb, Skeleton};
use nalgebra::Vector3;

/// Difference of the left from the right length, as a share of the longer, above which a warning says so. It judges the
/// measurement, not the person. Our provisional choice.
const ASYMMETRY_SHARE: f64 = 0.10;

/// Farthest that a shoulder or hip may lie from where the patient's other recording has it, metres. Farther ones are of
/// another sensor, which puts the torso joint elsewhere. Our provisional choice: two slow offsets.
const SAME_TRUNK_M: f64 = 0.05;

/// The lengths that are used.
pub(super) struct Fused {
    /// Lengths, in order.
    pub(super) segments: Vec<SegmentLength>,
    /// Knowledge that took part in any of them.
    pub(super) sources: Vec<Source>,
}

/// Fuses each segment. Without knowledge the measured length stays as it is, to the last bit.
///
/// A patient's earlier length that contradicts the recording is left out; a given length is used all the same; both are told.
pub(super) fn fuse(
    measured: &[MeasuredSegment],
    own: &[Option<Estimate>],
    knowledge: &BodyKnowledge<'_>,
    warnings: &mut Vec<Warning>,
) -> Fused {
    let (mut segments, mut sources) = (Vec::with_capacity(measured.len()), Vec::new());
    let (mut contradictions, mut unseen) = (Vec::new(), Vec::new());
    for ((measured, own), name) in measured.iter().zip(own).zip(segment_names()) {
        let mut used = *own;
        for (source, known) in knowledge.of_segment(measured.segment, measured.is_poor) {
            if let Some(own) = own.filter(|own| own.contradicts(known)) {
                let (known, own) = (known.length_m, own.length_m);
                contradictions.push(format!("{name} {own:.3} m, by {} {known:.3} m", source.name()));
                if source == Source::Patient {
                    continue;
                }
            }
            used = Some(used.map_or(known, |used| used.fused(known)));
            sources.push(source);
        }
        if own.is_none() {
            unseen.push(name.clone());
        }
        // Calibration has refused segments of which nothing is known.
        let used = used.unwrap_or(Estimate { length_m: measured.length_m, sd_m: f64::INFINITY });
        segments.push(SegmentLength {
            segment: name,
            length_m: used.length_m,
            uncertainty_m: Some(used.sd_m),
            spread_m: own.map(|_| measured.spread_m),
            measured_m: own.map(|own| own.length_m),
            measured_uncertainty_m: own.map(|own| own.sd_m),
        });
    }
    sources.sort_unstable();
    sources.dedup();
    warn(&contradictions, &unseen, measured, knowledge, &sources, warnings);
    Fused { segments, sources }
}

fn warn(
    contradictions: &[String],
    unseen: &[String],
    measured: &[MeasuredSegment],
    knowledge: &BodyKnowledge<'_>,
    sources: &[Source],
    warnings: &mut Vec<Warning>,
) {
    if knowledge.lacks_patient {
        warnings.push(Warning::new(
            "no_patient_calibration",
            "the patient's calibration was asked for, but no other recording of this patient has an assessment with one; \
             segment lengths are this recording's own",
        ));
    }
    if !unseen.is_empty() {
        let sentence = format!(
            "these segments were hardly ever seen from end to end, and their lengths are not measured but known by {}: \
             {}; angles of a limb that was not seen mean nothing",
            names(sources),
            unseen.join(", ")
        );
        warnings.push(Warning::new("segments_not_measured", sentence));
    } else if sources.contains(&Source::Stature) {
        let n_frames = measured.iter().map(|segment| segment.frames.len()).min().unwrap_or(0);
        let sentence = format!(
            "some segment is measured in {n_frames} frames only; the average proportions of a person of this stature \
             are taken into account"
        );
        warnings.push(Warning::new("stature_used", sentence));
    }
    if !contradictions.is_empty() {
        let sentence = format!(
            "this recording's own measurement of the body and what is known of it differ by more than chance allows: {}; \
             check the subject, the lengths given and the sensor",
            contradictions.join("; ")
        );
        warnings.push(Warning::new("body_contradicted", sentence));
    }
}

fn names(sources: &[Source]) -> String {
    sources.iter().map(|source| source.name()).collect::<Vec<_>>().join(", ")
}

/// Fuses shoulders and hips with those of the patient's other recording, unless any of them lies elsewhere.
pub(super) fn fuse_trunk_offsets(skeleton: &mut Skeleton, own: &[TrunkOffset], knowledge: &BodyKnowledge<'_>) {
    let Some(known) = knowledge.trunk_offsets() else { return };
    let distance =
        |(a, b): (&TrunkOffset, &TrunkOffset)| (Vector3::from(a.position_m) - Vector3::from(b.position_m)).norm();
    if !own.iter().zip(known).all(|pair| distance(pair) <= SAME_TRUNK_M) {
        return;
    }
    for (offset, (own, known)) in skeleton.offsets.iter_mut().zip(own.iter().zip(known)) {
        let (a, b) = (own.uncertainty_m.powi(-2), known.uncertainty_m.powi(-2));
        *offset = (Vector3::from(own.position_m) * a + Vector3::from(known.position_m) * b) / (a + b);
    }
}

/// Root mean square of the standard deviations of what was measured, metres.
pub(super) fn root_mean_square(own: &[Option<Estimate>]) -> Option<f64> {
    let squares: Vec<f64> = own.iter().flatten().map(|estimate| estimate.sd_m.powi(2)).collect();
    (squares.len() == own.len()).then(|| (squares.iter().sum::<f64>() / squares.len() as f64).sqrt())
}

/// Tells of segments whose left and right length differ by more than a body's do, and by more than two standard deviations
/// of the difference, which is 71 mm by the slow offset alone: the sensor's usual error is no news.
pub(super) fn warn_of_asymmetry(segments: &[SegmentLength], warnings: &mut Vec<Warning>) {
    let mut odd = Vec::new();
    for (left, right) in [(Limb::LeftArm, Limb::RightArm), (Limb::LeftLeg, Limb::RightLeg)] {
        for level in 0..2 {
            let (left, right) = (&segments[2 * left.index() + level], &segments[2 * right.index() + level]);
            let difference = (left.length_m - right.length_m).abs();
            let sd = left.uncertainty_m.unwrap_or(0.0).hypot(right.uncertainty_m.unwrap_or(0.0));
            if difference > ASYMMETRY_SHARE * left.length_m.max(right.length_m) && difference > 2.0 * sd {
                let side = |segment: &SegmentLength| format!("{} {:.3} m", segment.segment, segment.length_m);
                odd.push(format!("{} and {}", side(left), side(right)));
            }
        }
    }
    if !odd.is_empty() {
        let sentence = format!(
            "left and right differ by more than {:.0} %: {}; unless the subject's limbs do, the sensor misplaces a joint, \
             and angles of that limb carry a constant error",
            100.0 * ASYMMETRY_SHARE,
            odd.join("; ")
        );
        warnings.push(Warning::new("asymmetric_segments", sentence));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn segments(left_thigh_m: f64, sd_m: f64) -> Vec<SegmentLength> {
        let of = |(i, segment): (usize, String)| SegmentLength {
            segment,
            length_m: if i == 4 { left_thigh_m } else { 0.40 },
            uncertainty_m: Some(sd_m),
            spread_m: None,
            measured_m: None,
            measured_uncertainty_m: None,
        };
        segment_names().into_iter().enumerate().map(of).collect()
    }

    #[test]
    fn sides_that_differ_beyond_share_and_uncertainty_are_told_with_both_numbers() {
        let told = |left_thigh_m, sd_m| {
            let mut warnings = Vec::new();
            warn_of_asymmetry(&segments(left_thigh_m, sd_m), &mut warnings);
            warnings.pop().map(|warning| warning.message)
        };
        // A tenth of 0.45 m is 45 mm, two standard deviations of the difference are 28 mm at 10 mm and 57 mm at 20 mm.
        let message = told(0.45, 0.01).unwrap();
        assert!(message.contains("left_thigh 0.450 m and right_thigh 0.400 m"), "{message}");
        assert_eq!(told(0.45, 0.02), None);
        assert_eq!(told(0.44, 0.001), None);
    }
}
