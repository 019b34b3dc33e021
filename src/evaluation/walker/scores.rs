//! What an assessment of one simulated walk is worth: places, distances, steps and intervals beside the truth.

use super::{SimulatedFrames, mean_and_deviation, true_ankles};
use crate::assessment::gait::{ANKLES_AT_MID_DOUBLE_SUPPORT, FLAT_FOOTPRINTS, Step, StepMeasure};
use crate::assessment::{Assessment, LegPoseSettings};
use crate::body::Side;
use crate::pipeline::PipelineError;
use crate::pipeline::leg_pose::foreground::Foreground;
use crate::pipeline::leg_pose::two_legs::TwoLegs;
use crate::pipeline::leg_pose::{DepthFrames, assess_watched};
use crate::progress::Monitor;
use crate::synthetic::walker::course::Footprint;
use crate::synthetic::walker::{StepTruth, WalkerSimulation};
use nalgebra::{Point3, Vector3};

/// A contact and a step within this time of each other are the same, seconds.
const SAME_STEP_S: f64 = 0.25;

/// Errors of the distance of the ankles in floor axes, over the frames with both feet on the floor.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct DistanceErrors {
    /// Frames with both feet on the floor that have an estimate.
    pub n_frames: usize,
    /// Step length: mean absolute error and its standard deviation, metres.
    pub length_m: [f64; 2],
    /// Step width: the same.
    pub width_m: [f64; 2],
    /// Mean signed errors of length and width, metres.
    pub bias_m: [f64; 2],
}

/// Errors of the steps by one definition.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct StepErrors {
    /// Steps that are used in the means and have this definition.
    pub n_steps: usize,
    /// Mean absolute error of length and width, metres.
    pub absolute_m: [f64; 2],
    /// Mean signed error of length and width, metres.
    pub bias_m: [f64; 2],
    /// Steps whose interval holds the truth: of the length, of the width.
    pub n_held: [usize; 2],
}

/// What an assessment of one walk is worth.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct SequenceScore {
    /// Frames of the walk.
    pub n_frames: usize,
    /// The baseline: no model, no filter.
    pub baseline: DistanceErrors,
    /// The tracker.
    pub tracked: DistanceErrors,
    /// Distance of the ankles from the true ones: mean and 95th percentile, metres.
    pub ankle_m: [f64; 2],
    /// Frames without an estimate of both legs.
    pub n_lost: usize,
    /// Share of the estimates (ankle coordinates; step length and width in floor axes) whose interval holds the truth.
    pub held: [f64; 2],
    /// True contacts, those found, those missed, and steps found where none was.
    pub n_true_steps: usize,
    /// See `n_true_steps`.
    pub n_found: usize,
    /// See `n_true_steps`.
    pub n_false: usize,
    /// Steps that the means use though they are among the first or last two of a walk, or turn.
    pub n_wrongly_used: usize,
    /// Steps that the means use, and those that they should.
    pub n_used: [usize; 2],
    /// Heel strikes found less true ones: mean and standard deviation, seconds.
    pub heel_strike_s: [f64; 2],
    /// Toe offs found less true ones: the same.
    pub toe_off_s: [f64; 2],
    /// Errors by definition: ankle to ankle, footprint to footprint.
    pub steps: [StepErrors; 2],
}

impl SequenceScore {
    /// Whether the tracker's step length and step width are both nearer to the truth than the baseline's.
    pub fn beats_baseline(&self) -> bool {
        self.baseline.n_frames == 0
            || (self.tracked.length_m[0] < self.baseline.length_m[0]
                && self.tracked.width_m[0] < self.baseline.width_m[0])
    }
}

/// Assesses a simulated walk and compares it with its truth.
///
/// # Errors
/// When the walk cannot be assessed at all.
pub fn score(
    simulation: &WalkerSimulation,
    has_background: bool,
    settings: &LegPoseSettings,
) -> Result<SequenceScore, PipelineError> {
    let mut frames = SimulatedFrames::new(simulation);
    if !has_background {
        frames.background = None;
    }
    score_frames(simulation, frames, settings)
}

/// As [`score`], with the images of the walk from elsewhere.
///
/// # Errors
/// When the walk cannot be assessed at all.
pub fn score_frames(
    simulation: &WalkerSimulation,
    frames: impl DepthFrames,
    settings: &LegPoseSettings,
) -> Result<SequenceScore, PipelineError> {
    let mut feet = Vec::new();
    let mut watch = |_: i64, foreground: &Foreground| {
        feet.push(TwoLegs::find(&foreground.points).map(|legs| Side::BOTH.map(|side| legs.foot(side))));
    };
    let (found, _) = assess_watched(frames, settings, &mut watch, &Monitor::default())?;
    let mut score = SequenceScore { n_frames: simulation.len(), ..SequenceScore::default() };
    score_distances(simulation, &found, &feet, &mut score);
    score_steps(simulation, &found, &mut score);
    Ok(score)
}

#[derive(Default)]
struct Distances([Vec<f64>; 2]);

impl Distances {
    fn add(&mut self, truth: [f64; 2], found: [f64; 2]) {
        for k in 0..2 {
            self.0[k].push(found[k] - truth[k]);
        }
    }

    fn errors(&self) -> DistanceErrors {
        let absolute = self.0.each_ref().map(|errors| {
            let errors: Vec<f64> = errors.iter().map(|e| e.abs()).collect();
            mean_and_deviation(&errors)
        });
        DistanceErrors {
            n_frames: self.0[0].len(),
            length_m: absolute[0],
            width_m: absolute[1],
            bias_m: self.0.each_ref().map(|errors| mean_and_deviation(errors)[0]),
        }
    }
}

/// Value and interval of a channel at a frame; none where there is no estimate.
fn value(found: &Assessment, channel: &str, k: usize) -> Option<[f64; 3]> {
    let series = found.series.iter().find(|series| series.channel == channel)?;
    let value = [series.value[k], series.low[k], series.high[k]].map(f64::from);
    value[0].is_finite().then_some(value)
}

fn score_distances(
    simulation: &WalkerSimulation,
    found: &Assessment,
    feet: &[Option<[Vector3<f64>; 2]>],
    score: &mut SequenceScore,
) {
    let (mut baseline, mut tracked) = (Distances::default(), Distances::default());
    let (mut ankles, mut held) = (Vec::new(), [[0_usize; 2]; 2]);
    for k in 0..simulation.len().min(found.time_ns.len()) {
        let truth = simulation.truth(k);
        let [left, right] = true_ankles(&truth);
        let apart = [(left.z - right.z).abs(), (left.x - right.x).abs()];
        let is_double = truth.contacts == [true; 2];
        if let Some(Some([left, right])) = feet.get(k)
            && is_double
        {
            baseline.add(apart, [(left.z - right.z).abs(), (left.x - right.x).abs()]);
        }
        let distances = ["step_length_floor_m", "step_width_floor_m"].map(|channel| value(found, channel, k));
        let [Some(length), Some(width)] = distances else {
            score.n_lost += 1;
            continue;
        };
        if is_double {
            tracked.add(apart, [length[0], width[0]]);
        }
        for (truth, [_, low, high]) in apart.into_iter().zip([length, width]) {
            held[1][0] += usize::from((low..=high).contains(&truth));
            held[1][1] += 1;
        }
        for side in Side::BOTH {
            let ankle = truth.legs[side as usize].ankle;
            let name = |axis: &str| format!("{}_ankle_{axis}_m", side.name());
            let [Some(x), Some(y), Some(z)] = ["x", "y", "z"].map(|axis| value(found, &name(axis), k)) else {
                continue;
            };
            ankles.push((Point3::new(x[0], y[0], z[0]) - ankle).norm());
            for (axis, [_, low, high]) in [x, y, z].into_iter().enumerate() {
                held[0][0] += usize::from((low..=high).contains(&ankle[axis]));
                held[0][1] += 1;
            }
        }
    }
    ankles.sort_by(f64::total_cmp);
    let percentile = ankles.get(ankles.len() * 95 / 100).copied().unwrap_or(f64::NAN);
    score.ankle_m = [mean_and_deviation(&ankles)[0], percentile];
    score.held = held.map(|[inside, all]| inside as f64 / all.max(1) as f64);
    (score.baseline, score.tracked) = (baseline.errors(), tracked.errors());
}

/// Times at which feet came down and left, over the whole recording: side and seconds.
fn true_events(simulation: &WalkerSimulation) -> [Vec<(usize, f64)>; 2] {
    let mut events = [Vec::new(), Vec::new()];
    for print in simulation.footprints() {
        for (event, time) in [print.contact_s, print.release_s].into_iter().enumerate() {
            if time > 0.0 && time < simulation.settings().duration_s {
                events[event].push((print.side, time));
            }
        }
    }
    events
}

fn nearest(events: &[(usize, f64)], side: Side, time: f64) -> Option<f64> {
    let own = events.iter().filter(|(of, _)| *of == side as usize).map(|(_, at)| *at);
    own.min_by(|a, b| (a - time).abs().total_cmp(&(b - time).abs())).filter(|at| (at - time).abs() < SAME_STEP_S)
}

/// A step that was found and its true length and width by both definitions, metres.
struct Pair<'a> {
    step: &'a Step,
    ankles: [f64; 2],
    prints: Option<[f64; 2]>,
}

fn score_steps(simulation: &WalkerSimulation, found: &Assessment, score: &mut SequenceScore) {
    let Some(gait) = &found.gait else { return };
    let [contacts, releases] = true_events(simulation);
    let truth = simulation.steps();
    score.n_true_steps = contacts.len();
    let (mut strikes, mut offs) = (Vec::new(), Vec::new());
    let mut pairs: Vec<Pair<'_>> = Vec::new();
    for step in &gait.steps {
        let Some(contact) = nearest(&contacts, step.side, step.heel_strike_s) else {
            score.n_false += 1;
            continue;
        };
        score.n_found += 1;
        strikes.push(step.heel_strike_s - contact);
        offs.extend(nearest(&releases, step.side, step.toe_off_s).map(|release| step.toe_off_s - release));
        let is_used = step.excluded_because.is_empty();
        score.n_used[0] += usize::from(is_used);
        let Some(truth) = truth.iter().find(|t| t.side == step.side as usize && t.contact_s == contact) else {
            continue;
        };
        if is_used {
            let prints = prints_apart(simulation.footprints(), truth);
            pairs.push(Pair { step, ankles: [truth.ankle_length_m, truth.ankle_width_m], prints });
            score.n_wrongly_used += usize::from(!should_count(truth));
        }
    }
    score.n_used[1] = truth.iter().filter(|t| should_count(t)).count();
    score.heel_strike_s = mean_and_deviation(&strikes);
    score.toe_off_s = mean_and_deviation(&offs);
    score.steps = [
        step_errors(pairs.iter().map(|pair| (pair.step, pair.ankles)), ANKLES_AT_MID_DOUBLE_SUPPORT),
        step_errors(pairs.iter().filter_map(|pair| Some((pair.step, pair.prints?))), FLAT_FOOTPRINTS),
    ];
}

/// Whether a step is neither in a turn nor among the first or last two of its walk.
fn should_count(step: &StepTruth) -> bool {
    step.place_in_bout >= 2 && step.steps_to_come >= 2 && !step.is_turning
}

/// Length and width of a step by its footprints, along the line of the other foot's prints before and after it.
fn prints_apart(prints: &[Footprint], step: &StepTruth) -> Option<[f64; 2]> {
    let other = |print: &&Footprint| print.side != step.side;
    let before = prints.iter().filter(other).rfind(|print| print.contact_s < step.contact_s)?;
    let after = prints.iter().filter(other).find(|print| print.contact_s > step.contact_s)?;
    let along = (after.place - before.place).try_normalize(0.02)?;
    let apart = step.footprint.place - before.place;
    let left = Vector3::y().cross(&along);
    Some([apart.dot(&along), apart.dot(&left) * if step.side == 0 { 1.0 } else { -1.0 }])
}

fn step_errors<'a>(pairs: impl Iterator<Item = (&'a Step, [f64; 2])>, definition: &str) -> StepErrors {
    let mut errors = Distances::default();
    let mut n_held = [0; 2];
    for (step, truth) in pairs {
        let Some(measure) = step.measures.iter().find(|m: &&StepMeasure| m.definition == definition) else { continue };
        errors.add(truth, [measure.length_m, measure.width_m]);
        for (k, [low, high]) in [measure.length_interval_m, measure.width_interval_m].into_iter().enumerate() {
            n_held[k] += usize::from((low..=high).contains(&truth[k]));
        }
    }
    let summary = errors.errors();
    StepErrors {
        n_steps: summary.n_frames,
        absolute_m: [summary.length_m[0], summary.width_m[0]],
        bias_m: summary.bias_m,
        n_held,
    }
}
