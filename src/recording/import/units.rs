//! What the importers of inertial data sets have in common.

use super::report::UnitNotes;
use super::{ImportError, ImportNotes, Source, Trial};
use crate::recording::inertial_quality::{GRAVITY_M_S2, UnitStatistics};
use crate::recording::{Header, InertialRecording, InertialSensor, Recording, ReferenceSeries, Segment};
use nalgebra::{Quaternion, UnitQuaternion, Vector3};
use std::path::Path;

/// Standard gravity, m/s², for data sets in g.
pub(super) const G_M_S2: f64 = GRAVITY_M_S2;

/// Deviation of a norm from one up to which four numbers are an orientation; they are rounded to four digits or more.
const NORM_TOLERANCE: f64 = 0.01;

/// A unit's samples, without those that have a missing number: they become gaps in time.
pub(super) fn sensor(
    segment: Segment,
    time_ns: &[i64],
    acceleration: &[Vector3<f64>],
    angular_rate: &[Vector3<f64>],
) -> InertialSensor {
    let mut sensor = InertialSensor::new(segment);
    for ((time_ns, force), rate) in time_ns.iter().zip(acceleration).zip(angular_rate) {
        if force.iter().chain(rate).all(|value| value.is_finite()) {
            sensor.time_ns.push(*time_ns);
            sensor.acceleration.push(*force);
            sensor.angular_rate.push(*rate);
        }
    }
    sensor
}

/// Four reference series, `…_orientation_w` to `…_orientation_z`: what turns vectors of the unit or its segment into a
/// fixed right-handed frame with y up.
///
/// Normalised; NaN where the reference has none. The sign is that which makes each step short, so that the components
/// can be interpolated.
pub(super) fn orientation_references(
    segment: Segment,
    source: &str,
    clock_offset_ns: i64,
    time_ns: &[i64],
    fixed_from_segment: &[Option<UnitQuaternion<f64>>],
) -> Vec<ReferenceSeries> {
    let mut last: Option<Quaternion<f64>> = None;
    let smooth = fixed_from_segment.iter().map(|orientation| {
        let mut components = orientation.as_ref()?.into_inner();
        if last.is_some_and(|last| last.dot(&components) < 0.0) {
            components = -components;
        }
        last = Some(components);
        Some(components)
    });
    let smooth: Vec<Option<Quaternion<f64>>> = smooth.collect();
    let component = |pick: fn(&Quaternion<f64>) -> f64| smooth.iter().map(move |q| q.as_ref().map_or(f64::NAN, pick));
    let values: [Vec<f64>; 4] = [
        component(|q| q.w).collect(),
        component(|q| q.i).collect(),
        component(|q| q.j).collect(),
        component(|q| q.k).collect(),
    ];
    let series = ["w", "x", "y", "z"].into_iter().zip(values).map(|(name, values)| ReferenceSeries {
        channel: format!("{segment}_orientation_{name}"),
        source: source.to_owned(),
        clock_offset_ns,
        time_ns: time_ns.to_vec(),
        values,
    });
    series.collect()
}

/// The rotation that w, x, y, z stand for; nothing when a number is missing or the norm is not one.
pub(super) fn orientation(wxyz: &[f64]) -> Option<UnitQuaternion<f64>> {
    let &[w, x, y, z] = wxyz else { return None };
    let quaternion = Quaternion::new(w, x, y, z);
    ((quaternion.norm() - 1.0).abs() < NORM_TOLERANCE).then(|| UnitQuaternion::new_normalize(quaternion))
}

/// Turns vectors of a frame with z up into one with y up: (x, y, z) becomes (x, z, −y).
pub(super) fn y_up_from_z_up() -> UnitQuaternion<f64> {
    UnitQuaternion::from_axis_angle(&Vector3::x_axis(), -std::f64::consts::FRAC_PI_2)
}

/// The trial that units and their references make.
pub(super) fn trial(
    source: &Source,
    mut sensors: Vec<InertialSensor>,
    nominal_rate_hz: f64,
    references: Vec<ReferenceSeries>,
    remarks: Vec<String>,
) -> Result<Trial, ImportError> {
    for sensor in &mut sensors {
        sensor.nominal_rate_hz = Some(nominal_rate_hz);
        check(sensor, &source.file)?;
    }
    let notes = ImportNotes {
        name: source.name.clone(),
        dataset: source.dataset.name().to_owned(),
        exercise: source.exercise.clone(),
        inertial: sensors.iter().map(unit_notes).collect(),
        references: references.iter().map(|series| series.channel.clone()).collect(),
        remarks,
        ..ImportNotes::default()
    };
    let header = Header { protocol: Some(source.exercise.chars().take(64).collect()), ..Header::default() };
    let inertial = Some(InertialRecording { sensors });
    Ok(Trial { recording: Recording { header, skeleton: None, inertial, references }, notes })
}

/// A unit without samples, or whose clock stands or goes back, is no recording.
fn check(sensor: &InertialSensor, file: &Path) -> Result<(), ImportError> {
    let inconsistent = |reason| ImportError::Inconsistent { file: file.to_owned(), reason };
    if sensor.is_empty() {
        return Err(inconsistent(format!("no sample of the unit on {}", sensor.segment)));
    }
    match sensor.time_ns.windows(2).position(|pair| pair[1] <= pair[0]) {
        Some(i) => Err(inconsistent(format!("sample {} of the unit on {} is not later", i + 2, sensor.segment))),
        None => Ok(()),
    }
}

/// What a person should know of a unit, with the doubts that an upload would raise.
pub(super) fn unit_notes(sensor: &InertialSensor) -> UnitNotes {
    let mut statistics = UnitStatistics::default();
    for ((time_ns, force), rate) in sensor.time_ns.iter().zip(&sensor.acceleration).zip(&sensor.angular_rate) {
        statistics.push(*time_ns, force, rate);
    }
    let warnings = statistics.warnings(sensor.nominal_rate_hz);
    UnitNotes {
        segment: sensor.segment,
        n_samples: sensor.len(),
        rate_hz: statistics.rate_hz().unwrap_or(0.0),
        warnings: warnings.into_iter().map(|warning| warning.sentence).collect(),
    }
}

/// The trials of a folder: `stem_of` says of a file's name (without `.gz`) what its trial is called, if it is one.
pub(super) fn trials(
    root: &Path,
    dataset: super::Dataset,
    stem_of: impl Fn(&str) -> Option<String>,
    exercise: &str,
) -> Result<Vec<Source>, ImportError> {
    let mut sources = Vec::new();
    for file in super::file_names(root)? {
        if let Some(name) = stem_of(super::without_gz(&file)) {
            sources.push(Source { dataset, name, exercise: exercise.to_owned(), file: root.join(&file) });
        }
    }
    Ok(sources)
}
