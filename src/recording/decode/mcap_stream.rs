//! An MCAP recording, read record by record as its bytes arrive.

use super::assembler::Assembler;
use super::checks::coordinates_from_names;
use super::chunk::{self, Opener};
use super::json_error::defect_in_json;
use super::limits::Limits;
use super::message::{BatchMessage, FrameMessage, InertialBatchMessage};
use super::record::{Channel, Chunk, Fields, Malformed, Message, Statistics, opcode};
use super::topic::{Topic, required, topic};
use crate::recording::{DecodeError, Device, Header};
use mcap::McapError;
use mcap::sans_io::linear_reader::{LinearReadEvent, LinearReader, LinearReaderOptions};
use std::collections::{BTreeMap, HashMap};

/// Name of the metadata record, and of the profile, that make an MCAP file a recording.
const PROFILE: &str = "surefoot";

pub(super) struct McapDecoder {
    container: LinearReader,
    /// Bytes handed to the container so far.
    n_bytes: u64,
    content: Content,
}

impl McapDecoder {
    pub(super) fn new(limits: &Limits) -> Self {
        let options = LinearReaderOptions::default()
            .with_emit_chunks(true)
            .with_validate_data_section_crc(true)
            .with_validate_summary_section_crc(true)
            .with_check_finishes_after_end_magic(true)
            .with_record_length_limit(limits.max_chunk_bytes);
        Self { container: LinearReader::new_with_options(options), n_bytes: 0, content: Content::default() }
    }

    pub(super) fn push(&mut self, mut bytes: &[u8], assembler: &mut Assembler) -> Result<(), DecodeError> {
        while let Some(event) = self.container.next_event() {
            match event {
                Ok(LinearReadEvent::ReadRequest(wanted)) => {
                    if bytes.is_empty() {
                        return Ok(());
                    }
                    let (taken, rest) = bytes.split_at(wanted.min(bytes.len()));
                    self.container.insert(taken.len()).copy_from_slice(taken);
                    self.container.notify_read(taken.len());
                    self.n_bytes += taken.len() as u64;
                    bytes = rest;
                }
                Ok(LinearReadEvent::Record { data, opcode }) => {
                    let at = self.n_bytes;
                    self.content.record(opcode, data, assembler).map_err(|defect| place_by_byte(defect, at))?;
                }
                Err(error) => return Err(self.container_defect(error)),
            }
        }
        Ok(())
    }

    pub(super) fn finish(mut self, _assembler: &mut Assembler) -> Result<(), DecodeError> {
        if self.n_bytes == 0 {
            return Err(DecodeError::new("empty_recording", "the upload has no bytes; send the recording as its body"));
        }
        self.container.notify_read(0);
        match self.container.next_event() {
            None => self.content.check_statistics(),
            Some(Err(error)) => Err(self.container_defect(error)),
            Some(Ok(_)) => Err(self.container_defect(McapError::UnexpectedEof)),
        }
    }

    fn container_defect(&self, error: McapError) -> DecodeError {
        let (code, sentence) = match error {
            McapError::BadMagic if !self.content.has_profile => {
                ("not_a_recording", "the upload does not begin like an MCAP file; send MCAP or JSON".to_owned())
            }
            McapError::UnexpectedEof => (
                "truncated",
                format!("the file ends after {} bytes, before its end mark; send the whole file again", self.n_bytes),
            ),
            McapError::BadDataCrc { .. } | McapError::BadSummaryCrc { .. } => {
                ("checksum_mismatch", format!("{error}: the bytes changed on the way; send the recording again"))
            }
            McapError::RecordTooLarge { len, .. } | McapError::ChunkTooLarge(len) => (
                "record_too_large",
                format!(
                    "a record of {len} bytes is larger than accepted; write smaller chunks, or the file is damaged"
                ),
            ),
            other => ("invalid_mcap", format!("this is not a valid MCAP file: {other}; write it with an MCAP library")),
        };
        DecodeError::new(code, sentence).at(format!("byte {}", self.n_bytes))
    }
}

/// A defect without a field path is placed by the bytes read so far.
fn place_by_byte(defect: DecodeError, at: u64) -> DecodeError {
    if defect.place.is_some() { defect } else { defect.at(format!("byte {at}")) }
}

/// Everything read from the records so far.
#[derive(Default)]
struct Content {
    has_profile: bool,
    opener: Opener,
    channels: HashMap<u16, (Vec<u8>, Topic)>,
    n_decompressed: u64,
    n_messages: u64,
    n_chunks: u32,
    in_summary: bool,
    statistics: Option<Statistics>,
}

impl Content {
    fn record(&mut self, opcode: u8, data: &[u8], assembler: &mut Assembler) -> Result<(), DecodeError> {
        if !self.has_profile {
            return self.header(opcode, data);
        }
        if self.in_summary {
            // The summary repeats channels and indexes; only its counts say something new.
            if opcode == opcode::STATISTICS {
                self.statistics = Some(Statistics::parse(data).map_err(malformed)?);
            }
            return Ok(());
        }
        match opcode {
            opcode::CHUNK => self.chunk(data, assembler),
            opcode::METADATA => metadata(data, assembler),
            opcode::DATA_END => {
                self.in_summary = true;
                Ok(())
            }
            _ => self.record_of_data(opcode, data, assembler),
        }
    }

    fn header(&mut self, opcode: u8, data: &[u8]) -> Result<(), DecodeError> {
        if opcode != opcode::HEADER {
            let sentence = "the first record is not the MCAP header; write the file with an MCAP library";
            return Err(DecodeError::new("invalid_mcap", sentence));
        }
        let profile = Fields::new(data).text().map_err(malformed)?;
        if profile != PROFILE {
            let found: String = profile.chars().take(64).collect();
            let sentence =
                format!("the MCAP profile is `{found}`, expected `{PROFILE}`; set it when you start the writer");
            return Err(DecodeError::new("wrong_profile", sentence));
        }
        self.has_profile = true;
        Ok(())
    }

    fn chunk(&mut self, data: &[u8], assembler: &mut Assembler) -> Result<(), DecodeError> {
        let chunk = Chunk::parse(data).map_err(malformed)?;
        // Taken out, so that its memory and the rest of this can be used at the same time.
        let mut opener = std::mem::take(&mut self.opener);
        let result = self.chunk_records(opener.open(&chunk, assembler.limits().max_chunk_bytes)?, assembler);
        self.opener = opener;
        result
    }

    fn chunk_records(&mut self, content: &[u8], assembler: &mut Assembler) -> Result<(), DecodeError> {
        self.n_chunks += 1;
        self.n_decompressed += content.len() as u64;
        let limit = assembler.limits().max_decompressed_bytes;
        if self.n_decompressed > limit {
            let sentence = format!("the chunks hold more than {limit} bytes after decompression; split the recording");
            return Err(DecodeError::new("decompression_limit", sentence));
        }
        let mut records = Fields::new(content);
        while let Some(record) = chunk::next_record(&mut records) {
            let (opcode, data) = record.map_err(malformed)?;
            self.record_of_data(opcode, data, assembler)?;
        }
        Ok(())
    }

    fn record_of_data(&mut self, opcode: u8, data: &[u8], assembler: &mut Assembler) -> Result<(), DecodeError> {
        match opcode {
            opcode::CHANNEL => self.channel(data, assembler),
            opcode::MESSAGE => self.message(data, assembler),
            // Schemas are for other readers; indexes, attachments and unknown records say nothing of the movement.
            _ => Ok(()),
        }
    }

    fn channel(&mut self, data: &[u8], assembler: &mut Assembler) -> Result<(), DecodeError> {
        let channel = Channel::parse(data).map_err(malformed)?;
        if let Some((known, _)) = self.channels.get(&channel.id) {
            // A writer may repeat a channel in every chunk, but not change it.
            if known == data {
                return Ok(());
            }
            let sentence = format!("channel {} is declared twice, differently", channel.id);
            return Err(DecodeError::new("duplicate_channel", sentence));
        }
        if self.channels.len() >= assembler.limits().max_channels || data.len() > 64 * 1024 {
            let sentence =
                format!("there are more than {} channels, or one of more than 64 KiB", assembler.limits().max_channels);
            return Err(DecodeError::new("too_many_channels", sentence));
        }
        let topic = topic(&channel, assembler)?;
        self.channels.insert(channel.id, (data.to_owned(), topic));
        Ok(())
    }

    fn message(&mut self, data: &[u8], assembler: &mut Assembler) -> Result<(), DecodeError> {
        let message = Message::parse(data).map_err(malformed)?;
        self.n_messages += 1;
        if !assembler.has_header() {
            let sentence = "a message came before the metadata record `surefoot`; write the metadata first";
            return Err(DecodeError::new("missing_header", sentence));
        }
        let Some((_, topic)) = self.channels.get_mut(&message.channel) else {
            let sentence =
                format!("a message belongs to channel {}, which was not declared before it", message.channel);
            return Err(DecodeError::new("invalid_mcap", sentence));
        };
        match topic {
            Topic::Skeleton => skeleton_message(&message, assembler),
            Topic::Reference { number, n_batches } => {
                let place = format!("references[{number}].batches[{n_batches}]");
                *n_batches += 1;
                let batch: BatchMessage = serde_json::from_slice(message.data)
                    .map_err(|error| defect_in_json(message.data, &error, &place))?;
                assembler.reference_batch(*number, batch.time_ns, batch.values, &place)
            }
            Topic::Inertial { number, n_batches } => {
                let place = format!("inertial[{number}].batches[{n_batches}]");
                *n_batches += 1;
                let batch: InertialBatchMessage = serde_json::from_slice(message.data)
                    .map_err(|error| defect_in_json(message.data, &error, &place))?;
                assembler.inertial.batch(*number, batch.into_samples(), &place)
            }
            Topic::Depth(topic) => assembler.depth.message(*topic, message.log_time, message.data),
            Topic::Side(topic) => assembler.depth.side_message(*topic, message.log_time, message.data),
            Topic::Ignored(topic) => {
                assembler.ignore(topic);
                Ok(())
            }
        }
    }

    /// A record that was lost without a trace in the framing shows in the writer's own counts.
    fn check_statistics(&self) -> Result<(), DecodeError> {
        let Some(statistics) = &self.statistics else { return Ok(()) };
        let found = Statistics { messages: self.n_messages, chunks: self.n_chunks };
        if *statistics == found {
            return Ok(());
        }
        let sentence = format!(
            "the summary counts {} messages in {} chunks, {} in {} were found: the bytes changed on the way; \
             send the recording again",
            statistics.messages, statistics.chunks, found.messages, found.chunks
        );
        Err(DecodeError::new("checksum_mismatch", sentence))
    }
}

fn malformed(_: Malformed) -> DecodeError {
    let sentence = "a record is shorter than its fields say, or its text is not UTF-8; write it with an MCAP library";
    DecodeError::new("invalid_mcap", sentence)
}

fn skeleton_message(message: &Message<'_>, assembler: &mut Assembler) -> Result<(), DecodeError> {
    let place = format!("frames[{}]", assembler.n_frames());
    let frame: FrameMessage =
        serde_json::from_slice(message.data).map_err(|error| defect_in_json(message.data, &error, &place))?;
    if frame.time_ns.is_some() {
        let sentence = "`time_ns` does not belong into an MCAP message; its time is the message's `log_time`";
        return Err(DecodeError::new("unknown_field", sentence).at(format!("{place}.time_ns")));
    }
    let time_ns = i64::try_from(message.log_time).map_err(|_| {
        let sentence = format!("the log time {} is beyond 64 signed bits; is it in nanoseconds?", message.log_time);
        DecodeError::new("invalid_value", sentence).at(format!("{place}.time_ns"))
    })?;
    assembler.frame(time_ns, &frame)
}

fn metadata(data: &[u8], assembler: &mut Assembler) -> Result<(), DecodeError> {
    let mut fields = Fields::new(data);
    if fields.text().map_err(malformed)? != PROFILE {
        // Other metadata is the client's own.
        return Ok(());
    }
    if assembler.has_header() {
        let sentence = "there are two metadata records `surefoot`; write one";
        return Err(DecodeError::new("invalid_mcap", sentence).at("header"));
    }
    let map = fields.map().map_err(malformed)?;
    let version = required(&map, "version", "header")?;
    if version != "1" {
        let found: String = version.chars().take(16).collect();
        let sentence = format!("the recording has version `{found}`, this service reads version `1`");
        return Err(DecodeError::new("unsupported_version", sentence).at("header.version"));
    }
    let [handedness, up, length_unit] = [
        required(&map, "handedness", "header")?,
        required(&map, "up", "header")?,
        required(&map, "length_unit", "header")?,
    ];
    let coordinates = coordinates_from_names(handedness, up, length_unit, "header")?;
    let text = |key: &str| map.get(key).map(|text| (*text).to_owned());
    let subject_height_m = map.get("subject_height_m").map(|text| stature(text)).transpose()?;
    let start_time = map.get("start_time").map(|text| start_time(text)).transpose()?;
    let header = Header {
        protocol: text("protocol"),
        device: Device { model: text("device_model"), middleware: text("device_middleware") },
        subject_height_m,
        segment_lengths_m: map
            .get("segment_lengths_m")
            .map(|text| segment_lengths(text))
            .transpose()?
            .unwrap_or_default(),
        start_time,
    };
    assembler.declare(header, coordinates, "header")
}

fn stature(text: &str) -> Result<f64, DecodeError> {
    text.parse().map_err(|_| {
        let sentence = "`subject_height_m` is not a number; write metres, for example `1.75`";
        DecodeError::new("invalid_value", sentence).at("header.subject_height_m")
    })
}

fn segment_lengths(text: &str) -> Result<BTreeMap<String, f64>, DecodeError> {
    serde_json::from_str(text).map_err(|_| {
        let sentence =
            "`segment_lengths_m` is no JSON object of numbers; write metres, for example `{\"left_thigh\": 0.42}`";
        DecodeError::new("invalid_value", sentence).at("header.segment_lengths_m")
    })
}

fn start_time(text: &str) -> Result<time::OffsetDateTime, DecodeError> {
    time::OffsetDateTime::parse(text, &time::format_description::well_known::Rfc3339).map_err(|_| {
        let sentence = "`start_time` is not an RFC 3339 time; write for example `2026-03-01T09:30:00Z`";
        DecodeError::new("invalid_value", sentence).at("header.start_time")
    })
}
