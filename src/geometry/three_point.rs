//! Angle at the middle of three points.

use nalgebra::Vector3;

/// Angle between the two straight continuations at `middle`, radians: 0 when the three points are in line, growing as
/// they fold; NaN when a point is missing or two coincide.
///
/// With hip, knee and ankle this is the raw knee flexion that every tracker has to beat.
pub fn flexion_of_three_points(proximal: &Vector3<f64>, middle: &Vector3<f64>, distal: &Vector3<f64>) -> f64 {
    let (upper, lower) = (middle - proximal, distal - middle);
    if upper.norm_squared() == 0.0 || lower.norm_squared() == 0.0 {
        return f64::NAN;
    }
    // Unlike the arc cosine this keeps its precision near 0 and π.
    upper.cross(&lower).norm().atan2(upper.dot(&lower))
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f64::consts::{FRAC_PI_2, PI};

    #[test]
    fn a_straight_limb_has_no_flexion_and_a_folded_one_half_a_turn() {
        let [hip, knee, forward] = [Vector3::y(), Vector3::zeros(), Vector3::z()];
        assert_eq!(flexion_of_three_points(&hip, &knee, &-hip), 0.0);
        assert!((flexion_of_three_points(&hip, &knee, &forward) - FRAC_PI_2).abs() < 1e-15);
        assert!((flexion_of_three_points(&hip, &knee, &hip) - PI).abs() < 1e-15);
        assert!(flexion_of_three_points(&hip, &hip, &knee).is_nan());
        assert!(flexion_of_three_points(&hip, &knee, &Vector3::repeat(f64::NAN)).is_nan());
    }
}
