//! The units' clocks as the fusion uses them: aligned with the camera's, or as the recording declares them.

use super::synchronization::{
    AssignmentDoubt, ClockMap, CommonRest, Evidence, Refusal, Support, Synchronization, UnitClock, assignment_doubts,
    common_rest, synchronize,
};
use crate::assessment::{ClockQuality, Clocks, Warning};
use crate::body::Bone;
use crate::pipeline::PipelineError;
use crate::recording::{InertialSensor, Recording, Segment, SkeletonRecording};
use std::borrow::Cow;

/// Units of which one can contradict the others.
const FEWEST_TO_TELL: usize = 3;
/// Time from the camera's first frame within which units lie on a plank, nanoseconds: a minute.
const PLANK_WITHIN_NS: i64 = 60_000_000_000;

/// A unit on a bone, and its clock.
#[derive(Debug, Clone)]
pub struct ClockedUnit<'a> {
    /// The bone.
    pub bone: Bone,
    /// Its samples.
    pub unit: &'a InertialSensor,
    /// Its clock on the camera's.
    pub clock: ClockMap,
    /// What is said of it.
    pub quality: ClockQuality,
}

/// Units with their clocks, and what else camera and units say of each other.
#[derive(Debug, Clone)]
pub struct ClockedUnits<'a> {
    /// The units that are used.
    pub units: Vec<ClockedUnit<'a>>,
    /// The rest of all units on a plank, when there was one.
    pub plank: Option<CommonRest>,
}

/// Time for which a unit must have recorded for its disagreement with the camera to mean something, seconds: two of the
/// windows that clocks are compared in. In a few seconds of a camera that misplaces joints nothing agrees with anything.
const TELLING_S: f64 = 20.0;

/// True of a unit that no clock makes agree with the camera; where the movement only does not show the clock, the
/// declared one may still be right.
fn is_unusable(refusal: &Refusal, unit: &InertialSensor) -> bool {
    match refusal {
        Refusal::TooLong | Refusal::ClockRunsBackwards | Refusal::NoOverlap => true,
        Refusal::NoSharedMovement | Refusal::Inconsistent | Refusal::ImplausibleDrift { .. } => {
            unit.duration_s() >= TELLING_S
        }
        Refusal::TooShort
        | Refusal::UnitStill
        | Refusal::CameraStill
        | Refusal::NotTracked
        | Refusal::Ambiguous { .. }
        | Refusal::Imprecise { .. } => false,
    }
}

/// Units with their clocks; a unit whose clock contradicts the camera's, or that recorded at another time, is left out and
/// named. Without a camera the recording's clocks are taken.
///
/// # Errors
/// `clocks_not_aligned` or, with declared clocks, `no_overlap` when that leaves none.
pub fn clocked_units<'a>(
    recording: &Recording,
    units: &[(Bone, &'a InertialSensor)],
    choice: Clocks,
    warnings: &mut Vec<Warning>,
) -> Result<ClockedUnits<'a>, PipelineError> {
    let Some(skeleton) = recording.skeleton.as_ref().filter(|skeleton| skeleton.len() > 1) else {
        let units = units.iter().map(|(bone, unit)| of_declared(*bone, unit)).collect();
        return Ok(ClockedUnits { units, plank: None });
    };
    if choice == Clocks::Declared {
        return declared_units(skeleton, units, warnings);
    }
    let sensors = sensors_of(recording, units);
    let found = synchronize(skeleton, &sensors);
    let mut clocked = Vec::with_capacity(units.len());
    let mut refusals = Vec::new();
    for (bone, unit) in units {
        let Some(found) = found.units.iter().find(|clock| clock.segment == unit.segment) else { continue };
        let declared = of_declared(*bone, unit);
        match &found.alignment {
            Ok(alignment) => clocked.push(ClockedUnit {
                clock: alignment.clock,
                quality: quality(found, &alignment.clock, alignment.residual_s),
                ..declared
            }),
            Err(refusal) if is_unusable(refusal, unit) => refusals.push(format!("{}: {refusal}", unit.segment)),
            Err(_) if !overlaps(skeleton, &declared) => {
                refusals.push(format!("{}: {}", unit.segment, Refusal::NoOverlap));
            }
            Err(refusal) => {
                warnings.push(Warning::new(
                    "clock_not_identified",
                    format!(
                        "the clock of the unit on {} is taken as the recording declares it, as nothing shows it: {refusal}",
                        unit.segment
                    ),
                ));
                clocked.push(declared);
            }
        }
    }
    if clocked.is_empty() {
        let sentence = format!(
            "no unit's clock can be aligned with the camera's ({}); let the person jump five times before the exercise",
            refusals.join("; ")
        );
        return Err(PipelineError::unsuitable("clocks_not_aligned", sentence));
    }
    warn_of_refusals(&refusals, warnings);
    warn_of_exchanges(skeleton, &sensors, &found, warnings);
    let plank = on_plank(&sensors, &found);
    if plank.is_none()
        && let Some((odd, rest)) = odd_one_out(skeleton, &sensors, &found)
    {
        clocked.retain(|unit| unit.unit.segment != odd);
        warnings.push(Warning::new(
            "unit_left_out",
            format!(
                "a unit was left out, and its segment is estimated without it: all units lay at rest on one plank by the \
                 data of the others, but not by those of {odd}; is an axis mirrored, or its gyroscope not in rad/s?"
            ),
        ));
        return Ok(ClockedUnits { units: clocked, plank: Some(rest) });
    }
    Ok(ClockedUnits { units: clocked, plank })
}

fn on_plank(sensors: &[InertialSensor], found: &Synchronization) -> Option<CommonRest> {
    common_rest(sensors, found).filter(|rest| rest.support == Support::Plank)
}

/// The only unit without which all lay on a plank at the beginning, and their rest there. What it felt on the plank cannot
/// be: a defect that its movement may be too small to show.
fn odd_one_out(
    skeleton: &SkeletonRecording,
    sensors: &[InertialSensor],
    found: &Synchronization,
) -> Option<(Segment, CommonRest)> {
    if sensors.len() < FEWEST_TO_TELL {
        return None;
    }
    let until_ns = skeleton.time_ns.first()?.saturating_add(PLANK_WITHIN_NS);
    let beginnings: Vec<InertialSensor> =
        sensors.iter().zip(&found.units).map(|(sensor, clock)| beginning(sensor, clock, until_ns)).collect();
    let mut odd = None;
    for left_out in (0..sensors.len()).filter(|u| found.units[*u].clock().is_some()) {
        let others: Vec<InertialSensor> = without(&beginnings, left_out);
        let clocks = Synchronization { units: without(&found.units, left_out) };
        if let Some(rest) = on_plank(&others, &clocks) {
            if odd.is_some() {
                return None;
            }
            odd = Some((sensors[left_out].segment, rest));
        }
    }
    odd
}

/// A unit's samples before a time of the camera.
fn beginning(sensor: &InertialSensor, clock: &UnitClock, until_ns: i64) -> InertialSensor {
    let n = clock.clock().map_or(0, |map| sensor.time_ns.partition_point(|time| map.camera_ns(*time) < until_ns));
    InertialSensor {
        time_ns: sensor.time_ns[..n].to_vec(),
        acceleration: sensor.acceleration[..n].to_vec(),
        angular_rate: sensor.angular_rate[..n].to_vec(),
        ..InertialSensor::new(sensor.segment)
    }
}

fn without<T: Clone>(values: &[T], place: usize) -> Vec<T> {
    values.iter().enumerate().filter(|(i, _)| *i != place).map(|(_, value)| value.clone()).collect()
}

/// The sensors of the units that take part: one that was left out would spoil what the others say together.
fn sensors_of<'r>(recording: &'r Recording, units: &[(Bone, &InertialSensor)]) -> Cow<'r, [InertialSensor]> {
    let all = recording.inertial.as_ref().map_or(&[][..], |inertial| &inertial.sensors);
    if all.len() == units.len() {
        return Cow::Borrowed(all);
    }
    Cow::Owned(units.iter().map(|(_, unit)| (*unit).clone()).collect())
}

/// Units with the clocks that the recording declares.
fn declared_units<'a>(
    skeleton: &SkeletonRecording,
    units: &[(Bone, &'a InertialSensor)],
    warnings: &mut Vec<Warning>,
) -> Result<ClockedUnits<'a>, PipelineError> {
    let declared = units.iter().map(|(bone, unit)| of_declared(*bone, unit));
    let (clocked, apart): (Vec<_>, Vec<_>) = declared.partition(|unit| overlaps(skeleton, unit));
    if clocked.is_empty() {
        let sentence = "by the declared clocks no unit recorded at the camera's time; correct clock_offset_ns, or ask for \
                        estimated clocks";
        return Err(PipelineError::unsuitable("no_overlap", sentence));
    }
    let refusals: Vec<String> =
        apart.iter().map(|unit| format!("{}: {}", unit.unit.segment, Refusal::NoOverlap)).collect();
    warn_of_refusals(&refusals, warnings);
    Ok(ClockedUnits { units: clocked, plank: None })
}

/// True when some of a unit's samples lie between the camera's first and last frame.
fn overlaps(skeleton: &SkeletonRecording, unit: &ClockedUnit<'_>) -> bool {
    let camera = skeleton.time_ns.first().zip(skeleton.time_ns.last());
    let own = unit.unit.time_ns.first().zip(unit.unit.time_ns.last());
    let both = camera.zip(own);
    both.is_some_and(|((from, to), (first, last))| {
        unit.clock.camera_ns(*first) < *to && unit.clock.camera_ns(*last) > *from
    })
}

fn warn_of_refusals(refusals: &[String], warnings: &mut Vec<Warning>) {
    warnings.extend(refusals.iter().map(|refusal| {
        let sentence = format!("a unit was left out, as its clock cannot be aligned: {refusal}");
        Warning::new("unit_not_aligned", sentence)
    }));
}

fn warn_of_exchanges(
    skeleton: &SkeletonRecording,
    sensors: &[InertialSensor],
    found: &Synchronization,
    warnings: &mut Vec<Warning>,
) {
    for AssignmentDoubt { segments: [a, b], as_declared, exchanged } in assignment_doubts(skeleton, sensors, found) {
        warnings.push(Warning::new(
            "units_exchanged",
            format!(
                "the units on {a} and {b} move as if each were on the other's segment (correlation with the camera {:.2} and \
                 {:.2} as declared, {:.2} and {:.2} exchanged); their angles are not to be trusted until that is settled",
                as_declared[0], as_declared[1], exchanged[0], exchanged[1]
            ),
        ));
    }
}

fn of_declared<'a>(bone: Bone, unit: &'a InertialSensor) -> ClockedUnit<'a> {
    let clock = ClockMap {
        reference_ns: unit.time_ns.first().copied().unwrap_or(0),
        offset_s: unit.clock_offset_ns as f64 * 1e-9,
        drift_ppm: 0.0,
        offset_sd_s: 0.0,
        drift_sd_ppm: 0.0,
    };
    let quality = ClockQuality {
        evidence: "declared".to_owned(),
        offset_s: clock.offset_s,
        offset_sd_s: None,
        drift_ppm: 0.0,
        drift_sd_ppm: None,
        residual_s: None,
        reference_s: clock.reference_ns as f64 * 1e-9,
    };
    ClockedUnit { bone, unit, clock, quality }
}

fn quality(found: &UnitClock, clock: &ClockMap, residual_s: f64) -> ClockQuality {
    let evidence = match found.evidence() {
        Evidence::Jumps => "jumps",
        Evidence::Movement => "movement",
        Evidence::None => "none",
    };
    ClockQuality {
        evidence: evidence.to_owned(),
        offset_s: clock.offset_s,
        offset_sd_s: Some(clock.offset_sd_s),
        drift_ppm: clock.drift_ppm,
        drift_sd_ppm: Some(clock.drift_sd_ppm),
        residual_s: Some(residual_s),
        reference_s: clock.reference_ns as f64 * 1e-9,
    }
}
