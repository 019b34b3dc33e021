//! Joint angles as a Biovision hierarchy: the linked skeleton of the model in place, y up, metres and degrees.

use super::samples::Postures;
use super::{Export, NotExportable, Samples};
use crate::assessment::quality::CalibrationQuality;
use crate::body::{Limb, Pose, Skeleton};
use crate::geometry::euler::zxy_from_rotation;
use nalgebra::{Rotation3, Vector3};
use std::fmt::Write;

/// Stature of an adult of whom nothing is known, metres; it scales the drawing alone.
const AVERAGE_STATURE_M: f64 = 1.7;

/// A hierarchy with the lengths that the assessment was made with, as far as it tells them.
///
/// # Errors
/// [`NotExportable`] for assessments without joint angles of the whole body.
pub fn bvh(samples: Samples, calibration: Option<&CalibrationQuality>) -> Result<Export, NotExportable> {
    let postures = Postures::of(samples)?;
    let skeleton = skeleton_of(calibration);
    let mut text = String::from("HIERARCHY\nROOT trunk\n{\n");
    let _ = writeln!(text, "  OFFSET 0 0 0\n  CHANNELS 6 Xposition Yposition Zposition Zrotation Xrotation Yrotation");
    for limb in Limb::ALL {
        let [root, middle, _] = limb.joints().map(|(joint, _)| joint.name());
        let along = limb.reference_direction();
        let (proximal, distal) = (along * skeleton.proximal[limb.index()], along * skeleton.distal[limb.index()]);
        let _ = writeln!(text, "  JOINT {root}\n  {{\n    OFFSET {}", offset(&skeleton.offsets[limb.index()]));
        let _ = writeln!(text, "    CHANNELS 3 Zrotation Xrotation Yrotation\n    JOINT {middle}\n    {{");
        let _ = writeln!(text, "      OFFSET {}\n      CHANNELS 3 Zrotation Xrotation Yrotation", offset(&proximal));
        let _ = writeln!(text, "      End Site\n      {{\n        OFFSET {}\n      }}\n    }}\n  }}", offset(&distal));
    }
    let rate = postures.samples().rate_hz();
    let step = if rate > 0.0 { 1.0 / rate } else { 0.0 };
    let n = postures.samples().time_ns.len();
    let _ = writeln!(text, "}}\nMOTION\nFrames: {n}\nFrame Time: {step:.6}");
    Ok(Export::new(text, n, move |range| {
        let mut text = String::new();
        for i in range {
            text.push_str("0 0 0");
            for rotation in rotations(&postures.at(i)) {
                let angles = zxy_from_rotation(&rotation);
                for angle in [angles.first, angles.second, angles.third] {
                    let _ = write!(text, " {:.4}", angle.to_degrees());
                }
            }
            text.push('\n');
        }
        text
    }))
}

/// Rotation of the trunk, then of each limb's root and hinge against its parent.
fn rotations(pose: &Pose) -> Vec<Rotation3<f64>> {
    let mut found = vec![pose.trunk];
    for limb in Limb::ALL {
        found.push(pose.limbs[limb.index()]);
        found.push(Rotation3::new(limb.hinge_axis() * pose.hinges[limb.index()]));
    }
    found
}

fn offset(place: &Vector3<f64>) -> String {
    format!("{:.4} {:.4} {:.4}", place.x, place.y, place.z)
}

fn skeleton_of(calibration: Option<&CalibrationQuality>) -> Skeleton {
    let mut skeleton = Skeleton::of_stature(AVERAGE_STATURE_M);
    let Some(calibration) = calibration else { return skeleton };
    for limb in Limb::ALL {
        let length = |name: &str| calibration.segments.iter().find(|s| s.segment == name).map(|s| s.length_m);
        let [proximal, distal] = limb.segment_names();
        let i = limb.index();
        skeleton.proximal[i] = length(&proximal).unwrap_or(skeleton.proximal[i]);
        skeleton.distal[i] = length(&distal).unwrap_or(skeleton.distal[i]);
        let root = limb.joints()[0].0.name();
        if let Some(found) = calibration.measured_trunk_offsets.iter().find(|offset| offset.joint == root) {
            skeleton.offsets[i] = Vector3::from(found.position_m);
        }
    }
    skeleton
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::assessment::{AngleChannel, Series};

    #[test]
    fn a_hierarchy_has_as_many_numbers_a_frame_as_channels() {
        let series: Vec<Series> = AngleChannel::all().into_iter().map(|c| Series::empty(c.name(), 2)).collect();
        let samples = Samples { time_ns: vec![0, 20_000_000], series };
        let text: String = bvh(samples, None).unwrap().pieces().collect();
        let channels: usize = text
            .lines()
            .filter_map(|line| line.trim().strip_prefix("CHANNELS "))
            .map(|line| line.split(' ').next().unwrap().parse::<usize>().unwrap())
            .sum();
        let frames: Vec<&str> = text.lines().skip_while(|line| !line.starts_with("Frame Time")).skip(1).collect();
        assert_eq!((channels, frames.len()), (30, 2));
        assert!(frames.iter().all(|frame| frame.split(' ').count() == channels));
        assert_eq!(text.matches('{').count(), text.matches('}').count());
        assert!(bvh(Samples { time_ns: Vec::new(), series: Vec::new() }, None).is_err());
    }
}
