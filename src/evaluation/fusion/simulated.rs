//! Contenders on simulated recordings, whose whole body is known.

use super::angles::{AngleErrors, Estimate, compare};
use super::clocks::{UnitErrors, errors_of_unit};
use super::contender::Contender;
use crate::assessment::{AngleChannel, Assessment, SkeletonFusionSettings};
use crate::body::{Limb, Side};
use crate::evaluation::three_point::hinge_flexion_deg;
use crate::pipeline::skeleton_fusion;
use crate::progress::Monitor;
use crate::recording::{Recording, Segment};
use crate::synthetic::inertial::protocol::{PHASE_CODES, Protocol};
use crate::synthetic::{FusionSimulation, Movement, simulate_fusion};
use rayon::prelude::*;
use serde::Serialize;

/// Time in which the camera does not see a limb, several or the whole body, seconds: that of the bar.
pub const OCCLUSION_S: f64 = 20.0;

/// What is simulated and compared.
#[derive(Debug, Clone)]
pub struct Plan {
    /// The movements.
    pub movements: Vec<Movement>,
    /// Subjects of each movement.
    pub seeds: Vec<u64>,
    /// The segments whose units are kept; none keeps all nine.
    pub units: Option<Vec<Segment>>,
    /// Whether the units lie on a common plank before they are put on.
    pub plank: bool,
    /// What is compared.
    pub contenders: Vec<Contender>,
    /// Length of the movement, seconds.
    pub movement_s: f64,
    /// Time in which the camera does not see a limb, several or the whole body, seconds.
    pub occlusion_s: f64,
}

impl Plan {
    /// Some contenders on the movements of \[fusion\] with nine units after plank and jumps, 30 s each.
    pub fn new(seeds: Vec<u64>, contenders: Vec<Contender>) -> Self {
        Self {
            movements: Movement::OF_FUSION.to_vec(),
            seeds,
            units: None,
            plank: true,
            contenders,
            movement_s: 30.0,
            occlusion_s: OCCLUSION_S,
        }
    }
}

/// What one contender did in one recording.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Outcome {
    /// What the subject did.
    pub movement: String,
    /// The subject.
    pub seed: u64,
    /// What was compared.
    pub contender: Contender,
    /// Each angle that it estimates, in the order of [`channels`].
    pub angles: Vec<AngleErrors>,
    /// Each unit that it used.
    pub units: Vec<UnitErrors>,
    /// Why there is nothing.
    pub failure: Option<String>,
}

/// The angles that are compared: elbows and knees first.
pub fn channels() -> Vec<AngleChannel> {
    let both = |of: fn(Side) -> AngleChannel| Side::BOTH.map(of);
    let mut channels = [both(AngleChannel::ElbowFlexion), both(AngleChannel::KneeFlexion)].concat();
    for of in [AngleChannel::HipFlexion, AngleChannel::HipAbduction, AngleChannel::HipAxialRotation] {
        channels.extend(both(of));
    }
    channels.extend([AngleChannel::TrunkFlexion, AngleChannel::TrunkLateralBending, AngleChannel::TrunkAxialRotation]);
    channels
}

/// Runs every contender on every recording, recordings in parallel; the result does not depend on the number of threads.
///
/// `done` is called after each recording.
pub fn run(plan: &Plan, done: impl Fn() + Sync) -> Vec<Outcome> {
    let trials: Vec<(&Movement, u64)> =
        plan.movements.iter().flat_map(|movement| plan.seeds.iter().map(move |seed| (movement, *seed))).collect();
    trials
        .par_iter()
        .with_max_len(1)
        .flat_map_iter(|(movement, seed)| {
            let outcomes = evaluate(plan, movement, *seed);
            done();
            outcomes
        })
        .collect()
}

/// Every contender on one recording.
fn evaluate(plan: &Plan, movement: &Movement, seed: u64) -> Vec<Outcome> {
    let usual = FusionSimulation::new(movement.clone(), seed);
    let settings = FusionSimulation {
        occlusion_s: plan.occlusion_s,
        movement_s: plan.movement_s,
        protocol: if plan.plank { Protocol::FULL } else { Protocol { plank: false, ..Protocol::FULL } },
        ..usual
    };
    let outcome = |contender: Contender| Outcome {
        movement: movement.name().to_owned(),
        seed,
        contender,
        angles: Vec::new(),
        units: Vec::new(),
        failure: None,
    };
    let failed = |contender, failure: String| Outcome { failure: Some(failure), ..outcome(contender) };
    let mut recording = match simulate_fusion(&settings) {
        Ok(found) => found.recording,
        Err(error) => return plan.contenders.iter().map(|c| failed(*c, error.to_string())).collect(),
    };
    // Each unit has random streams of its own: taking one away changes nothing of the others.
    if let (Some(kept), Some(inertial)) = (&plan.units, &mut recording.inertial) {
        inertial.sensors.retain(|unit| kept.contains(&unit.segment));
    }
    let compared = plan.contenders.iter().map(|contender| {
        let Some(settings) = contender.settings(&SkeletonFusionSettings::default()) else {
            return Outcome { angles: errors_of_raw(&recording), ..outcome(*contender) };
        };
        match skeleton_fusion::assess(&recording, &settings, &Monitor::default()) {
            Ok(found) => Outcome {
                angles: errors_of_assessment(&recording, &found),
                units: errors_of_units(&recording, &found),
                ..outcome(*contender)
            },
            Err(error) => failed(*contender, error.to_string()),
        }
    });
    compared.collect()
}

/// Errors of the three-point angles of the camera's joints.
pub fn errors_of_raw(recording: &Recording) -> Vec<AngleErrors> {
    let Some(skeleton) = &recording.skeleton else { return Vec::new() };
    let errors = |limb: Limb| {
        let side = limb.side();
        let channel = if limb.is_arm() { AngleChannel::ElbowFlexion(side) } else { AngleChannel::KneeFlexion(side) };
        let value = hinge_flexion_deg(skeleton, limb)?;
        errors_of(recording, channel, &Estimate { time_ns: &skeleton.time_ns, value: &value, interval: None })
    };
    Limb::ALL.into_iter().filter_map(errors).collect()
}

/// Errors of every angle of an assessment.
pub fn errors_of_assessment(recording: &Recording, assessment: &Assessment) -> Vec<AngleErrors> {
    let errors = |channel: AngleChannel| {
        let name = channel.name();
        let series = assessment.series.iter().find(|series| series.channel == name)?;
        let value: Vec<f64> = series.value.iter().map(|value| f64::from(*value)).collect();
        let interval = Some([&series.low[..], &series.high[..]]);
        errors_of(recording, channel, &Estimate { time_ns: &assessment.time_ns, value: &value, interval })
    };
    channels().into_iter().filter_map(errors).collect()
}

fn errors_of_units(recording: &Recording, assessment: &Assessment) -> Vec<UnitErrors> {
    let units = assessment.quality.fusion.iter().flat_map(|fusion| &fusion.units);
    units.filter_map(|unit| errors_of_unit(recording, unit)).collect()
}

fn errors_of(recording: &Recording, channel: AngleChannel, estimate: &Estimate<'_>) -> Option<AngleErrors> {
    let name = channel.name();
    let reference = recording.references.iter().find(|series| series.channel == name)?;
    compare(estimate, reference, worn_from_ns(recording))
}

/// Time of the T-posture, before which units may lie on the plank or be carried, nanoseconds; the earliest there is when
/// the recording does not tell its phases.
fn worn_from_ns(recording: &Recording) -> i64 {
    let rest = PHASE_CODES.iter().find(|(name, _)| *name == "rest").map(|(_, code)| *code);
    let phases = recording.references.iter().find(|series| series.channel == "protocol_phase_code");
    let starts = phases.map(|phases| phases.time_ns.iter().zip(&phases.values));
    starts.and_then(|mut starts| starts.find(|(_, code)| Some(**code) == rest)).map_or(i64::MIN, |(time, _)| *time)
}
