//! Vertical jumps in the magnitude of the specific force.
//!
//! A jump is a flight: the force is near zero, because body and unit fall together, with a push-off before and a
//! landing after it in which the force is well above gravity. Nothing else that a person does near the ground has both.
//! Jumps for synchronisation come in a train, one after the other.

use super::motion::{GRAVITY, Motion};

/// Force below which a segment is taken to fall, in g: half of what standing gives, and more than what the smoothing
/// leaves of push-off and landing in the middle of a flight of 0.15 s.
const FALLING_G: f64 = 0.6;

/// Force that a push-off before and a landing after a flight exceed, in g.
const PUSHING_G: f64 = 1.2;

/// Duration of a fall below [`FALLING_G`], seconds: jumps of 3 to 45 cm fly 0.15 to 0.6 s, ± the smoothing.
const FLIGHT_S: std::ops::RangeInclusive<f64> = 0.08..=0.75;

/// Time within which push-off and landing must lie, seconds from the flight's ends.
const PUSHING_WITHIN_S: f64 = 0.45;

/// Time between the middles of two jumps of one train, seconds.
const SPACING_S: std::ops::RangeInclusive<f64> = 0.45..=4.0;

/// Time after a flight in which an impact rings and the smoothing carries it on, seconds.
const RINGING_S: f64 = 0.35;

/// Jumps that make a train.
pub(super) const MIN_JUMPS: usize = 3;

/// The middles of all flights, in steps of the grid.
pub(super) fn flights(motion: &Motion) -> Vec<f64> {
    let step_s = motion.grid.step_s();
    let reach = (PUSHING_WITHIN_S / step_s) as usize;
    let is_pushing = |range: &[f64]| range.iter().any(|&force| force > PUSHING_G * GRAVITY);
    let mut flights = Vec::new();
    let mut start = 0;
    for run in motion.force.chunk_by(|a, b| (*a < FALLING_G * GRAVITY) == (*b < FALLING_G * GRAVITY)) {
        let end = start + run.len();
        let is_fall = run[0] < FALLING_G * GRAVITY && FLIGHT_S.contains(&(run.len() as f64 * step_s));
        if is_fall
            && is_pushing(&motion.force[start.saturating_sub(reach)..start])
            && is_pushing(&motion.force[end..(end + reach).min(motion.force.len())])
        {
            flights.push(0.5 * (start + end - 1) as f64);
        }
        start = end;
    }
    flights
}

/// The same motion without what was felt at landings: the impact makes whatever carries a unit ring, each place in its own
/// way and after the landing only, which would pass for a delay (3 to 6 ms on legs). The camera sees nothing of it.
pub(super) fn without_landings(motion: &Motion) -> Motion {
    let mut motion = motion.clone();
    let step_s = motion.grid.step_s();
    for middle in flights(&motion) {
        // From the middle on, as the smoothing carries the impact back into the flight.
        let first = middle.ceil() as usize;
        let is_falling = |force: &&f64| **force < FALLING_G * GRAVITY;
        let end = first + motion.force[first..].iter().take_while(is_falling).count();
        let last = (end + (RINGING_S / step_s) as usize).min(motion.force.len());
        motion.force[first..last].fill(f64::NAN);
    }
    motion
}

/// The flights that belong to trains of at least [`MIN_JUMPS`], one list a train.
pub(super) fn trains(motion: &Motion) -> Vec<Vec<f64>> {
    let step_s = motion.grid.step_s();
    let flights = flights(motion);
    let runs = flights.chunk_by(|a, b| SPACING_S.contains(&((b - a) * step_s)));
    runs.filter(|train| train.len() >= MIN_JUMPS).map(<[f64]>::to_vec).collect()
}
