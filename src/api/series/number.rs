//! Numbers to text. A read of a series writes up to a million of them, so the usual ones, below a thousand, are put
//! together from two tables: the text of the whole part, and the text of three decimals.

use std::io::Write;

/// Decimals of a unit.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Decimals {
    /// For degrees: a thousandth is far below what any sensor resolves.
    Three,
    /// For every other unit.
    Six,
}

/// Up to four characters, the first in the lowest byte.
#[derive(Clone, Copy)]
struct Piece {
    text: u32,
    len: u32,
}

/// Whole numbers below a thousand.
static WHOLE: [Piece; 1000] = pieces(false);
/// Thousandths: point and three digits. `len` leaves out trailing zeros, and the point when nothing follows it.
static THOUSANDTHS: [Piece; 1000] = pieces(true);

const fn pieces(decimals: bool) -> [Piece; 1000] {
    let mut table = [Piece { text: 0, len: 0 }; 1000];
    let mut i = 0;
    while i < 1000 {
        let [a, b, c] = [b'0' + (i / 100) as u8, b'0' + (i / 10 % 10) as u8, b'0' + (i % 10) as u8];
        table[i] = match (decimals, i) {
            (true, 0) => Piece { text: u32::from_le_bytes([b'.', a, b, c]), len: 0 },
            (true, _) if i % 100 == 0 => Piece { text: u32::from_le_bytes([b'.', a, b, c]), len: 2 },
            (true, _) if i % 10 == 0 => Piece { text: u32::from_le_bytes([b'.', a, b, c]), len: 3 },
            (true, _) => Piece { text: u32::from_le_bytes([b'.', a, b, c]), len: 4 },
            (false, 0..10) => Piece { text: u32::from_le_bytes([c, 0, 0, 0]), len: 1 },
            (false, 10..100) => Piece { text: u32::from_le_bytes([b, c, 0, 0]), len: 2 },
            (false, _) => Piece { text: u32::from_le_bytes([a, b, c, 0]), len: 3 },
        };
        i += 1;
    }
    table
}

/// Appends the lowest `len` bytes of `text`; at most eight. A copy of fixed length is one instruction.
#[inline]
fn append(out: &mut Vec<u8>, text: u64, len: u32) {
    let end = out.len() + len as usize;
    out.extend_from_slice(&text.to_le_bytes());
    out.truncate(end);
}

/// Numbers that are put together before they are appended.
const BLOCK: usize = 256;

/// Appends a JSON list; what is no number is null.
pub(super) fn list(out: &mut Vec<u8>, values: &[f32], decimals: Decimals) {
    // A vector's length lives in memory and each number would wait for the one before; a local one lives in a register.
    let mut text = [0; BLOCK * 9];
    out.push(b'[');
    for block in values.chunks(BLOCK) {
        let mut end = 0;
        for value in block {
            if let Some((number, len)) = common_number(*value, decimals) {
                text[end..end + 8].copy_from_slice(&number.to_le_bytes());
                end += len as usize;
                text[end] = b',';
                end += 1;
                continue;
            }
            out.extend_from_slice(&text[..end]);
            end = 0;
            if !uncommon_number(out, *value, decimals) {
                out.extend_from_slice(b"null");
            }
            out.push(b',');
        }
        out.extend_from_slice(&text[..end]);
    }
    end_list(out);
}

/// Replaces the comma behind the last item, if there is one, by the end of the list.
pub(super) fn end_list(out: &mut Vec<u8>) {
    if out.last() == Some(&b',') {
        out.pop();
    }
    out.push(b']');
}

/// Writes a finite number and says so; writes nothing for any other.
pub(super) fn number(out: &mut Vec<u8>, value: f32, decimals: Decimals) -> bool {
    match common_number(value, decimals) {
        Some((text, len)) => {
            append(out, text, len);
            true
        }
        None => uncommon_number(out, value, decimals),
    }
}

/// Text, the first character in the lowest byte, and length of a number below a thousand with three decimals.
#[inline]
fn common_number(value: f32, decimals: Decimals) -> Option<(u64, u32)> {
    // A scaled f32 is exact in an f64, and so is half a step more: this rounds half away from zero.
    let thousandths = f64::from(value.abs()) * 1000.0 + 0.5;
    if decimals != Decimals::Three || thousandths.is_nan() || thousandths >= 1_000_000.0 {
        return None;
    }
    let thousandths = thousandths as u32;
    let whole = WHOLE[(thousandths / 1000) as usize];
    let fraction = THOUSANDTHS[(thousandths % 1000) as usize];
    // What rounds to zero has no sign.
    let sign = u32::from(value < 0.0 && thousandths > 0);
    let text = u64::from(whole.text) | (u64::from(fraction.text) << (8 * whole.len));
    let signed = (text << (8 * sign)) | (u64::from(b'-') * u64::from(sign));
    Some((signed, sign + whole.len + fraction.len))
}

fn uncommon_number(out: &mut Vec<u8>, value: f32, decimals: Decimals) -> bool {
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
    let per_unit = match decimals {
        Decimals::Three => 1e3,
        Decimals::Six => 1e6,
    };
    let scaled = (f64::from(value.abs()) * per_unit).round() as u64;
    if value < 0.0 && scaled > 0 {
        out.push(b'-');
    }
    match decimals {
        Decimals::Three => millionths(out, scaled * 1000),
        Decimals::Six => millionths(out, scaled),
    }
    true
}

/// Nanoseconds as seconds, to the microsecond.
pub(super) fn time(out: &mut Vec<u8>, ns: i64) {
    // Half away from zero, in integers: no clock of a recording loses its microseconds to a float.
    let micros = (ns.unsigned_abs() + 500) / 1000;
    if ns < 0 && micros > 0 {
        out.push(b'-');
    }
    millionths(out, micros);
}

/// `scaled / 10^6` without trailing zeros.
fn millionths(out: &mut Vec<u8>, scaled: u64) {
    integer(out, scaled / 1_000_000);
    let upper = THOUSANDTHS[(scaled / 1000 % 1000) as usize];
    let lower = THOUSANDTHS[(scaled % 1000) as usize];
    if lower.len == 0 {
        append(out, u64::from(upper.text), upper.len);
    } else {
        // The upper ones in full, then the lower ones without their point.
        append(out, u64::from(upper.text) | u64::from(lower.text >> 8) << 32, 3 + lower.len);
    }
}

/// A whole number.
fn integer(out: &mut Vec<u8>, value: u64) {
    match WHOLE.get(value as usize).filter(|_| value < 1000) {
        Some(piece) => append(out, u64::from(piece.text), piece.len),
        None => {
            integer(out, value / 1000);
            let last = THOUSANDTHS[(value % 1000) as usize];
            append(out, u64::from(last.text >> 8), 3);
        }
    }
}

/// A whole number that is below a thousand by its type.
#[inline]
pub(super) fn small_integer(out: &mut Vec<u8>, value: u8) {
    let piece = WHOLE[usize::from(value)];
    append(out, u64::from(piece.text), piece.len);
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
        let number = |v: f32| text(|out| assert!(number(out, v, Decimals::Three)));
        assert_eq!(number(12.0), "12");
        assert_eq!(number(-0.25), "-0.25");
        assert_eq!(number(-0.0001), "0");
        assert_eq!(number(90.0996), "90.1");
        assert_eq!(number(-179.987), "-179.987");
        assert_eq!(number(999.9996), "1000");
        assert_eq!(number(-123_456.79), "-123456.789");
        assert_eq!(number(3e38), "300000000000000000000000000000000000000");
        assert_eq!(text(|out| time(out, 33_333_333)), "0.033333");
        assert_eq!(text(|out| time(out, 7_000_010_000)), "7.00001");
        assert_eq!(text(|out| time(out, -1_500_000_000)), "-1.5");
        assert_eq!(text(|out| time(out, i64::MIN)), "-9223372036.854776");
        assert_eq!(text(|out| small_integer(out, 207)), "207");
    }

    #[test]
    fn a_list_of_common_and_uncommon_numbers_is_json() {
        let list = |values: &[f32]| text(|out| list(out, values, Decimals::Three));
        assert_eq!(list(&[]), "[]");
        assert_eq!(list(&[1.5, f32::NAN, -2000.25, 0.0, f32::INFINITY]), "[1.5,null,-2000.25,0,null]");
        let many: Vec<f32> = (0..BLOCK + 2).map(|i| -999.999 + i as f32).collect();
        let read: Vec<f32> = serde_json::from_str(&list(&many)).unwrap();
        assert_eq!(read.len(), many.len());
        assert!(read.iter().zip(&many).all(|(read, value)| (read - value).abs() < 0.001));
    }

    #[test]
    fn what_is_not_finite_is_not_written() {
        for value in [f32::NAN, f32::INFINITY, f32::NEG_INFINITY] {
            assert_eq!(text(|out| assert!(!number(out, value, Decimals::Three))), "");
        }
    }

    proptest! {
        #[test]
        fn every_finite_number_reads_back_within_half_of_the_last_decimal(
            value in prop_oneof![-1e12f32..1e12, -1000f32..1000.0, -1f32..1.0],
            (decimals, half) in prop_oneof![Just((Decimals::Three, 0.5e-3)), Just((Decimals::Six, 0.5e-6))],
        ) {
            let written = text(|out| assert!(number(out, value, decimals)));
            let read: f64 = serde_json::from_str(&written).unwrap();
            // Above LARGEST_FIXED the shortest text of the f32 is exact to half a step of the f32.
            let tolerance = (half * 1.000_001f64).max(f64::from(value.abs()) * f64::from(f32::EPSILON));
            prop_assert!((read - f64::from(value)).abs() <= tolerance, "{value} was written {written}");
            prop_assert!(!written.contains('.') || !written.ends_with(['0', '.']), "{value} was written {written}");
        }

        #[test]
        fn every_integer_is_written_as_its_digits(value: u64) {
            prop_assert_eq!(text(|out| integer(out, value)), value.to_string());
        }
    }
}
