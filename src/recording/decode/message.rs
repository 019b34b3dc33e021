//! The JSON values inside a recording, bounded in memory, before their meaning is checked.

use super::inertial::{Declaration, Samples};
use serde::de::{Deserializer, Error, IgnoredAny, SeqAccess, Visitor};
use serde::{Deserialize, Serialize};
use std::fmt;
use std::marker::PhantomData;

/// Entries of a per-joint list that are kept; no vocabulary has more joints.
const MAX_JOINTS: usize = 64;

/// Samples of a reference batch that are kept; more is refused.
pub(super) const MAX_BATCH: usize = 1_000_000;

/// Skeleton frame as written: the JSON of an MCAP message, or an element of `frames` in a JSON recording.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct FrameMessage {
    /// Only in JSON recordings; MCAP messages carry their time in `log_time`.
    #[serde(default)]
    pub(super) time_ns: Option<i64>,
    pub(super) positions: List<Option<Numbers<3>>, MAX_JOINTS>,
    #[serde(default)]
    pub(super) confidence: Option<List<f32, MAX_JOINTS>>,
    #[serde(default)]
    pub(super) orientations: Option<List<Option<Numbers<4>>, MAX_JOINTS>>,
}

/// Batch of reference samples as written in an MCAP message.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct BatchMessage {
    pub(super) time_ns: List<i64, MAX_BATCH>,
    pub(super) values: List<Option<f64>, MAX_BATCH>,
}

/// Element of `references` in a JSON recording.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct ReferenceMessage {
    pub(super) channel: String,
    pub(super) source: String,
    #[serde(default)]
    pub(super) clock_offset_ns: i64,
    pub(super) time_ns: List<i64, MAX_BATCH>,
    pub(super) values: List<Option<f64>, MAX_BATCH>,
}

/// Batch of inertial samples as written in an MCAP message.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct InertialBatchMessage {
    time_ns: List<i64, MAX_BATCH>,
    acceleration: List<Numbers<3>, MAX_BATCH>,
    angular_rate: List<Numbers<3>, MAX_BATCH>,
    #[serde(default)]
    magnetic_field: Option<List<Numbers<3>, MAX_BATCH>>,
}

impl InertialBatchMessage {
    pub(super) fn into_samples(self) -> Samples<MAX_BATCH> {
        let Self { time_ns, acceleration, angular_rate, magnetic_field } = self;
        Samples { time_ns, acceleration, angular_rate, magnetic_field }
    }
}

/// Element of `inertial` in a JSON recording.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct InertialMessage {
    segment: String,
    #[serde(default)]
    device_model: Option<String>,
    #[serde(default)]
    mounting: Option<String>,
    #[serde(default)]
    nominal_rate_hz: Option<f64>,
    #[serde(default)]
    clock_offset_ns: i64,
    time_ns: List<i64, MAX_BATCH>,
    acceleration: List<Numbers<3>, MAX_BATCH>,
    angular_rate: List<Numbers<3>, MAX_BATCH>,
    #[serde(default)]
    magnetic_field: Option<List<Numbers<3>, MAX_BATCH>>,
}

impl InertialMessage {
    pub(super) fn into_parts(self) -> (Declaration, Samples<MAX_BATCH>) {
        let Self { segment, device_model, mounting, nominal_rate_hz, clock_offset_ns, .. } = self;
        let Self { time_ns, acceleration, angular_rate, magnetic_field, .. } = self;
        (
            Declaration { segment, device_model, mounting, nominal_rate_hz, clock_offset_ns },
            Samples { time_ns, acceleration, angular_rate, magnetic_field },
        )
    }
}

/// `coordinates` of a JSON recording.
#[derive(Debug, Default, Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
pub(super) struct CoordinatesMessage {
    pub(super) handedness: String,
    pub(super) up: String,
    pub(super) length_unit: String,
}

/// Part of a JSON recording that must be known before its frames can be checked, in whatever order it was written.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Preamble {
    pub(super) format: String,
    pub(super) version: u64,
    pub(super) coordinates: CoordinatesMessage,
    #[serde(default)]
    pub(super) header: crate::recording::Header,
    #[serde(default)]
    pub(super) joints: Option<List<String, MAX_JOINTS>>,
    #[serde(default)]
    pub(super) frames: Option<IgnoredAny>,
    #[serde(default, rename = "inertial")]
    pub(super) _inertial: Option<IgnoredAny>,
    #[serde(default, rename = "references")]
    pub(super) _references: Option<IgnoredAny>,
}

/// A list of which at most `MAX` entries are kept and all are counted, so that no list costs more memory than a
/// correct one; the reader of the message compares the count.
#[derive(Debug)]
pub(super) struct List<T, const MAX: usize> {
    pub(super) items: Vec<T>,
    pub(super) count: usize,
}

impl<'de, T: Deserialize<'de>, const MAX: usize> Deserialize<'de> for List<T, MAX> {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        struct ListVisitor<T, const MAX: usize>(PhantomData<T>);

        impl<'de, T: Deserialize<'de>, const MAX: usize> Visitor<'de> for ListVisitor<T, MAX> {
            type Value = List<T, MAX>;

            fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                f.write_str("a list")
            }

            fn visit_seq<A: SeqAccess<'de>>(self, mut list: A) -> Result<Self::Value, A::Error> {
                let mut items = Vec::new();
                while items.len() < MAX {
                    match list.next_element()? {
                        Some(item) => items.push(item),
                        None => return Ok(List { count: items.len(), items }),
                    }
                }
                let mut count = items.len();
                while list.next_element::<IgnoredAny>()?.is_some() {
                    count += 1;
                }
                Ok(List { items, count })
            }
        }

        deserializer.deserialize_seq(ListVisitor(PhantomData))
    }
}

/// Exactly `N` numbers.
#[derive(Debug, Clone, Copy)]
pub(super) struct Numbers<const N: usize>(pub(super) [f64; N]);

impl<'de, const N: usize> Deserialize<'de> for Numbers<N> {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        struct NumbersVisitor<const N: usize>;

        impl<'de, const N: usize> Visitor<'de> for NumbersVisitor<N> {
            type Value = Numbers<N>;

            fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                write!(f, "a list of {N} numbers")
            }

            fn visit_seq<A: SeqAccess<'de>>(self, mut list: A) -> Result<Self::Value, A::Error> {
                let mut numbers = [0.0; N];
                for (i, number) in numbers.iter_mut().enumerate() {
                    *number = list.next_element()?.ok_or_else(|| A::Error::invalid_length(i, &self))?;
                }
                if list.next_element::<IgnoredAny>()?.is_some() {
                    return Err(A::Error::invalid_length(N + 1, &self));
                }
                Ok(Numbers(numbers))
            }
        }

        deserializer.deserialize_seq(NumbersVisitor)
    }
}
