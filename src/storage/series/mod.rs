//! Series of an assessment, in compressed chunks.
//!
//! A chunk holds [`CHUNK_SAMPLES`] samples of one channel: value, low, high and flags, each coded by itself (see
//! `codec`). A read of a time range decodes only the chunks that it touches, and of those only the parts that were
//! asked for; one question to the database brings all channels.

pub(super) mod codec;
mod decimation;

use super::database::{self, Row, Transaction, dialects};
use super::{Access, AssessmentId, StorageError, Store};
use crate::assessment::{Assessment, Series};
use std::ops::Range;
use tokio::task::spawn_blocking;

/// Samples in one chunk of one channel.
pub const CHUNK_SAMPLES: usize = 4096;

/// Which parts of each sample are wanted beside its value.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Parts {
    /// Both ends of the credible interval.
    pub interval: bool,
    /// The flag bits.
    pub flags: bool,
}

/// Which samples of an assessment are wanted; the default is all of all channels.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct SeriesQuery {
    /// Channels by name, answered in this order; `None` for all, in the assessment's order.
    pub channels: Option<Vec<String>>,
    /// Earliest sample, nanoseconds on the recording's clock.
    pub from_ns: Option<i64>,
    /// Latest sample, nanoseconds on the recording's clock, itself included.
    pub to_ns: Option<i64>,
    /// Parts beside the value; those not wanted stay empty in the answer.
    pub parts: Parts,
    /// Most samples in the answer. More are thinned out to real samples that stand on one time axis for all channels:
    /// the first, the last, and each channel's extremes are kept as far as the number allows, and of each stretch
    /// between them the sample that stands out most.
    pub max_points: Option<usize>,
}

impl Default for SeriesQuery {
    fn default() -> Self {
        Self {
            channels: None,
            from_ns: None,
            to_ns: None,
            parts: Parts { interval: true, flags: true },
            max_points: None,
        }
    }
}

/// Samples of some channels on one time axis.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct SeriesSlice {
    /// Time of each sample, nanoseconds on the recording's clock.
    pub time_ns: Vec<i64>,
    /// The channels that were asked for; parts that were not asked for are empty.
    pub series: Vec<Series>,
    /// Samples in the time range, before any were thinned out.
    pub n_in_range: usize,
}

/// The chunks of one assessment, ready to be inserted. Coding costs milliseconds of computation, so it is done before
/// the transaction that writes them.
#[derive(Debug)]
pub(crate) struct EncodedSeries {
    time: Vec<codec::TimeChunk>,
    /// Channel-major.
    series: Vec<(i64, i64, codec::SeriesChunk)>,
}

impl EncodedSeries {
    /// Codes every series of an assessment.
    pub(crate) fn encode(assessment: &Assessment) -> Result<Self, StorageError> {
        let n = assessment.time_ns.len();
        if !assessment.time_ns.is_sorted_by(|a, b| a < b) {
            return Err(StorageError::Corrupt("the times of an assessment do not increase".into()));
        }
        let mut encoder = codec::Encoder::new()?;
        let mut series = Vec::new();
        for (channel, one) in assessment.series.iter().enumerate() {
            if [one.value.len(), one.low.len(), one.high.len(), one.flags.len()] != [n; 4] {
                return Err(StorageError::Corrupt(format!("the series `{}` is not as long as its time", one.channel)));
            }
            for (chunk, range) in chunk_ranges(n).enumerate() {
                series.push((channel as i64, chunk as i64, encoder.encode_series(one, range)?));
            }
        }
        let time = chunk_ranges(n).map(|range| encoder.encode_time(&assessment.time_ns[range]));
        Ok(Self { time: time.collect::<Result<_, _>>()?, series })
    }
}

fn chunk_ranges(n: usize) -> impl Iterator<Item = Range<usize>> {
    (0..n).step_by(CHUNK_SAMPLES).map(move |start| start..n.min(start + CHUNK_SAMPLES))
}

/// Inserts the chunks inside the caller's transaction.
pub(super) async fn insert(
    connection: &mut Transaction,
    id: AssessmentId,
    encoded: &EncodedSeries,
) -> Result<(), StorageError> {
    for (chunk, time) in encoded.time.iter().enumerate() {
        database::query(
            "INSERT INTO time_chunks (assessment_id, chunk, n_samples, first_ns, last_ns, time)
             VALUES ($1, $2, $3, $4, $5, $6)",
        )
        .bind(id)
        .bind(chunk as i64)
        .bind(time.n_samples as i64)
        .bind(time.first_ns)
        .bind(time.last_ns)
        .bind(&time.bytes)
        .execute(&mut *connection)
        .await?;
    }
    for (channel, chunk, series) in &encoded.series {
        database::query(
            "INSERT INTO series_chunks
                 (assessment_id, channel, chunk, value_min, value_max, value, low, high, flags)
             VALUES ($1, $2, $3, $4, $5, $6, $7, $8, $9)",
        )
        .bind(id)
        .bind(channel)
        .bind(chunk)
        .bind(series.value_range.map(|(min, _)| min))
        .bind(series.value_range.map(|(_, max)| max))
        .bind(&series.value)
        .bind(&series.low)
        .bind(&series.high)
        .bind(&series.flags)
        .execute(&mut *connection)
        .await?;
    }
    Ok(())
}

impl Store {
    /// Samples of an assessment within the caller's reach.
    ///
    /// # Errors
    /// `NotFound` for an unknown assessment (`assessment`) or channel (`channel`); `Corrupt` when stored chunks are
    /// damaged.
    pub async fn series_of_assessment(
        &self,
        access: &Access,
        id: AssessmentId,
        query: &SeriesQuery,
    ) -> Result<SeriesSlice, StorageError> {
        let known = self.channels_of_assessment(access, id).await?;
        let wanted = match &query.channels {
            None => (0..known.len()).collect(),
            Some(names) => names
                .iter()
                .map(|name| known.iter().position(|k| k == name).ok_or(StorageError::not_found("channel")))
                .collect::<Result<Vec<_>, _>>()?,
        };
        let time_rows = database::query(
            "SELECT chunk, n_samples, time FROM time_chunks
             WHERE assessment_id = $1 AND ($2 IS NULL OR last_ns >= $2) AND ($3 IS NULL OR first_ns <= $3)
             ORDER BY chunk",
        )
        .bind(id)
        .bind(query.from_ns)
        .bind(query.to_ns)
        .fetch_all(self.reader())
        .await?;
        let first_chunk = time_rows.first().map(|row| row.try_get::<i64>("chunk")).transpose()?;
        let last_chunk = time_rows.last().map(|row| row.try_get::<i64>("chunk")).transpose()?;
        let list = serde_json::to_string(&wanted).map_err(|error| StorageError::Corrupt(error.to_string()))?;
        macro_rules! chunks_of {
            ($channels:literal) => {
                concat!(
                    "SELECT channel, chunk, value_min, value_max, value,
                            CASE WHEN $5 THEN low END AS low, CASE WHEN $5 THEN high END AS high,
                            CASE WHEN $6 THEN flags END AS flags
                     FROM series_chunks
                     WHERE assessment_id = $1 AND channel IN (",
                    $channels,
                    ") AND chunk BETWEEN $3 AND $4
                     ORDER BY channel, chunk"
                )
            };
        }
        let series_rows = database::query(dialects! {
            sqlite: chunks_of!("SELECT value FROM json_each($2)"),
            postgres: chunks_of!("SELECT value::bigint FROM json_array_elements_text($2::json)"),
        })
        .bind(id)
        .bind(list)
        .bind(first_chunk.unwrap_or(0))
        .bind(last_chunk.unwrap_or(-1))
        .bind(query.parts.interval)
        .bind(query.parts.flags)
        .fetch_all(self.reader())
        .await?;
        let names: Vec<(usize, String)> = wanted.into_iter().map(|i| (i, known[i].clone())).collect();
        let query = query.clone();
        spawn_blocking(move || slice_from_rows(&names, &time_rows, &series_rows, &query))
            .await
            .map_err(|panic| StorageError::Corrupt(format!("decoding series failed: {panic}")))?
    }
}

/// The channel that is being put together, and how far.
struct Assembly {
    series: Series,
    value_range: Option<(f64, f64)>,
}

fn slice_from_rows(
    names: &[(usize, String)],
    time_rows: &[Row],
    series_rows: &[Row],
    query: &SeriesQuery,
) -> Result<SeriesSlice, StorageError> {
    let mut decoder = codec::Decoder::new()?;
    let mut lengths = Vec::with_capacity(time_rows.len());
    let mut time_ns = Vec::with_capacity(time_rows.len() * CHUNK_SAMPLES);
    for row in time_rows {
        let n = usize::try_from(row.try_get::<i64>("n_samples")?).unwrap_or(usize::MAX);
        decoder.decode_time(row.try_get("time")?, n, &mut time_ns)?;
        lengths.push(n);
    }
    let first = query.from_ns.map_or(0, |from| time_ns.partition_point(|t| *t < from));
    let last = query.to_ns.map_or(time_ns.len(), |to| time_ns.partition_point(|t| *t <= to));
    let range = first..last.max(first);

    let first_chunk: i64 = time_rows.first().map(|row| row.try_get("chunk")).transpose()?.unwrap_or(0);
    let mut channels = Vec::with_capacity(names.len());
    for (number, name) in names {
        // Rows come ordered by channel; a channel that is asked for twice is decoded twice.
        let start = series_rows.partition_point(|row| channel_of(row) < *number as i64);
        let end = series_rows.partition_point(|row| channel_of(row) <= *number as i64);
        let rows = &series_rows[start..end];
        if rows.len() != lengths.len() {
            return Err(StorageError::Corrupt(format!("channel `{name}` lacks chunks")));
        }
        let mut one = Assembly { series: Series { channel: name.clone(), ..empty() }, value_range: None };
        for (i, (row, n)) in rows.iter().zip(&lengths).enumerate() {
            if row.try_get::<i64>("chunk")? != first_chunk + i as i64 {
                return Err(StorageError::Corrupt(format!("channel `{name}` lacks a chunk")));
            }
            one.append(row, *n, query.parts, &mut decoder)?;
        }
        channels.push(one);
    }

    let mut slice = SeriesSlice { n_in_range: range.len(), ..SeriesSlice::default() };
    let thinned = match query.max_points {
        Some(most) if most < range.len() => {
            let columns: Vec<decimation::Column<'_>> = channels
                .iter()
                .map(|c| decimation::Column { values: &c.series.value[range.clone()], value_range: c.value_range })
                .collect();
            let chosen = decimation::choose(range.len(), &columns, most);
            Some(chosen.into_iter().map(|i| range.start + i).collect::<Vec<_>>())
        }
        _ => None,
    };
    slice.time_ns = select(time_ns, &range, thinned.as_deref());
    for Assembly { series, .. } in channels {
        let pick = |part: Vec<f32>| if part.is_empty() { part } else { select(part, &range, thinned.as_deref()) };
        slice.series.push(Series {
            channel: series.channel,
            value: select(series.value, &range, thinned.as_deref()),
            low: pick(series.low),
            high: pick(series.high),
            flags: if query.parts.flags { select(series.flags, &range, thinned.as_deref()) } else { Vec::new() },
        });
    }
    Ok(slice)
}

impl Assembly {
    fn append(&mut self, row: &Row, n: usize, parts: Parts, decoder: &mut codec::Decoder) -> Result<(), StorageError> {
        decoder.decode_f32(row.try_get("value")?, n, &mut self.series.value)?;
        if parts.interval {
            decoder.decode_f32(row.try_get("low")?, n, &mut self.series.low)?;
            decoder.decode_f32(row.try_get("high")?, n, &mut self.series.high)?;
        }
        if parts.flags {
            decoder.decode_u8(row.try_get("flags")?, n, &mut self.series.flags)?;
        }
        let range: (Option<f64>, Option<f64>) = (row.try_get("value_min")?, row.try_get("value_max")?);
        if let (Some(min), Some(max)) = range {
            let (low, high) = self.value_range.unwrap_or((min, max));
            self.value_range = Some((low.min(min), high.max(max)));
        }
        Ok(())
    }
}

fn channel_of(row: &Row) -> i64 {
    // A missing column cannot be: the question names it. -1 would be caught as a channel that lacks chunks.
    row.try_get("channel").unwrap_or(-1)
}

fn empty() -> Series {
    Series::empty("", 0)
}

/// The samples at `chosen`, or all of `range`.
fn select<T: Copy>(mut all: Vec<T>, range: &Range<usize>, chosen: Option<&[usize]>) -> Vec<T> {
    match chosen {
        Some(chosen) => chosen.iter().map(|&i| all[i]).collect(),
        None => {
            all.truncate(range.end);
            all.drain(..range.start);
            all
        }
    }
}

#[cfg(test)]
mod tests;
