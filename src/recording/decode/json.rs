//! A JSON recording: kept as text up to the limit, then read twice.
//!
//! The first reading finds what the frames need (axes, joints), wherever in the document it stands, and proves the
//! syntax; the second feeds the frames one by one to the assembler, so that no tree of values is ever built.

use super::assembler::Assembler;
use super::checks::coordinates_from_names;
use super::json_error::defect_in_json;
use super::limits::BYTE_ORDER_MARK;
use super::message::{FrameMessage, InertialMessage, Preamble, ReferenceMessage};
use crate::recording::DecodeError;
use serde::Deserialize;
use serde::de::{DeserializeSeed, Deserializer, Error, IgnoredAny, MapAccess, SeqAccess, Visitor};
use std::fmt;

/// The only version of the format.
const VERSION: u64 = 1;

#[derive(Default)]
pub(super) struct JsonDecoder {
    text: Vec<u8>,
}

impl JsonDecoder {
    pub(super) fn push(&mut self, bytes: &[u8], assembler: &Assembler) -> Result<(), DecodeError> {
        let limit = assembler.limits().max_json_bytes;
        if self.text.len() + bytes.len() > limit {
            let sentence = format!(
                "the JSON recording is larger than the {limit} bytes accepted; send it as MCAP, which is read as it arrives"
            );
            return Err(DecodeError::new("too_large", sentence).at(format!("byte {limit}")));
        }
        self.text.extend_from_slice(bytes);
        Ok(())
    }

    pub(super) fn finish(self, assembler: &mut Assembler) -> Result<(), DecodeError> {
        let text = self.text.strip_prefix(BYTE_ORDER_MARK).unwrap_or(&self.text);
        if text.iter().all(u8::is_ascii_whitespace) {
            return Err(DecodeError::new("empty_recording", "the upload has no bytes; send the recording as its body"));
        }
        let preamble: Preamble = serde_json::from_slice(text).map_err(|error| defect_in_json(text, &error, ""))?;
        if preamble.format != "surefoot" {
            let found: String = preamble.format.chars().take(64).collect();
            let sentence = format!("`format` is `{found}`, expected `surefoot`");
            return Err(DecodeError::new("wrong_profile", sentence).at("format"));
        }
        if preamble.version != VERSION {
            let sentence = format!("`version` is {}, this service reads version {VERSION}", preamble.version);
            return Err(DecodeError::new("unsupported_version", sentence).at("version"));
        }
        let declared = &preamble.coordinates;
        let coordinates =
            coordinates_from_names(&declared.handedness, &declared.up, &declared.length_unit, "coordinates")?;
        assembler.declare(preamble.header, coordinates, "header")?;
        match (&preamble.joints, &preamble.frames) {
            (Some(joints), Some(_)) => {
                if joints.count > joints.items.len() {
                    let sentence =
                        format!("there are {} joints, more than any sensor names; name every joint once", joints.count);
                    return Err(DecodeError::new("duplicate_joint", sentence).at("joints"));
                }
                assembler.skeleton_channel(joints.items.iter().map(String::as_str), "joints")?;
            }
            (None, None) => {}
            (joints, _) => {
                let (absent, present) = if joints.is_none() { ("joints", "frames") } else { ("frames", "joints") };
                let sentence = format!("`{absent}` is missing beside `{present}`; a skeleton needs both");
                return Err(DecodeError::new("missing_field", sentence).at(absent));
            }
        }

        let mut body = Body { assembler, defect: None };
        let mut parser = serde_json::Deserializer::from_slice(text);
        let result = parser.deserialize_map(&mut body);
        match (body.defect, result) {
            (Some(defect), _) => Err(defect),
            (None, Err(error)) => Err(defect_in_json(text, &error, "")),
            (None, Ok(())) => Ok(()),
        }
    }
}

/// Second reading; a defect found by the assembler is kept aside, since a parser's error holds only words.
struct Body<'a> {
    assembler: &'a mut Assembler,
    defect: Option<DecodeError>,
}

impl Body<'_> {
    fn check<E: Error>(&mut self, result: Result<(), DecodeError>) -> Result<(), E> {
        result.map_err(|defect| {
            let words = E::custom(&defect);
            self.defect = Some(defect);
            words
        })
    }
}

impl<'de> Visitor<'de> for &mut Body<'_> {
    type Value = ();

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("a recording")
    }

    fn visit_map<A: MapAccess<'de>>(self, mut map: A) -> Result<(), A::Error> {
        while let Some(key) = map.next_key::<std::borrow::Cow<'de, str>>()? {
            match key.as_ref() {
                "frames" => map.next_value_seed(Elements { body: self, take: take_frame })?,
                "references" => map.next_value_seed(Elements { body: self, take: take_reference })?,
                "inertial" => map.next_value_seed(Elements { body: self, take: take_unit })?,
                _ => {
                    map.next_value::<IgnoredAny>()?;
                }
            }
        }
        Ok(())
    }
}

fn take_frame(assembler: &mut Assembler, frame: FrameMessage, _index: usize) -> Result<(), DecodeError> {
    match frame.time_ns {
        Some(time_ns) => assembler.frame(time_ns, &frame),
        None => {
            let place = format!("frames[{}]", assembler.n_frames());
            let sentence = "the frame has no `time_ns`; give every frame its time in nanoseconds";
            Err(DecodeError::new("missing_field", sentence).at(place))
        }
    }
}

fn take_reference(assembler: &mut Assembler, reference: ReferenceMessage, index: usize) -> Result<(), DecodeError> {
    let place = format!("references[{index}]");
    let ReferenceMessage { channel, source, clock_offset_ns, time_ns, values } = reference;
    let number = assembler.reference_channel(&channel, &source, clock_offset_ns, &place)?;
    assembler.reference_batch(number, time_ns, values, &place)
}

fn take_unit(assembler: &mut Assembler, unit: InertialMessage, index: usize) -> Result<(), DecodeError> {
    let place = format!("inertial[{index}]");
    let (declaration, samples) = unit.into_parts();
    let number = assembler.inertial.declare(declaration, &place)?;
    assembler.inertial.batch(number, samples, &place)
}

/// The elements of a list, or null for none, each handed to the assembler with its index.
struct Elements<'a, 'b, T> {
    body: &'a mut Body<'b>,
    take: fn(&mut Assembler, T, usize) -> Result<(), DecodeError>,
}

impl<'de, T: Deserialize<'de>> DeserializeSeed<'de> for Elements<'_, '_, T> {
    type Value = ();

    fn deserialize<D: Deserializer<'de>>(self, deserializer: D) -> Result<(), D::Error> {
        deserializer.deserialize_option(self)
    }
}

impl<'de, T: Deserialize<'de>> Visitor<'de> for Elements<'_, '_, T> {
    type Value = ();

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("a list")
    }

    fn visit_none<E: Error>(self) -> Result<(), E> {
        Ok(())
    }

    fn visit_some<D: Deserializer<'de>>(self, deserializer: D) -> Result<(), D::Error> {
        deserializer.deserialize_seq(self)
    }

    fn visit_seq<A: SeqAccess<'de>>(self, mut list: A) -> Result<(), A::Error> {
        let mut index = 0;
        while let Some(element) = list.next_element::<T>()? {
            let result = (self.take)(self.body.assembler, element, index);
            self.body.check(result)?;
            index += 1;
        }
        Ok(())
    }
}
