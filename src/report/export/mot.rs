//! Joint angles as an OpenSim motion file.
//!
//! Coordinates are named as those of the full-body model of Rajagopal and others: flexion, adduction and internal rotation are
//! positive, the trunk is rigid and therefore told as the pelvis. An arm is told as flexion, adduction and rotation from
//! hanging (Z-X-Y) there, and as plane and elevation in the assessment.

use super::samples::{Postures, side_letter};
use super::{Export, NotExportable, Samples};
use crate::body::anatomical_angles::{as_right_side, t_posture_from_hanging};
use crate::body::{Limb, Pose};
use crate::geometry::euler::zxy_from_rotation;
use std::fmt::Write;

/// A motion file in degrees.
///
/// # Errors
/// [`NotExportable`] for assessments without joint angles of the whole body.
pub fn mot(samples: Samples) -> Result<Export, NotExportable> {
    let postures = Postures::of(samples)?;
    let names = coordinate_names();
    let n = postures.samples().time_ns.len();
    let mut head = format!(
        "surefoot joint angles\nversion=1\nnRows={n}\nnColumns={}\ninDegrees=yes\nendheader\ntime",
        names.len() + 1
    );
    for name in &names {
        let _ = write!(head, "\t{name}");
    }
    head.push('\n');
    Ok(Export::new(head, n, move |range| {
        let mut text = String::new();
        for i in range {
            let _ = write!(text, "{:.6}", postures.samples().seconds(i));
            for angle in coordinates(&postures.at(i)) {
                let _ = write!(text, "\t{:.5}", angle.to_degrees());
            }
            text.push('\n');
        }
        text
    }))
}

fn coordinate_names() -> Vec<String> {
    let mut names: Vec<String> = ["pelvis_tilt", "pelvis_list", "pelvis_rotation"].map(str::to_owned).to_vec();
    for limb in Limb::ALL {
        let side = side_letter(limb.side());
        let own = if limb.is_arm() {
            ["arm_flex", "arm_add", "arm_rot", "elbow_flex"]
        } else {
            ["hip_flexion", "hip_adduction", "hip_rotation", "knee_angle"]
        };
        names.extend(own.map(|name| format!("{name}_{side}")));
    }
    names
}

/// Coordinates of a posture, radians, in the order of the names.
fn coordinates(pose: &Pose) -> Vec<f64> {
    let trunk = zxy_from_rotation(&pose.trunk);
    let mut found = vec![trunk.first, trunk.second, trunk.third];
    for limb in Limb::ALL {
        let rotation = as_right_side(limb, &pose.limbs[limb.index()]);
        let angles = zxy_from_rotation(&if limb.is_arm() { rotation * t_posture_from_hanging() } else { rotation });
        found.extend([angles.first, angles.second, angles.third, pose.hinges[limb.index()]]);
    }
    found
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::body::anatomical_angles::{hip_rotation, shoulder_rotation};
    use std::f64::consts::FRAC_PI_2;

    #[test]
    fn a_flexed_abducted_hip_and_a_hanging_arm_have_the_signs_of_the_model() {
        let mut pose = Pose::reference();
        for limb in Limb::ALL {
            pose.limbs[limb.index()] = match limb.is_arm() {
                true => shoulder_rotation(limb.side(), FRAC_PI_2, 0.5, 0.0),
                false => hip_rotation(limb.side(), 0.7, 0.2, 0.1),
            };
        }
        let found = coordinates(&pose);
        let at = |name: &str| found[coordinate_names().iter().position(|n| n == name).unwrap()];
        for side in ["l", "r"] {
            let of = |name: &str| at(&format!("{name}_{side}"));
            assert!((of("hip_flexion") - 0.7).abs() < 1e-9 && (of("hip_adduction") + 0.2).abs() < 1e-9);
            assert!((of("hip_rotation") - 0.1).abs() < 1e-9);
            assert!((of("arm_flex") - 0.5).abs() < 1e-9 && of("arm_add").abs() < 1e-9, "{side}");
        }
    }
}
