//! What the samples of an inertial unit say of the unit itself, gathered while they stream by.
//!
//! Nothing here changes a sample. What would make every result wrong, a unit in g or in degrees, is a [`WrongUnit`],
//! which the decoder refuses; everything else is a warning, named by its kind and told in a sentence. The bounds are
//! those of plausibility, wide on purpose: they tell a defect of a device or of an export from a fast movement.

mod gravity;
mod histogram;
mod rail;
#[cfg(test)]
mod tests;

use super::inertial::Segment;
use gravity::{Fault, GravityAgreement};
use histogram::LogHistogram;
use nalgebra::Vector3;
use rail::Rail;
use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

/// Standard gravity, m/s² (3rd CGPM, 1901); the earth's surface differs by less than 0.4 %.
pub const GRAVITY_M_S2: f64 = 9.80665;

/// Median magnitudes of the acceleration, m/s², outside which it is not gravity and a movement; a unit in g has 1.
const POSSIBLE_MEDIAN_M_S2: std::ops::RangeInclusive<f64> = 4.0..=25.0;

/// Median magnitudes, m/s², outside which the scale is doubtful.
const PLAUSIBLE_MEDIAN_M_S2: std::ops::RangeInclusive<f64> = 8.8..=12.5;

/// Samples below which a median says nothing.
const MIN_SAMPLES: u64 = 50;

/// Magnitudes below which an axis is not clipped: no unit's range ends under ±2 g or ±250 °/s (4.4 rad/s).
const LEAST_RAILS: [f64; 2] = [15.0, 4.0];

/// Intervals this many times the median are drop-outs.
const DROP_OUT: f64 = 1.5;

/// Spread of the intervals, 5th to 95th percentile over the median, beyond which the clock jitters.
const JITTER: f64 = 0.2;

/// Seconds and samples for which a sensor that repeats itself exactly is stuck.
const STUCK: (f64, u64) = (1.0, 25);

/// Deviation of the measured from the declared rate, relative.
const RATE_DIFFERENCE: f64 = 0.05;

/// What an inertial unit's data raise doubts about.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
#[serde(rename_all = "snake_case")]
pub enum InertialWarningKind {
    /// The unit was declared and sent nothing.
    NoSamples,
    /// An axis stays at the end of its range.
    Saturation,
    /// Samples are missing: intervals much longer than the others.
    DropOut,
    /// The intervals between samples vary.
    Jitter,
    /// The accelerometer repeats one reading exactly.
    ConstantAcceleration,
    /// The gyroscope repeats one reading exactly.
    ConstantAngularRate,
    /// The typical acceleration is not that of gravity and a movement.
    AccelerationScale,
    /// The gyroscope turns gravity the wrong way about an axis.
    MirroredAxis,
    /// The time stamps do not have the declared rate.
    RateDiffers,
}

/// A doubt about an inertial unit's data; they are accepted all the same.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
pub struct InertialWarning {
    /// What it is.
    pub kind: InertialWarningKind,
    /// What was found, in one sentence.
    pub sentence: String,
}

/// What is known of an inertial unit that was read once.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct InertialSummary {
    /// What the unit is fixed to.
    pub segment: Segment,
    /// Model of the unit, where the client gave it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub device_model: Option<String>,
    /// Samples.
    pub n_samples: u64,
    /// Time of the first sample on the recording's clock, seconds.
    pub start_s: f64,
    /// Time between the first and the last sample, seconds.
    pub duration_s: f64,
    /// Samples per second on average, gaps included; null with fewer than two samples.
    pub rate_hz: Option<f64>,
    /// Rate that the client declared, per second.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub nominal_rate_hz: Option<f64>,
    /// Samples that are missing by the median interval.
    pub n_missing: u64,
    /// True when the unit has a magnetometer.
    pub has_magnetic_field: bool,
    /// Doubts about the data.
    pub warnings: Vec<InertialWarning>,
}

/// Units of measurement that are certainly not those of the format.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum WrongUnit {
    /// The median magnitude of the acceleration, here in the unit as sent, is not near gravity in m/s².
    Acceleration(f64),
    /// Only in degrees does the gyroscope turn gravity as the accelerometer sees it turn.
    AngularRateInDegrees,
}

/// Sums over the samples of one unit.
#[derive(Debug, Clone)]
pub struct UnitStatistics {
    n: u64,
    first_ns: i64,
    last_ns: i64,
    intervals_s: LogHistogram,
    magnitudes: LogHistogram,
    rails: [[Rail; 3]; 2],
    stuck: [Stuck; 2],
    gravity: GravityAgreement,
}

impl Default for UnitStatistics {
    fn default() -> Self {
        Self {
            n: 0,
            first_ns: 0,
            last_ns: 0,
            intervals_s: LogHistogram::new(1e-5, 1e4),
            magnitudes: LogHistogram::new(1e-3, 1e5),
            rails: Default::default(),
            stuck: Default::default(),
            gravity: GravityAgreement::default(),
        }
    }
}

impl UnitStatistics {
    /// Takes a sample: time in nanoseconds, later than the one before; specific force, m/s²; angular rate, rad/s.
    pub fn push(&mut self, time_ns: i64, acceleration: &Vector3<f64>, angular_rate: &Vector3<f64>) {
        if self.n == 0 {
            self.first_ns = time_ns;
        } else {
            self.intervals_s.push(seconds(self.last_ns, time_ns));
        }
        self.magnitudes.push(acceleration.norm());
        for ((rails, stuck), vector) in self.rails.iter_mut().zip(&mut self.stuck).zip([acceleration, angular_rate]) {
            rails.iter_mut().zip(vector).for_each(|(rail, value)| rail.push(*value));
            stuck.push(time_ns, vector);
        }
        self.gravity.push(time_ns, acceleration, angular_rate);
        self.last_ns = time_ns;
        self.n += 1;
    }

    /// Number of samples so far.
    pub fn n(&self) -> u64 {
        self.n
    }

    /// Time of the first sample, nanoseconds on the unit's clock; zero without any.
    pub fn first_ns(&self) -> i64 {
        self.first_ns
    }

    /// Time of the last sample, nanoseconds on the unit's clock; nothing without any.
    pub fn last_ns(&self) -> Option<i64> {
        (self.n > 0).then_some(self.last_ns)
    }

    /// Time between the first and the last sample, seconds.
    pub fn duration_s(&self) -> f64 {
        seconds(self.first_ns, self.last_ns)
    }

    /// Samples per second on average, gaps included.
    pub fn rate_hz(&self) -> Option<f64> {
        (self.n > 1).then(|| (self.n - 1) as f64 / self.duration_s())
    }

    /// Samples that are missing by the median interval.
    pub fn n_missing(&self) -> u64 {
        let Some(median) = self.intervals_s.quantile(0.5) else { return 0 };
        let gaps = self.intervals_s.bins().filter(|(interval, _)| *interval > DROP_OUT * median);
        gaps.map(|(interval, count)| count.saturating_mul((interval / median).round() as u64 - 1)).sum()
    }

    /// A unit of measurement that makes the data unusable, when that is certain.
    pub fn wrong_unit(&self) -> Option<WrongUnit> {
        if let Some(median) = self.median_magnitude().filter(|median| !POSSIBLE_MEDIAN_M_S2.contains(median)) {
            return Some(WrongUnit::Acceleration(median));
        }
        (self.gravity.fault() == Some(Fault::Degrees)).then_some(WrongUnit::AngularRateInDegrees)
    }

    fn median_magnitude(&self) -> Option<f64> {
        self.magnitudes.quantile(0.5).filter(|_| self.magnitudes.n() >= MIN_SAMPLES)
    }

    /// Every doubt about the data; `nominal_rate_hz` is the rate that was declared.
    pub fn warnings(&self, nominal_rate_hz: Option<f64>) -> Vec<InertialWarning> {
        use InertialWarningKind::{
            AccelerationScale, ConstantAcceleration, ConstantAngularRate, NoSamples, Saturation,
        };
        let mut warnings = Vec::new();
        let mut warn = |kind, sentence: String| warnings.push(InertialWarning { kind, sentence });
        if self.n == 0 {
            warn(NoSamples, "the unit was declared and has no sample".into());
        }
        for (what, unit, rails, least) in [
            ("acceleration", "m/s²", &self.rails[0], LEAST_RAILS[0]),
            ("angular rate", "rad/s", &self.rails[1], LEAST_RAILS[1]),
        ] {
            for (axis, rail) in ["x", "y", "z"].into_iter().zip(rails) {
                if let Some((rail, n)) = rail.clipped().filter(|(rail, _)| *rail >= least) {
                    warn(Saturation, format!("{n} samples of the {what} in {axis} are at the rail, ±{rail:.2} {unit}"));
                }
            }
        }
        for (kind, what, stuck) in [
            (ConstantAcceleration, "accelerometer", &self.stuck[0]),
            (ConstantAngularRate, "gyroscope", &self.stuck[1]),
        ] {
            if let Some(seconds) = stuck.found() {
                warn(kind, format!("the {what} repeats one reading exactly for {seconds:.1} s"));
            }
        }
        if let Some(median) = self.median_magnitude().filter(|median| !PLAUSIBLE_MEDIAN_M_S2.contains(median)) {
            let sentence = format!("half of all accelerations are below {median:.1} m/s², expected about 9.8");
            warn(AccelerationScale, sentence);
        }
        warnings.extend(self.clock_warnings(nominal_rate_hz));
        warnings.extend(self.gravity_warning());
        warnings
    }

    fn clock_warnings(&self, nominal_rate_hz: Option<f64>) -> Vec<InertialWarning> {
        use InertialWarningKind::{DropOut, Jitter, RateDiffers};
        let [Some(median), Some(low), Some(high)] = [0.5, 0.05, 0.95].map(|q| self.intervals_s.quantile(q)) else {
            return Vec::new();
        };
        let mut warnings = Vec::new();
        let mut warn = |kind, sentence: String| warnings.push(InertialWarning { kind, sentence });
        let n_missing = self.n_missing();
        if n_missing > 0 {
            let sentence = format!("about {n_missing} samples are missing in gaps of the clock, {} came", self.n);
            warn(DropOut, sentence);
        }
        let spread = (high - low) / median;
        if spread > JITTER && self.intervals_s.n() >= MIN_SAMPLES {
            let sentence = format!(
                "the intervals between samples vary from {:.1} to {:.1} ms (5th to 95th percentile)",
                low * 1e3,
                high * 1e3
            );
            warn(Jitter, sentence);
        }
        let (Some(nominal), n_intervals) = (nominal_rate_hz, self.n.saturating_sub(1)) else { return warnings };
        // Gaps are told above; here the samples that are missing count as if they had come.
        let measured = (n_intervals + n_missing) as f64 / self.duration_s();
        if (measured / nominal - 1.0).abs() > RATE_DIFFERENCE {
            let sentence = format!("the time stamps have {measured:.1} samples/s, declared are {nominal:.1}");
            warn(RateDiffers, sentence);
        }
        warnings
    }

    fn gravity_warning(&self) -> Option<InertialWarning> {
        let what = match self.gravity.fault()? {
            Fault::Degrees => return None,
            Fault::Mirrored(axis) => format!("about {}: is that axis mirrored?", ["x", "y", "z"][axis.min(2)]),
            Fault::LeftHanded => "about every axis: is the unit's frame left-handed?".to_owned(),
        };
        let sentence = format!("the gyroscope turns gravity the wrong way {what}");
        Some(InertialWarning { kind: InertialWarningKind::MirroredAxis, sentence })
    }
}

fn seconds(from_ns: i64, to_ns: i64) -> f64 {
    (i128::from(to_ns) - i128::from(from_ns)) as f64 * 1e-9
}

/// The longest time for which a sensor repeated one reading.
#[derive(Debug, Clone, Default)]
struct Stuck {
    reading: Vector3<f64>,
    since_ns: i64,
    n: u64,
    longest: (f64, u64),
}

impl Stuck {
    fn push(&mut self, time_ns: i64, reading: &Vector3<f64>) {
        if self.n == 0 || self.reading != *reading {
            *self = Self { reading: *reading, since_ns: time_ns, n: 0, longest: self.longest };
        }
        self.n += 1;
        let lasted = seconds(self.since_ns, time_ns);
        if lasted > self.longest.0 {
            self.longest = (lasted, self.n);
        }
    }

    fn found(&self) -> Option<f64> {
        (self.longest.0 >= STUCK.0 && self.longest.1 >= STUCK.1).then_some(self.longest.0)
    }
}
