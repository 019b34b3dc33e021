//! Every channel with its interval and flags, as comma separated values.

use super::Samples;
use std::fmt::Write;

/// One row for each sample: `time_s`, then of each channel its value, the ends of its 95 % interval (names with `_low` and
/// `_high`) and its flag bits (`_flags`). A number that there is none of stays empty.
pub fn csv(samples: &Samples<'_>) -> String {
    let mut text = String::with_capacity(samples.time_ns.len() * samples.series.len() * 28);
    text.push_str("time_s");
    for series in samples.series {
        let name = &series.channel;
        let _ = write!(text, ",{name},{name}_low,{name}_high,{name}_flags");
    }
    text.push('\n');
    for (i, time_ns) in samples.time_ns.iter().enumerate() {
        let _ = write!(text, "{:.6}", *time_ns as f64 * 1e-9);
        for series in samples.series {
            for column in [&series.value, &series.low, &series.high] {
                match column.get(i).filter(|value| value.is_finite()) {
                    Some(value) => {
                        let _ = write!(text, ",{value}");
                    }
                    None => text.push(','),
                }
            }
            let _ = write!(text, ",{}", series.flags.get(i).copied().unwrap_or_default());
        }
        text.push('\n');
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::assessment::Series;

    #[test]
    fn a_missing_number_stays_empty() {
        let mut series = Series::empty("left_knee_flexion_deg", 2);
        series.value[0] = 12.5;
        series.flags[1] = 3;
        let samples = Samples { time_ns: &[0, 33_333_333], series: &[series] };
        let text = csv(&samples);
        let rows: Vec<&str> = text.lines().collect();
        assert_eq!(rows[0].split(',').count(), 5);
        assert_eq!((rows[1], rows[2]), ("0.000000,12.5,,,0", "0.033333,,,,3"));
    }
}
