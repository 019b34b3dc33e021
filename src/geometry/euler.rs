//! Cardan and Euler decompositions used for anatomical angles (ISB: Wu 2002, Wu 2005; Grood and Suntay 1983).

use nalgebra::{Rotation3, Vector3};

/// Sine of the distance (1°) to the singular middle angle inside which the other two are not separable.
const SINGULAR_COSINE: f64 = 0.017_452_406;

/// Three successive rotation angles in radians, and whether the middle one made the outer two inseparable.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct EulerAngles {
    /// Angle about the first axis of the sequence, radians.
    pub first: f64,
    /// Angle about the second, floating axis, radians.
    pub second: f64,
    /// Angle about the third axis, radians.
    pub third: f64,
    /// True within 1° of the singular posture: only a combination of `first` and `third` is defined there.
    pub is_singular: bool,
}

/// Decomposes `R = Rz(first) Rx(second) Ry(third)`; `second` lies in ±90°.
///
/// At the singularity `third` is set to zero and `first` carries the whole rotation.
pub fn zxy_from_rotation(rotation: &Rotation3<f64>) -> EulerAngles {
    let r = rotation.matrix();
    let second = r[(2, 1)].clamp(-1.0, 1.0).asin();
    if second.cos() < SINGULAR_COSINE {
        return EulerAngles { first: r[(1, 0)].atan2(r[(0, 0)]), second, third: 0.0, is_singular: true };
    }
    EulerAngles {
        first: (-r[(0, 1)]).atan2(r[(1, 1)]),
        second,
        third: (-r[(2, 0)]).atan2(r[(2, 2)]),
        is_singular: false,
    }
}

/// Decomposes `R = Ry(first) Rx(second) Ry(third)` with `second ≤ 0` (shoulder: plane, elevation, axial).
///
/// At the singularity (arm hanging or overhead) `third` is set to zero and `first` carries the whole rotation.
pub fn yxy_from_rotation(rotation: &Rotation3<f64>) -> EulerAngles {
    let r = rotation.matrix();
    let second = -r[(1, 1)].clamp(-1.0, 1.0).acos();
    let s = second.sin();
    if s.abs() < SINGULAR_COSINE {
        return EulerAngles { first: (-r[(2, 0)]).atan2(r[(0, 0)]), second, third: 0.0, is_singular: true };
    }
    EulerAngles {
        first: (r[(0, 1)] / s).atan2(r[(2, 1)] / s),
        second,
        third: (r[(1, 0)] / s).atan2(-r[(1, 2)] / s),
        is_singular: false,
    }
}

/// Rotation `Rz(first) Rx(second) Ry(third)`, angles in radians.
pub fn rotation_from_zxy(first: f64, second: f64, third: f64) -> Rotation3<f64> {
    Rotation3::from_axis_angle(&Vector3::z_axis(), first)
        * Rotation3::from_axis_angle(&Vector3::x_axis(), second)
        * Rotation3::from_axis_angle(&Vector3::y_axis(), third)
}

/// Rotation `Ry(first) Rx(second) Ry(third)`, angles in radians.
pub fn rotation_from_yxy(first: f64, second: f64, third: f64) -> Rotation3<f64> {
    Rotation3::from_axis_angle(&Vector3::y_axis(), first)
        * Rotation3::from_axis_angle(&Vector3::x_axis(), second)
        * Rotation3::from_axis_angle(&Vector3::y_axis(), third)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::attitude::attitude_from_rotation;
    use proptest::prelude::*;

    fn degrees(angles: EulerAngles) -> [f64; 3] {
        [angles.first, angles.second, angles.third].map(f64::to_degrees)
    }

    fn close(a: [f64; 3], b: [f64; 3], tolerance_deg: f64) -> bool {
        a.iter().zip(b).all(|(a, b)| (a - b).abs() < tolerance_deg)
    }

    #[test]
    fn zxy_of_30_10_5_degrees_and_its_attitude_vector() {
        let rotation = rotation_from_zxy(30f64.to_radians(), 10f64.to_radians(), 5f64.to_radians());
        assert!(close(degrees(zxy_from_rotation(&rotation)), [30.0, 10.0, 5.0], 1e-9));
        let attitude = attitude_from_rotation(&rotation).map(f64::to_degrees);
        assert!(close(attitude.into(), [8.4612, 7.4914, 30.3404], 1e-4), "{attitude}");
    }

    #[test]
    fn yxy_of_40_minus_90_20_degrees() {
        let rotation = rotation_from_yxy(40f64.to_radians(), (-90f64).to_radians(), 20f64.to_radians());
        assert!(close(degrees(yxy_from_rotation(&rotation)), [40.0, -90.0, 20.0], 1e-9));
    }

    #[test]
    fn zxy_flags_the_t_posture_as_singular() {
        let rotation = rotation_from_zxy(0.0, (-90f64).to_radians(), 0.0);
        assert!(zxy_from_rotation(&rotation).is_singular);
        assert!(!yxy_from_rotation(&rotation).is_singular);
    }

    proptest! {
        #[test]
        fn zxy_round_trips(a in -3.0..3.0f64, b in -1.5..1.5f64, c in -3.0..3.0f64) {
            let angles = zxy_from_rotation(&rotation_from_zxy(a, b, c));
            let back = rotation_from_zxy(angles.first, angles.second, angles.third);
            prop_assert!((back.matrix() - rotation_from_zxy(a, b, c).matrix()).norm() < 1e-9);
        }

        #[test]
        fn yxy_round_trips_even_when_singular(a in -3.0..3.0f64, b in -std::f64::consts::PI..0.0, c in -3.0..3.0f64) {
            let angles = yxy_from_rotation(&rotation_from_yxy(a, b, c));
            let back = rotation_from_yxy(angles.first, angles.second, angles.third);
            // Inside the flagged degree the third angle is dropped, which costs at most the sine of that degree, twice.
            let tolerance = if angles.is_singular { 0.1 } else { 1e-9 };
            prop_assert!((back.matrix() - rotation_from_yxy(a, b, c).matrix()).norm() < tolerance);
        }
    }
}
