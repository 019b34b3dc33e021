//! Depth images as bytes: the header of the recording format, and lossless codings of the values.
//!
//! The coding of choice goes through the values in reading order and writes runs: how many are missing, how many are not,
//! and of the latter the differences from the value before, all as numbers of three bits and a mark per half byte (RVL:
//! A. D. Wilson, Fast lossless depth image compression, ISS 2017, with the missing value of the unit). zstd then takes
//! what the runs have in common. Measured against others in `docs/measurements.md`.

use super::{DepthImage, DepthUnit, MISSING_RAW};
use crate::recording::DecodeError;
use zstd::bulk::{Compressor, Decompressor};

/// Bytes before the values.
const HEADER_BYTES: usize = 8;

/// Largest width and height, pixels.
pub const MAX_SIDE: usize = 2048;

/// Most pixels of an image; that of an uncompressed one fits into a record of 16 MiB.
pub const MAX_PIXELS: usize = MAX_SIDE * MAX_SIDE;

/// Compression of zstd; higher levels gain little on runs.
const ZSTD_LEVEL: i32 = 1;

/// Half bytes of the longest number: 24 bits, where a run of all pixels has 22 and a difference 17.
const MAX_HALF_BYTES: u32 = 8;

/// Bytes of runs for each pixel at worst: a difference of 17 bits is six half bytes long. A pixel on its own takes two
/// more for its runs, and then leaves out its neighbour.
const MAX_BYTES_PER_PIXEL: usize = 3;

/// Bytes of the runs' own lengths beyond that.
const RUN_BYTES: usize = 16;

/// How the values of an image are written.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum DepthCoding {
    /// As they are.
    None,
    /// Compressed by zstd.
    Zstd,
    /// Runs and differences, compressed by zstd.
    RunsZstd,
}

impl DepthCoding {
    /// The coding's number in the header.
    fn id(self) -> u8 {
        match self {
            DepthCoding::None => 0,
            DepthCoding::Zstd => 1,
            DepthCoding::RunsZstd => 2,
        }
    }
}

/// What the header of an image says.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct ImageHeader {
    /// Pixels in a row.
    pub width: usize,
    /// Rows.
    pub height: usize,
    /// What the values are.
    pub unit: DepthUnit,
    coding: DepthCoding,
}

impl ImageHeader {
    /// Reads the header of a message.
    ///
    /// # Errors
    /// `invalid_depth` for a message that is no depth image, `depth_size` for one of an impossible size.
    pub fn parse(message: &[u8]) -> Result<Self, DecodeError> {
        let refuse = |sentence: String| Err(DecodeError::new("invalid_depth", sentence));
        let Some(header) = message.first_chunk::<HEADER_BYTES>() else {
            return refuse(format!("the message has {} bytes, a depth image has a header of 8", message.len()));
        };
        let [w0, w1, h0, h1, unit, coding, zeros @ ..] = *header;
        let (width, height) = (u16::from_le_bytes([w0, w1]).into(), u16::from_le_bytes([h0, h1]).into());
        if !(1..=MAX_SIDE).contains(&width) || !(1..=MAX_SIDE).contains(&height) {
            let sentence = format!("the image has {width} × {height} pixels, expected 1 to {MAX_SIDE} each way");
            return Err(DecodeError::new("depth_size", sentence));
        }
        let unit = match unit {
            0 => DepthUnit::Raw11,
            1 => DepthUnit::Millimetres,
            other => return refuse(format!("unit {other} is none, expected 0 (raw 11-bit) or 1 (millimetres)")),
        };
        let coding = match coding {
            0 => DepthCoding::None,
            1 => DepthCoding::Zstd,
            2 => DepthCoding::RunsZstd,
            other => return refuse(format!("coding {other} is none, expected 0, 1 or 2")),
        };
        if zeros != [0, 0] {
            return refuse("bytes 6 and 7 of the header are not zero".to_owned());
        }
        Ok(Self { width, height, unit, coding })
    }
}

/// Reads depth images one after the other, in memory that is used again.
#[derive(Default)]
pub struct DepthDecoder {
    zstd: Option<Decompressor<'static>>,
    bytes: Vec<u8>,
}

impl DepthDecoder {
    /// Reads the image of a message into `image`, whatever that was before.
    ///
    /// # Errors
    /// `depth_size`, `invalid_depth`, or `invalid_value` for a raw value above 2047.
    pub fn decode_into(&mut self, message: &[u8], image: &mut DepthImage) -> Result<(), DecodeError> {
        let header = ImageHeader::parse(message)?;
        let body = &message[HEADER_BYTES..];
        let pixels = header.width * header.height;
        (image.width, image.height, image.unit) = (header.width, header.height, header.unit);
        image.values.clear();
        match header.coding {
            DepthCoding::None => read_values(body, pixels, &mut image.values)?,
            DepthCoding::Zstd => {
                let bytes = self.decompress(body, 2 * pixels)?;
                read_values(bytes, pixels, &mut image.values)?;
            }
            DepthCoding::RunsZstd => {
                let bytes = self.decompress(body, MAX_BYTES_PER_PIXEL * pixels + RUN_BYTES)?;
                read_runs(bytes, pixels, header.unit.missing(), &mut image.values)?;
            }
        }
        if header.unit == DepthUnit::Raw11
            && let Some(pixel) = image.values.iter().position(|value| *value > MISSING_RAW)
        {
            let (value, i, j) = (image.values[pixel], pixel % header.width, pixel / header.width);
            let sentence = format!(
                "the value in column {i}, row {j} is {value}, but raw values have 11 bits (at most 2047); are they \
                 millimetres, or in the wrong byte order?"
            );
            return Err(DecodeError::new("invalid_value", sentence));
        }
        Ok(())
    }

    /// Decompresses at most `limit` bytes; what is longer is an error before it is written.
    fn decompress(&mut self, body: &[u8], limit: usize) -> Result<&[u8], DecodeError> {
        let corrupt = |error: std::io::Error| {
            let sentence = format!("the image cannot be decompressed to its size ({error}); send the recording again");
            DecodeError::new("invalid_depth", sentence)
        };
        let zstd = match &mut self.zstd {
            Some(zstd) => zstd,
            none => none.insert(Decompressor::new().map_err(corrupt)?),
        };
        // The system gives pages to what is written only, so reserving the worst case of runs costs nothing.
        self.bytes.clear();
        self.bytes.reserve_exact(limit);
        zstd.decompress_to_buffer(body, &mut self.bytes).map_err(corrupt)?;
        Ok(&self.bytes)
    }
}

fn read_values(bytes: &[u8], pixels: usize, values: &mut Vec<u16>) -> Result<(), DecodeError> {
    let (pairs, rest) = bytes.as_chunks::<2>();
    if pairs.len() != pixels || !rest.is_empty() {
        let sentence = format!("the image has {} bytes of values, its size needs {}", bytes.len(), 2 * pixels);
        return Err(DecodeError::new("invalid_depth", sentence));
    }
    values.extend(pairs.iter().map(|pair| u16::from_le_bytes(*pair)));
    Ok(())
}

fn read_runs(bytes: &[u8], pixels: usize, missing: u16, values: &mut Vec<u16>) -> Result<(), DecodeError> {
    let mut numbers = HalfBytes { bytes, at: 0 };
    let defect = |what: &str| DecodeError::new("invalid_depth", format!("the runs of the image {what}"));
    values.reserve_exact(pixels);
    let mut value = 0i32;
    while values.len() < pixels {
        let before = values.len();
        let absent = numbers.next().ok_or_else(|| defect("end early"))? as usize;
        if absent > pixels - before {
            return Err(defect("are longer than the image"));
        }
        values.resize(before + absent, missing);
        if values.len() == pixels {
            break;
        }
        let present = numbers.next().ok_or_else(|| defect("end early"))? as usize;
        if present > pixels - values.len() || absent + present == 0 {
            return Err(defect("do not fit the image"));
        }
        for _ in 0..present {
            let folded = numbers.next().ok_or_else(|| defect("end early"))?;
            value = value.wrapping_add((folded >> 1) as i32 ^ -((folded & 1) as i32));
            values.push(u16::try_from(value).map_err(|_| defect("lead outside of 16 bits"))?);
        }
    }
    // Half a byte may be left over.
    if numbers.at.div_ceil(2) != bytes.len() {
        return Err(defect("are followed by more bytes"));
    }
    Ok(())
}

/// Numbers of three bits for each half byte, least significant first; the fourth bit says that more follow. The upper
/// half of a byte comes first.
struct HalfBytes<'a> {
    bytes: &'a [u8],
    at: usize,
}

impl HalfBytes<'_> {
    #[inline(always)]
    fn next(&mut self) -> Option<u32> {
        let mut number = 0;
        for place in 0..MAX_HALF_BYTES {
            let byte = *self.bytes.get(self.at / 2)?;
            let half = if self.at.is_multiple_of(2) { byte >> 4 } else { byte & 15 };
            self.at += 1;
            number |= u32::from(half & 7) << (3 * place);
            if half & 8 == 0 {
                return Some(number);
            }
        }
        None
    }
}

/// Writes depth images one after the other, in memory that is used again.
pub struct DepthEncoder {
    coding: DepthCoding,
    zstd: Compressor<'static>,
    values: Vec<u8>,
    message: Vec<u8>,
}

impl DepthEncoder {
    /// An encoder with a coding.
    ///
    /// # Errors
    /// When zstd has no memory.
    pub fn new(coding: DepthCoding) -> std::io::Result<Self> {
        Ok(Self { coding, zstd: Compressor::new(ZSTD_LEVEL)?, values: Vec::new(), message: Vec::new() })
    }

    /// The message of an image. Its sides must fit 16 bits.
    ///
    /// # Errors
    /// When zstd fails.
    pub fn encode(&mut self, image: &DepthImage) -> std::io::Result<&[u8]> {
        let side = |side: usize| u16::try_from(side).map_err(|_| std::io::Error::other("an image side beyond 16 bits"));
        let unit = match image.unit {
            DepthUnit::Raw11 => 0,
            DepthUnit::Millimetres => 1,
        };
        self.message.clear();
        self.message.extend(side(image.width)?.to_le_bytes());
        self.message.extend(side(image.height)?.to_le_bytes());
        self.message.extend([unit, self.coding.id(), 0, 0]);
        self.values.clear();
        match self.coding {
            DepthCoding::RunsZstd => write_runs(&image.values, image.unit.missing(), &mut self.values),
            _ => self.values.extend(image.values.iter().flat_map(|value| value.to_le_bytes())),
        }
        match self.coding {
            DepthCoding::None => self.message.extend(&self.values),
            _ => self.message.extend(self.zstd.compress(&self.values)?),
        }
        Ok(&self.message)
    }
}

fn write_runs(values: &[u16], missing: u16, out: &mut Vec<u8>) {
    let mut half: Option<u8> = None;
    let mut put = |mut number: u32| {
        loop {
            let more = number > 7;
            let bits = (number & 7) as u8 | if more { 8 } else { 0 };
            match half.take() {
                None => half = Some(bits),
                Some(upper) => out.push(upper << 4 | bits),
            }
            number >>= 3;
            if !more {
                return;
            }
        }
    };
    let mut before = 0i32;
    let mut rest = values;
    while !rest.is_empty() {
        let absent = rest.iter().take_while(|value| **value == missing).count();
        put(absent as u32);
        rest = &rest[absent..];
        if rest.is_empty() {
            break;
        }
        let present = rest.iter().take_while(|value| **value != missing).count();
        put(present as u32);
        for value in &rest[..present] {
            let difference = i32::from(*value) - before;
            put(((difference << 1) ^ (difference >> 31)) as u32);
            before = i32::from(*value);
        }
        rest = &rest[present..];
    }
    if let Some(upper) = half {
        out.push(upper << 4);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    const CODINGS: [DepthCoding; 3] = [DepthCoding::None, DepthCoding::Zstd, DepthCoding::RunsZstd];

    fn round_trip(image: &DepthImage, coding: DepthCoding) -> DepthImage {
        let mut encoder = DepthEncoder::new(coding).unwrap();
        let mut read = DepthImage::missing(1, 1, DepthUnit::Millimetres);
        DepthDecoder::default().decode_into(encoder.encode(image).unwrap(), &mut read).unwrap();
        read
    }

    fn refusal(message: &[u8]) -> &'static str {
        let mut image = DepthImage::missing(1, 1, DepthUnit::Raw11);
        DepthDecoder::default().decode_into(message, &mut image).unwrap_err().code
    }

    /// A message with the given body of runs.
    fn runs(width: u16, body: &[u8]) -> Vec<u8> {
        let mut message = vec![width as u8, (width >> 8) as u8, 1, 0, 1, 2, 0, 0];
        message.extend(zstd::bulk::compress(body, 1).unwrap());
        message
    }

    proptest! {
        #[test]
        fn every_image_is_read_as_it_was_written(
            unit in prop::sample::select(vec![DepthUnit::Raw11, DepthUnit::Millimetres]),
            width in 1usize..9,
            values in prop::collection::vec(prop_oneof![Just(2047u16), Just(0u16), 0u16..=2047, any::<u16>()], 1..200),
        ) {
            let height = values.len().div_ceil(width);
            let mut values = values;
            values.resize(width * height, unit.missing());
            if unit == DepthUnit::Raw11 {
                for value in &mut values {
                    *value &= MISSING_RAW;
                }
            }
            let image = DepthImage { width, height, unit, values };
            for coding in CODINGS {
                prop_assert_eq!(&round_trip(&image, coding), &image);
            }
        }

        #[test]
        fn any_bytes_are_read_or_refused_without_panic(bytes in prop::collection::vec(any::<u8>(), 0..300)) {
            let mut image = DepthImage::missing(1, 1, DepthUnit::Raw11);
            let mut decoder = DepthDecoder::default();
            let _ = decoder.decode_into(&bytes, &mut image);
            let _ = decoder.decode_into(&runs(200, &bytes), &mut image);
            prop_assert!(image.values.len() <= MAX_PIXELS);
        }
    }

    #[test]
    fn the_runs_of_a_small_image_are_the_bytes_on_the_page_of_the_format() {
        let mut bytes = Vec::new();
        // Two missing, three present (500, 503, 502), one missing.
        write_runs(&[0, 0, 500, 503, 502, 0], 0, &mut bytes);
        // 2 | 3 | +500 folded is 1000 = 0 + 5·8 + 7·64 + 1·512 | +3 is 6 | −1 is 1 | 1
        assert_eq!(bytes, [0x23, 0x8d, 0xf1, 0x61, 0x10]);
    }

    #[test]
    fn headers_that_are_none_are_refused() {
        assert_eq!(refusal(b"short"), "invalid_depth");
        assert_eq!(refusal(&[0, 0, 1, 0, 0, 0, 0, 0]), "depth_size");
        assert_eq!(refusal(&[1, 9, 1, 0, 0, 0, 0, 0]), "depth_size");
        assert_eq!(refusal(&[1, 0, 1, 0, 2, 0, 0, 0, 1, 1]), "invalid_depth");
        assert_eq!(refusal(&[1, 0, 1, 0, 0, 9, 0, 0, 1, 1]), "invalid_depth");
        assert_eq!(refusal(&[1, 0, 1, 0, 0, 0, 1, 0, 1, 1]), "invalid_depth");
    }

    #[test]
    fn values_that_do_not_fill_the_image_or_have_more_than_11_bits_are_refused() {
        assert_eq!(refusal(&[2, 0, 1, 0, 0, 0, 0, 0, 1, 1, 1]), "invalid_depth");
        assert_eq!(refusal(&[1, 0, 1, 0, 0, 0, 0, 0, 0, 8]), "invalid_value");
        assert_eq!(refusal(&[2, 0, 1, 0, 0, 1, 0, 0, 1, 2, 3, 4]), "invalid_depth");
    }

    #[test]
    fn a_bomb_is_refused_before_it_is_unpacked() {
        let zeros = zstd::bulk::compress(&vec![0; 32 << 20], 1).unwrap();
        let mut message = vec![16, 0, 16, 0, 1, 1, 0, 0];
        message.extend(&zeros);
        assert_eq!(refusal(&message), "invalid_depth");
        message[5] = 2;
        assert_eq!(refusal(&message), "invalid_depth");
    }

    #[test]
    fn runs_that_do_not_fit_their_image_are_refused() {
        assert_eq!(refusal(&runs(4, &[0x50])), "invalid_depth");
        assert_eq!(refusal(&runs(4, &[0x05])), "invalid_depth");
        assert_eq!(refusal(&runs(4, &[0x00, 0x40])), "invalid_depth");
        assert_eq!(refusal(&runs(4, &[0x02, 0x11])), "invalid_depth");
        assert_eq!(refusal(&runs(4, &[0x40, 0x00])), "invalid_depth");
        assert_eq!(refusal(&runs(4, &[0xff, 0xff, 0xff, 0xff, 0xff])), "invalid_depth");
    }

    #[test]
    fn a_truncated_image_is_refused() {
        let image = DepthImage {
            width: 64,
            height: 4,
            unit: DepthUnit::Raw11,
            values: (0..256).map(|k| 700 + k % 7).collect(),
        };
        for coding in CODINGS {
            let message = DepthEncoder::new(coding).unwrap().encode(&image).unwrap().to_owned();
            for length in 0..message.len() {
                assert_eq!(refusal(&message[..length]), "invalid_depth", "{coding:?} {length}");
            }
        }
    }
}
