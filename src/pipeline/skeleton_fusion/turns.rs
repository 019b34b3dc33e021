//! How uncertain the bones are at one time.

use super::alignment::{Alignment, TurnColumn};
use super::posture::TurnCovariance;
use crate::body::{BONE_COUNT, Bone};
use nalgebra::{Matrix3, Rotation3, UnitQuaternion};

/// Standard deviation of a unit's attitude about each axis beside what the alignment knows, radians (1.2°): skin and strap
/// against the bone, and the filter.
const ATTITUDE_SD: f64 = 1.2 * std::f64::consts::PI / 180.0;

/// Uncertainty of every bone at one time.
#[derive(Debug, Clone)]
pub struct BoneTurns<'a> {
    alignment: &'a Alignment,
    /// What turns a bone that follows its unit; none for the others, which the caller knows from elsewhere.
    columns: [Option<[TurnColumn; 7]>; BONE_COUNT],
}

impl<'a> BoneTurns<'a> {
    /// Bones of which nothing is known but by the alignment.
    pub fn new(alignment: &'a Alignment) -> Self {
        Self { alignment, columns: [const { None }; BONE_COUNT] }
    }

    /// A bone follows its unit.
    pub fn follow(&mut self, bone: Bone, unit: usize, time_ns: i64, at: &(usize, UnitQuaternion<f64>)) {
        let rotation: Rotation3<f64> = self.alignment.subject_from_bone(unit, time_ns, at.0, &at.1);
        self.columns[bone.index()] = Some(self.alignment.turn_columns(unit, at.0, time_ns, &rotation));
    }
}

impl TurnCovariance for BoneTurns<'_> {
    fn between(&self, a: Bone, b: Bone) -> Matrix3<f64> {
        let (Some(of_a), Some(of_b)) = (&self.columns[a.index()], &self.columns[b.index()]) else {
            return Matrix3::zeros();
        };
        let mut covariance = if a == b { Matrix3::identity() * ATTITUDE_SD.powi(2) } else { Matrix3::zeros() };
        for (i, axis_a) in of_a {
            for (j, axis_b) in of_b {
                covariance += axis_a * axis_b.transpose() * self.alignment.covariance_of(*i, *j);
            }
        }
        covariance
    }
}
