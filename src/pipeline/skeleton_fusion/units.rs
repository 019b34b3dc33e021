//! The units that take part: those on bones of the model whose data can be what they claim to be.

use crate::assessment::Warning;
use crate::body::Bone;
use crate::pipeline::PipelineError;
use crate::recording::inertial_quality::{InertialWarningKind, UnitStatistics, WrongUnit};
use crate::recording::{InertialSensor, Recording};

/// Part of the samples that repeat the one before exactly, from which on a sensor is stuck. Those of sensors that are sampled
/// slower than they are sent repeat too, but not in both of their sensors and not most of the time.
const STUCK_SHARE: f64 = 0.8;

/// The units that sit on bones of the model, with their bones; what is doubtful about them becomes warnings.
///
/// # Errors
/// `no_inertial_units`; `acceleration_unit` and `angular_rate_unit` as the decoder has them; `no_usable_unit` when every
/// unit was left out.
pub fn worn_units<'a>(
    recording: &'a Recording,
    warnings: &mut Vec<Warning>,
) -> Result<Vec<(Bone, &'a InertialSensor)>, PipelineError> {
    let (mut units, mut defects) = (Vec::new(), Vec::new());
    for unit in recording.inertial.iter().flat_map(|inertial| &inertial.sensors) {
        let segment = unit.segment;
        let Some(bone) = segment.bone() else {
            warnings.push(Warning::new(
                "unit_not_used",
                format!("the unit on {segment} is not used: the model has no such segment"),
            ));
            continue;
        };
        if unit.len() < 2 {
            warnings.push(Warning::new(
                "unit_without_samples",
                format!("the unit on {segment} sent no samples; its segment is estimated without it"),
            ));
            continue;
        }
        match defect(unit, warnings)? {
            Some(defect) => defects.push(format!("{segment}: {defect}")),
            None => units.push((bone, unit)),
        }
    }
    if units.is_empty() && !defects.is_empty() {
        let sentence =
            format!("no inertial unit can be used ({}); mend them, or ask for joint_angles", defects.join("; "));
        return Err(PipelineError::unsuitable("no_usable_unit", sentence));
    }
    if units.is_empty() {
        return Err(PipelineError::unsuitable(
            "no_inertial_units",
            "the recording has no inertial unit on the chest, an arm or a leg; record at least one, or ask for the \
             pipeline joint_angles",
        ));
    }
    for defect in defects {
        warnings.push(Warning::new(
            "unit_left_out",
            format!("a unit was left out, and its segment is estimated without it: {defect}"),
        ));
    }
    units.sort_by_key(|(bone, _)| bone.index());
    Ok(units)
}

/// Why a unit must be left out, if so; what is doubtful and usable becomes warnings.
fn defect(unit: &InertialSensor, warnings: &mut Vec<Warning>) -> Result<Option<String>, PipelineError> {
    let segment = unit.segment;
    if unit.time_ns.windows(2).any(|pair| pair[1] <= pair[0]) {
        return Ok(Some("its time stamps do not increase".to_owned()));
    }
    let mut statistics = UnitStatistics::default();
    for ((time_ns, acceleration), rate) in unit.time_ns.iter().zip(&unit.acceleration).zip(&unit.angular_rate) {
        statistics.push(*time_ns, acceleration, rate);
    }
    // The decoder refuses these; a recording that was made in memory did not pass it.
    match statistics.wrong_unit() {
        Some(WrongUnit::Acceleration(median)) => {
            let sentence = format!("the accelerations of {segment} have a median of {median:.2}, and are not in m/s²");
            return Err(PipelineError::unsuitable("acceleration_unit", sentence));
        }
        Some(WrongUnit::AngularRateInDegrees) => {
            let sentence =
                format!("the angular rates of {segment} turn gravity as it turns only when they are in degrees");
            return Err(PipelineError::unsuitable("angular_rate_unit", sentence));
        }
        None => {}
    }
    for (what, readings) in [("accelerometer", &unit.acceleration), ("gyroscope", &unit.angular_rate)] {
        let repeated = readings.windows(2).filter(|pair| pair[0] == pair[1]).count();
        if repeated as f64 >= STUCK_SHARE * (readings.len() - 1) as f64 {
            return Ok(Some(format!("its {what} repeats one reading")));
        }
    }
    for warning in statistics.warnings(unit.nominal_rate_hz) {
        // Its rates turn the wrong way: no filter makes an orientation of them.
        if warning.kind == InertialWarningKind::MirroredAxis {
            return Ok(Some(warning.sentence));
        }
        warnings.push(Warning::new(code(warning.kind), format!("the unit on {segment}: {}", warning.sentence)));
    }
    Ok(None)
}

/// Code of the warning about a doubt that the description of the recording tells too.
fn code(kind: InertialWarningKind) -> &'static str {
    match kind {
        InertialWarningKind::NoSamples => "unit_without_samples",
        InertialWarningKind::Saturation => "unit_saturation",
        InertialWarningKind::DropOut => "unit_drop_out",
        InertialWarningKind::Jitter => "unit_jitter",
        InertialWarningKind::ConstantAcceleration => "unit_constant_acceleration",
        InertialWarningKind::ConstantAngularRate => "unit_constant_angular_rate",
        InertialWarningKind::AccelerationScale => "unit_acceleration_scale",
        InertialWarningKind::MirroredAxis => "unit_mirrored_axis",
        InertialWarningKind::RateDiffers => "unit_rate_differs",
    }
}
