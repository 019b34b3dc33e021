//! The rigid parts of a figure's lower body, and where the joints between them are.
//!
//! Every part has its own axes, which in the rest posture and in any other are found the same way: y up along the part,
//! x to the subject's left, z forward. A vertex that hangs on a part moves by `posed · rest⁻¹`.

use nalgebra::{Isometry3, Matrix3, Point3, Rotation3, Translation3, UnitQuaternion, Vector3};

/// Rigid parts: the pelvis with all above it, then thigh, shank, foot and toes of the left and of the right leg.
pub const PART_COUNT: usize = 9;

/// Number of the pelvis among the parts.
pub const PELVIS: usize = 0;

/// A part of a leg.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum LegPart {
    /// Hip to knee.
    Thigh,
    /// Knee to ankle.
    Shank,
    /// Ankle to ball.
    Foot,
    /// In front of the ball.
    Toes,
}

/// Number of a leg's part among the parts; side 0 is the left.
pub fn part_index(side: usize, part: LegPart) -> usize {
    1 + 4 * side + part as usize
}

/// Points of one leg, metres.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LegPoints {
    /// Centre of the hip.
    pub hip: Point3<f64>,
    /// Centre of the knee.
    pub knee: Point3<f64>,
    /// Centre of the ankle.
    pub ankle: Point3<f64>,
    /// Lowest point of the heel's rear.
    pub heel: Point3<f64>,
    /// Foremost point of the sole.
    pub toe: Point3<f64>,
}

/// A leg at rest: both feet flat on the floor y = 0, the subject at the origin looking along z with the left at +x.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct RestLeg {
    /// Its points.
    pub points: LegPoints,
    /// Where the sole bends when the heel rises, on the floor.
    pub ball: Point3<f64>,
}

impl RestLeg {
    /// Length from hip to knee, metres.
    pub fn thigh_m(&self) -> f64 {
        (self.points.knee - self.points.hip).norm()
    }

    /// Length from knee to ankle, metres.
    pub fn shank_m(&self) -> f64 {
        (self.points.ankle - self.points.knee).norm()
    }

    /// The same leg of a figure that is `scale` times as large.
    pub fn scaled(&self, scale: f64) -> Self {
        let p = &self.points;
        Self {
            points: LegPoints {
                hip: p.hip * scale,
                knee: p.knee * scale,
                ankle: p.ankle * scale,
                heel: p.heel * scale,
                toe: p.toe * scale,
            },
            ball: self.ball * scale,
        }
    }
}

/// The orientation of a foot and its toes, and where its ankle is.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FootPose {
    /// Centre of the ankle.
    pub ankle: Point3<f64>,
    /// Turn of the foot out of its rest orientation.
    pub foot: UnitQuaternion<f64>,
    /// Turn of the toes out of their rest orientation.
    pub toes: UnitQuaternion<f64>,
}

/// Where all parts are: the transform of each part's rest position into the posed one.
#[derive(Debug, Clone, PartialEq)]
pub struct Posture {
    /// `posed_from_rest` of each part.
    pub parts: [Isometry3<f64>; PART_COUNT],
    /// Points of the left and the right leg.
    pub legs: [LegPoints; 2],
}

impl Posture {
    /// The posture with the pelvis and the feet where they are given; knees bend forwards.
    ///
    /// A hip that is farther from its ankle than the leg is long is drawn towards it: the caller keeps the pelvis low
    /// enough that this does not happen.
    pub fn of_pelvis_and_feet(rest: &[RestLeg; 2], pelvis: &Isometry3<f64>, feet: &[FootPose; 2]) -> Self {
        let mut parts = [*pelvis; PART_COUNT];
        let legs = std::array::from_fn(|side| {
            let (leg, foot) = (&rest[side], &feet[side]);
            let (hip, forward) = (pelvis * leg.points.hip, pelvis * Vector3::z() + foot.foot * Vector3::z());
            let knee = knee_between(&hip, &foot.ankle, leg.thigh_m(), leg.shank_m(), &forward);
            let left = Vector3::y().cross(&forward);
            let rest_part = |upper: &Point3<f64>, lower: &Point3<f64>| part_frame(upper, lower, &Vector3::x());
            let thigh = part_frame(&hip, &knee, &left) * rest_part(&leg.points.hip, &leg.points.knee).inverse();
            let shank =
                part_frame(&knee, &foot.ankle, &left) * rest_part(&leg.points.knee, &leg.points.ankle).inverse();
            let foot_part = turned_about(&leg.points.ankle, &foot.ankle, &foot.foot);
            let toes = turned_about(&leg.ball, &(foot_part * leg.ball), &foot.toes);
            for (part, transform) in
                [(LegPart::Thigh, thigh), (LegPart::Shank, shank), (LegPart::Foot, foot_part), (LegPart::Toes, toes)]
            {
                parts[part_index(side, part)] = transform;
            }
            LegPoints { hip, knee, ankle: foot.ankle, heel: foot_part * leg.points.heel, toe: toes * leg.points.toe }
        });
        Self { parts, legs }
    }
}

/// The transform that takes `rest` to `posed` and turns by `turn`.
fn turned_about(rest: &Point3<f64>, posed: &Point3<f64>, turn: &UnitQuaternion<f64>) -> Isometry3<f64> {
    Isometry3::from_parts(Translation3::from(posed.coords), *turn) * Translation3::from(-rest.coords)
}

/// Axes of a long part: origin at its upper end, y from the lower end to the upper, x as near to `left` as that allows.
fn part_frame(upper: &Point3<f64>, lower: &Point3<f64>, left: &Vector3<f64>) -> Isometry3<f64> {
    let y = (upper - lower).normalize();
    let x = (left - y * left.dot(&y)).normalize();
    let axes = Rotation3::from_matrix_unchecked(Matrix3::from_columns(&[x, y, x.cross(&y)]));
    Isometry3::from_parts(Translation3::from(upper.coords), UnitQuaternion::from_rotation_matrix(&axes))
}

/// The knee of a leg of two given lengths, on the side of the line from hip to ankle that `forward` points to.
fn knee_between(hip: &Point3<f64>, ankle: &Point3<f64>, thigh: f64, shank: f64, forward: &Vector3<f64>) -> Point3<f64> {
    let down = ankle - hip;
    // Keeps the triangle a triangle when the leg is stretched.
    let reach = down.norm().clamp((thigh - shank).abs() + 1e-6, thigh + shank - 1e-6);
    let down = down.normalize();
    let ahead = (forward - down * forward.dot(&down)).normalize();
    // Law of cosines at the hip.
    let along = (thigh * thigh + reach * reach - shank * shank) / (2.0 * reach);
    let aside = (thigh * thigh - along * along).max(0.0).sqrt();
    hip + down * along + ahead * aside
}

#[cfg(test)]
mod tests {
    use super::*;

    fn leg() -> RestLeg {
        let points = LegPoints {
            hip: Point3::new(0.09, 0.9, 0.0),
            knee: Point3::new(0.09, 0.48, 0.02),
            ankle: Point3::new(0.09, 0.08, 0.0),
            heel: Point3::new(0.09, 0.0, -0.06),
            toe: Point3::new(0.09, 0.0, 0.2),
        };
        RestLeg { points, ball: Point3::new(0.09, 0.0, 0.13) }
    }

    fn mirrored(leg: &RestLeg) -> RestLeg {
        let m = |p: &Point3<f64>| Point3::new(-p.x, p.y, p.z);
        let p = &leg.points;
        let points =
            LegPoints { hip: m(&p.hip), knee: m(&p.knee), ankle: m(&p.ankle), heel: m(&p.heel), toe: m(&p.toe) };
        RestLeg { points, ball: m(&leg.ball) }
    }

    #[test]
    fn the_rest_posture_moves_nothing() {
        let rest = [leg(), mirrored(&leg())];
        let feet = rest.map(|leg| FootPose {
            ankle: leg.points.ankle,
            foot: UnitQuaternion::identity(),
            toes: UnitQuaternion::identity(),
        });
        let posture = Posture::of_pelvis_and_feet(&rest, &Isometry3::identity(), &feet);
        for part in posture.parts {
            assert!((part.to_matrix() - Isometry3::<f64>::identity().to_matrix()).norm() < 1e-6, "{part}");
        }
        assert!((posture.legs[0].knee - rest[0].points.knee).norm() < 1e-6);
    }

    #[test]
    fn segment_lengths_hold_and_the_knee_points_forward() {
        let rest = [leg(), mirrored(&leg())];
        let pelvis = Isometry3::translation(0.02, -0.06, 0.1);
        let feet = [0.3, -0.2].map(|z| FootPose {
            ankle: Point3::new(if z > 0.0 { 0.05 } else { -0.06 }, 0.1, z),
            foot: UnitQuaternion::from_axis_angle(&Vector3::y_axis(), 0.2),
            toes: UnitQuaternion::identity(),
        });
        let posture = Posture::of_pelvis_and_feet(&rest, &pelvis, &feet);
        for leg in &posture.legs {
            assert!(((leg.knee - leg.hip).norm() - rest[0].thigh_m()).abs() < 1e-9);
            assert!(((leg.knee - leg.ankle).norm() - rest[0].shank_m()).abs() < 1e-9);
            let straight = leg.hip + (leg.ankle - leg.hip) * 0.5;
            assert!(leg.knee.z > straight.z);
        }
    }
}
