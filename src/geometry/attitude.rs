//! Attitude vectors (rotation vectors, axis × angle) and the exponential map.

use nalgebra::{Matrix3, Rotation3, UnitQuaternion, Vector3};

/// Squared angle (rad²) below which the Taylor series replaces `sin x / x`; the first neglected term is x⁴/120 < 1e-18.
const SMALL_ANGLE_SQUARED: f64 = 1e-8;

/// Rotation of an attitude vector in radians (exponential map), exact at zero.
///
/// Rodrigues' formula `R = I + s [v]ₓ + c [v]ₓ²` with `s = sin θ / θ` and `c = (1 − cos θ) / θ²`.
pub fn rotation_from_attitude(attitude: &Vector3<f64>) -> Rotation3<f64> {
    let (s, c) = rodrigues_coefficients(attitude.norm_squared());
    let k = attitude.cross_matrix();
    Rotation3::from_matrix_unchecked(Matrix3::identity() + k * s + k * k * c)
}

/// `(sin θ / θ, (1 − cos θ) / θ²)` of a squared angle, continuous at zero.
pub fn rodrigues_coefficients(angle_squared: f64) -> (f64, f64) {
    if angle_squared < SMALL_ANGLE_SQUARED {
        (1.0 - angle_squared / 6.0, 0.5 - angle_squared / 24.0)
    } else {
        let angle = angle_squared.sqrt();
        (angle.sin() / angle, (1.0 - angle.cos()) / angle_squared)
    }
}

/// Attitude vector in radians of a rotation (logarithmic map); its norm lies in `[0, π]`.
///
/// At exactly π the axis is defined up to sign; see [`nearest_branch`] for the continuous choice in a series.
pub fn attitude_from_rotation(rotation: &Rotation3<f64>) -> Vector3<f64> {
    attitude_from_quaternion(&UnitQuaternion::from_rotation_matrix(rotation))
}

/// Attitude vector in radians of a unit quaternion; its norm lies in `[0, π]`.
///
/// Uses `2 atan2(|v|, |w|)`, which keeps full precision both near 0 and near π.
pub fn attitude_from_quaternion(quaternion: &UnitQuaternion<f64>) -> Vector3<f64> {
    let sign = if quaternion.w < 0.0 { -1.0 } else { 1.0 };
    let v = quaternion.imag() * sign;
    let sine = v.norm();
    // Below 1e-12 the vector part is the half angle times the axis to machine precision.
    if sine < 1e-12 {
        return v * 2.0;
    }
    v * (2.0 * sine.atan2(quaternion.w * sign) / sine)
}

/// The attitude vector of the same rotation that lies nearest to `previous`, radians.
///
/// All vectors `v (1 + 2πk/|v|)` describe one rotation; the branch nearest to the previous frame keeps a series
/// continuous through π. The angle stays within ±2π.
pub fn nearest_branch(attitude: &Vector3<f64>, previous: &Vector3<f64>) -> Vector3<f64> {
    let turn = std::f64::consts::TAU;
    let angle = attitude.norm();
    // Without an axis there is no other branch along it: follow the previous axis by whole turns.
    let axis = if angle > 1e-12 {
        attitude / angle
    } else {
        match previous.try_normalize(1e-12) {
            Some(axis) => axis,
            None => return *attitude,
        }
    };
    [angle - turn, angle, angle + turn]
        .into_iter()
        .filter(|candidate| candidate.abs() <= turn)
        .map(|candidate| axis * candidate)
        .min_by(|a, b| (a - previous).norm_squared().total_cmp(&(b - previous).norm_squared()))
        .unwrap_or(*attitude)
}

/// Left Jacobian of SO(3): `exp(v + δ) ≈ exp(J δ) exp(v)` for a small `δ` in radians.
pub fn left_jacobian(attitude: &Vector3<f64>) -> Matrix3<f64> {
    let angle_squared = attitude.norm_squared();
    let (s, c) = rodrigues_coefficients(angle_squared);
    let k = attitude.cross_matrix();
    let third =
        if angle_squared < SMALL_ANGLE_SQUARED { 1.0 / 6.0 - angle_squared / 120.0 } else { (1.0 - s) / angle_squared };
    Matrix3::identity() + k * c + k * k * third
}

/// Inverse of [`left_jacobian`], in closed form; none at a full turn (but not at zero), where there is none.
///
/// ```text
/// J⁻¹ = 1 − ½ [θ]× + (1 − ½θ cot ½θ) / θ² [θ]×²
/// ```
pub fn inverse_left_jacobian(attitude: &Vector3<f64>) -> Option<Matrix3<f64>> {
    /// Sine of half the angle under which a turn counts as full.
    const FULL_TURN: f64 = 1e-12;
    let angle_squared = attitude.norm_squared();
    let k = attitude.cross_matrix();
    let second = if angle_squared < SMALL_ANGLE_SQUARED {
        1.0 / 12.0 + angle_squared / 720.0
    } else {
        let half = 0.5 * angle_squared.sqrt();
        let (sin, cos) = half.sin_cos();
        if sin.abs() < FULL_TURN {
            return None;
        }
        (1.0 - half * cos / sin) / angle_squared
    };
    Some(Matrix3::identity() - k * 0.5 + k * k * second)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;
    use std::f64::consts::PI;

    fn attitude() -> impl Strategy<Value = Vector3<f64>> {
        prop::array::uniform3(-1.0..1.0f64).prop_map(|v| Vector3::from(v) * 1.8)
    }

    proptest! {
        #[test]
        fn logarithm_inverts_exponential_below_pi(v in attitude()) {
            let back = attitude_from_rotation(&rotation_from_attitude(&v));
            let same_rotation = nearest_branch(&back, &v);
            prop_assert!((same_rotation - v).norm() < 1e-7, "{v} became {same_rotation}");
        }

        #[test]
        fn the_inverse_of_the_left_jacobian_undoes_it(v in attitude(), scale in prop::sample::select(vec![1.0, 1e-3, 1e-6])) {
            let v = v * scale;
            let inverse = inverse_left_jacobian(&v).unwrap();
            prop_assert!((inverse * left_jacobian(&v) - Matrix3::identity()).norm() < 1e-12, "{v}");
        }

        #[test]
        fn exponential_is_orthonormal_with_determinant_one(v in attitude()) {
            let m = *rotation_from_attitude(&v).matrix();
            prop_assert!((m * m.transpose() - Matrix3::identity()).norm() < 1e-12);
            prop_assert!((m.determinant() - 1.0).abs() < 1e-12);
        }

        #[test]
        fn left_jacobian_is_the_derivative_of_the_exponential(v in attitude(), d in attitude()) {
            let step = d * 1e-6;
            let exact = rotation_from_attitude(&(v + step));
            let linear = rotation_from_attitude(&(left_jacobian(&v) * step)) * rotation_from_attitude(&v);
            prop_assert!((exact.matrix() - linear.matrix()).norm() < 1e-10);
        }
    }

    #[test]
    fn the_exponential_is_exact_at_zero_and_the_logarithm_near_it() {
        assert_eq!(rotation_from_attitude(&Vector3::zeros()).matrix(), &Matrix3::identity());
        let tiny = Vector3::new(1e-9, -2e-9, 3e-9);
        assert!((attitude_from_rotation(&rotation_from_attitude(&tiny)) - tiny).norm() < 1e-20);
    }

    #[test]
    fn the_logarithm_of_a_half_turn_has_length_pi() {
        let half_turn = UnitQuaternion::from_axis_angle(&Vector3::y_axis(), PI);
        assert!((attitude_from_quaternion(&half_turn).norm() - PI).abs() < 1e-12);
    }

    #[test]
    fn a_series_through_pi_stays_continuous() {
        let mut previous = Vector3::new(0.0, 3.0, 0.0);
        for i in 0..40 {
            let angle = 3.0 + f64::from(i) * 0.02;
            let wrapped = attitude_from_rotation(&rotation_from_attitude(&Vector3::new(0.0, angle, 0.0)));
            let continuous = nearest_branch(&wrapped, &previous);
            assert!((continuous.y - angle).abs() < 1e-9, "{angle} rad became {continuous}");
            previous = continuous;
        }
    }
}
