//! Depth images in, one message at a time: every one is checked, none is kept.

use super::json_error::defect_in_json;
use super::limits::Limits;
use super::record::Channel;
use super::side::{EncodedSides, SideAssembler, SideTopic};
use super::topic::{declare_once, expect_encoding};
use crate::recording::DecodeError;
use crate::recording::depth::summary::DepthStatistics;
use crate::recording::depth::{DepthCalibration, DepthDecoder, DepthImage, DepthSummary, DepthUnit, ImageHeader};
use crate::recording::encode::DEPTH_ENCODING;
use std::collections::VecDeque;

/// What the messages of a depth topic are.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum DepthTopic {
    Image,
    Background,
    Calibration,
}

impl DepthTopic {
    /// The topic of a channel, if it is one of depth.
    ///
    /// # Errors
    /// `unsupported_encoding`.
    pub(super) fn of_channel(channel: &Channel<'_>) -> Result<Option<Self>, DecodeError> {
        let (topic, encoding) = match channel.topic {
            "/depth" => (DepthTopic::Image, DEPTH_ENCODING),
            "/depth/background" => (DepthTopic::Background, DEPTH_ENCODING),
            "/depth/calibration" => (DepthTopic::Calibration, "json"),
            _ => return Ok(None),
        };
        expect_encoding(channel, encoding)?;
        Ok(Some(topic))
    }
}

/// An image as it arrived.
pub(super) struct EncodedImage {
    pub(super) time_ns: i64,
    pub(super) message: Vec<u8>,
    /// What the cameras at the sides saw at its time, as it arrived.
    pub(super) sides: Option<EncodedSides>,
}

/// Checks depth images; hands them on, as they arrived, only when asked to.
pub(super) struct DepthAssembler {
    limits: Limits,
    pub(super) calibration: Option<DepthCalibration>,
    pub(super) background: Option<DepthImage>,
    /// The colour images, checked apart.
    pub(super) sides: SideAssembler,
    /// Images that a reader has yet to take; absent when nobody does. No longer than what one chunk holds.
    pub(super) queue: Option<VecDeque<EncodedImage>>,
    declared: Vec<DepthTopic>,
    decoder: DepthDecoder,
    image: DepthImage,
    shape: Option<(usize, usize, DepthUnit)>,
    statistics: DepthStatistics,
    n_frames: u64,
    n_bytes: u64,
    span_ns: [i64; 2],
}

impl DepthAssembler {
    pub(super) fn new(limits: Limits) -> Self {
        Self {
            limits,
            calibration: None,
            background: None,
            sides: SideAssembler::default(),
            queue: None,
            declared: Vec::new(),
            decoder: DepthDecoder::default(),
            image: DepthImage::missing(0, 0, DepthUnit::Raw11),
            shape: None,
            statistics: DepthStatistics::default(),
            n_frames: 0,
            n_bytes: 0,
            span_ns: [0; 2],
        }
    }

    pub(super) fn has_images(&self) -> bool {
        self.n_frames > 0
    }

    /// Time between the first and the last image, seconds.
    pub(super) fn duration_s(&self) -> f64 {
        self.span_ns[1].saturating_sub(self.span_ns[0]) as f64 * 1e-9
    }

    /// Takes a channel's topic.
    pub(super) fn declare(&mut self, topic: DepthTopic, name: &str) -> Result<(), DecodeError> {
        declare_once(&mut self.declared, topic, name)
    }

    /// Takes one message.
    pub(super) fn message(&mut self, topic: DepthTopic, log_time: u64, data: &[u8]) -> Result<(), DecodeError> {
        match topic {
            DepthTopic::Image => self.depth(log_time, data),
            DepthTopic::Background => {
                let place = "depth.background";
                self.check_place(self.background.is_some(), place)?;
                let header = ImageHeader::parse(data).map_err(|defect| defect.at(place))?;
                self.check_shape(&header).map_err(|defect| defect.at(place))?;
                let mut image = DepthImage::missing(0, 0, DepthUnit::Raw11);
                self.decoder.decode_into(data, &mut image).map_err(|defect| defect.at(place))?;
                self.background = Some(image);
                Ok(())
            }
            DepthTopic::Calibration => {
                let place = "depth.calibration";
                self.check_place(self.calibration.is_some(), place)?;
                let calibration: DepthCalibration =
                    serde_json::from_slice(data).map_err(|error| defect_in_json(data, &error, place))?;
                if let Some((field, sentence)) = calibration.defect() {
                    return Err(DecodeError::new("invalid_value", sentence).at(format!("{place}.{field}")));
                }
                self.calibration = Some(calibration);
                Ok(())
            }
        }
    }

    /// Takes one message of a camera at the side.
    pub(super) fn side_message(&mut self, topic: SideTopic, log_time: u64, data: &[u8]) -> Result<(), DecodeError> {
        if topic.comes_once() {
            self.check_place(self.sides.has(topic), &topic.place())?;
        }
        let n_bytes = self.sides.message(topic, log_time, data, &self.limits, self.queue.is_none())?;
        self.count_bytes(n_bytes, || topic.place())
    }

    fn count_bytes(&mut self, n_bytes: u64, place: impl FnOnce() -> String) -> Result<(), DecodeError> {
        self.n_bytes += n_bytes;
        if self.n_bytes <= self.limits.max_depth_bytes {
            return Ok(());
        }
        let sentence = format!(
            "the images hold more than {} bytes after decompression; split the recording",
            self.limits.max_depth_bytes
        );
        Err(DecodeError::new("decompression_limit", sentence).at(place()))
    }

    /// What comes once must come before the images, so that one pass is enough to use it.
    fn check_place(&self, is_second: bool, place: &str) -> Result<(), DecodeError> {
        let sentence = match (is_second, self.n_frames) {
            (false, 0) => return Ok(()),
            (true, _) => "this message came a second time; write it once",
            (false, _) => "this message came after the first depth image; write it before",
        };
        Err(DecodeError::new("misplaced_message", sentence).at(place))
    }

    fn check_shape(&mut self, header: &ImageHeader) -> Result<(), DecodeError> {
        let shape = (header.width, header.height, header.unit);
        let (width, height, unit) = *self.shape.get_or_insert(shape);
        if shape == (width, height, unit) {
            return Ok(());
        }
        let sentence = format!(
            "the image is {} × {} in {:?}, the one before it {width} × {height} in {unit:?}; one recording has one kind",
            header.width, header.height, header.unit
        );
        Err(DecodeError::new("depth_size", sentence))
    }

    fn depth(&mut self, log_time: u64, data: &[u8]) -> Result<(), DecodeError> {
        let place = format!("depth[{}]", self.n_frames);
        let time_ns = i64::try_from(log_time).map_err(|_| {
            let sentence = format!("the log time {log_time} is beyond 64 signed bits; is it in nanoseconds?");
            DecodeError::new("invalid_value", sentence).at(format!("{place}.time_ns"))
        })?;
        self.check_time(time_ns).map_err(|defect| defect.at(format!("{place}.time_ns")))?;
        let header = ImageHeader::parse(data).map_err(|defect| defect.at(place.as_str()))?;
        self.check_shape(&header).map_err(|defect| defect.at(place.as_str()))?;
        self.count_bytes(2 * (header.width * header.height) as u64, || place.clone())?;
        if self.n_frames == 0 {
            self.sides.settle()?;
        }
        let sides = self.sides.beside(time_ns);
        match &mut self.queue {
            // Whoever takes it from the queue decodes it, and finds what is wrong with it.
            Some(queue) => queue.push_back(EncodedImage { time_ns, message: data.to_owned(), sides }),
            None => {
                self.decoder.decode_into(data, &mut self.image).map_err(|defect| defect.at(place))?;
                self.statistics.add(time_ns, &self.image);
            }
        }
        if self.n_frames == 0 {
            self.span_ns[0] = time_ns;
        }
        self.span_ns[1] = time_ns;
        self.n_frames += 1;
        Ok(())
    }

    fn check_time(&self, time_ns: i64) -> Result<(), DecodeError> {
        if self.n_frames >= self.limits.max_frames {
            let sentence = format!("the recording has more than {} depth images; split it", self.limits.max_frames);
            return Err(DecodeError::new("too_many_frames", sentence));
        }
        let [first, last] = self.span_ns;
        if self.n_frames > 0 && time_ns <= last {
            let sentence = format!(
                "depth image {} at {time_ns} ns is not later than the one before it ({last} ns); drop repeated images \
                 and sort the others",
                self.n_frames
            );
            return Err(DecodeError::new("time_not_increasing", sentence));
        }
        if self.n_frames > 0 && time_ns.saturating_sub(first) / 1_000_000_000 > self.limits.max_duration_s as i64 {
            let sentence = format!(
                "the depth images span more than the {} s accepted; are the time stamps nanoseconds?",
                self.limits.max_duration_s
            );
            return Err(DecodeError::new("too_long", sentence));
        }
        Ok(())
    }

    /// Ends the images; nothing when there were none.
    pub(super) fn finish(&self) -> Result<Option<DepthSummary>, DecodeError> {
        match self.n_frames {
            0 => Ok(None),
            1 => {
                let sentence = "the recording has one depth image, at least two are needed to see a movement";
                Err(DecodeError::new("too_few_frames", sentence))
            }
            // Whoever takes the images from the queue has no use for a summary of none.
            _ if self.queue.is_some() => Ok(None),
            n => {
                let (has_calibration, has_background) = (self.calibration.is_some(), self.background.is_some());
                let mut summary =
                    self.statistics.summary(n, self.span_ns, &self.image, has_calibration, has_background);
                summary.side_cameras = self.sides.summary();
                summary.warnings.extend(self.sides.warning());
                Ok(Some(summary))
            }
        }
    }
}
