//! Depth images from a raw stream: little-endian u16, image after image, as it is or compressed by xz or zstd.

use crate::recording::depth::{DepthCalibration, DepthImage, DepthUnit, DepthWriter, MAX_SIDE, MISSING_RAW};
use crate::recording::encode::EncodeError;
use crate::recording::{Device, Header};
use liblzma::read::XzDecoder;
use liblzma::stream::Stream;
use serde::Deserialize;
use std::io::{BufRead, BufReader, ErrorKind, Read, Seek, Write};

/// First bytes of compressed streams.
const XZ_MAGIC: &[u8] = &[0xfd, b'7', b'z', b'X', b'Z', 0];
const ZSTD_MAGIC: &[u8] = &[0x28, 0xb5, 0x2f, 0xfd];

/// Memory that decompressing xz may take, bytes: its highest preset needs 65 MiB.
const XZ_MEMORY: u64 = 128 << 20;

/// The camera of a raw stream, as its JSON file says. Unknown fields are ignored: such files come from many programs.
#[derive(Debug, Clone, PartialEq, Deserialize)]
pub struct CameraFile {
    /// Focal length along the rows, pixels.
    pub fx: f64,
    /// Focal length along the columns, pixels.
    pub fy: f64,
    /// Column of the optical axis.
    #[serde(alias = "x0", alias = "ppx")]
    pub cx: f64,
    /// Row of the optical axis.
    #[serde(alias = "y0", alias = "ppy")]
    pub cy: f64,
    /// Pixels in a row; 640 when it is not said.
    #[serde(default = "default_width")]
    pub width: usize,
    /// Rows; 480 when it is not said.
    #[serde(default = "default_height")]
    pub height: usize,
    /// `raw11` or `millimetres`.
    pub unit: Option<DepthUnit>,
    /// Images per second.
    pub rate_hz: Option<f64>,
    /// Height of the camera above the floor, metres.
    pub camera_height_m: Option<f64>,
    /// Tilt of the camera downwards, degrees.
    pub camera_tilt_deg: Option<f64>,
    /// Model of the camera.
    pub device_model: Option<String>,
}

fn default_width() -> usize {
    640
}

fn default_height() -> usize {
    480
}

/// Why a raw stream is no recording.
#[derive(Debug, thiserror::Error)]
pub enum DepthImportError {
    /// The camera's file says something impossible or not enough.
    #[error("the calibration is not usable: {0}")]
    Camera(String),
    /// The stream does not hold whole images.
    #[error(
        "image {frame} is incomplete: the stream ends after {bytes} of its {expected} bytes; are width and height right?"
    )]
    Incomplete {
        /// The image, from 0.
        frame: u64,
        /// Bytes of it that came.
        bytes: usize,
        /// Bytes that its size needs.
        expected: usize,
    },
    /// A value that the unit does not have.
    #[error("image {frame} has the value {value}, but raw values have 11 bits; is the unit millimetres?")]
    Value {
        /// The image, from 0.
        frame: u64,
        /// The value.
        value: u16,
    },
    /// Fewer than two images.
    #[error("the stream has {0} images, at least two are needed to see a movement")]
    TooFew(u64),
    /// The stream could not be read or decompressed.
    #[error("the stream cannot be read: {0}")]
    Read(#[from] std::io::Error),
    /// The recording could not be written.
    #[error(transparent)]
    Write(#[from] EncodeError),
}

impl CameraFile {
    fn calibration(&self) -> Result<DepthCalibration, DepthImportError> {
        let calibration = DepthCalibration {
            fx: self.fx,
            fy: self.fy,
            cx: self.cx,
            cy: self.cy,
            world_from_sensor: None,
            camera_height_m: self.camera_height_m,
            camera_tilt_deg: self.camera_tilt_deg,
        };
        if let Some((field, sentence)) = calibration.defect() {
            return Err(DepthImportError::Camera(format!("{field}: {sentence}")));
        }
        if ![self.width, self.height].iter().all(|side| (1..=MAX_SIDE).contains(side)) {
            let sentence = format!("{} × {} pixels, expected 1 to {MAX_SIDE} each way", self.width, self.height);
            return Err(DepthImportError::Camera(sentence));
        }
        Ok(calibration)
    }

    fn unit(&self) -> Result<DepthUnit, DepthImportError> {
        let sentence = "it does not say the `unit`, `raw11` or `millimetres`";
        self.unit.ok_or_else(|| DepthImportError::Camera(sentence.to_owned()))
    }

    fn rate_hz(&self) -> Result<f64, DepthImportError> {
        match self.rate_hz {
            Some(rate) if (0.1..=1000.0).contains(&rate) => Ok(rate),
            Some(rate) => Err(DepthImportError::Camera(format!("{rate} images a second, expected 0.1 to 1000"))),
            None => Err(DepthImportError::Camera("it does not say the `rate_hz`, images per second".to_owned())),
        }
    }
}

/// Images of a raw stream, one at a time.
pub struct RawImages<'a> {
    reader: Box<dyn Read + 'a>,
    bytes: Vec<u8>,
    image: DepthImage,
    n: u64,
}

impl<'a> RawImages<'a> {
    /// Reads a stream of a camera; its first bytes tell how it is compressed.
    ///
    /// # Errors
    /// [`DepthImportError`] when the camera's file is unusable or the stream cannot be read.
    pub fn new(reader: impl Read + 'a, camera: &CameraFile) -> Result<Self, DepthImportError> {
        camera.calibration()?;
        let image = DepthImage::missing(camera.width, camera.height, camera.unit()?);
        let mut reader = BufReader::with_capacity(1 << 16, reader);
        let start = reader.fill_buf()?;
        let reader: Box<dyn Read + 'a> = if start.starts_with(XZ_MAGIC) {
            let stream = Stream::new_stream_decoder(XZ_MEMORY, 0).map_err(std::io::Error::from)?;
            Box::new(XzDecoder::new_stream(reader, stream))
        } else if start.starts_with(ZSTD_MAGIC) {
            Box::new(zstd::stream::read::Decoder::with_buffer(reader)?)
        } else {
            Box::new(reader)
        };
        Ok(Self { reader, bytes: vec![0; 2 * camera.width * camera.height], image, n: 0 })
    }

    /// Reads the next image; nothing at the end.
    ///
    /// # Errors
    /// [`DepthImportError`] for an incomplete image or a value that the unit does not have.
    pub fn next_image(&mut self) -> Result<Option<&DepthImage>, DepthImportError> {
        let mut filled = 0;
        while filled < self.bytes.len() {
            match self.reader.read(&mut self.bytes[filled..]) {
                Ok(0) if filled == 0 => return Ok(None),
                Ok(0) => {
                    let (frame, expected) = (self.n, self.bytes.len());
                    return Err(DepthImportError::Incomplete { frame, bytes: filled, expected });
                }
                Ok(n) => filled += n,
                Err(error) if error.kind() == ErrorKind::Interrupted => {}
                Err(error) => return Err(error.into()),
            }
        }
        for (value, pair) in self.image.values.iter_mut().zip(self.bytes.as_chunks::<2>().0) {
            *value = u16::from_le_bytes(*pair);
        }
        if self.image.unit == DepthUnit::Raw11
            && let Some(value) = self.image.values.iter().find(|value| **value > MISSING_RAW)
        {
            return Err(DepthImportError::Value { frame: self.n, value: *value });
        }
        self.n += 1;
        Ok(Some(&self.image))
    }
}

/// Writes the images of a raw stream as a recording and answers their number. `background` is another stream of the same
/// camera, of which the first image is taken.
///
/// # Errors
/// [`DepthImportError`]; what was written until then is no whole recording.
pub fn import_depth<'a, W: Write + Seek>(
    images: impl Read + 'a,
    background: Option<Box<dyn Read + 'a>>,
    camera: &CameraFile,
    out: W,
) -> Result<u64, DepthImportError> {
    let rate = camera.rate_hz()?;
    let background = match background {
        Some(stream) => Some(RawImages::new(stream, camera)?.next_image()?.ok_or(DepthImportError::TooFew(0))?.clone()),
        None => None,
    };
    let header =
        Header { device: Device { model: camera.device_model.clone(), middleware: None }, ..Header::default() };
    let mut images = RawImages::new(images, camera)?;
    let mut writer = DepthWriter::new(out, &header, &camera.calibration()?, background.as_ref())?;
    let mut n = 0u64;
    while let Some(image) = images.next_image()? {
        writer.write((n as f64 * 1e9 / rate).round() as i64, image)?;
        n += 1;
    }
    if n < 2 {
        return Err(DepthImportError::TooFew(n));
    }
    writer.finish(&[])?;
    Ok(n)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::recording::Limits;
    use crate::recording::depth::DepthReader;
    use std::io::Cursor;
    use std::path::PathBuf;

    fn camera() -> CameraFile {
        serde_json::from_str(
            r#"{"fx": 580, "fy": 580, "x0": 4, "y0": 3, "width": 8, "height": 6, "unit": "millimetres",
                "rate_hz": 25, "serial": "A0"}"#,
        )
        .unwrap()
    }

    fn values(n: usize) -> Vec<u16> {
        (0..n * 48).map(|k| if k % 5 == 0 { 0 } else { 900 + k as u16 }).collect()
    }

    fn bytes(values: &[u16]) -> Vec<u8> {
        values.iter().flat_map(|value| value.to_le_bytes()).collect()
    }

    fn imported(stream: &[u8], background: Option<&[u8]>, camera: &CameraFile) -> Result<Vec<u8>, DepthImportError> {
        let mut out = Cursor::new(Vec::new());
        let background = background.map(|bytes| Box::new(bytes) as Box<dyn Read>);
        import_depth(stream, background, camera, &mut out)?;
        Ok(out.into_inner())
    }

    #[test]
    fn plain_xz_and_zstd_streams_become_the_same_recording() {
        let plain = bytes(&values(3));
        let mut xz = Vec::new();
        liblzma::read::XzEncoder::new(&plain[..], 6).read_to_end(&mut xz).unwrap();
        let zstd = zstd::bulk::compress(&plain, 1).unwrap();
        let recording = imported(&plain, Some(&xz), &camera()).unwrap();
        assert_eq!(imported(&xz, Some(&zstd), &camera()).unwrap(), recording);
        assert_eq!(imported(&zstd, Some(&plain), &camera()).unwrap(), recording);
        let reader = DepthReader::open(&recording[..], &Limits::default()).unwrap();
        assert_eq!(reader.background().unwrap().values, values(1));
        let images: Vec<_> = reader.map(|image| image.unwrap()).collect();
        assert_eq!(images.iter().map(|image| image.0).collect::<Vec<_>>(), [0, 40_000_000, 80_000_000]);
        assert_eq!(images[2].1.values, values(3)[96..]);
    }

    #[test]
    fn what_does_not_fit_is_refused_with_the_image_and_the_reason() {
        let refusal = |stream: &[u8], camera: &CameraFile| imported(stream, None, camera).unwrap_err().to_string();
        let stream = bytes(&values(3));
        assert!(
            refusal(&stream[..200], &camera()).starts_with("image 2 is incomplete: the stream ends after 8 of its 96")
        );
        assert!(refusal(&stream[..96], &camera()).contains("at least two"));
        let raw = CameraFile { unit: Some(DepthUnit::Raw11), ..camera() };
        assert!(refusal(&bytes(&[3000; 96]), &raw).contains("image 0 has the value 3000"));
        assert!(refusal(&stream, &CameraFile { unit: None, ..camera() }).contains("`unit`"));
        assert!(refusal(&stream, &CameraFile { rate_hz: None, ..camera() }).contains("`rate_hz`"));
        assert!(refusal(&stream, &CameraFile { fx: 0.5, ..camera() }).contains("fx"));
        assert!(refusal(&stream, &CameraFile { width: 5000, ..camera() }).contains("5000"));
        let cut = zstd::bulk::compress(&stream, 1).unwrap();
        assert!(imported(&cut[..cut.len() - 9], None, &camera()).is_err());
    }

    #[test]
    fn real_images_of_a_kinect_pass_through_without_loss() {
        let root = std::env::var_os("SUREFOOT_DATA").map_or_else(|| PathBuf::from("../shared/data"), PathBuf::from);
        for (name, unit) in [("raw11", DepthUnit::Raw11), ("mm", DepthUnit::Millimetres)] {
            let path = root.join(format!("depth/kinect_v1_people/skeltrack_{name}.u16le.xz"));
            let Ok(file) = std::fs::read(&path) else {
                println!("skipped: no {}", path.display());
                continue;
            };
            let camera: CameraFile =
                serde_json::from_str(r#"{"fx": 580, "fy": 580, "cx": 319.5, "cy": 239.5, "rate_hz": 30}"#).unwrap();
            let camera = CameraFile { unit: Some(unit), ..camera };
            let recording = imported(&file, None, &camera).unwrap();
            let mut raw = RawImages::new(&file[..], &camera).unwrap();
            let mut n = 0;
            for image in DepthReader::open(&recording[..], &Limits::default()).unwrap() {
                assert_eq!(Some(&image.unwrap().1), raw.next_image().unwrap());
                n += 1;
            }
            assert_eq!(n, 8);
            // 614 kB an image.
            assert!(recording.len() < 8 * 40_000, "{} bytes", recording.len());
        }
    }
}
