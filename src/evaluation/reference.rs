//! A reference at the times of an assessment.

use crate::recording::ReferenceSeries;
use crate::signal::interpolation::interpolate;

/// Longest time between two samples of a reference that is bridged, nanoseconds: the angles of quick exercises are not
/// straight lines over longer times.
const LONGEST_GAP_NS: i64 = 200_000_000;

/// Values of a reference at times on the skeleton's clock, linearly interpolated; NaN before its first and after its
/// last sample, within gaps, and beside samples without a number.
pub fn interpolated(reference: &ReferenceSeries, time_ns: &[i64]) -> Vec<f64> {
    let value_at = |time: i64| {
        let on_reference_clock = time.saturating_sub(reference.clock_offset_ns);
        let next = reference.time_ns.partition_point(|t| *t < on_reference_clock);
        let (before, after) = (reference.time_ns.get(next.wrapping_sub(1)), reference.time_ns.get(next));
        match (before, after) {
            (Some(before), Some(after)) if *after != on_reference_clock && after - before > LONGEST_GAP_NS => f64::NAN,
            _ => interpolate(&reference.time_ns, &reference.values, on_reference_clock),
        }
    };
    time_ns.iter().map(|time| value_at(*time)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn reference(clock_offset_ns: i64) -> ReferenceSeries {
        ReferenceSeries {
            channel: "left_knee_flexion_deg".into(),
            source: "test".into(),
            clock_offset_ns,
            time_ns: vec![0, 100_000_000, 200_000_000, 900_000_000],
            values: vec![10.0, 20.0, f64::NAN, 30.0],
        }
    }

    #[test]
    fn values_between_samples_lie_on_a_line_and_there_are_none_outside_or_in_gaps() {
        let found =
            interpolated(&reference(0), &[-1, 0, 50_000_000, 100_000_000, 150_000_000, 500_000_000, 900_000_001]);
        assert!(found[0].is_nan());
        assert_eq!(&found[1..4], [10.0, 15.0, 20.0]);
        assert!(found[4..].iter().all(|v| v.is_nan()));
    }

    #[test]
    fn the_clock_offset_is_added_to_the_reference_s_times() {
        assert_eq!(interpolated(&reference(1_000_000_000), &[1_050_000_000]), [15.0]);
        assert!(interpolated(&reference(1_000_000_000), &[50_000_000])[0].is_nan());
    }
}
