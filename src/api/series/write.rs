//! Samples to text. An assessment of ten minutes has a million numbers, so they go straight into one buffer.

use super::flag_names;
use crate::assessment::Series;
use crate::storage::{SeriesSlice, StoredAssessment};
use std::io::Write;

/// Decimals of an angle in degrees: a thousandth is far below what any sensor resolves.
const DECIMALS_DEG: u32 = 3;
/// Decimals of every other unit.
const DECIMALS: u32 = 6;
/// Bytes that a number needs at most in the usual case: sign, three digits, point, decimals, comma.
const BYTES_PER_NUMBER: usize = 10;

/// The document that `SeriesResponse` describes.
pub(super) fn json(assessment: &StoredAssessment, slice: &SeriesSlice) -> Vec<u8> {
    let mut out = Vec::with_capacity(1024 + slice.time_ns.len() * (1 + 3 * slice.series.len()) * BYTES_PER_NUMBER);
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
            array(out, numbers, |out, v| {
                if !number(out, *v, decimals) {
                    out.extend_from_slice(b"null");
                }
            });
        }
    }
    if series.flags.len() == n {
        out.extend_from_slice(b",\"flags\":");
        array(out, &series.flags, |out, flags| integer(out, u64::from(*flags)));
    }
    out.push(b'}');
}

/// One header line, then one row per sample.
pub(super) fn csv(slice: &SeriesSlice) -> Vec<u8> {
    let n = slice.time_ns.len();
    let mut out = Vec::with_capacity(1024 + n * (1 + 3 * slice.series.len()) * BYTES_PER_NUMBER);
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
    let decimals: Vec<u32> = slice.series.iter().map(|series| decimals(&series.channel)).collect();
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
                integer(&mut out, u64::from(*flags));
            }
        }
        out.extend_from_slice(b"\r\n");
    }
    out
}

fn decimals(channel: &str) -> u32 {
    if channel.ends_with("_deg") { DECIMALS_DEG } else { DECIMALS }
}

fn array<T>(out: &mut Vec<u8>, items: &[T], mut item: impl FnMut(&mut Vec<u8>, &T)) {
    out.push(b'[');
    for (i, value) in items.iter().enumerate() {
        if i > 0 {
            out.push(b',');
        }
        item(out, value);
    }
    out.push(b']');
}

/// Nanoseconds as seconds, to the microsecond.
fn time(out: &mut Vec<u8>, ns: i64) {
    // Half away from zero, in integers: no clock of a recording loses its microseconds to a float.
    let micros = (ns.unsigned_abs() + 500) / 1000;
    if ns < 0 && micros > 0 {
        out.push(b'-');
    }
    fixed(out, micros, 6);
}

/// Writes a finite number and says so; writes nothing for any other.
fn number(out: &mut Vec<u8>, value: f32, decimals: u32) -> bool {
    // Beyond this a scaled number would leave the 53 bits of an exact integer; no measure comes near.
    const LARGEST_FIXED: f32 = 1e9;
    if !value.is_finite() {
        return false;
    }
    if value.abs() > LARGEST_FIXED {
        // Writing into memory does not fail.
        let _ = write!(out, "{value}");
        return true;
    }
    let scaled = (f64::from(value) * f64::from(10u32.pow(decimals))).round();
    if scaled < 0.0 {
        out.push(b'-');
    }
    fixed(out, scaled.abs() as u64, decimals);
    true
}

/// `scaled / 10^decimals` without trailing zeros.
fn fixed(out: &mut Vec<u8>, scaled: u64, decimals: u32) {
    let unit = 10u64.pow(decimals);
    integer(out, scaled / unit);
    let mut fraction = scaled % unit;
    if fraction == 0 {
        return;
    }
    let mut width = decimals as usize;
    while fraction % 10 == 0 {
        fraction /= 10;
        width -= 1;
    }
    let mut digits = [b'0'; 8];
    for digit in digits[..width].iter_mut().rev() {
        *digit = b'0' + (fraction % 10) as u8;
        fraction /= 10;
    }
    out.push(b'.');
    out.extend_from_slice(&digits[..width]);
}

fn integer(out: &mut Vec<u8>, mut value: u64) {
    // 20 digits hold every 64-bit integer.
    let mut digits = [0u8; 20];
    let mut first = digits.len();
    loop {
        first -= 1;
        digits[first] = b'0' + (value % 10) as u8;
        value /= 10;
        if value == 0 {
            break;
        }
    }
    out.extend_from_slice(&digits[first..]);
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn text(write: impl FnOnce(&mut Vec<u8>)) -> String {
        let mut out = Vec::new();
        write(&mut out);
        String::from_utf8(out).unwrap()
    }

    #[test]
    fn numbers_and_times_are_written_short_and_rounded() {
        let number = |v: f32| text(|out| assert!(number(out, v, 3)));
        assert_eq!(number(12.0), "12");
        assert_eq!(number(-0.25), "-0.25");
        assert_eq!(number(-0.0001), "0");
        assert_eq!(number(90.0996), "90.1");
        assert_eq!(number(3e38), "300000000000000000000000000000000000000");
        assert_eq!(text(|out| time(out, 33_333_333)), "0.033333");
        assert_eq!(text(|out| time(out, -1_500_000_000)), "-1.5");
        assert_eq!(text(|out| time(out, i64::MIN)), "-9223372036.854776");
    }

    #[test]
    fn a_missing_number_is_an_empty_cell() {
        let mut series = Series::empty("left_knee_flexion_deg", 2);
        series.value = vec![1.5, f32::NAN];
        let slice = SeriesSlice { time_ns: vec![0, 1_000_000], series: vec![series], n_in_range: 2 };
        let name = "left_knee_flexion_deg";
        let expected = format!("time_s,{name},{name}_low,{name}_high,{name}_flags\r\n0,1.5,,,0\r\n0.001,,,,0\r\n");
        assert_eq!(String::from_utf8(csv(&slice)).unwrap(), expected);
    }

    proptest! {
        #[test]
        fn every_finite_number_reads_back_within_half_of_the_last_decimal(value in -1e12f32..1e12) {
            let written = text(|out| assert!(number(out, value, 3)));
            let read: f64 = serde_json::from_str(&written).unwrap();
            // Above LARGEST_FIXED the shortest text of the f32 is exact to half a step of the f32.
            let tolerance = 0.000_500_1f64.max(f64::from(value.abs()) * f64::from(f32::EPSILON));
            prop_assert!((read - f64::from(value)).abs() <= tolerance, "{value} was written {written}");
        }

        #[test]
        fn every_integer_is_written_as_its_digits(value: u64) {
            prop_assert_eq!(text(|out| integer(out, value)), value.to_string());
        }
    }
}
