//! Damaged bytes: never a panic, never other data than was written.

use super::*;
use proptest::prelude::*;

fn whole(format: Format) -> Vec<u8> {
    match format {
        Format::Mcap => encode::mcap(&with_units()).expect("mcap"),
        Format::Json => encode::json(&with_units()).expect("json"),
    }
}

#[test]
fn a_recording_cut_anywhere_is_refused_and_says_it_is_cut() {
    for format in [Format::Mcap, Format::Json] {
        let bytes = whole(format);
        for length in 0..bytes.len() {
            let code = defect(&bytes[..length], format).code;
            let expected = if length == 0 { "empty_recording" } else { "truncated" };
            assert_eq!(code, expected, "{format:?} cut to {length} of {} bytes", bytes.len());
        }
    }
}

#[test]
fn an_mcap_file_with_any_one_bit_flipped_is_refused_or_means_the_same() {
    let bytes = whole(Format::Mcap);
    let sound = bits(&with_units());
    let mut refused = 0;
    for i in 0..bytes.len() {
        for bit in 0..8 {
            let mut damaged = bytes.clone();
            damaged[i] ^= 1 << bit;
            match decode(&damaged[..], Format::Mcap, &Limits::default()) {
                Ok(recording) => assert_eq!(bits(&recording), sound, "byte {i} bit {bit}"),
                Err(_) => refused += 1,
            }
        }
    }
    assert!(refused > bytes.len() * 8 * 9 / 10, "only {refused} of {} flips were noticed", bytes.len() * 8);
}

#[test]
fn a_chunk_lost_by_a_flipped_opcode_shows_in_the_counts_even_without_a_data_checksum() {
    let mut bytes = whole(Format::Mcap);
    let chunk = bytes.windows(4).position(|w| w == b"zstd").expect("a chunk") - 4 - 4 - 8 - 8 - 8 - 9;
    assert_eq!(bytes[chunk], 0x06, "the opcode of a chunk");
    bytes[chunk] = 0x86;
    // Data end: opcode, length 4, checksum; zero means that there is none.
    let mark = [0x0f, 4, 0, 0, 0, 0, 0, 0, 0];
    let end = bytes.windows(9).rposition(|w| w == mark).expect("data end");
    bytes[end + 9..end + 13].fill(0);
    assert_eq!(defect(&bytes, Format::Mcap).code, "checksum_mismatch");
}

proptest! {
    #[test]
    fn any_bytes_are_refused_without_panic(bytes in prop::collection::vec(any::<u8>(), 0..2000)) {
        for format in [Format::Mcap, Format::Json] {
            prop_assert!(inspect(&bytes, format, 300).is_err());
        }
    }

    #[test]
    fn any_bytes_after_a_sound_beginning_are_refused_without_panic(
        keep in 0.0..1.0f64, bytes in prop::collection::vec(any::<u8>(), 1..500)
    ) {
        for format in [Format::Mcap, Format::Json] {
            let mut damaged = whole(format);
            damaged.truncate((damaged.len() as f64 * keep) as usize);
            damaged.extend(&bytes);
            let _ = inspect(&damaged, format, 300);
        }
    }

    #[test]
    fn json_with_bytes_changed_is_refused_or_decoded_without_panic(at in any::<prop::sample::Index>(), byte in any::<u8>()) {
        let mut damaged = whole(Format::Json);
        let at = at.index(damaged.len());
        damaged[at] = byte;
        let _ = inspect(&damaged, Format::Json, 64);
    }
}
