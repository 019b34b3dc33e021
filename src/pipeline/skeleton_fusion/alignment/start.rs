//! Where the alignment starts: mounting and heading of a unit from pairs of vectors, without any first guess.
//!
//! A vector `u` that the camera sees in `subject` and the vector `v` that it is in the bone's axes belong together when
//! `u = R_y(h) E A v`, with E the unit's orientation, h its heading and A its mounting `imu_from_bone`. For a fixed h
//! the best mounting A is the answer to Wahba's problem: it maximises the trace of `Aᵀ K(h)` with
//!
//! ```text
//! K(h) = Σ w Eᵀ R_y(h)ᵀ u vᵀ = K₀ + K₁ cos h + K₂ sin h
//! ```
//!
//! so that one pass over the recording serves all headings.

use nalgebra::{Matrix3, Rotation3, UnitQuaternion, Vector3};
use std::f64::consts::TAU;

/// Headings that are tried.
const HEADINGS: usize = 72;

/// Sums over pairs of vectors, from which the agreement of any heading and mounting can be told.
#[derive(Debug, Clone, Default, PartialEq)]
pub(super) struct Agreement {
    constant: Matrix3<f64>,
    cosine: Matrix3<f64>,
    sine: Matrix3<f64>,
    weight: f64,
}

/// A heading (radians) and mounting (`imu_from_bone`), and how well the vectors agree with them: 1 is perfect.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Start {
    pub(super) heading: f64,
    pub(super) imu_from_bone: Rotation3<f64>,
    pub(super) agreement: f64,
}

impl Agreement {
    /// Adds that a direction of the bone is seen in a direction of `subject` while the unit has an orientation.
    pub(super) fn add(
        &mut self,
        earth_from_imu: &UnitQuaternion<f64>,
        in_subject: &Vector3<f64>,
        in_bone: &Vector3<f64>,
        weight: f64,
    ) {
        let orientation = earth_from_imu.to_rotation_matrix();
        // R_y(h)ᵀ u = y (y·u) + (u − y (y·u)) cos h + (u × y) sin h, then turned into the unit's frame.
        let upright = Vector3::new(0.0, in_subject.y, 0.0);
        let level = in_subject - upright;
        let sideways = in_subject.cross(&Vector3::y());
        let row = (in_bone * weight).transpose();
        self.constant += (orientation.inverse() * upright) * row;
        self.cosine += (orientation.inverse() * level) * row;
        self.sine += (orientation.inverse() * sideways) * row;
        self.weight += weight;
    }

    /// The same sums for a unit whose heading is counted from `heading` on.
    pub(super) fn headed(&self, heading: f64) -> Self {
        let (sine, cosine) = heading.sin_cos();
        Self {
            constant: self.constant,
            cosine: self.cosine * cosine + self.sine * sine,
            sine: self.sine * cosine - self.cosine * sine,
            weight: self.weight,
        }
    }

    /// True without any pair.
    pub(super) fn is_empty(&self) -> bool {
        self.weight <= 0.0
    }

    /// Agreement of a heading and a mounting that are known.
    pub(super) fn agreement_of(&self, heading: f64, imu_from_bone: &Rotation3<f64>) -> f64 {
        let (sine, cosine) = heading.sin_cos();
        let k = self.constant + self.cosine * cosine + self.sine * sine;
        imu_from_bone.matrix().dot(&k) / self.weight.max(f64::MIN_POSITIVE)
    }

    /// The best heading for a mounting that is known.
    pub(super) fn with_mounting(&self, imu_from_bone: &Rotation3<f64>) -> Start {
        let trace = |k: &Matrix3<f64>| imu_from_bone.matrix().dot(k);
        let (constant, cosine, sine) = (trace(&self.constant), trace(&self.cosine), trace(&self.sine));
        let agreement = (constant + cosine.hypot(sine)) / self.weight.max(f64::MIN_POSITIVE);
        Start { heading: sine.atan2(cosine), imu_from_bone: *imu_from_bone, agreement }
    }

    /// The best mounting for a heading that is known.
    pub(super) fn with_heading(&self, heading: f64) -> Start {
        let (sine, cosine) = heading.sin_cos();
        let k = self.constant + self.cosine * cosine + self.sine * sine;
        let svd = k.svd(true, true);
        let (Some(u), Some(v_t)) = (svd.u, svd.v_t) else {
            return Start { heading, imu_from_bone: Rotation3::identity(), agreement: 0.0 };
        };
        // The smallest singular value bears the sign that makes the result a rotation.
        let sign = (u * v_t).determinant().signum();
        let smallest = svd.singular_values.imin();
        let mut signs = Vector3::repeat(1.0);
        signs[smallest] = sign;
        let rotation = Rotation3::from_matrix_unchecked(u * Matrix3::from_diagonal(&signs) * v_t);
        let agreement = svd.singular_values.dot(&signs) / self.weight.max(f64::MIN_POSITIVE);
        Start { heading, imu_from_bone: rotation, agreement }
    }

    /// The same sums with a mounting that decides what they leave open, at a weight relative to all pairs.
    pub(super) fn hinted(&self, hint: &Rotation3<f64>, hint_weight: f64) -> Self {
        let constant = self.constant + hint.matrix() * (hint_weight * self.weight);
        Self { constant, ..self.clone() }
    }

    /// The same sums with a direction of the unit that is known to be one of the bone, at a weight relative to all pairs.
    pub(super) fn paired(&self, in_imu: &Vector3<f64>, in_bone: &Vector3<f64>, weight: f64) -> Self {
        let constant = self.constant + in_imu * in_bone.transpose() * (weight * self.weight);
        Self { constant, ..self.clone() }
    }

    /// The best heading and mounting together, with a hint.
    pub(super) fn free(&self, hint: &Rotation3<f64>, hint_weight: f64) -> Start {
        let hinted = self.hinted(hint, hint_weight);
        let tried = (0..HEADINGS).map(|i| hinted.with_heading(TAU * i as f64 / HEADINGS as f64));
        let best = tried.max_by(|a, b| a.agreement.total_cmp(&b.agreement));
        let found = best.unwrap_or(Start { heading: 0.0, imu_from_bone: *hint, agreement: 0.0 });
        self.with_mounting(&found.imu_from_bone)
    }
}

/// The offset that, added to the headings of all units, makes them agree best with the mountings that they should have, or,
/// where those agree less than `least`, with mountings of their own; radians. 0 when nothing was seen.
pub(super) fn common_heading(units: &[(Agreement, Rotation3<f64>)], least: f64) -> f64 {
    let seen: Vec<&(Agreement, Rotation3<f64>)> = units.iter().filter(|(sum, _)| !sum.is_empty()).collect();
    if seen.is_empty() {
        return 0.0;
    }
    let sums = seen.iter().fold((0.0, 0.0), |(sine, cosine), (agreement, imu_from_bone)| {
        let trace = |k: &Matrix3<f64>| imu_from_bone.matrix().dot(k);
        (sine + trace(&agreement.sine), cosine + trace(&agreement.cosine))
    });
    let heading = sums.0.atan2(sums.1);
    let n = seen.len() as f64;
    let by_rule = seen.iter().map(|(sum, imu_from_bone)| sum.agreement_of(heading, imu_from_bone)).sum::<f64>();
    if by_rule / n > least {
        return heading;
    }
    let free = |heading: f64| seen.iter().map(|(sum, _)| sum.with_heading(heading).agreement).sum::<f64>();
    // The first is where the plank should have lain.
    let tried = (0..HEADINGS).map(|i| TAU * i as f64 / HEADINGS as f64).map(|heading| (heading, free(heading)));
    let best = tried.fold((0.0, f64::NEG_INFINITY), |best, found| if found.1 > best.1 { found } else { best });
    best.0
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn rotation(v: [f64; 3]) -> Rotation3<f64> {
        Rotation3::new(Vector3::from(v))
    }

    fn vertical(heading: f64) -> UnitQuaternion<f64> {
        UnitQuaternion::from_axis_angle(&Vector3::y_axis(), heading)
    }

    /// A bone that swings and turns, its unit mounted and headed in some way.
    fn swinging(heading: f64, imu_from_bone: &Rotation3<f64>) -> Agreement {
        let mut agreement = Agreement::default();
        for i in 0..200 {
            let t = f64::from(i) * 0.05;
            let subject_from_bone = rotation([0.7 * t.sin(), 0.3 * (1.7 * t).cos(), 0.9 * (0.6 * t).sin()]);
            let subject_from_imu = subject_from_bone * imu_from_bone.inverse();
            let earth_from_imu = vertical(-heading) * UnitQuaternion::from_rotation_matrix(&subject_from_imu);
            for in_bone in [-Vector3::y(), Vector3::z()] {
                agreement.add(&earth_from_imu, &(subject_from_bone * in_bone), &in_bone, 1.0);
            }
        }
        agreement
    }

    proptest! {
        #[test]
        fn any_mounting_and_heading_is_found_from_movement(
            mounting in prop::array::uniform3(-1.8..1.8f64), heading in -3.1..3.1f64,
        ) {
            let imu_from_bone = rotation(mounting);
            let agreement = swinging(heading, &imu_from_bone);
            let found = agreement.free(&Rotation3::identity(), 0.0);
            // The grid of headings is 5° wide; the alignment refines from there.
            prop_assert!(found.imu_from_bone.angle_to(&imu_from_bone) < 0.06, "{found:?}");
            let exact = agreement.with_mounting(&imu_from_bone);
            prop_assert!((exact.agreement - 1.0).abs() < 1e-9);
            prop_assert!((vertical(exact.heading).angle_to(&vertical(heading))) < 1e-9);
        }
    }

    #[test]
    fn headings_counted_from_elsewhere_add_up() {
        let agreement = swinging(1.0, &Rotation3::identity());
        let rest = agreement.headed(0.4).with_mounting(&Rotation3::identity());
        assert!((rest.heading - 0.6).abs() < 1e-9, "{rest:?}");
        let common = common_heading(&[(agreement.headed(0.4), Rotation3::identity())], 0.5);
        assert!((common - 0.6).abs() < 1e-9);
    }
}
