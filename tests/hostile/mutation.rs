//! Changes of sound inputs.

use mcap::MessageStream;
use mcap::write::{WriteOptions, Writer};
use rand::{Rng, RngExt};
use std::io::Cursor;

/// What an input is made of, for changes that get past its outermost checks.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Shape {
    /// Bytes.
    Bytes,
    /// Text with numbers in it.
    Text,
    /// MCAP: its checksums are made right again after a change of a message.
    Mcap,
}

/// Numbers at which code goes wrong.
const NUMBERS: [&str; 14] = [
    "0",
    "-0",
    "-1",
    "1e999",
    "-1e999",
    "1e-400",
    "9223372036854775807",
    "-9223372036854775808",
    "18446744073709551616",
    "4294967296",
    "null",
    "NaN",
    "\"\"",
    "[]",
];

/// One of the seeds with a few changes.
pub fn mutated(seeds: &[Vec<u8>], shape: Shape, random: &mut impl Rng) -> Vec<u8> {
    let mut input = seeds[random.random_range(0..seeds.len())].clone();
    if shape == Shape::Mcap && random.random_bool(0.7) {
        return with_messages_changed(&input, random).unwrap_or(input);
    }
    for _ in 0..random.random_range(1..=8) {
        if shape == Shape::Text && random.random_bool(0.6) {
            change_number(&mut input, random);
        } else {
            change_bytes(&mut input, seeds, random);
        }
    }
    input
}

fn change_bytes(input: &mut Vec<u8>, seeds: &[Vec<u8>], random: &mut impl Rng) {
    if input.is_empty() {
        input.push(random.random());
        return;
    }
    let at = random.random_range(0..input.len());
    let length = random.random_range(1..=64.min(input.len() - at));
    match random.random_range(0..8) {
        0 => input[at] ^= 1 << random.random_range(0..8),
        1 => input[at] = [0, 1, 0x7f, 0x80, 0xff][random.random_range(0..5)],
        2 => input[at..at + length].fill([0, 0xff][random.random_range(0..2)]),
        3 => input.truncate(at),
        4 => drop(input.drain(at..at + length)),
        5 => {
            let piece = input[at..at + length].to_vec();
            let to = random.random_range(0..=input.len());
            input.splice(to..to, piece);
        }
        6 => {
            // A width of the integers of binary formats, set to a large number.
            let width = [2, 4, 8][random.random_range(0..3)].min(input.len() - at);
            input[at..at + width].fill(0xff);
        }
        _ => {
            let other = &seeds[random.random_range(0..seeds.len())];
            let from = random.random_range(0..other.len());
            let to = at.min(other.len());
            input.truncate(at);
            input.extend_from_slice(&other[from.max(to.saturating_sub(64))..]);
        }
    }
}

fn change_number(input: &mut Vec<u8>, random: &mut impl Rng) {
    let is_of_number = |byte: &u8| byte.is_ascii_digit() || matches!(byte, b'-' | b'.' | b'e' | b'+');
    let starts: Vec<usize> = (0..input.len())
        .filter(|&i| is_of_number(&input[i]) && (i == 0 || !is_of_number(&input[i - 1])))
        .take(4096)
        .collect();
    if starts.is_empty() {
        return;
    }
    let start = starts[random.random_range(0..starts.len())];
    let end = start + input[start..].iter().take_while(|byte| is_of_number(byte)).count();
    let number = NUMBERS[random.random_range(0..NUMBERS.len())];
    input.splice(start..end, number.bytes());
}

/// The same recording with one message changed, dropped, doubled or moved in time, written anew.
fn with_messages_changed(bytes: &[u8], random: &mut impl Rng) -> Option<Vec<u8>> {
    let messages: Vec<_> = MessageStream::new(bytes).ok()?.collect::<Result<_, _>>().ok()?;
    let victim = random.random_range(0..messages.len());
    let kind = random.random_range(0..8);
    let options = WriteOptions::new().profile("surefoot");
    let mut writer = Writer::with_options(Cursor::new(Vec::new()), options).ok()?;
    let summary = mcap::Summary::read(bytes).ok()??;
    for index in &summary.metadata_indexes {
        writer.write_metadata(&mcap::read::metadata(bytes, index).ok()?).ok()?;
    }
    for index in &summary.attachment_indexes {
        writer.attach(&mcap::read::attachment(bytes, index).ok()?).ok()?;
    }
    for (i, message) in messages.iter().enumerate() {
        let mut message = message.clone();
        if i == victim {
            match kind {
                0 => continue,
                1 => writer.write(&message).ok()?,
                2 => message.log_time = [0, 1, u64::MAX, i64::MAX as u64][random.random_range(0..4)],
                3 | 4 => {
                    let mut data = message.data.to_vec();
                    change_number(&mut data, random);
                    message.data = data.into();
                }
                _ => {
                    let mut data = message.data.to_vec();
                    for _ in 0..random.random_range(1..4) {
                        change_bytes(&mut data, &[bytes.to_vec()], random);
                    }
                    message.data = data.into();
                }
            }
        }
        writer.write(&message).ok()?;
    }
    writer.finish().ok()?;
    Some(writer.into_inner().into_inner())
}
