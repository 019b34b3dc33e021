//! Steps from tracked feet: contacts, lengths, widths, and which steps do not count.

use super::floor_motion::{FeetFrame, floor_displacement};
use super::foot_contact::{FeetSample, Phase, phases};
use crate::assessment::gait::{
    ANKLES_AT_MID_DOUBLE_SUPPORT, ExcludedSteps, FLAT_FOOTPRINTS, Gait, Step, StepMeasure, StepSummary,
};
use crate::body::Side;
use nalgebra::{Matrix3, Vector2, Vector3};

/// A foot that moves less than this against the other, metres, shifts its weight; it does not step.
const MIN_SWING: f64 = 0.06;
/// Share of a swing's fastest speed of the ankle at which the toes leave the floor.
const TOE_OFF_SPEED: f64 = 0.2;
/// Bounds of the time of a swing, seconds; walkers' users swing for 0.3 to 0.6.
const SWING_TIME: std::ops::Range<f64> = 0.12..1.5;
/// A contact later than this after the one before begins a new walk, seconds: the longest plausible step time
/// (Mobilise-D).
const MAX_STEP_TIME: f64 = 2.124;
/// Steps at either end of a walk that do not count (clinical convention).
const END_STEPS: usize = 2;
/// Share of a step's frames in which both lower legs must be seen.
const MIN_COVERAGE: f64 = 0.8;
/// A step during which the walker turns by more than this is part of a turn, radians: a corner in six steps is 15 degrees
/// a step.
const TURN: f64 = 5.0 * std::f64::consts::PI / 180.0;
/// Feet turn before the walker does, which is pushed and heavy: so many steps before one that turns are part of the turn.
const STEPS_BEFORE_TURN: usize = 2;
/// Way of a standing foot, metres, on which a bend is half believed: a bend of 2 mm on 0.1 m is 9 degrees.
const NOTHING_SURE: f64 = 0.1;
/// Standard deviation of a well-seen standing foot about its path, metres.
const PATH_SD: f64 = 0.004;
/// 97.5 % point of the normal distribution.
const NORMAL_975: f64 = 1.96;
/// What differs from body to body between tracked ankles and joints, and does not cancel between the feet: standard
/// deviation along and across by the definitions of a step, metres; from simulated walks.
const ANKLE_BODY_SD: [f64; 2] = [0.009, 0.006];
/// See [`ANKLE_BODY_SD`].
const PRINT_BODY_SD: [f64; 2] = [0.012, 0.007];

/// A swing, as frame numbers.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Swing {
    side: Side,
    backward: bool,
    toe_off: usize,
    heel_strike: usize,
}

/// Steps of a recording.
pub fn gait(frames: &[FeetFrame]) -> Gait {
    let samples: Vec<FeetSample> = frames
        .iter()
        .map(|f| FeetSample {
            time: f.time,
            relative_speed: f.velocity[0].y - f.velocity[1].y,
            relative_height: f.height[0] - f.height[1],
            seen: f.seen,
        })
        .collect();
    let phases = phases(&samples);
    let swings = swings(frames, &phases);
    let displacement = floor_displacement(frames, &phases);
    let mut gait = Gait::default();
    let mut walking = 0.0;
    let mut double = 0.0;
    for walk in walks(frames, &swings) {
        let begin = walk[0].toe_off;
        let end = walk[walk.len() - 1].heel_strike;
        walking += frames[end].time - frames[begin].time;
        double += both_down(frames, walk);
        gait.steps.extend(steps_of_walk(frames, &displacement, walk));
    }
    let duration = frames.last().map_or(0.0, |last| last.time - frames[0].time);
    gait.standing_s = (duration - walking).max(0.0);
    gait.double_support_share = (walking > 0.0).then(|| double / walking);
    finish(&mut gait);
    gait
}

/// Runs of swing phases that are swings: long enough in time and way, and seen.
fn swings(frames: &[FeetFrame], phases: &[Phase]) -> Vec<Swing> {
    let mut swings = Vec::new();
    let mut k = 0;
    while k < phases.len() {
        let begin = k;
        while k < phases.len() && phases[k] == phases[begin] {
            k += 1;
        }
        let Phase::Swing { side, backward } = phases[begin] else { continue };
        let run = begin..k;
        // Of a swing at the beginning nobody knows when it began; at the end its contact is known when the foot has
        // come to rest.
        if begin == 0 {
            continue;
        }
        let heel_strike = if k < phases.len() { Some(k) } else { rest(frames, side, run.clone()) };
        let Some(heel_strike) = heel_strike else { continue };
        let relative = |n: usize| frames[n].ankle[side as usize] - frames[n].ankle[side.opposite() as usize];
        let way = (relative(heel_strike) - relative(begin)).y.abs();
        let time = frames[heel_strike].time - frames[begin].time;
        let seen = frames[begin..heel_strike].iter().filter(|f| f.seen).count();
        if way >= MIN_SWING && SWING_TIME.contains(&time) && 2 * seen >= heel_strike - begin {
            swings.push(Swing { side, backward, toe_off: toe_off(frames, side, run), heel_strike });
        }
    }
    swings
}

/// The frame in which a foot that swings until the last frame has come to rest against the other one.
fn rest(frames: &[FeetFrame], side: Side, swing: std::ops::Range<usize>) -> Option<usize> {
    /// Frames that it must rest for, so that it is not the slow beginning of another swing.
    const RESTING: usize = 2;
    let (speed, fastest) = speeds(frames, side, &swing);
    let last = swing.clone().rfind(|k| speed(*k) >= TOE_OFF_SPEED * fastest)?;
    (last + RESTING < swing.end).then_some(last + 1)
}

/// The frame in which the toes leave the floor: the ankle moves before, while the heel rises over the standing toes, but
/// not as fast as in the air.
fn toe_off(frames: &[FeetFrame], side: Side, swing: std::ops::Range<usize>) -> usize {
    let (speed, fastest) = speeds(frames, side, &swing);
    swing.clone().find(|k| speed(*k) >= TOE_OFF_SPEED * fastest).unwrap_or(swing.start)
}

/// Speed of a swinging foot against the other one, m/s, and its greatest in the swing.
fn speeds(frames: &[FeetFrame], side: Side, swing: &std::ops::Range<usize>) -> (impl Fn(usize) -> f64, f64) {
    let speed =
        move |k: usize| (frames[k].velocity[side as usize].y - frames[k].velocity[side.opposite() as usize].y).abs();
    (speed, swing.clone().map(speed).fold(0.0, f64::max))
}

/// Swings that follow each other without a rest, in one direction.
fn walks<'a>(frames: &'a [FeetFrame], swings: &'a [Swing]) -> impl Iterator<Item = &'a [Swing]> {
    swings.chunk_by(|a, b| {
        a.backward == b.backward && frames[b.heel_strike].time - frames[a.heel_strike].time <= MAX_STEP_TIME
    })
}

/// Time between the swings of a walk, seconds.
fn both_down(frames: &[FeetFrame], walk: &[Swing]) -> f64 {
    walk.windows(2).map(|pair| (frames[pair[1].toe_off].time - frames[pair[0].heel_strike].time).max(0.0)).sum()
}

fn steps_of_walk(frames: &[FeetFrame], displacement: &[Vector2<f64>], walk: &[Swing]) -> Vec<Step> {
    let prints: Vec<Option<Footprint>> = (0..walk.len()).map(|n| footprint(frames, displacement, walk, n)).collect();
    let turns = turns(frames, walk);
    let mut steps = Vec::with_capacity(walk.len());
    for (n, swing) in walk.iter().enumerate() {
        let before = n.checked_sub(1).map(|m| walk[m]);
        let after = walk.get(n + 1);
        let alternates = before.is_none_or(|b| b.side != swing.side) && after.is_none_or(|a| a.side != swing.side);
        let begin = before.map_or(swing.toe_off, |b| b.heel_strike);
        let end = after.map_or(swing.heel_strike, |a| a.toe_off);
        let mut measures = Vec::new();
        if alternates {
            if after.is_some() {
                measures.push(ankle_measure(frames, swing, (swing.heel_strike + end) / 2));
            }
            measures.extend(print_measure(swing, &prints, n));
        }
        let span = &frames[begin..=end.max(begin)];
        let coverage = span.iter().filter(|f| f.seen).count() as f64 / span.len() as f64;
        let mut excluded = Vec::new();
        let mut exclude = |reason: &str, applies: bool| {
            if applies {
                excluded.push(reason.to_owned());
            }
        };
        exclude("first_or_last", n < END_STEPS || n + END_STEPS >= walk.len());
        exclude("turning", turns[n..].iter().take(1 + STEPS_BEFORE_TURN).any(|turn| turn.abs() > TURN));
        exclude("low_coverage", coverage < MIN_COVERAGE);
        exclude("missed_contact", !alternates);
        let start = frames[0].time;
        steps.push(Step {
            side: swing.side,
            toe_off_s: frames[swing.toe_off].time - start,
            heel_strike_s: frames[swing.heel_strike].time - start,
            opposite_toe_off_s: after.filter(|_| alternates).map(|a| frames[a.toe_off].time - start),
            step_time_s: before
                .filter(|_| alternates)
                .map(|b| frames[swing.heel_strike].time - frames[b.heel_strike].time),
            measures,
            coverage,
            backward: swing.backward,
            excluded_because: excluded,
        });
    }
    steps
}

/// Where a foot stands on the floor.
#[derive(Debug, Clone, Copy)]
struct Footprint {
    position: Vector2<f64>,
    sd: Vector2<f64>,
}

/// The print of the foot that landed with swing `n`: where its ankle is while the other foot swings past.
fn footprint(frames: &[FeetFrame], displacement: &[Vector2<f64>], walk: &[Swing], n: usize) -> Option<Footprint> {
    let next = walk.get(n + 1)?;
    let foot = walk[n].side as usize;
    let middle = (next.toe_off + next.heel_strike) / 2;
    let span = next.toe_off..=middle;
    let count = (middle - next.toe_off + 1) as f64;
    let position = span.clone().map(|k| frames[k].ankle[foot] - displacement[k]).sum::<Vector2<f64>>() / count;
    let sd = span.map(|k| frames[k].ankle_sd[foot]).sum::<Vector2<f64>>() / count;
    Some(Footprint { position, sd })
}

fn ankle_measure(frames: &[FeetFrame], swing: &Swing, at: usize) -> StepMeasure {
    let frame = &frames[at];
    let foot = swing.side as usize;
    let other = 1 - foot;
    let between = frame.ankle[foot] - frame.ankle[other];
    let direction = if swing.backward { -1.0 } else { 1.0 };
    let width = frame.ankle[Side::Left as usize].x - frame.ankle[Side::Right as usize].x;
    let variance = frame.ankle_sd[foot].map(|s| s * s) + frame.ankle_sd[other].map(|s| s * s);
    measure(ANKLES_AT_MID_DOUBLE_SUPPORT, direction * between.y, width, variance, ANKLE_BODY_SD)
}

/// Step by footprints: needs the prints before and after it of the other foot.
fn print_measure(swing: &Swing, prints: &[Option<Footprint>], n: usize) -> Option<StepMeasure> {
    let (before, here, after) = (prints[n.checked_sub(1)?]?, prints[n]?, (*prints.get(n + 1)?)?);
    let stride = after.position - before.position;
    let u = stride.try_normalize(0.02)?;
    // The left of somebody who walks along (x, z) = u, for whom the left is at larger x when u is (0, 1).
    let left = Vector2::new(u.y, -u.x) * if swing.backward { -1.0 } else { 1.0 };
    let step = here.position - before.position;
    let across = step.dot(&left) * if swing.side == Side::Left { 1.0 } else { -1.0 };
    let variance = here.sd.map(|s| s * s) + before.sd.map(|s| s * s);
    Some(measure(FLAT_FOOTPRINTS, step.dot(&u), across, variance, PRINT_BODY_SD))
}

fn measure(definition: &str, length: f64, width: f64, variance: Vector2<f64>, body_sd: [f64; 2]) -> StepMeasure {
    let half_length = NORMAL_975 * (variance.y + body_sd[0].powi(2)).sqrt();
    let half_width = NORMAL_975 * (variance.x + body_sd[1].powi(2)).sqrt();
    StepMeasure {
        definition: definition.to_owned(),
        length_m: length,
        length_interval_m: [length - half_length, length + half_length],
        width_m: width,
        width_interval_m: [width - half_width, width + half_width],
    }
}

/// Angle by which the walker turns during each step of a walk, radians.
///
/// A walker turns about its wheels near the user, so a turn hardly shifts the floor where the user stands; but the path of a
/// standing foot before the camera bends: it is a parabola x(z) whose direction changes by the angle of the turn. One step
/// has a bend of a few millimetres, so three together are looked at, each by the square of its way.
fn turns(frames: &[FeetFrame], walk: &[Swing]) -> Vec<f64> {
    let bends: Vec<(f64, f64)> = walk
        .iter()
        .map(|swing| {
            let standing = swing.side.opposite() as usize;
            let path: Vec<(Vector2<f64>, f64)> = frames[swing.toe_off..=swing.heel_strike]
                .iter()
                .map(|frame| (frame.ankle[standing], 1.0 / (frame.ankle_sd[standing].x.powi(2) + PATH_SD * PATH_SD)))
                .collect();
            bend(&path)
        })
        .collect();
    let step_share = |n: usize| {
        let step = (frames[walk[n].heel_strike].time
            - n.checked_sub(1).map_or(f64::NAN, |m| frames[walk[m].heel_strike].time))
            / (frames[walk[n].heel_strike].time - frames[walk[n].toe_off].time);
        if step.is_finite() { step.clamp(1.0, 2.0) } else { 1.5 }
    };
    (0..walk.len())
        .map(|n| {
            let around = n.saturating_sub(1)..(n + 2).min(walk.len());
            let (sum, weight) = around.fold((0.0, 0.0), |(sum, total), k| {
                let (angle, way) = bends[k];
                // Its own twice, so that both feet count alike: as one leg passes behind the other its path bends to its
                // own side, and a turn bends both to one side.
                let weight = way * way * if k == n { 2.0 } else { 1.0 };
                (sum + angle * step_share(k) * weight, total + weight)
            });
            // A step of a few centimetres bends by chance.
            if weight > 0.0 { sum / weight * (weight / (weight + NOTHING_SURE * NOTHING_SURE)) } else { 0.0 }
        })
        .collect()
}

/// Change of direction along a path of weighted places and its extent along z as far as it is sure: the parabola x(z) of
/// least squares.
fn bend(path: &[(Vector2<f64>, f64)]) -> (f64, f64) {
    let total: f64 = path.iter().map(|(_, weight)| weight).sum();
    let mean = path.iter().map(|(place, weight)| place * *weight).sum::<Vector2<f64>>() / total;
    let way = path[path.len() - 1].0.y - path[0].0.y;
    let mut matrix = Matrix3::zeros();
    let mut vector = Vector3::zeros();
    for (place, weight) in path {
        let z = place.y - mean.y;
        let row = Vector3::new(1.0, z, z * z);
        matrix += row * row.transpose() * *weight;
        vector += row * (place.x - mean.x) * *weight;
    }
    let sure = total * PATH_SD * PATH_SD / path.len() as f64;
    match matrix.lu().solve(&vector) {
        Some(parabola) if way != 0.0 => (2.0 * parabola[2] * way, way.abs() * sure.sqrt()),
        _ => (0.0, 0.0),
    }
}

/// Counts and means over the steps that count.
fn finish(gait: &mut Gait) {
    for reason in ["first_or_last", "turning", "low_coverage", "missed_contact"] {
        let n_steps = gait.steps.iter().filter(|s| s.excluded_because.iter().any(|r| r == reason)).count() as u64;
        if n_steps > 0 {
            gait.excluded.push(ExcludedSteps { reason: reason.to_owned(), n_steps });
        }
    }
    let used: Vec<&Step> = gait.steps.iter().filter(|s| s.excluded_because.is_empty()).collect();
    gait.n_steps_used = used.len() as u64;
    for definition in [ANKLES_AT_MID_DOUBLE_SUPPORT, FLAT_FOOTPRINTS] {
        gait.summary.extend(summary(definition, &used));
    }
    let times: Vec<f64> = used.iter().filter_map(|s| s.step_time_s).collect();
    gait.cadence_per_min = (times.len() > 1).then(|| 60.0 * times.len() as f64 / times.iter().sum::<f64>());
}

fn summary(definition: &str, steps: &[&Step]) -> Option<StepSummary> {
    let of = |value: fn(&StepMeasure) -> f64| {
        steps
            .iter()
            .filter_map(|s| {
                let found = s.measures.iter().find(|m| m.definition == definition)?;
                Some((s.side, value(found)))
            })
            .collect::<Vec<(Side, f64)>>()
    };
    let lengths = of(|m| m.length_m);
    let widths = of(|m| m.width_m);
    if lengths.len() < 2 {
        return None;
    }
    let mean = |values: &[(Side, f64)]| values.iter().map(|v| v.1).sum::<f64>() / values.len() as f64;
    Some(StepSummary {
        definition: definition.to_owned(),
        n_steps: lengths.len() as u64,
        length_mean_m: mean(&lengths),
        length_sd_m: pooled_deviation(&lengths),
        width_mean_m: mean(&widths),
        width_sd_m: pooled_deviation(&widths),
    })
}

/// Standard deviation (n − 1) after each side's mean is removed.
fn pooled_deviation(values: &[(Side, f64)]) -> f64 {
    let mut squares = 0.0;
    for side in Side::BOTH {
        let own: Vec<f64> = values.iter().filter(|v| v.0 == side).map(|v| v.1).collect();
        let mean = own.iter().sum::<f64>() / own.len().max(1) as f64;
        squares += own.iter().map(|v| (v - mean).powi(2)).sum::<f64>();
    }
    (squares / (values.len() - 1) as f64).sqrt()
}

#[cfg(test)]
mod tests;
