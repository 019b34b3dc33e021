//! Every channel with its interval and flags, as comma separated values.

use super::{Export, Samples};
use std::fmt::Write;
use std::ops::Range;

/// One row for each sample: `time_s`, then of each channel its value, the ends of its 95 % interval (names with `_low` and
/// `_high`) and its flag bits (`_flags`). A number that there is none of stays empty.
pub fn csv(samples: Samples) -> Export {
    let mut head = String::from("time_s");
    for series in &samples.series {
        let name = &series.channel;
        let _ = write!(head, ",{name},{name}_low,{name}_high,{name}_flags");
    }
    head.push('\n');
    Export::new(head, samples.time_ns.len(), move |range| rows(&samples, range))
}

fn rows(samples: &Samples, range: Range<usize>) -> String {
    let mut text = String::with_capacity(range.len() * samples.series.len() * 28);
    for i in range {
        let _ = write!(text, "{}", samples.time_ns[i] as f64 * 1e-9);
        for series in &samples.series {
            for column in [&series.value, &series.low, &series.high] {
                text.push(',');
                if let Some(value) = column.get(i).filter(|value| value.is_finite()) {
                    let _ = write!(text, "{value}");
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
        let samples = Samples { time_ns: vec![0, 33_333_333], series: vec![series] };
        let text: String = csv(samples).pieces().collect();
        let rows: Vec<&str> = text.lines().collect();
        assert_eq!(rows[0].split(',').count(), 5);
        assert_eq!((rows[1], rows[2]), ("0,12.5,,,0", "0.033333333,,,,3"));
    }
}
