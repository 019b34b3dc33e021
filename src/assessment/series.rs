//! A named series with its credible interval.

use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

/// One estimated quantity over time.
#[derive(Debug, Clone, PartialEq)]
pub struct Series {
    /// Name with the unit at its end, for example `right_knee_flexion_deg`.
    pub channel: String,
    /// Estimate of each sample; NaN where there is none.
    pub value: Vec<f32>,
    /// Lower end of the 95 % credible interval; NaN where there is none.
    pub low: Vec<f32>,
    /// Upper end of the 95 % credible interval; NaN where there is none.
    pub high: Vec<f32>,
    /// Union of the `FLAG_…` bits of each sample; 0 is a plain, observed estimate.
    pub flags: Vec<u8>,
}

/// The joints that the value depends on were not all seen: the value is bridged from its neighbours.
pub const FLAG_BRIDGED: u8 = 1;
/// The joint centres say nothing of this angle in this posture; the value is the prior's.
pub const FLAG_NOT_OBSERVABLE: u8 = 2;
/// The posture is singular for this decomposition; see the attitude vector instead.
pub const FLAG_SINGULAR: u8 = 4;
/// An observation of this frame was rejected as an outlier.
pub const FLAG_OUTLIER: u8 = 8;
/// The rotation was turned by 180° about the limb's axis to undo a flip of the middleware.
pub const FLAG_FLIP_CORRECTED: u8 = 16;

/// The sensor had taken the left limb for the right one; they were exchanged back before the estimate.
pub const FLAG_SWAP_CORRECTED: u8 = 32;

/// Names of the flag bits, lowest bit first.
pub const FLAG_NAMES: [&str; 6] =
    ["bridged", "not_observable", "singular", "outlier", "flip_corrected", "swap_corrected"];

/// One line about one series. Numbers are in the unit that ends the channel's name.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct ChannelSummary {
    /// The series.
    pub channel: String,
    /// Share of samples that are observed (not bridged, not unobservable), 0 to 1.
    pub coverage: f64,
    /// Smallest observed value; null when nothing was observed.
    pub min: Option<f64>,
    /// Largest observed value.
    pub max: Option<f64>,
    /// `max - min`: the range of motion in this recording.
    pub range: Option<f64>,
    /// Mean of the observed values.
    pub mean: Option<f64>,
    /// Median width of the 95 % credible interval; null when the method gives none.
    pub interval_width: Option<f64>,
}

impl Series {
    /// A series of `len` samples without any estimate.
    pub fn empty(channel: impl Into<String>, len: usize) -> Self {
        let none = vec![f32::NAN; len];
        Self { channel: channel.into(), value: none.clone(), low: none.clone(), high: none, flags: vec![0; len] }
    }

    /// Summary over the samples that are observed.
    pub fn summarize(&self) -> ChannelSummary {
        const UNSEEN: u8 = FLAG_BRIDGED | FLAG_NOT_OBSERVABLE;
        let samples = self.value.iter().zip(&self.flags);
        let observed = samples.filter(|(v, f)| v.is_finite() && *f & UNSEEN == 0).map(|(v, _)| f64::from(*v));
        let (mut count, mut sum, mut min, mut max) = (0u64, 0.0, f64::INFINITY, f64::NEG_INFINITY);
        for value in observed {
            count += 1;
            sum += value;
            min = min.min(value);
            max = max.max(value);
        }
        let when_any = |number: f64| (count > 0).then_some(number);
        let mut widths: Vec<f32> =
            self.low.iter().zip(&self.high).map(|(l, h)| h - l).filter(|w| w.is_finite()).collect();
        let middle = widths.len() / 2;
        let median = (!widths.is_empty()).then(|| *widths.select_nth_unstable_by(middle, f32::total_cmp).1);
        ChannelSummary {
            channel: self.channel.clone(),
            coverage: count as f64 / self.value.len().max(1) as f64,
            min: when_any(min),
            max: when_any(max),
            range: when_any(max - min),
            mean: when_any(sum / count.max(1) as f64),
            interval_width: median.map(f64::from),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_summary_leaves_out_bridged_and_missing_samples() {
        let mut series = Series::empty("left_knee_flexion_deg", 4);
        series.value = vec![10.0, 30.0, 90.0, f32::NAN];
        series.flags = vec![0, 0, FLAG_BRIDGED, 0];
        let summary = series.summarize();
        assert_eq!((summary.min, summary.max, summary.mean), (Some(10.0), Some(30.0), Some(20.0)));
        assert_eq!((summary.coverage, summary.interval_width), (0.5, None));
    }

    #[test]
    fn the_summary_of_nothing_holds_no_numbers() {
        let summary = Series::empty("left_knee_flexion_deg", 0).summarize();
        assert_eq!((summary.min, summary.mean, summary.coverage), (None, None, 0.0));
    }
}
