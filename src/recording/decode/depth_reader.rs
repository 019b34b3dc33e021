//! The depth images of a recording, one by one: memory does not grow with the recording.

use super::side::EncodedSides;
use super::{Decoder, Format, Limits};
use crate::recording::depth::{DepthCalibration, DepthDecoder, DepthImage, DepthUnit};
use crate::recording::side_camera::{SIDE_NAMES, SideCamera, SideImages, png_image};
use crate::recording::{DecodeError, Header, Recording};
use std::collections::VecDeque;
use std::io::{ErrorKind, Read};

/// Bytes that are read at a time.
const PIECE: usize = 64 * 1024;

/// Reads depth images as they are asked for. What was said before the first of them (header, calibration, background) is
/// there from the beginning.
///
/// An iterator over `(time_ns, image)`; [`DepthReader::next_into`] does the same without taking memory. Images before a
/// defect are given, then the defect; a recording that lacks its end is `truncated` after its last image.
pub struct DepthReader<R> {
    reader: R,
    /// Present until the end or the first defect.
    decoder: Option<Decoder>,
    /// All but the images, from the end on.
    rest: Option<Recording>,
    header: Header,
    calibration: Option<DepthCalibration>,
    background: Option<DepthImage>,
    side_cameras: Option<[SideCamera; 2]>,
    /// What the cameras at the sides saw at the time of the last image, as it arrived.
    sides: Option<EncodedSides>,
    images: DepthDecoder,
    piece: Vec<u8>,
    /// Images that have yet to be taken once the decoder is gone.
    waiting: VecDeque<super::depth::EncodedImage>,
    n_taken: u64,
    /// What is wrong after the images that wait.
    defect_ahead: Option<DecodeError>,
    defect: Option<DecodeError>,
}

impl<R: Read> DepthReader<R> {
    /// Reads a recording in MCAP up to its first depth image.
    ///
    /// # Errors
    /// The first defect; `empty_recording` when there is no depth image.
    pub fn open(reader: R, limits: &Limits) -> Result<Self, DecodeError> {
        let mut decoder = Decoder::new(Format::Mcap, limits, true);
        decoder.assembler.depth.queue = Some(VecDeque::new());
        let mut own = Self {
            reader,
            decoder: Some(decoder),
            rest: None,
            header: Header::default(),
            calibration: None,
            background: None,
            side_cameras: None,
            sides: None,
            images: DepthDecoder::default(),
            piece: vec![0; PIECE],
            waiting: VecDeque::new(),
            n_taken: 0,
            defect_ahead: None,
            defect: None,
        };
        own.read_until_image();
        if own.waiting.is_empty() {
            let sentence = "the recording has no depth image; send `/depth`";
            return Err(own.defect_ahead.unwrap_or_else(|| DecodeError::new("empty_recording", sentence)));
        }
        Ok(own)
    }

    /// What was recorded, with what, of whom.
    pub fn header(&self) -> &Header {
        &self.header
    }

    /// The camera, when it was described.
    pub fn calibration(&self) -> Option<&DepthCalibration> {
        self.calibration.as_ref()
    }

    /// The scene without the person, when there is such an image.
    pub fn background(&self) -> Option<&DepthImage> {
        self.background.as_ref()
    }

    /// The colour cameras at the sides, when they are described, labelled and began before the depth images.
    pub fn side_cameras(&self) -> Option<&[SideCamera; 2]> {
        self.side_cameras.as_ref()
    }

    /// What they saw at the time of the last image that was read; nothing when there is no image of both.
    ///
    /// # Errors
    /// `invalid_image`.
    pub fn side_images(&self) -> Result<Option<SideImages>, DecodeError> {
        let Some([left, right]) = &self.sides else { return Ok(None) };
        let decode = |side: usize, message: &[u8]| {
            png_image::colour(message).map_err(|defect| defect.at(format!("side.{}", SIDE_NAMES[side])))
        };
        Ok(Some([decode(0, left)?, decode(1, right)?]))
    }

    /// Reads the next image over another one and answers its time in nanoseconds; nothing at the end.
    ///
    /// # Errors
    /// The first defect of the recording up to that image; every later call answers the same one.
    pub fn next_into(&mut self, image: &mut DepthImage) -> Result<Option<i64>, DecodeError> {
        if let Some(defect) = &self.defect {
            return Err(defect.clone());
        }
        let result = self.take(image);
        if let Err(defect) = &result {
            self.defect = Some(defect.clone());
        }
        result
    }

    fn take(&mut self, image: &mut DepthImage) -> Result<Option<i64>, DecodeError> {
        self.read_until_image();
        let Some(next) = self.waiting.pop_front() else {
            return self.defect_ahead.take().map_or(Ok(None), Err);
        };
        let place = format!("depth[{}]", self.n_taken);
        self.images.decode_into(&next.message, image).map_err(|defect| defect.at(place))?;
        self.n_taken += 1;
        self.sides = next.sides;
        Ok(Some(next.time_ns))
    }

    /// Reads on until an image waits, to the end, or to the first defect.
    fn read_until_image(&mut self) {
        while self.waiting.is_empty()
            && let Some(mut decoder) = self.decoder.take()
        {
            let result = match self.reader.read(&mut self.piece) {
                Ok(0) => {
                    self.take_from(&mut decoder);
                    match decoder.finish() {
                        Ok(assembled) => self.rest = assembled.recording,
                        Err(defect) => self.defect_ahead = Some(defect),
                    }
                    return;
                }
                Ok(n) => decoder.push(&self.piece[..n]),
                Err(error) if error.kind() == ErrorKind::Interrupted => Ok(()),
                Err(error) => Err(DecodeError::new("unreadable", format!("the recording could not be read: {error}"))),
            };
            self.take_from(&mut decoder);
            match result {
                Ok(()) => self.decoder = Some(decoder),
                Err(defect) => self.defect_ahead = Some(defect),
            }
        }
    }

    /// Takes what the decoder has read: what came before the images once, and the images.
    fn take_from(&mut self, decoder: &mut Decoder) {
        let assembler = &mut decoder.assembler;
        let Some(queue) = &mut assembler.depth.queue else { return };
        if self.n_taken == 0 && !queue.is_empty() {
            self.header = assembler.header.as_ref().map(|(header, _)| header.clone()).unwrap_or_default();
            self.calibration = assembler.depth.calibration;
            self.background = assembler.depth.background.take();
            self.side_cameras = assembler.depth.sides.usable().cloned();
        }
        std::mem::swap(&mut self.waiting, queue);
    }

    /// Reads on to the end and answers all of the recording but its images: references, for example.
    ///
    /// # Errors
    /// The first defect.
    pub fn finish(mut self) -> Result<Recording, DecodeError> {
        let mut image = DepthImage::missing(0, 0, DepthUnit::Raw11);
        while self.next_into(&mut image)?.is_some() {}
        self.rest.ok_or_else(|| DecodeError::new("empty_recording", "the recording has no data"))
    }
}

impl<R: Read> Iterator for DepthReader<R> {
    type Item = Result<(i64, DepthImage), DecodeError>;

    fn next(&mut self) -> Option<Self::Item> {
        if self.defect.is_some() {
            // Told once; then the iteration ends.
            return None;
        }
        let mut image = DepthImage::missing(0, 0, DepthUnit::Raw11);
        self.next_into(&mut image).map(|time| time.map(|time| (time, image))).transpose()
    }
}
