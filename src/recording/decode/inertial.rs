//! Inertial units in, one batch of samples at a time; the checks that both formats share.

use super::checks::MAX_TEXT;
use super::limits::Limits;
use super::message::{List, Numbers};
use crate::recording::inertial_quality::{InertialSummary, UnitStatistics, WrongUnit};
use crate::recording::{DecodeError, InertialRecording, InertialSensor, Segment};
use nalgebra::Vector3;

/// Largest component of an acceleration, m/s²: twice the range of units made for impacts (±200 g).
const MAX_ACCELERATION_M_S2: f64 = 4000.0;

/// Largest component of an angular rate, rad/s: units end at ±4000 °/s, which is 70.
const MAX_ANGULAR_RATE_RAD_S: f64 = 100.0;

/// Largest component of a magnetic field, microtesla: the earth's has 65, the strongest sensors' range ends at 5000.
const MAX_MAGNETIC_FIELD_UT: f64 = 10_000.0;

/// Fastest sampling that can be declared, per second.
const MAX_RATE_HZ: f64 = 100_000.0;

/// How a client describes a unit.
#[derive(Debug, Default)]
pub(super) struct Declaration {
    pub(super) segment: String,
    pub(super) device_model: Option<String>,
    pub(super) mounting: Option<String>,
    pub(super) nominal_rate_hz: Option<f64>,
    pub(super) clock_offset_ns: i64,
}

/// Samples of one unit as written; every list has one entry for each sample.
#[derive(Debug)]
pub(super) struct Samples<const MAX: usize> {
    pub(super) time_ns: List<i64, MAX>,
    pub(super) acceleration: List<Numbers<3>, MAX>,
    pub(super) angular_rate: List<Numbers<3>, MAX>,
    pub(super) magnetic_field: Option<List<Numbers<3>, MAX>>,
}

struct Unit {
    sensor: InertialSensor,
    statistics: UnitStatistics,
    has_magnetic_field: bool,
}

/// Checks the units' samples; keeps them only when asked to.
pub(super) struct InertialAssembler {
    keep: bool,
    limits: Limits,
    units: Vec<Unit>,
    n_samples: u64,
}

impl InertialAssembler {
    pub(super) fn new(limits: Limits, keep: bool) -> Self {
        Self { keep, limits, units: Vec::new(), n_samples: 0 }
    }

    /// True when at least one unit sent a sample.
    pub(super) fn has_samples(&self) -> bool {
        self.n_samples > 0
    }

    /// Declares a unit and answers its number.
    pub(super) fn declare(&mut self, declaration: Declaration, place: &str) -> Result<usize, DecodeError> {
        let segment: Segment = declaration.segment.parse().map_err(|_| {
            let shown: String = declaration.segment.chars().take(MAX_TEXT).collect();
            let sentence = format!("`{shown}` is not a segment name; the page on the recording format lists them");
            DecodeError::new("unknown_segment", sentence).at(place)
        })?;
        for (name, text) in [("device_model", &declaration.device_model), ("mounting", &declaration.mounting)] {
            if text.as_deref().is_some_and(|text| text.chars().count() > MAX_TEXT) {
                let sentence = format!("`{name}` has more than {MAX_TEXT} characters; shorten it");
                return Err(DecodeError::new("invalid_value", sentence).at(format!("{place}.{name}")));
            }
        }
        if let Some(rate) = declaration.nominal_rate_hz.filter(|rate| !(*rate > 0.0 && *rate <= MAX_RATE_HZ)) {
            let sentence = format!("the declared rate is {rate}, expected samples per second up to {MAX_RATE_HZ}");
            return Err(DecodeError::new("invalid_value", sentence).at(format!("{place}.nominal_rate_hz")));
        }
        if self.units.iter().any(|unit| unit.sensor.segment == segment) {
            let sentence = format!("two inertial units are declared on `{segment}`; a recording has one on a segment");
            return Err(DecodeError::new("duplicate_channel", sentence).at(place));
        }
        let sensor = InertialSensor {
            device_model: declaration.device_model,
            mounting: declaration.mounting,
            nominal_rate_hz: declaration.nominal_rate_hz,
            clock_offset_ns: declaration.clock_offset_ns,
            ..InertialSensor::new(segment)
        };
        self.units.push(Unit { sensor, statistics: UnitStatistics::default(), has_magnetic_field: false });
        Ok(self.units.len() - 1)
    }

    /// Takes samples of unit `number`; `place` is the path of the object that holds the lists.
    pub(super) fn batch<const MAX: usize>(
        &mut self,
        number: usize,
        samples: Samples<MAX>,
        place: &str,
    ) -> Result<(), DecodeError> {
        let n = samples.time_ns.count;
        self.n_samples = self.n_samples.saturating_add(n as u64);
        let limit = self.limits.max_inertial_samples;
        if n > MAX || self.n_samples > limit {
            let sentence = format!("too many inertial samples: at most {MAX} in one batch and {limit} in a recording");
            return Err(DecodeError::new("too_many_samples", sentence).at(place));
        }
        let unit = &mut self.units[number];
        unit.check_counts(&samples, place)?;
        for (i, &time_ns) in samples.time_ns.items.iter().enumerate() {
            unit.check_time(time_ns, self.limits.max_duration_s)
                .map_err(|defect| defect.at(format!("{place}.time_ns[{i}]")))?;
            let (Numbers(force), Numbers(rate)) = (samples.acceleration.items[i], samples.angular_rate.items[i]);
            let field = samples.magnetic_field.as_ref().map(|list| list.items[i].0);
            check_ranges(force, rate, field).map_err(|(list, defect)| defect.at(format!("{place}.{list}[{i}]")))?;
            let (force, rate) = (Vector3::from(force), Vector3::from(rate));
            unit.statistics.push(time_ns, &force, &rate);
            if self.keep {
                unit.sensor.time_ns.push(time_ns);
                unit.sensor.acceleration.push(force);
                unit.sensor.angular_rate.push(rate);
                if let Some(field) = field {
                    unit.sensor.magnetic_field.get_or_insert_default().push(field.into());
                }
            }
        }
        Ok(())
    }

    /// Ends the units.
    pub(super) fn finish(self) -> Result<(Vec<InertialSummary>, Option<InertialRecording>), DecodeError> {
        let mut summaries = Vec::with_capacity(self.units.len());
        for (number, unit) in self.units.iter().enumerate() {
            if let Some(wrong) = unit.statistics.wrong_unit() {
                return Err(wrong_unit(wrong, unit.sensor.segment, number));
            }
            summaries.push(unit.summary());
        }
        let sensors: Vec<InertialSensor> = self.units.into_iter().map(|unit| unit.sensor).collect();
        Ok((summaries, (self.keep && !sensors.is_empty()).then_some(InertialRecording { sensors })))
    }
}

impl Unit {
    fn check_counts<const MAX: usize>(&mut self, samples: &Samples<MAX>, place: &str) -> Result<(), DecodeError> {
        let n = samples.time_ns.count;
        let counts = [
            ("acceleration", samples.acceleration.count),
            ("angular_rate", samples.angular_rate.count),
            ("magnetic_field", samples.magnetic_field.as_ref().map_or(n, |list| list.count)),
        ];
        if let Some((list, count)) = counts.into_iter().find(|(_, count)| *count != n) {
            let sentence = format!("found {count} entries for {n} time stamps; write one entry for each sample");
            return Err(DecodeError::new("sample_count_mismatch", sentence).at(format!("{place}.{list}")));
        }
        if n == 0 {
            return Ok(());
        }
        if self.statistics.n() == 0 {
            self.has_magnetic_field = samples.magnetic_field.is_some();
        } else if self.has_magnetic_field != samples.magnetic_field.is_some() {
            let sentence = "some batches of the unit have a magnetic field and some have none; write it in all or none";
            return Err(DecodeError::new("sample_count_mismatch", sentence).at(format!("{place}.magnetic_field")));
        }
        Ok(())
    }

    fn check_time(&self, time_ns: i64, max_duration_s: u64) -> Result<(), DecodeError> {
        let Some(last_ns) = self.statistics.last_ns() else { return Ok(()) };
        if time_ns <= last_ns {
            let sentence = format!(
                "inertial sample at {time_ns} ns is not later than the one before it ({last_ns} ns); the unit's clock \
                 must not stand or go backwards, so drop repeated samples and undo the counter's overflow"
            );
            return Err(DecodeError::new("time_not_increasing", sentence));
        }
        let duration = i128::from(time_ns) - i128::from(self.statistics.first_ns());
        if duration > i128::from(max_duration_s) * 1_000_000_000 {
            let sentence = format!(
                "the unit's samples span {} s, more than the {max_duration_s} s accepted; are the time stamps \
                 nanoseconds?",
                duration / 1_000_000_000
            );
            return Err(DecodeError::new("too_long", sentence));
        }
        Ok(())
    }

    fn summary(&self) -> InertialSummary {
        let (sensor, statistics) = (&self.sensor, &self.statistics);
        let start_ns = i128::from(statistics.first_ns()) + i128::from(sensor.clock_offset_ns);
        InertialSummary {
            segment: sensor.segment,
            device_model: sensor.device_model.clone(),
            n_samples: statistics.n(),
            start_s: if statistics.n() > 0 { start_ns as f64 * 1e-9 } else { 0.0 },
            duration_s: statistics.duration_s(),
            rate_hz: statistics.rate_hz(),
            nominal_rate_hz: sensor.nominal_rate_hz,
            n_missing: statistics.n_missing(),
            has_magnetic_field: self.has_magnetic_field,
            warnings: statistics.warnings(sensor.nominal_rate_hz),
        }
    }
}

/// What no unit on a body can measure, with the name of the list it stands in.
fn check_ranges(force: [f64; 3], rate: [f64; 3], field: Option<[f64; 3]>) -> Result<(), (&'static str, DecodeError)> {
    let exceeds = |values: [f64; 3], limit: f64| values.iter().any(|value| value.abs() > limit);
    if exceeds(force, MAX_ACCELERATION_M_S2) {
        let sentence =
            format!("the acceleration is {force:?}; m/s² stay within ±{MAX_ACCELERATION_M_S2}: is it in mg?");
        return Err(("acceleration", DecodeError::new("acceleration_unit", sentence)));
    }
    if exceeds(rate, MAX_ANGULAR_RATE_RAD_S) {
        let sentence = format!(
            "the angular rate is {rate:?}; rad/s stay within ±{MAX_ANGULAR_RATE_RAD_S}: is it in degrees per second? \
             Multiply by π/180"
        );
        return Err(("angular_rate", DecodeError::new("angular_rate_unit", sentence)));
    }
    if let Some(field) = field.filter(|field| exceeds(*field, MAX_MAGNETIC_FIELD_UT)) {
        let sentence = format!(
            "the magnetic field is {field:?}; microtesla stay within ±{MAX_MAGNETIC_FIELD_UT}: is it in nanotesla?"
        );
        return Err(("magnetic_field", DecodeError::new("invalid_value", sentence)));
    }
    Ok(())
}

fn wrong_unit(wrong: WrongUnit, segment: Segment, number: usize) -> DecodeError {
    match wrong {
        WrongUnit::Acceleration(median) => {
            let advice = match median {
                0.7..1.4 => "is it in g? Multiply by 9.80665",
                500.0..2000.0 => "is it in mg? Multiply by 0.00980665",
                _ if median < 4.0 => "was gravity subtracted? Send what the accelerometer measured",
                _ => "check its unit",
            };
            let sentence = format!(
                "half of the accelerations of the unit on `{segment}` are below {median:.3}, gravity alone is 9.8 \
                 m/s²: {advice}"
            );
            DecodeError::new("acceleration_unit", sentence).at(format!("inertial[{number}].acceleration"))
        }
        WrongUnit::AngularRateInDegrees => {
            let sentence = format!(
                "the gyroscope of the unit on `{segment}` turns gravity as its accelerometer sees it turn only when its \
                 numbers are degrees per second; send rad/s: multiply by π/180"
            );
            DecodeError::new("angular_rate_unit", sentence).at(format!("inertial[{number}].angular_rate"))
        }
    }
}
