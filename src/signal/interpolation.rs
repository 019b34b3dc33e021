//! Values between samples.

/// Nanoseconds in a second.
pub const NS_PER_S: f64 = 1e9;

/// Value at `at_ns` on the straight line between the two samples around it; NaN outside the series and beside a
/// missing value.
///
/// `time_ns` is strictly increasing and as long as `values`.
pub fn interpolate(time_ns: &[i64], values: &[f64], at_ns: i64) -> f64 {
    let after = time_ns.partition_point(|&time| time < at_ns);
    if after < time_ns.len() && time_ns[after] == at_ns {
        return values[after];
    }
    if after == 0 || after == time_ns.len() {
        return f64::NAN;
    }
    let (t0, t1) = (time_ns[after - 1], time_ns[after]);
    let fraction = (at_ns - t0) as f64 / (t1 - t0) as f64;
    values[after - 1] + fraction * (values[after] - values[after - 1])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn values_are_exact_on_samples_linear_between_and_missing_outside() {
        let (time, values) = ([0, 10, 30], [1.0, 2.0, 4.0]);
        assert_eq!(interpolate(&time, &values, 10), 2.0);
        assert_eq!(interpolate(&time, &values, 15), 2.5);
        assert!(interpolate(&time, &values, -1).is_nan() && interpolate(&time, &values, 31).is_nan());
        assert!(interpolate(&[], &[], 0).is_nan());
    }

    #[test]
    fn a_gap_stays_a_gap() {
        let (time, values) = ([0, 10, 20], [1.0, f64::NAN, 3.0]);
        assert!(interpolate(&time, &values, 15).is_nan());
        assert_eq!(interpolate(&time, &values, 20), 3.0);
    }
}
