//! Depth recordings as MCAP, written image by image.

use super::{DepthCalibration, DepthCoding, DepthEncoder, DepthImage};
use crate::recording::encode::{self, EncodeError};
use crate::recording::side_camera::{SIDE_NAMES, SideCalibration, SideCamera, SideImages, png_image};
use crate::recording::{Header, ReferenceSeries};
use mcap::records::MessageHeader;
use std::collections::BTreeMap;
use std::io::{Seek, Write};

/// Size at which a chunk is closed, bytes: about ten images, so that a reader holds few of them.
const CHUNK_BYTES: u64 = 1 << 20;

/// Writes a depth recording while it is made; memory does not grow with it.
pub struct DepthWriter<W: Write + Seek> {
    file: mcap::Writer<W>,
    encoder: DepthEncoder,
    channel: u16,
    n_frames: u32,
    /// Channels of the colour cameras at the sides, and images of each.
    side_channels: Option<[u16; 2]>,
    n_sides: u32,
}

impl<W: Write + Seek> DepthWriter<W> {
    /// Begins a recording with what comes before the images.
    ///
    /// # Errors
    /// [`EncodeError`] when `out` fails or the header has no form.
    pub fn new(
        out: W,
        header: &Header,
        calibration: &DepthCalibration,
        background: Option<&DepthImage>,
    ) -> Result<Self, EncodeError> {
        // The images are compressed already.
        let mut file = encode::options(None).chunk_size(Some(CHUNK_BYTES)).create(out)?;
        encode::write_header(&mut file, header)?;
        let mut encoder = DepthEncoder::new(DepthCoding::RunsZstd)?;
        let calibrations = file.add_channel(0, "/depth/calibration", "json", &BTreeMap::new())?;
        file.write_to_known_channel(&message_header(calibrations, 0, 0), &serde_json::to_vec(calibration)?)?;
        if let Some(background) = background {
            let backgrounds = file.add_channel(0, "/depth/background", encode::DEPTH_ENCODING, &BTreeMap::new())?;
            file.write_to_known_channel(&message_header(backgrounds, 0, 0), encoder.encode(background)?)?;
        }
        let channel = file.add_channel(0, "/depth", encode::DEPTH_ENCODING, &BTreeMap::new())?;
        Ok(Self { file, encoder, channel, n_frames: 0, side_channels: None, n_sides: 0 })
    }

    /// Describes the colour cameras at the sides, with the labels of their first images; before the first depth image.
    ///
    /// # Errors
    /// [`EncodeError`] when there are not as many labels as pixels, or when writing fails.
    pub fn describe_sides(&mut self, cameras: &[SideCamera; 2]) -> Result<(), EncodeError> {
        let mut channels = [0; 2];
        for ((camera, name), channel) in cameras.iter().zip(SIDE_NAMES).zip(&mut channels) {
            let mut once = |topic: &str, encoding: &str, content: &[u8]| {
                let id = self.file.add_channel(0, &format!("/side/{name}/{topic}"), encoding, &BTreeMap::new())?;
                self.file.write_to_known_channel(&message_header(id, 0, 0), content)
            };
            once("calibration", "json", &serde_json::to_vec(&SideCalibration::of_camera(camera))?)?;
            let size = [camera.first.width, camera.first.height];
            once("labels", "png", &png_image::encode_labels(size, &camera.labels)?)?;
            *channel = self.file.add_channel(0, &format!("/side/{name}"), "png", &BTreeMap::new())?;
        }
        self.side_channels = Some(channels);
        Ok(())
    }

    /// Writes what the cameras at the sides saw at the time of the next image.
    ///
    /// # Errors
    /// [`EncodeError`] when the cameras were not described, for a negative time, or when writing fails.
    pub fn write_sides(&mut self, time_ns: i64, images: &SideImages) -> Result<(), EncodeError> {
        let channels =
            self.side_channels.ok_or(EncodeError::Unsuitable("the cameras at the sides are not described"))?;
        let time = u64::try_from(time_ns).map_err(|_| EncodeError::Unsuitable("a time stamp is negative"))?;
        for (channel, image) in channels.into_iter().zip(images) {
            let header = message_header(channel, self.n_sides, time);
            self.file.write_to_known_channel(&header, &png_image::encode_colour(image)?)?;
        }
        self.n_sides += 1;
        Ok(())
    }

    /// Writes the next image.
    ///
    /// # Errors
    /// [`EncodeError`] for a negative time, or when writing fails.
    pub fn write(&mut self, time_ns: i64, image: &DepthImage) -> Result<(), EncodeError> {
        let time = u64::try_from(time_ns).map_err(|_| EncodeError::Unsuitable("a time stamp is negative"))?;
        let header = message_header(self.channel, self.n_frames, time);
        self.file.write_to_known_channel(&header, self.encoder.encode(image)?)?;
        self.n_frames += 1;
        Ok(())
    }

    /// Ends the recording with the reference series that were made beside it.
    ///
    /// # Errors
    /// [`EncodeError`] when writing fails.
    pub fn finish(mut self, references: &[ReferenceSeries]) -> Result<W, EncodeError> {
        encode::write_references(&mut self.file, references)?;
        self.file.finish()?;
        Ok(self.file.into_inner())
    }
}

fn message_header(channel_id: u16, sequence: u32, log_time: u64) -> MessageHeader {
    MessageHeader { channel_id, sequence, log_time, publish_time: log_time }
}
