//! Values in, recording out: everything that both formats check, one frame at a time.

use super::checks::{MAX_TEXT, check_counts, check_segment_lengths, checked_sample};
use super::depth::DepthAssembler;
use super::inertial::InertialAssembler;
use super::limits::{Format, Limits};
use super::message::{FrameMessage, List};
use super::{IgnoredChannel, Inspection};
use crate::body::Joint;
use crate::recording::coordinates::Coordinates;
use crate::recording::{DecodeError, Header, Recording, ReferenceSeries, SkeletonRecording};
use nalgebra::Vector3;
use std::collections::BTreeMap;

/// Accepted stature, metres.
const STATURE_M: std::ops::RangeInclusive<f64> = 0.5..=2.5;

/// Result of a whole upload.
pub(super) struct Assembled {
    pub(super) inspection: Inspection,
    /// Present when frames were kept.
    pub(super) recording: Option<Recording>,
}

/// Checks and converts what a decoder reads; keeps it only when asked to.
pub(super) struct Assembler {
    keep: bool,
    limits: Limits,
    pub(super) header: Option<(Header, Coordinates)>,
    joints: Option<Vec<Joint>>,
    skeleton: SkeletonRecording,
    n_frames: u64,
    first_ns: i64,
    last_ns: i64,
    has_orientations: bool,
    references: Vec<Reference>,
    n_reference_samples: u64,
    ignored: BTreeMap<String, u64>,
    /// The inertial units, checked apart.
    pub(super) inertial: InertialAssembler,
    /// The depth images, checked apart.
    pub(super) depth: DepthAssembler,
}

struct Reference {
    series: ReferenceSeries,
    last_ns: Option<i64>,
}

impl Assembler {
    pub(super) fn new(limits: Limits, keep: bool) -> Self {
        Self {
            keep,
            inertial: InertialAssembler::new(limits.clone(), keep),
            depth: DepthAssembler::new(limits.clone()),
            limits,
            header: None,
            joints: None,
            skeleton: SkeletonRecording::default(),
            n_frames: 0,
            first_ns: 0,
            last_ns: 0,
            has_orientations: false,
            references: Vec::new(),
            n_reference_samples: 0,
            ignored: BTreeMap::new(),
        }
    }

    pub(super) fn limits(&self) -> &Limits {
        &self.limits
    }

    pub(super) fn has_header(&self) -> bool {
        self.header.is_some()
    }

    /// Takes the description of the recording; `place` names the object that holds the header's fields.
    pub(super) fn declare(&mut self, header: Header, coordinates: Coordinates, place: &str) -> Result<(), DecodeError> {
        let texts = [
            ("protocol", &header.protocol),
            ("device_model", &header.device.model),
            ("device_middleware", &header.device.middleware),
        ];
        for (name, text) in texts {
            let length = text.as_deref().map_or(0, |text| text.chars().count());
            if length > MAX_TEXT {
                let sentence = format!("`{name}` has {length} characters, at most {MAX_TEXT} are accepted; shorten it");
                return Err(DecodeError::new("invalid_value", sentence).at(format!("{place}.{name}")));
            }
        }
        if let Some(stature) = header.subject_height_m.filter(|stature| !STATURE_M.contains(stature)) {
            let sentence = format!("the subject's height is {stature}, expected metres between 0.5 and 2.5");
            return Err(DecodeError::new("invalid_value", sentence).at(format!("{place}.subject_height_m")));
        }
        check_segment_lengths(&header.segment_lengths_m).map_err(|(name, sentence)| {
            let shown: String = name.chars().take(MAX_TEXT).collect();
            DecodeError::new("invalid_value", sentence).at(format!("{place}.segment_lengths_m.{shown}"))
        })?;
        self.header = Some((header, coordinates));
        Ok(())
    }

    /// Takes the joints of every frame, by name.
    pub(super) fn skeleton_channel<'a>(
        &mut self,
        names: impl IntoIterator<Item = &'a str>,
        place: &str,
    ) -> Result<(), DecodeError> {
        if self.joints.is_some() {
            let sentence = "there is a second skeleton channel; write all joints of one person into one channel";
            return Err(DecodeError::new("duplicate_channel", sentence).at(place));
        }
        let mut joints = Vec::new();
        for (i, name) in names.into_iter().enumerate() {
            let place = format!("{place}[{i}]");
            let joint: Joint = name.parse().map_err(|_| {
                let shown: String = name.chars().take(MAX_TEXT).collect();
                let sentence = format!("`{shown}` is not a joint name; the page on the recording format lists them");
                DecodeError::new("unknown_joint", sentence).at(place.as_str())
            })?;
            if joints.contains(&joint) {
                let sentence = format!("joint `{joint}` is named twice; name every joint once");
                return Err(DecodeError::new("duplicate_joint", sentence).at(place));
            }
            joints.push(joint);
        }
        if joints.is_empty() {
            let sentence = "the list of joints is empty; name the joints in the order of the positions";
            return Err(DecodeError::new("invalid_value", sentence).at(place));
        }
        self.skeleton.joints.clone_from(&joints);
        self.joints = Some(joints);
        Ok(())
    }

    /// Number of skeleton frames so far, which is the index of the next one.
    pub(super) fn n_frames(&self) -> u64 {
        self.n_frames
    }

    /// Takes one skeleton frame.
    pub(super) fn frame(&mut self, time_ns: i64, frame: &FrameMessage) -> Result<(), DecodeError> {
        let index = self.n_frames;
        self.check_time(time_ns).map_err(|defect| defect.at(format!("frames[{index}].time_ns")))?;
        let (Some(joints), Some((_, coordinates))) = (&self.joints, &self.header) else {
            let sentence = "a skeleton frame came before the header and the joints were declared";
            return Err(DecodeError::new("missing_header", sentence).at(format!("frames[{index}]")));
        };
        check_counts(frame, joints, index)?;
        if self.keep && frame.orientations.is_some() && self.skeleton.orientations.is_empty() {
            // Frames before the first one with orientations had none.
            self.skeleton.orientations.resize(self.skeleton.positions.len(), None);
        }
        let keeps_orientations = self.keep && (frame.orientations.is_some() || !self.skeleton.orientations.is_empty());
        for (j, &joint) in joints.iter().enumerate() {
            let sample = checked_sample(frame, j, joint, index)?;
            self.has_orientations |= sample.orientation.is_some();
            if !self.keep {
                continue;
            }
            let position = sample.position.map_or(Vector3::repeat(f64::NAN), |p| coordinates.world_from_declared(p));
            self.skeleton.positions.push(position);
            self.skeleton.confidence.push(sample.confidence);
            if keeps_orientations {
                self.skeleton.orientations.push(sample.orientation.map(|q| coordinates.world_from_joint(q)));
            }
        }
        if self.keep {
            self.skeleton.time_ns.push(time_ns);
        }
        if index == 0 {
            self.first_ns = time_ns;
        }
        self.last_ns = time_ns;
        self.n_frames += 1;
        Ok(())
    }

    fn check_time(&self, time_ns: i64) -> Result<(), DecodeError> {
        if self.n_frames >= self.limits.max_frames {
            let sentence = format!(
                "the recording has more than {} frames; split it into several recordings",
                self.limits.max_frames
            );
            return Err(DecodeError::new("too_many_frames", sentence));
        }
        if self.n_frames == 0 {
            return Ok(());
        }
        let step = i128::from(time_ns) - i128::from(self.last_ns);
        if step <= 0 {
            let what = if step == 0 { "repeats the time of" } else { "is earlier than" };
            let sentence = format!(
                "frame {} at {time_ns} ns {what} the frame before it ({} ns); time stamps must increase, \
                 so drop repeated frames and sort the others",
                self.n_frames, self.last_ns
            );
            return Err(DecodeError::new("time_not_increasing", sentence));
        }
        let duration = i128::from(time_ns) - i128::from(self.first_ns);
        if duration > i128::from(self.limits.max_duration_s) * 1_000_000_000 {
            let sentence = format!(
                "the frames span {} s, more than the {} s accepted; are the time stamps nanoseconds?",
                duration / 1_000_000_000,
                self.limits.max_duration_s
            );
            return Err(DecodeError::new("too_long", sentence));
        }
        Ok(())
    }

    /// Declares a reference channel and answers its number.
    pub(super) fn reference_channel(
        &mut self,
        channel: &str,
        source: &str,
        clock_offset_ns: i64,
        place: &str,
    ) -> Result<usize, DecodeError> {
        let is_name = |c: char| c.is_ascii_lowercase() || c.is_ascii_digit() || c == '_';
        if channel.is_empty() || channel.len() > MAX_TEXT || !channel.chars().all(is_name) {
            let shown: String = channel.chars().take(MAX_TEXT).collect();
            let sentence = format!(
                "`{shown}` is not a reference channel's name: at most {MAX_TEXT} of a-z, 0-9 and _, its unit last, \
                 for example `right_knee_flexion_deg`"
            );
            return Err(DecodeError::new("invalid_value", sentence).at(place));
        }
        if source.chars().count() > MAX_TEXT {
            let sentence = format!("the reference's source has more than {MAX_TEXT} characters; shorten it");
            return Err(DecodeError::new("invalid_value", sentence).at(place));
        }
        if self.references.iter().any(|known| known.series.channel == channel) {
            let sentence = format!("reference channel `{channel}` is declared twice; use one channel for a series");
            return Err(DecodeError::new("duplicate_channel", sentence).at(place));
        }
        if self.references.len() >= self.limits.max_channels {
            let sentence = format!("there are more than {} channels", self.limits.max_channels);
            return Err(DecodeError::new("too_many_channels", sentence).at(place));
        }
        let series = ReferenceSeries {
            channel: channel.to_owned(),
            source: source.to_owned(),
            clock_offset_ns,
            ..ReferenceSeries::default()
        };
        self.references.push(Reference { series, last_ns: None });
        Ok(self.references.len() - 1)
    }

    /// Takes samples of reference channel `number`; `place` is the path of the object that holds the two lists.
    pub(super) fn reference_batch<const MAX: usize>(
        &mut self,
        number: usize,
        time_ns: List<i64, MAX>,
        values: List<Option<f64>, MAX>,
        place: &str,
    ) -> Result<(), DecodeError> {
        if time_ns.count != values.count {
            let sentence = format!(
                "the batch has {} time stamps and {} values; write one value (or null) for each time stamp",
                time_ns.count, values.count
            );
            return Err(DecodeError::new("invalid_value", sentence).at(place));
        }
        self.n_reference_samples += time_ns.count as u64;
        if time_ns.count > MAX || self.n_reference_samples > self.limits.max_reference_samples {
            let sentence = format!(
                "too many reference samples: at most {MAX} in one batch and {} in a recording",
                self.limits.max_reference_samples
            );
            return Err(DecodeError::new("too_many_samples", sentence).at(place));
        }
        let reference = &mut self.references[number];
        for (i, &time) in time_ns.items.iter().enumerate() {
            if reference.last_ns.is_some_and(|last| time <= last) {
                let sentence = format!("reference sample at {time} ns is not later than the one before it; sort them");
                return Err(DecodeError::new("time_not_increasing", sentence).at(format!("{place}.time_ns[{i}]")));
            }
            reference.last_ns = Some(time);
        }
        if self.keep {
            reference.series.time_ns.extend(time_ns.items);
            reference.series.values.extend(values.items.into_iter().map(|value| value.unwrap_or(f64::NAN)));
        }
        Ok(())
    }

    /// Counts a message of a topic that is reserved or private and therefore not read.
    pub(super) fn ignore(&mut self, topic: &str) {
        match self.ignored.get_mut(topic) {
            Some(count) => *count += 1,
            None => {
                self.ignored.insert(topic.to_owned(), 1);
            }
        }
    }

    /// Ends the recording.
    pub(super) fn finish(mut self, format: Format) -> Result<Assembled, DecodeError> {
        let Some((header, _)) = self.header else {
            let sentence = "the recording has no header; write the `surefoot` metadata before the first message";
            return Err(DecodeError::new("missing_header", sentence));
        };
        match self.n_frames {
            0 if !self.inertial.has_samples() && !self.depth.has_images() => {
                let sentence = "the recording has neither a skeleton frame nor an inertial sample nor a depth image; send \
                                `/skeleton`, `/inertial/…` or `/depth`";
                return Err(DecodeError::new("empty_recording", sentence));
            }
            1 => {
                let sentence = "the recording has one skeleton frame, at least two are needed to see a movement";
                return Err(DecodeError::new("too_few_frames", sentence));
            }
            _ => {}
        }
        let (inertial_units, inertial) = self.inertial.finish()?;
        let has_skeleton = self.n_frames > 0;
        let depth = self.depth.finish()?;
        let unit_durations_s = inertial_units.iter().map(|unit| unit.duration_s);
        let longest_s = unit_durations_s.fold(self.depth.duration_s(), f64::max);
        let inspection = Inspection {
            format,
            header: header.clone(),
            n_frames: self.n_frames,
            duration_s: if has_skeleton { (self.last_ns - self.first_ns) as f64 * 1e-9 } else { longest_s },
            joints: self.joints.filter(|_| has_skeleton).unwrap_or_default(),
            has_orientations: self.has_orientations,
            inertial_units,
            depth,
            reference_channels: self.references.iter().map(|known| known.series.channel.clone()).collect(),
            ignored_channels: self
                .ignored
                .into_iter()
                .map(|(topic, n_messages)| IgnoredChannel { topic, n_messages })
                .collect(),
        };
        if !self.has_orientations {
            self.skeleton.orientations.clear();
        }
        let recording = self.keep.then(|| Recording {
            header,
            skeleton: has_skeleton.then_some(self.skeleton),
            inertial,
            references: self.references.into_iter().map(|known| known.series).collect(),
        });
        Ok(Assembled { inspection, recording })
    }
}
