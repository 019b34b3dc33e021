//! Samples to text. An assessment of ten minutes has a million numbers, so they go straight into one buffer.

use super::flag_names;
use super::number::{Decimals, end_list, list, number, small_integer, time};
use crate::assessment::Series;
use crate::storage::{SeriesSlice, StoredAssessment};

/// Bytes that an angle needs at most: sign, three digits, point, decimals, comma.
const BYTES_PER_NUMBER: usize = 9;

/// The document that `SeriesResponse` describes.
pub(super) fn json(assessment: &StoredAssessment, slice: &SeriesSlice) -> Vec<u8> {
    let mut out = Vec::with_capacity(capacity(slice));
    let head = serde_json::json!({
        "assessment_id": assessment.id,
        "recording_sha256": assessment.provenance.recording_sha256,
        "n_in_range": slice.n_in_range,
        "flag_names": flag_names(),
    });
    out.extend_from_slice(head.to_string().trim_end_matches('}').as_bytes());
    out.extend_from_slice(b",\"time_s\":");
    array(&mut out, &slice.time_ns, |out, ns| time(out, *ns));
    out.extend_from_slice(b",\"channels\":[");
    for (i, series) in slice.series.iter().enumerate() {
        if i > 0 {
            out.push(b',');
        }
        channel(&mut out, series, slice.time_ns.len());
    }
    out.extend_from_slice(b"]}");
    out
}

fn channel(out: &mut Vec<u8>, series: &Series, n: usize) {
    let decimals = decimals(&series.channel);
    out.extend_from_slice(b"{\"channel\":");
    out.extend_from_slice(serde_json::Value::from(series.channel.as_str()).to_string().as_bytes());
    for (name, numbers) in [("value", &series.value), ("low", &series.low), ("high", &series.high)] {
        // A part that was not asked for is empty; so is every part when there are no samples.
        if numbers.len() == n {
            out.extend_from_slice(b",\"");
            out.extend_from_slice(name.as_bytes());
            out.extend_from_slice(b"\":");
            list(out, numbers, decimals);
        }
    }
    if series.flags.len() == n {
        out.extend_from_slice(b",\"flags\":");
        array(out, &series.flags, |out, flags| small_integer(out, *flags));
    }
    out.push(b'}');
}

/// One header line, then one row per sample.
pub(super) fn csv(slice: &SeriesSlice) -> Vec<u8> {
    let n = slice.time_ns.len();
    let mut out = Vec::with_capacity(capacity(slice));
    out.extend_from_slice(b"time_s");
    for series in &slice.series {
        let parts = [("", series.value.len()), ("_low", series.low.len()), ("_high", series.high.len())];
        for (suffix, _) in parts.into_iter().chain([("_flags", series.flags.len())]).filter(|(_, len)| *len == n) {
            out.push(b',');
            out.extend_from_slice(series.channel.as_bytes());
            out.extend_from_slice(suffix.as_bytes());
        }
    }
    out.extend_from_slice(b"\r\n");
    let decimals: Vec<Decimals> = slice.series.iter().map(|series| decimals(&series.channel)).collect();
    for (t, ns) in slice.time_ns.iter().enumerate() {
        time(&mut out, *ns);
        for (series, decimals) in slice.series.iter().zip(&decimals) {
            for numbers in [&series.value, &series.low, &series.high] {
                if let Some(v) = numbers.get(t) {
                    out.push(b',');
                    number(&mut out, *v, *decimals);
                }
            }
            if let Some(flags) = series.flags.get(t) {
                out.push(b',');
                small_integer(&mut out, *flags);
            }
        }
        out.extend_from_slice(b"\r\n");
    }
    out
}

/// Bytes that the samples need, about; too few only cost a copy.
fn capacity(slice: &SeriesSlice) -> usize {
    let n = slice.time_ns.len();
    let parts = |series: &Series| series.value.len() + series.low.len() + series.high.len();
    let numbers: usize = slice.series.iter().map(parts).sum();
    4096 + (n + numbers) * BYTES_PER_NUMBER + 3 * n * slice.series.len()
}

fn decimals(channel: &str) -> Decimals {
    if channel.ends_with("_deg") { Decimals::Three } else { Decimals::Six }
}

fn array<T>(out: &mut Vec<u8>, items: &[T], mut item: impl FnMut(&mut Vec<u8>, &T)) {
    out.push(b'[');
    for value in items {
        item(out, value);
        out.push(b',');
    }
    end_list(out);
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_missing_number_is_an_empty_cell() {
        let mut series = Series::empty("left_knee_flexion_deg", 2);
        series.value = vec![1.5, f32::NAN];
        let slice = SeriesSlice { time_ns: vec![0, 1_000_000], series: vec![series], n_in_range: 2 };
        let name = "left_knee_flexion_deg";
        let expected = format!("time_s,{name},{name}_low,{name}_high,{name}_flags\r\n0,1.5,,,0\r\n0.001,,,,0\r\n");
        assert_eq!(String::from_utf8(csv(&slice)).unwrap(), expected);
    }
}
