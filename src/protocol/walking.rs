//! Walks: the pelvis goes somewhere.

use super::MeasureSpec;
use super::motion::{INTERVAL_S, Motion};
use nalgebra::Vector3;

/// Speed of the pelvis below which somebody stands, metres per second.
const STANDING_MPS: f64 = 0.15;

/// Least way from the first to the farthest place, metres: two steps.
const LEAST_M: f64 = 1.2;

/// Time over which the pelvis is averaged, seconds: half a step.
const AVERAGE_S: f64 = 0.4;

/// What the footfalls of a walk tell, whichever sensor saw them.
pub(super) const OF_FOOTFALLS: &[MeasureSpec] = &[
    ("usual_speed_mps", "m/s", "way by time, between places of the same foot"),
    ("step_length_m", "m", "from foot to foot along the way, by its definition"),
    ("step_width_m", "m", "from foot to foot across the way, by its definition"),
    ("stride_length_m", "m", "from a place of a foot to its next"),
    ("step_time_s", "s", "from a contact to the other foot's"),
    ("stride_time_s", "s", "from a contact to the same foot's next"),
    ("cadence_spm", "{steps}/min", "steps a minute"),
    ("double_support_pct", "%", "share of a stride with both feet on the floor"),
    ("stance_pct", "%", "share of a stride with the foot on the floor"),
    ("swing_pct", "%", "share of a stride with the foot in the air"),
    ("step_width_sd_m", "m", "standard deviation over steps, each foot about its own mean"),
    ("stride_time_sd_s", "s", "standard deviation over strides, each foot about its own mean"),
];

/// A walk.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Walk {
    /// Way of the pelvis while it moved, metres.
    pub distance_m: f64,
    /// Time in which it moved, seconds.
    pub moving_s: f64,
}

/// The walk of a recording; none when the pelvis stays about where it was, or its place is not known.
pub fn walk(motion: &Motion) -> Option<Walk> {
    let places = motion.places.as_ref()?;
    let half = (0.5 * AVERAGE_S / INTERVAL_S) as usize;
    let flat = |v: &Vector3<f64>| Vector3::new(v.x, 0.0, v.z);
    let seen: Vec<Vector3<f64>> = places.pelvis.iter().map(flat).filter(|place| place.x.is_finite()).collect();
    let first = *seen.first()?;
    if seen.iter().map(|place| (place - first).norm()).fold(0.0, f64::max) < LEAST_M {
        return None;
    }
    let mut walk = Walk { distance_m: 0.0, moving_s: 0.0 };
    for pair in seen.windows(2 * half + 1) {
        let step = (pair[2 * half] - pair[0]) / (2 * half) as f64;
        if step.norm() >= STANDING_MPS * INTERVAL_S {
            walk.distance_m += step.norm();
            walk.moving_s += INTERVAL_S;
        }
    }
    (walk.distance_m >= LEAST_M).then_some(walk)
}
