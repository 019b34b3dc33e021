//! Canaries: a small recording for each pipeline whose truth is known. A worker that gets one wrong takes no jobs, whatever made
//! it wrong: a defect of this build, of the processor, or of a library that was changed beneath it.

use crate::assessment::{Assessment, Settings};
use crate::pipeline;
use crate::progress::Monitor;
use crate::recording::decode::{DepthReader, Format, Limits, decode};
use crate::recording::{Recording, encode};
use crate::synthetic::walker::{Course, WalkerSettings, WalkerSimulation, trousers};
use crate::synthetic::{Exercise, FusionSimulation, Movement, Preset, SimulationSettings, simulate, simulate_fusion};
use std::io::Cursor;

/// Largest mean error of an angle on a recording without errors of the sensors, degrees.
const MOST_ANGLE_ERROR_DEG: f64 = 3.0;
/// Largest mean distance of an ankle from its truth, metres.
const MOST_ANKLE_ERROR_M: f64 = 0.05;
/// The angle that is looked at.
const CHANNEL: &str = "right_knee_flexion_deg";
/// Seed of every canary.
const SEED: u64 = 7;

/// Runs every canary.
///
/// # Errors
/// Names the pipeline that got its recording wrong, and how.
pub fn sing() -> Result<(), String> {
    let of = |pipeline: &'static str| move |why: String| format!("{pipeline}: {why}");
    joint_angles().map_err(of("joint_angles"))?;
    skeleton_fusion().map_err(of("skeleton_fusion"))?;
    leg_pose().map_err(of("leg_pose"))
}

fn joint_angles() -> Result<(), String> {
    let settings =
        SimulationSettings { duration_s: 6.0, ..SimulationSettings::new(Exercise::BackKnee, Preset::Clean, SEED) };
    let recording = simulate(&settings).map_err(|error| error.to_string())?.recording;
    check_angle(&recording, &assessed(&recording)?)
}

fn skeleton_fusion() -> Result<(), String> {
    let exercise = Movement::Exercise(Exercise::BackKnee);
    let settings = FusionSimulation { movement_s: 6.0, ..FusionSimulation::without_errors(exercise, SEED) };
    let recording = simulate_fusion(&settings).map_err(|error| error.to_string())?.recording;
    check_angle(&recording, &assessed(&recording)?)
}

/// The assessment of a recording that has gone through its file form, as every uploaded one has.
fn assessed(recording: &Recording) -> Result<Assessment, String> {
    let bytes = encode::mcap(recording).map_err(|error| error.to_string())?;
    let decoded = decode(Cursor::new(bytes), Format::Mcap, &Limits::default()).map_err(|error| error.to_string())?;
    let units = decoded.inertial.iter().flat_map(|inertial| &inertial.sensors).map(|sensor| sensor.segment);
    let settings = Settings::suited_to(units);
    pipeline::assess(&decoded, &settings, &Monitor::default()).map_err(|error| error.to_string())
}

fn check_angle(recording: &Recording, assessment: &Assessment) -> Result<(), String> {
    let truth = recording.references.iter().find(|series| series.channel == CHANNEL).ok_or("no truth")?;
    let found = assessment.series.iter().find(|series| series.channel == CHANNEL).ok_or("no series")?;
    let at = |time: i64| truth.values[truth.time_ns.partition_point(|t| *t < time).min(truth.values.len() - 1)];
    let values = assessment.time_ns.iter().zip(&found.value).filter(|(_, value)| value.is_finite());
    let errors: Vec<f64> = values.map(|(time, value)| (f64::from(*value) - at(*time)).abs()).collect();
    let missing = assessment.time_ns.len() - errors.len();
    within(mean(&errors), MOST_ANGLE_ERROR_DEG, "degrees from the truth")?;
    if missing * 10 > assessment.time_ns.len() { Err(format!("{missing} samples are missing")) } else { Ok(()) }
}

fn leg_pose() -> Result<(), String> {
    let settings = WalkerSettings { duration_s: 2.0, ..WalkerSettings::of_seed(Course::Straight, SEED) };
    let simulation = WalkerSimulation::new(&settings, trousers::trousers()).map_err(|error| error.to_string())?;
    let bytes = simulation.write(Cursor::new(Vec::new()), |_| {}).map_err(|error| error.to_string())?.into_inner();
    let reader = DepthReader::open(Cursor::new(bytes), &Limits::default()).map_err(|error| error.to_string())?;
    let assessment = pipeline::leg_pose::assess(reader, &Default::default(), &Monitor::default())
        .map_err(|error| error.to_string())?;
    let axis = |name: &str| {
        let series = assessment.series.iter().find(|series| series.channel == name);
        series.map(|series| &series.value).ok_or_else(|| format!("no series {name}"))
    };
    let ankle = [axis("left_ankle_x_m")?, axis("left_ankle_y_m")?, axis("left_ankle_z_m")?];
    let distance = |k: usize| {
        let truth = simulation.truth(k).legs[0].ankle;
        (0..3).map(|i| (f64::from(ankle[i][k]) - truth[i]).powi(2)).sum::<f64>().sqrt()
    };
    let distances: Vec<f64> = (0..assessment.time_ns.len()).map(distance).filter(|d| d.is_finite()).collect();
    within(mean(&distances), MOST_ANKLE_ERROR_M, "metres from the truth")
}

fn mean(values: &[f64]) -> f64 {
    values.iter().sum::<f64>() / values.len() as f64
}

/// Written so that NaN, the mean of nothing, is outside too.
fn within(found: f64, most: f64, what: &str) -> Result<(), String> {
    if found <= most { Ok(()) } else { Err(format!("{found:.3} {what}, at most {most} are right")) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_canaries_sing_and_a_wrong_result_is_heard() {
        sing().unwrap();
        let settings =
            SimulationSettings { duration_s: 6.0, ..SimulationSettings::new(Exercise::BackKnee, Preset::Clean, SEED) };
        let recording = simulate(&settings).unwrap().recording;
        let mut assessment = assessed(&recording).unwrap();
        let knee = assessment.series.iter_mut().find(|series| series.channel == CHANNEL).unwrap();
        knee.value.iter_mut().for_each(|value| *value += 10.0);
        assert!(check_angle(&recording, &assessment).unwrap_err().contains("degrees"));
        assert!(within(f64::NAN, 1.0, "").is_err());
    }
}
