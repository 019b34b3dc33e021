//! Values in, recording out: everything that both formats check, one frame at a time.

use super::limits::{Format, Limits};
use super::message::{FrameMessage, List, Numbers};
use super::{IgnoredChannel, Inspection};
use crate::body::Joint;
use crate::recording::coordinates::{Coordinates, Handedness, Up};
use crate::recording::{DecodeError, Header, Recording, ReferenceSeries, SkeletonRecording};
use nalgebra::{Quaternion, UnitQuaternion, Vector3};
use std::collections::BTreeMap;

/// Farthest coordinate of a joint from the sensor, metres; nothing that sees bodies sees farther.
const MAX_COORDINATE_M: f64 = 100.0;

/// Accepted deviation of a quaternion's norm from one: numbers rounded to two decimals still pass.
const QUATERNION_TOLERANCE: f64 = 0.01;

/// Below this deviation a quaternion is kept bit for bit, so that a decoded recording encodes to the same bytes.
const QUATERNION_EXACT: f64 = 1e-9;

/// Accepted stature, metres.
const STATURE_M: std::ops::RangeInclusive<f64> = 0.5..=2.5;

/// Longest accepted free text of the header, characters.
const MAX_TEXT: usize = 64;

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
    header: Option<(Header, Coordinates)>,
    joints: Option<Vec<Joint>>,
    skeleton: SkeletonRecording,
    n_frames: u64,
    first_ns: i64,
    last_ns: i64,
    has_orientations: bool,
    references: Vec<Reference>,
    n_reference_samples: u64,
    ignored: BTreeMap<String, u64>,
}

struct Reference {
    series: ReferenceSeries,
    last_ns: Option<i64>,
}

impl Assembler {
    pub(super) fn new(limits: Limits, keep: bool) -> Self {
        Self {
            keep,
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
        let at = |field: &str| format!("frames[{index}].{field}");
        self.check_time(time_ns).map_err(|defect| defect.at(at("time_ns")))?;
        let (Some(joints), Some((_, coordinates))) = (&self.joints, &self.header) else {
            let sentence = "a skeleton frame came before the header and the joints were declared";
            return Err(DecodeError::new("missing_header", sentence).at(format!("frames[{index}]")));
        };
        let n = joints.len();
        check_count(frame.positions.count, joints, &at("positions"))?;
        if let Some(confidence) = &frame.confidence {
            check_count(confidence.count, joints, &at("confidence"))?;
        }
        if let Some(orientations) = &frame.orientations {
            check_count(orientations.count, joints, &at("orientations"))?;
        }
        if self.keep && frame.orientations.is_some() && self.skeleton.orientations.is_empty() {
            // Frames before the first one with orientations had none.
            self.skeleton.orientations.resize(self.skeleton.positions.len(), None);
        }
        let keeps_orientations = self.keep && (frame.orientations.is_some() || !self.skeleton.orientations.is_empty());
        for j in 0..n {
            let position = frame.positions.items[j];
            let given = frame.confidence.as_ref().map(|list| list.items[j]);
            let confidence = checked_confidence(given, &|| at(&format!("confidence[{j}]")))?;
            if let Some(Numbers(p)) = position {
                check_position(p, joints[j], &|| at(&format!("positions[{j}]")))?;
            }
            let raw = frame.orientations.as_ref().and_then(|list| list.items[j]);
            let orientation = match raw {
                Some(Numbers(q)) => checked_orientation(q, &|| at(&format!("orientations[{j}]")))?,
                None => None,
            };
            // Lost is lost: whichever way the client says so, the joint keeps nothing.
            let seen = position.filter(|_| confidence > 0.0);
            self.has_orientations |= seen.is_some() && orientation.is_some();
            if !self.keep {
                continue;
            }
            match seen {
                Some(Numbers(p)) => {
                    self.skeleton.positions.push(coordinates.world_from_declared(Vector3::from(p)));
                    self.skeleton.confidence.push(confidence);
                }
                None => {
                    self.skeleton.positions.push(Vector3::repeat(f64::NAN));
                    self.skeleton.confidence.push(0.0);
                }
            }
            if keeps_orientations {
                let orientation = orientation.filter(|_| seen.is_some());
                self.skeleton.orientations.push(orientation.map(|q| coordinates.world_from_joint(q)));
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
            0 => {
                let sentence = "the recording has no skeleton frame; record at least two and send them as `/skeleton`";
                return Err(DecodeError::new("empty_recording", sentence));
            }
            1 => {
                let sentence = "the recording has one skeleton frame, at least two are needed to see a movement";
                return Err(DecodeError::new("too_few_frames", sentence));
            }
            _ => {}
        }
        let inspection = Inspection {
            format,
            header: header.clone(),
            n_frames: self.n_frames,
            duration_s: (self.last_ns - self.first_ns) as f64 * 1e-9,
            joints: self.joints.unwrap_or_default(),
            has_orientations: self.has_orientations,
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
            skeleton: Some(self.skeleton),
            references: self.references.into_iter().map(|known| known.series).collect(),
        });
        Ok(Assembled { inspection, recording })
    }
}

/// The declared axes, or what is wrong with them.
pub(super) fn coordinates_from_names(
    handedness: &str,
    up: &str,
    length_unit: &str,
    place: &str,
) -> Result<Coordinates, DecodeError> {
    let refuse = |field: &str, found: &str, expected: &str| {
        let shown: String = found.chars().take(MAX_TEXT).collect();
        let sentence = format!("`{field}` is `{shown}`, expected {expected}");
        Err(DecodeError::new("invalid_value", sentence).at(format!("{place}.{field}")))
    };
    let Some(handedness) = Handedness::from_name(handedness) else {
        return refuse("handedness", handedness, "`right` or `left`");
    };
    let Some(up) = Up::from_name(up) else {
        return refuse("up", up, "one of `+x`, `-x`, `+y`, `-y`, `+z`, `-z`");
    };
    if length_unit != "m" {
        return refuse("length_unit", length_unit, "`m`: convert the positions to metres");
    }
    Ok(Coordinates { handedness, up })
}

fn check_count(count: usize, joints: &[Joint], place: &str) -> Result<(), DecodeError> {
    if count == joints.len() {
        return Ok(());
    }
    let sentence = format!(
        "found {count} entries for {} joints; write one entry for each joint, null for a lost one",
        joints.len()
    );
    Err(DecodeError::new("joint_count_mismatch", sentence).at(place))
}

fn check_position(p: [f64; 3], joint: Joint, place: &dyn Fn() -> String) -> Result<(), DecodeError> {
    if p.iter().all(|c| c.abs() <= MAX_COORDINATE_M) {
        return Ok(());
    }
    let [x, y, z] = p;
    let sentence = format!(
        "joint `{joint}` is at ({x}, {y}, {z}); coordinates are metres and stay within {MAX_COORDINATE_M} of the sensor"
    );
    Err(DecodeError::new("position_out_of_range", sentence).at(place()))
}

fn checked_confidence(given: Option<f32>, place: &dyn Fn() -> String) -> Result<f32, DecodeError> {
    match given {
        None => Ok(1.0),
        Some(c) if (0.0..=1.0).contains(&c) => Ok(c),
        Some(c) => {
            let sentence = format!("the confidence is {c}, expected 0 (lost) to 1");
            Err(DecodeError::new("confidence_out_of_range", sentence).at(place()))
        }
    }
}

/// The rotation, or nothing for four zeros, which is how Kinect writes "none".
fn checked_orientation(q: [f64; 4], place: &dyn Fn() -> String) -> Result<Option<UnitQuaternion<f64>>, DecodeError> {
    if q == [0.0; 4] {
        return Ok(None);
    }
    let quaternion = Quaternion::new(q[0], q[1], q[2], q[3]);
    let deviation = (quaternion.norm() - 1.0).abs();
    if deviation.is_nan() || deviation > QUATERNION_TOLERANCE {
        let sentence = format!(
            "the quaternion's norm is {}, expected 1 ± {QUATERNION_TOLERANCE}; write w, x, y, z, or null where there is none",
            quaternion.norm()
        );
        return Err(DecodeError::new("bad_quaternion", sentence).at(place()));
    }
    Ok(Some(if deviation < QUATERNION_EXACT {
        UnitQuaternion::new_unchecked(quaternion)
    } else {
        UnitQuaternion::new_normalize(quaternion)
    }))
}
