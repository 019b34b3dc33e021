//! Which foot is on the floor, from two feet seen by a camera that moves itself.
//!
//! The floor's own motion before the camera is not known yet, but it cancels from the difference of the feet: while both
//! stand, they move alike; while one swings, they do not. A hidden Markov model over five phases (both feet down; left or
//! right swinging, forwards or backwards) weighs that difference and which foot is higher; its most probable sequence
//! gives heel strikes and toe offs. Which of the two moving feet swings is ambiguous by speed alone (a film played
//! backwards), hence the heights, summed over whole walks because the direction of walking seldom changes.

use crate::body::Side;

/// What is seen of both feet in one frame.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FeetSample {
    /// Time, seconds.
    pub time: f64,
    /// Speed of the left foot less that of the right along the direction of walking, m/s.
    pub relative_speed: f64,
    /// Height of the left foot less that of the right, metres.
    pub relative_height: f64,
    /// True when both feet were seen.
    pub seen: bool,
}

/// A phase of walking.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Phase {
    /// Both feet are on the floor.
    Double,
    /// One foot swings.
    Swing {
        /// The foot.
        side: Side,
        /// True when it swings backwards.
        backward: bool,
    },
}

impl Phase {
    const ALL: [Phase; 5] = [
        Phase::Double,
        Phase::Swing { side: Side::Left, backward: false },
        Phase::Swing { side: Side::Right, backward: false },
        Phase::Swing { side: Side::Left, backward: true },
        Phase::Swing { side: Side::Right, backward: true },
    ];

    /// Logarithm of the density of a sample in this phase, up to a constant.
    fn log_likelihood(self, sample: &FeetSample) -> f64 {
        /// Feet roll while both are down: relative speed, m/s.
        const ROLLING_SD: f64 = 0.16;
        /// A foot swings at this speed against the other, m/s; the first, short step of a walk and a shuffle are slow, and
        /// what is faster is no less likely.
        const SWING_SPEED: f64 = 0.6;
        const SWING_SPEED_SD: f64 = 0.4;
        /// A swinging foot is this much higher, metres.
        const SWING_HEIGHT: f64 = 0.03;
        const HEIGHT_SD: f64 = 0.04;
        /// Heights of neighbouring frames err together.
        const HEIGHT_WEIGHT: f64 = 0.3;
        // A frame without feet says nothing.
        if !sample.seen {
            return 0.0;
        }
        let normal = |x: f64, mean: f64, sd: f64| -0.5 * ((x - mean) / sd).powi(2) - sd.ln();
        match self {
            Phase::Double => {
                normal(sample.relative_speed, 0.0, ROLLING_SD)
                    + HEIGHT_WEIGHT * normal(sample.relative_height, 0.0, HEIGHT_SD)
            }
            Phase::Swing { side, backward } => {
                let sign = if side == Side::Left { 1.0 } else { -1.0 };
                let speed = if backward { -SWING_SPEED } else { SWING_SPEED };
                // A swing faster than expected is no worse than one as expected.
                let towards = (sign * sample.relative_speed * speed.signum()).min(SWING_SPEED);
                normal(towards, SWING_SPEED, SWING_SPEED_SD)
                    + HEIGHT_WEIGHT * normal(sign * sample.relative_height, SWING_HEIGHT, HEIGHT_SD)
            }
        }
    }

    /// Logarithm of the probability of going from this phase to another within `dt` seconds, up to a constant.
    fn log_transition(self, next: Phase, last_direction: Option<bool>, dt: f64) -> f64 {
        /// Mean time in a phase, seconds.
        const DWELL: f64 = 0.4;
        /// Cost of a turn of direction against a step in the same one.
        const TURN_COST: f64 = 10.0;
        match (self, next) {
            _ if self == next => -dt / DWELL,
            (Phase::Double, Phase::Swing { backward, .. }) => {
                let turned = last_direction.is_some_and(|before| before != backward);
                (dt / DWELL).ln() - if turned { TURN_COST } else { 0.0 }
            }
            (Phase::Swing { .. }, Phase::Double) => (dt / DWELL).ln(),
            // From swing to swing only by running, or when the frames between are missing.
            _ => (dt / DWELL).ln() - TURN_COST,
        }
    }
}

/// The most probable phase of each frame.
pub fn phases(samples: &[FeetSample]) -> Vec<Phase> {
    let Some(first) = samples.first() else { return Vec::new() };
    // A double support remembers the direction of the walk: it exists three times (no walk yet, forwards, backwards).
    let nodes: Vec<(Phase, Option<bool>)> = Phase::ALL
        .into_iter()
        .flat_map(|phase| match phase {
            Phase::Double => vec![(phase, None), (phase, Some(false)), (phase, Some(true))],
            Phase::Swing { backward, .. } => vec![(phase, Some(backward))],
        })
        .collect();
    let mut score: Vec<f64> = nodes
        .iter()
        .map(|(phase, direction)| match (phase, direction) {
            (Phase::Double, Some(_)) => f64::NEG_INFINITY,
            _ => phase.log_likelihood(first),
        })
        .collect();
    let mut came_from: Vec<Vec<usize>> = Vec::with_capacity(samples.len());
    for pair in samples.windows(2) {
        let dt = (pair[1].time - pair[0].time).clamp(1e-3, 0.3);
        let mut next_score = Vec::with_capacity(nodes.len());
        let mut origins = Vec::with_capacity(nodes.len());
        for (phase, direction) in &nodes {
            let reach = |(k, (before, before_direction)): (usize, &(Phase, Option<bool>))| {
                let possible = match (before, phase) {
                    (Phase::Double, Phase::Double) | (Phase::Swing { .. }, Phase::Double) => {
                        direction == before_direction
                    }
                    _ => true,
                };
                let step = before.log_transition(*phase, *before_direction, dt);
                (k, if possible { score[k] + step } else { f64::NEG_INFINITY })
            };
            let (origin, best) = nodes
                .iter()
                .enumerate()
                .map(reach)
                .max_by(|a, b| a.1.total_cmp(&b.1))
                .unwrap_or((0, f64::NEG_INFINITY));
            next_score.push(best + phase.log_likelihood(&pair[1]));
            origins.push(origin);
        }
        score = next_score;
        came_from.push(origins);
    }
    let mut node = (0..nodes.len()).max_by(|a, b| score[*a].total_cmp(&score[*b])).unwrap_or(0);
    let mut path = vec![nodes[node].0];
    for origins in came_from.iter().rev() {
        node = origins[node];
        path.push(nodes[node].0);
    }
    path.reverse();
    path
}

#[cfg(test)]
mod tests {
    use super::*;

    fn samples(speed: impl Fn(f64) -> f64, height: f64, seen: bool) -> Vec<FeetSample> {
        let sample = |k: i32| {
            let time = f64::from(k) / 30.0;
            let relative_speed = speed(time);
            FeetSample { time, relative_speed, relative_height: height * relative_speed.signum(), seen }
        };
        (0..180).map(sample).collect()
    }

    /// Half a second for each foot with both feet down in between.
    fn alternating(time: f64) -> f64 {
        match time % 1.4 {
            t if t < 0.5 => 1.0,
            t if (0.7..1.2).contains(&t) => -1.0,
            _ => 0.0,
        }
    }

    #[test]
    fn feet_that_move_alike_stand() {
        assert!(phases(&samples(|t| 0.08 * t.sin(), 0.0, true)).iter().all(|phase| *phase == Phase::Double));
        assert!(phases(&samples(alternating, 0.03, false)).windows(2).all(|pair| pair[0] == pair[1]));
        assert!(phases(&[]).is_empty());
    }

    #[test]
    fn the_foot_that_moves_against_the_other_swings_and_heights_tell_forwards_from_backwards() {
        for (height, is_backward) in [(0.03, false), (-0.03, true)] {
            let samples = samples(alternating, height, true);
            let found = phases(&samples);
            let mut right = 0;
            for (sample, phase) in samples.iter().zip(&found) {
                // Backwards the other foot is the one that swings.
                let side = if (sample.relative_speed > 0.0) == is_backward { Side::Right } else { Side::Left };
                let truth = match sample.relative_speed {
                    0.0 => Phase::Double,
                    _ => Phase::Swing { side, backward: is_backward },
                };
                right += usize::from(*phase == truth);
            }
            assert!(right * 20 > samples.len() * 19, "{right} of {}", samples.len());
        }
    }
}
