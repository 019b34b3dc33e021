//! Topics of an MCAP recording: what a channel's name and metadata declare.

use super::assembler::Assembler;
use super::depth::DepthTopic;
use super::inertial::Declaration;
use super::record::Channel;
use super::side::SideTopic;
use crate::recording::DecodeError;
use std::collections::BTreeMap;

/// Longest accepted topic, bytes.
const MAX_TOPIC: usize = 128;

/// What a channel's messages are.
pub(super) enum Topic {
    Skeleton,
    Reference { number: usize, n_batches: u64 },
    Inertial { number: usize, n_batches: u64 },
    Depth(DepthTopic),
    Side(SideTopic),
    Ignored(String),
}

/// The topic of a channel, declared to the assembler.
pub(super) fn topic(channel: &Channel<'_>, assembler: &mut Assembler) -> Result<Topic, DecodeError> {
    let name = channel.topic;
    let place = format!("channel {}", channel.id);
    if name.len() > MAX_TOPIC {
        let sentence = format!("a topic has {} bytes, at most {MAX_TOPIC} are accepted", name.len());
        return Err(DecodeError::new("unknown_topic", sentence).at(place));
    }
    if let Some(topic) = DepthTopic::of_channel(channel)? {
        assembler.depth.declare(topic, name)?;
        return Ok(Topic::Depth(topic));
    }
    if let Some(topic) = SideTopic::of_channel(channel)? {
        assembler.depth.sides.declare(topic, name)?;
        return Ok(Topic::Side(topic));
    }
    if name.starts_with("/x/") {
        return Ok(Topic::Ignored(name.to_owned()));
    }
    let reference = name.strip_prefix("/reference/");
    let segment = name.strip_prefix("/inertial/");
    if name != "/skeleton" && reference.is_none() && segment.is_none() {
        let sentence = format!("topic `{name}` is not part of the format; put your own topics under `/x/`");
        return Err(DecodeError::new("unknown_topic", sentence).at(place));
    }
    expect_encoding(channel, "json")?;
    if let Some(segment) = segment {
        let declaration = declaration(segment, channel)?;
        return Ok(Topic::Inertial { number: assembler.inertial.declare(declaration, name)?, n_batches: 0 });
    }
    let Some(reference) = reference else {
        let names = required(&channel.metadata, "joints", name)?;
        assembler.skeleton_channel(names.split(',').map(str::trim), "joints")?;
        return Ok(Topic::Skeleton);
    };
    let source = required(&channel.metadata, "source", name)?;
    let number = assembler.reference_channel(reference, source, clock_offset_ns(channel)?, name)?;
    Ok(Topic::Reference { number, n_batches: 0 })
}

/// Refuses a channel whose messages are not encoded as its topic's are.
pub(super) fn expect_encoding(channel: &Channel<'_>, encoding: &str) -> Result<(), DecodeError> {
    if channel.message_encoding == encoding {
        return Ok(());
    }
    let found: String = channel.message_encoding.chars().take(32).collect();
    let sentence = format!("messages of `{}` are encoded as `{found}`, expected `{encoding}`", channel.topic);
    Err(DecodeError::new("unsupported_encoding", sentence).at(channel.topic))
}

/// Notes that a topic has a channel, and refuses a second one.
pub(super) fn declare_once<T: PartialEq>(declared: &mut Vec<T>, topic: T, name: &str) -> Result<(), DecodeError> {
    if declared.contains(&topic) {
        let sentence = format!("there is a second channel `{name}`; write the messages of one topic into one");
        return Err(DecodeError::new("duplicate_channel", sentence).at(name));
    }
    declared.push(topic);
    Ok(())
}

fn declaration(segment: &str, channel: &Channel<'_>) -> Result<Declaration, DecodeError> {
    let text = |key: &str| channel.metadata.get(key).map(|text| (*text).to_owned());
    let rate = |text: &&str| {
        text.parse().map_err(|_| {
            let sentence = "`nominal_rate_hz` is not a number of samples per second";
            DecodeError::new("invalid_value", sentence).at(format!("{}.nominal_rate_hz", channel.topic))
        })
    };
    Ok(Declaration {
        segment: segment.to_owned(),
        device_model: text("device_model"),
        mounting: text("mounting"),
        nominal_rate_hz: channel.metadata.get("nominal_rate_hz").map(rate).transpose()?,
        clock_offset_ns: clock_offset_ns(channel)?,
    })
}

fn clock_offset_ns(channel: &Channel<'_>) -> Result<i64, DecodeError> {
    channel.metadata.get("clock_offset_ns").map_or(Ok(0), |text| {
        text.parse().map_err(|_| {
            let sentence = "`clock_offset_ns` is not a whole number of nanoseconds";
            DecodeError::new("invalid_value", sentence).at(format!("{}.clock_offset_ns", channel.topic))
        })
    })
}

/// A required key of a metadata map; `place` names the map.
pub(super) fn required<'a>(
    metadata: &BTreeMap<&'a str, &'a str>,
    key: &str,
    place: &str,
) -> Result<&'a str, DecodeError> {
    metadata.get(key).copied().ok_or_else(|| {
        let sentence = format!("`{key}` is missing; see the page on the recording format");
        DecodeError::new("missing_field", sentence).at(format!("{place}.{key}"))
    })
}
