//! Colour images and labels as PNG, one image a message.

use super::SEGMENT_LABELS;
use crate::geometry::colour_image::ColourImage;
use crate::recording::DecodeError;
use crate::recording::depth::MAX_SIDE;
use crate::recording::encode::EncodeError;
use png::{BitDepth, ColorType};
use std::io::Cursor;

/// What the pixels of an image are.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Pixels {
    /// Red, green and blue.
    Colour,
    /// The number of a segment.
    Labels,
}

impl Pixels {
    fn colour_type(self) -> ColorType {
        match self {
            Pixels::Colour => ColorType::Rgb,
            Pixels::Labels => ColorType::Grayscale,
        }
    }

    fn expected(self) -> &'static str {
        match self {
            Pixels::Colour => "red, green and blue of 8 bits each, without transparency",
            Pixels::Labels => "grey values of 8 bits, the numbers of the segments",
        }
    }
}

/// Width and height of an image, from its header alone.
///
/// # Errors
/// `invalid_image`.
pub fn size(message: &[u8], pixels: Pixels) -> Result<[usize; 2], DecodeError> {
    Ok(open(message, pixels)?.1)
}

/// A colour image.
///
/// # Errors
/// `invalid_image`.
pub fn colour(message: &[u8]) -> Result<ColourImage, DecodeError> {
    let ([width, height], bytes) = read(message, Pixels::Colour)?;
    let pixels = bytes.as_chunks::<3>().0.to_vec();
    Ok(ColourImage { width, height, pixels })
}

/// Labels, row by row, with the width and height of what they are of.
///
/// # Errors
/// `invalid_image`, also for a label that names no segment.
pub fn labels(message: &[u8]) -> Result<([usize; 2], Vec<u8>), DecodeError> {
    let (size, labels) = read(message, Pixels::Labels)?;
    if let Some(label) = labels.iter().find(|label| usize::from(**label) > SEGMENT_LABELS) {
        let sentence = format!("the label {label} names no segment; there are 0 (none) to {SEGMENT_LABELS}");
        return Err(DecodeError::new("invalid_image", sentence));
    }
    Ok((size, labels))
}

type Reader<'a> = png::Reader<Cursor<&'a [u8]>>;

fn open(message: &[u8], pixels: Pixels) -> Result<(Reader<'_>, [usize; 2]), DecodeError> {
    /// Memory for what is not the image itself.
    const MOST_BYTES: usize = 1 << 20;
    let mut decoder = png::Decoder::new_with_limits(Cursor::new(message), png::Limits { bytes: MOST_BYTES });
    decoder.set_ignore_text_chunk(true);
    decoder.set_ignore_iccp_chunk(true);
    let reader = decoder.read_info().map_err(not_png)?;
    let info = reader.info();
    let (width, height) = (info.width as usize, info.height as usize);
    let refused = |sentence: String| Err(DecodeError::new("invalid_image", sentence));
    if width > MAX_SIDE || height > MAX_SIDE {
        return refused(format!("the image is {width} × {height}, at most {MAX_SIDE} pixels each way are accepted"));
    }
    if (info.color_type, info.bit_depth) != (pixels.colour_type(), BitDepth::Eight) {
        let found = (info.color_type, info.bit_depth);
        return refused(format!("the pixels are {found:?}, expected {}", pixels.expected()));
    }
    Ok((reader, [width, height]))
}

fn read(message: &[u8], pixels: Pixels) -> Result<([usize; 2], Vec<u8>), DecodeError> {
    let (mut reader, [width, height]) = open(message, pixels)?;
    let mut bytes = vec![0; width * height * pixels.colour_type().samples()];
    reader.next_frame(&mut bytes).map_err(not_png)?;
    Ok(([width, height], bytes))
}

fn not_png(error: png::DecodingError) -> DecodeError {
    DecodeError::new("invalid_image", format!("the message is not a whole PNG image: {error}"))
}

/// A colour image as PNG.
///
/// # Errors
/// [`EncodeError`] for an image without pixels.
pub fn encode_colour(image: &ColourImage) -> Result<Vec<u8>, EncodeError> {
    encode([image.width, image.height], Pixels::Colour, image.pixels.as_flattened())
}

/// Labels of an image of this width and height as PNG.
///
/// # Errors
/// [`EncodeError`] when there are more or fewer labels than pixels, or none.
pub fn encode_labels(size: [usize; 2], labels: &[u8]) -> Result<Vec<u8>, EncodeError> {
    encode(size, Pixels::Labels, labels)
}

fn encode([width, height]: [usize; 2], pixels: Pixels, bytes: &[u8]) -> Result<Vec<u8>, EncodeError> {
    let unsuitable = |_| EncodeError::Unsuitable("an image at the side has no size, or not as many pixels");
    let side = |pixels: usize| u32::try_from(pixels).unwrap_or(0);
    let mut out = Vec::new();
    let mut encoder = png::Encoder::new(&mut out, side(width), side(height));
    encoder.set_color(pixels.colour_type());
    encoder.set_depth(BitDepth::Eight);
    encoder.set_compression(png::Compression::Fast);
    let mut writer = encoder.write_header().map_err(unsuitable)?;
    writer.write_image_data(bytes).map_err(unsuitable)?;
    writer.finish().map_err(unsuitable)?;
    Ok(out)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn image() -> ColourImage {
        let pixels = (0..7 * 5).map(|k: u8| [k, 255 - k, k.wrapping_mul(37)]).collect();
        ColourImage { width: 7, height: 5, pixels }
    }

    #[test]
    fn images_and_labels_come_back_as_they_were() {
        let message = encode_colour(&image()).unwrap();
        assert_eq!((colour(&message), size(&message, Pixels::Colour)), (Ok(image()), Ok([7, 5])));
        let segments: Vec<u8> = (0..35).map(|k| k % 7).collect();
        assert_eq!(labels(&encode_labels([7, 5], &segments).unwrap()), Ok(([7, 5], segments)));
    }

    #[test]
    fn what_is_no_such_image_is_refused_and_says_why() {
        let sentence = |result: Result<_, DecodeError>| {
            let defect = result.map(|_: [usize; 2]| ()).unwrap_err();
            assert_eq!(defect.code, "invalid_image");
            defect.sentence
        };
        let message = encode_colour(&image()).unwrap();
        assert!(sentence(colour(&message[..message.len() / 2]).map(|_| [0; 2])).contains("not a whole PNG"));
        assert!(sentence(colour(b"\xff\xd8\xff\xe0 a JPEG").map(|_| [0; 2])).contains("not a whole PNG"));
        assert!(sentence(labels(&message).map(|(size, _)| size)).contains("grey values"));
        let seventh = encode_labels([1, 1], &[7]).unwrap();
        assert!(sentence(labels(&seventh).map(|(size, _)| size)).contains("label 7"));
        // A header that promises more than is accepted costs nothing.
        let wide = encode([MAX_SIDE + 1, 1], Pixels::Labels, &vec![0; MAX_SIDE + 1]).unwrap();
        assert!(sentence(size(&wide, Pixels::Labels)).contains("at most"));
        assert!(encode_labels([3, 3], &[0; 8]).is_err() && encode_labels([0, 0], &[]).is_err());
    }
}
