//! How the floor passes before a camera that rolls over it: what the standing foot does.

use super::foot_contact::Phase;
use crate::body::Side;
use nalgebra::Vector2;

/// Both feet in one frame.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FeetFrame {
    /// Time, seconds.
    pub time: f64,
    /// Ankles (left, right) in `floor`: x and z, metres.
    pub ankle: [Vector2<f64>; 2],
    /// Standard deviations of the same, metres.
    pub ankle_sd: [Vector2<f64>; 2],
    /// Velocities of the ankles, m/s.
    pub velocity: [Vector2<f64>; 2],
    /// Heights of the feet above the floor, metres.
    pub height: [f64; 2],
    /// True when both lower legs were seen.
    pub seen: bool,
}

/// Width of the window over which the velocity of the floor is averaged, seconds.
const WINDOW: f64 = 0.08;
/// Weight of a frame with both feet down, in which both roll, against one in which one foot carries.
const ROLLING_WEIGHT: f64 = 0.05;
/// The end of a single support, in which the heel rises, counts as rolling: its share.
const HEEL_RISE_SHARE: f64 = 0.35;

/// Displacement of the floor (x, z; metres) before the camera since the first frame.
pub fn floor_displacement(frames: &[FeetFrame], phases: &[Phase]) -> Vec<Vector2<f64>> {
    let observed: Vec<(Vector2<f64>, f64)> = (0..frames.len()).map(|k| standing_velocity(frames, phases, k)).collect();
    let mut displacement = Vec::with_capacity(frames.len());
    let mut position = Vector2::zeros();
    let mut before: Option<(f64, Vector2<f64>)> = None;
    let mut first = 0;
    for frame in frames {
        // Farther than five widths nothing counts, except when there is nothing nearer.
        while frames[first].time < frame.time - 5.0 * WINDOW {
            first += 1;
        }
        let (mut sum, mut total) = (Vector2::zeros(), 1e-12);
        for (other, (velocity, weight)) in frames[first..].iter().zip(&observed[first..]) {
            if other.time > frame.time + 5.0 * WINDOW {
                break;
            }
            let weight = weight * (-0.5 * ((other.time - frame.time) / WINDOW).powi(2)).exp();
            sum += velocity * weight;
            total += weight;
        }
        let velocity = sum / total;
        if let Some((time, earlier)) = before {
            position += (velocity + earlier) * (0.5 * (frame.time - time));
        }
        before = Some((frame.time, velocity));
        displacement.push(position);
    }
    displacement
}

/// Velocity of what stands on the floor in a frame, and how much it counts.
fn standing_velocity(frames: &[FeetFrame], phases: &[Phase], k: usize) -> (Vector2<f64>, f64) {
    let frame = &frames[k];
    match phases[k] {
        Phase::Double => ((frame.velocity[0] + frame.velocity[1]) * 0.5, ROLLING_WEIGHT),
        Phase::Swing { side, .. } => {
            let same = |n: &usize| phases[*n] == phases[k];
            let begin = (0..=k).rev().take_while(same).last().unwrap_or(k);
            let end = (k..frames.len()).take_while(same).last().unwrap_or(k);
            let share = (k - begin) as f64 / (end - begin).max(1) as f64;
            let weight = if share > 1.0 - HEEL_RISE_SHARE { ROLLING_WEIGHT } else { 1.0 };
            (frame.velocity[standing(side) as usize], weight)
        }
    }
}

/// The foot that carries while the other swings.
fn standing(swinging: Side) -> Side {
    swinging.opposite()
}
