//! Bounds of the state.
//!
//! Lengths are those of statures from 1.35 to 2.10 m ([`LegState::upright`](super::LegState::upright)). Angles are common
//! goniometric ranges of walking adults with a wide margin (`body::range_of_motion` has the full ranges). The remaining
//! ones are provisional: wide enough for anybody in front of a walker's camera.

use super::{LEG_DIMENSION, LegVector};

/// Lower and upper bound of each element, in degrees where the element is an angle.
const BOUNDS: [[f64; 2]; LEG_DIMENSION] = [
    [0.10, 0.30],
    [-40.0, 40.0],
    [-20.0, 20.0],
    [-1.0, 1.0],
    [-1.5, 1.5],
    [0.3, 3.0],
    [0.33, 0.52],
    [0.33, 0.52],
    [0.15, 0.25],
    [0.7, 1.7],
    [0.7, 1.5],
    [-40.0, 90.0],
    [-30.0, 40.0],
    [-45.0, 45.0],
    [-40.0, 90.0],
    [-30.0, 40.0],
    [-45.0, 45.0],
    [-5.0, 120.0],
    [-5.0, 120.0],
    [-45.0, 35.0],
    [-25.0, 30.0],
    [-45.0, 35.0],
    [-25.0, 30.0],
];

/// True of the elements that are angles.
pub const fn is_angle(element: usize) -> bool {
    element == 1 || element == 2 || element >= super::FIRST_ANGLE
}

/// Lower and upper bound of an element, in metres, radians or factors.
pub fn bounds(element: usize) -> [f64; 2] {
    let bounds = BOUNDS[element];
    if is_angle(element) { bounds.map(f64::to_radians) } else { bounds }
}

/// The nearest state inside the bounds.
pub fn clamp(x: &LegVector) -> LegVector {
    LegVector::from_fn(|i, _| {
        let [low, high] = bounds(i);
        x[i].clamp(low, high)
    })
}

/// True when every element is inside its bounds.
pub fn contains(x: &LegVector) -> bool {
    (0..LEG_DIMENSION).all(|i| {
        let [low, high] = bounds(i);
        (low..=high).contains(&x[i])
    })
}
