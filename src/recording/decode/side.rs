//! Colour images of the cameras at the sides in, one message at a time: every one is checked, the newest of each is kept.
//!
//! What belongs to a depth image is the newest image of each camera before it in the file, when it is of the same time.

use super::json_error::defect_in_json;
use super::limits::Limits;
use super::record::Channel;
use super::topic::{declare_once, expect_encoding};
use crate::recording::DecodeError;
use crate::recording::depth::{DepthWarning, DepthWarningKind};
use crate::recording::side_camera::png_image::{self, Pixels};
use crate::recording::side_camera::{SIDE_NAMES, SideCalibration, SideCamera, SideCameraSummary};
use std::sync::Arc;

/// How far apart images of one time may be, nanoseconds: cameras of 30 images a second that nothing synchronises are up
/// to half of 33 ms apart.
const SAME_TIME_NS: u64 = 20_000_000;

/// What the messages of a topic of a side are.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Content {
    Image,
    Calibration,
    Labels,
}

/// A topic of the left (0) or right (1) camera.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct SideTopic {
    side: usize,
    content: Content,
}

impl SideTopic {
    /// The topic of a channel, if it is one of a camera at the side.
    ///
    /// # Errors
    /// `unsupported_encoding`.
    pub(super) fn of_channel(channel: &Channel<'_>) -> Result<Option<Self>, DecodeError> {
        let named = |(side, name): (usize, &&str)| {
            let (content, encoding) = match channel.topic.strip_prefix("/side/")?.strip_prefix(*name)? {
                "" => (Content::Image, "png"),
                "/calibration" => (Content::Calibration, "json"),
                "/labels" => (Content::Labels, "png"),
                _ => return None,
            };
            Some((Self { side, content }, encoding))
        };
        let Some((topic, encoding)) = SIDE_NAMES.iter().enumerate().find_map(named) else { return Ok(None) };
        expect_encoding(channel, encoding)?;
        Ok(Some(topic))
    }

    /// True of what is said once, before the first depth image.
    pub(super) fn comes_once(self) -> bool {
        self.content != Content::Image
    }

    pub(super) fn place(self) -> String {
        let field = match self.content {
            Content::Image => "",
            Content::Calibration => ".calibration",
            Content::Labels => ".labels",
        };
        format!("side.{}{field}", SIDE_NAMES[self.side])
    }
}

/// Images of both cameras as they arrived.
pub(super) type EncodedSides = [Arc<[u8]>; 2];

/// One of the cameras, as far as it is known.
#[derive(Default)]
struct Camera {
    calibration: Option<SideCalibration>,
    /// Width and height of the labelled image, and its labels.
    labels: Option<([usize; 2], Vec<u8>)>,
    size: Option<[usize; 2]>,
    first: Option<Arc<[u8]>>,
    newest: Option<(u64, Arc<[u8]>)>,
    n_images: u64,
}

/// Checks the colour images.
#[derive(Default)]
pub(super) struct SideAssembler {
    declared: Vec<SideTopic>,
    cameras: [Camera; 2],
    /// Both cameras, when all of them was there before the first depth image.
    usable: Option<Box<[SideCamera; 2]>>,
    n_paired: u64,
}

impl SideAssembler {
    /// Takes a channel's topic.
    pub(super) fn declare(&mut self, topic: SideTopic, name: &str) -> Result<(), DecodeError> {
        declare_once(&mut self.declared, topic, name)
    }

    /// Whether what comes once has come.
    pub(super) fn has(&self, topic: SideTopic) -> bool {
        let camera = &self.cameras[topic.side];
        match topic.content {
            Content::Image => camera.n_images > 0,
            Content::Calibration => camera.calibration.is_some(),
            Content::Labels => camera.labels.is_some(),
        }
    }

    /// Takes one message and answers how many bytes it holds after decompression. Images that somebody will decode later are
    /// looked at only as far as their size.
    pub(super) fn message(
        &mut self,
        topic: SideTopic,
        log_time: u64,
        data: &[u8],
        limits: &Limits,
        decodes: bool,
    ) -> Result<u64, DecodeError> {
        let camera = &mut self.cameras[topic.side];
        match topic.content {
            Content::Image => camera.image(log_time, data, limits, decodes),
            Content::Labels => png_image::labels(data).map(|labels| {
                let n_bytes = labels.1.len() as u64;
                camera.labels = Some(labels);
                n_bytes
            }),
            Content::Calibration => {
                let place = topic.place();
                let calibration: SideCalibration =
                    serde_json::from_slice(data).map_err(|error| defect_in_json(data, &error, &place))?;
                if let Some((field, sentence)) = calibration.defect() {
                    return Err(DecodeError::new("invalid_value", sentence).at(format!("{place}.{field}")));
                }
                camera.calibration = Some(calibration);
                return Ok(0);
            }
        }
        .map_err(|defect| defect.at(topic.place()))
    }

    /// The first depth image comes: what is there now is what the cameras are.
    ///
    /// # Errors
    /// `invalid_image` when labels are not of the first image.
    pub(super) fn settle(&mut self) -> Result<(), DecodeError> {
        let [left, right] = &self.cameras;
        if let (Some(left), Some(right)) = (left.settled(0)?, right.settled(1)?) {
            self.usable = Some(Box::new([left, right]));
        }
        Ok(())
    }

    /// Both cameras, when they can be used.
    pub(super) fn usable(&self) -> Option<&[SideCamera; 2]> {
        self.usable.as_deref()
    }

    /// What both cameras saw at the time of a depth image that comes now.
    pub(super) fn beside(&mut self, time_ns: i64) -> Option<EncodedSides> {
        let time = u64::try_from(time_ns).ok()?;
        let newest = |camera: &Camera| {
            let (own, image) = camera.newest.as_ref()?;
            (own.abs_diff(time) <= SAME_TIME_NS).then(|| image.clone())
        };
        let [left, right] = self.cameras.each_ref().map(newest);
        let sides = [left?, right?];
        self.n_paired += 1;
        Some(sides)
    }

    /// What came; nothing when nothing did.
    pub(super) fn summary(&self) -> Option<SideCameraSummary> {
        let n_images = self.cameras.each_ref().map(|camera| camera.n_images);
        let summary = SideCameraSummary { n_images, n_paired: self.n_paired, is_usable: self.usable.is_some() };
        (!self.declared.is_empty()).then_some(summary)
    }

    /// Why cameras of which something came cannot be used.
    pub(super) fn warning(&self) -> Option<DepthWarning> {
        if self.declared.is_empty() || self.usable.is_some() {
            return None;
        }
        let mut missing = Vec::new();
        for (camera, name) in self.cameras.iter().zip(SIDE_NAMES) {
            let parts = [(camera.first.is_none(), ""), (camera.calibration.is_none(), "/calibration")];
            for (is_missing, part) in parts.into_iter().chain([(camera.labels.is_none(), "/labels")]) {
                if is_missing {
                    missing.push(format!("`/side/{name}{part}`"));
                }
            }
        }
        let sentence = if missing.is_empty() {
            "the colour images cannot be used: their first ones came after the first depth image".to_owned()
        } else {
            format!("the colour images cannot be used without {}", missing.join(", "))
        };
        Some(DepthWarning { kind: DepthWarningKind::SideCameras, sentence })
    }
}

impl Camera {
    fn image(&mut self, log_time: u64, data: &[u8], limits: &Limits, decodes: bool) -> Result<u64, DecodeError> {
        if self.n_images >= limits.max_frames {
            let sentence = format!("the camera has more than {} images; split the recording", limits.max_frames);
            return Err(DecodeError::new("too_many_frames", sentence));
        }
        if let Some((last, _)) = &self.newest
            && log_time <= *last
        {
            let sentence = format!(
                "image {} at {log_time} ns is not later than the one before it ({last} ns); drop repeated images and \
                 sort the others",
                self.n_images
            );
            return Err(DecodeError::new("time_not_increasing", sentence));
        }
        let found = png_image::size(data, Pixels::Colour)?;
        let size = *self.size.get_or_insert(found);
        if found != size {
            let [[width, height], [before, above]] = [found, size];
            let sentence = format!("the image is {width} × {height}, the ones before it {before} × {above}");
            return Err(DecodeError::new("invalid_image", sentence));
        }
        if decodes {
            png_image::colour(data)?;
        }
        let image: Arc<[u8]> = data.into();
        self.first.get_or_insert_with(|| image.clone());
        self.newest = Some((log_time, image));
        self.n_images += 1;
        Ok((3 * size[0] * size[1]) as u64)
    }

    fn settled(&self, side: usize) -> Result<Option<SideCamera>, DecodeError> {
        let (Some(calibration), Some((size, labels)), Some(first)) = (&self.calibration, &self.labels, &self.first)
        else {
            return Ok(None);
        };
        let place = |field: &str| format!("side.{}{field}", SIDE_NAMES[side]);
        let first = png_image::colour(first).map_err(|defect| defect.at(place("")))?;
        if *size != [first.width, first.height] {
            let sentence = "the labels are not of the size of the camera's images";
            return Err(DecodeError::new("invalid_image", sentence).at(place(".labels")));
        }
        Ok(Some(SideCamera {
            intrinsics: calibration.intrinsics(),
            camera_from_sensor: calibration.camera_from_sensor(),
            first,
            labels: labels.clone(),
        }))
    }
}
