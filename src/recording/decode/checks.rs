//! What each value of a frame, and each declaration, must be.

use super::message::{FrameMessage, Numbers};
use crate::body::skeleton::PLAUSIBLE_SEGMENT_M;
use crate::body::{Joint, Limb};
use crate::recording::DecodeError;
use crate::recording::coordinates::{Coordinates, Handedness, Up};
use nalgebra::{Quaternion, UnitQuaternion, Vector3};
use std::collections::BTreeMap;
use std::ops::Range;

/// Longest accepted free text, characters.
pub(super) const MAX_TEXT: usize = 64;

/// Farthest coordinate of a joint from the sensor, metres; nothing that sees bodies sees farther.
const MAX_COORDINATE_M: f64 = 100.0;

/// Accepted deviation of a quaternion's norm from one: numbers rounded to two decimals still pass.
const QUATERNION_TOLERANCE: f64 = 0.01;

/// Below this deviation a quaternion is kept bit for bit, so that a decoded recording encodes to the same bytes.
const QUATERNION_EXACT: f64 = 1e-9;

/// One joint of one frame, in the declared coordinates; a lost joint has neither position nor orientation.
pub(super) struct JointSample {
    pub(super) position: Option<Vector3<f64>>,
    pub(super) confidence: f32,
    pub(super) orientation: Option<UnitQuaternion<f64>>,
}

/// Joint `j` of frame `index`. Lost is lost: whichever way the client says so, the joint keeps nothing.
pub(super) fn checked_sample(
    frame: &FrameMessage,
    j: usize,
    joint: Joint,
    index: u64,
) -> Result<JointSample, DecodeError> {
    let at = |field: &str| format!("frames[{index}].{field}[{j}]");
    let given = frame.confidence.as_ref().map(|list| list.items[j]);
    let confidence = checked_confidence(given).map_err(|defect| defect.at(at("confidence")))?;
    let position = frame.positions.items[j].map(|Numbers(p)| checked_position(p, joint)).transpose();
    let position = position.map_err(|defect| defect.at(at("positions")))?;
    let orientation = match frame.orientations.as_ref().and_then(|list| list.items[j]) {
        Some(Numbers(q)) => checked_orientation(q).map_err(|defect| defect.at(at("orientations")))?,
        None => None,
    };
    Ok(match position.filter(|_| confidence > 0.0) {
        Some(position) => JointSample { position: Some(position), confidence, orientation },
        None => JointSample { position: None, confidence: 0.0, orientation: None },
    })
}

/// Every list of frame `index` has one entry for each joint.
pub(super) fn check_counts(frame: &FrameMessage, joints: &[Joint], index: u64) -> Result<(), DecodeError> {
    let counts = [
        ("positions", Some(frame.positions.count)),
        ("confidence", frame.confidence.as_ref().map(|list| list.count)),
        ("orientations", frame.orientations.as_ref().map(|list| list.count)),
    ];
    for (field, count) in counts {
        if let Some(count) = count.filter(|count| *count != joints.len()) {
            let sentence = format!(
                "found {count} entries for {} joints; write one entry for each joint, null for a lost one",
                joints.len()
            );
            return Err(DecodeError::new("joint_count_mismatch", sentence).at(format!("frames[{index}].{field}")));
        }
    }
    Ok(())
}

fn checked_position(p: [f64; 3], joint: Joint) -> Result<Vector3<f64>, DecodeError> {
    if p.iter().all(|c| c.abs() <= MAX_COORDINATE_M) {
        return Ok(Vector3::from(p));
    }
    let [x, y, z] = p;
    let sentence = format!(
        "joint `{joint}` is at ({x}, {y}, {z}); coordinates are metres and stay within {MAX_COORDINATE_M} of the sensor"
    );
    Err(DecodeError::new("position_out_of_range", sentence))
}

fn checked_confidence(given: Option<f32>) -> Result<f32, DecodeError> {
    match given {
        None => Ok(1.0),
        Some(c) if (0.0..=1.0).contains(&c) => Ok(c),
        Some(c) => {
            let sentence = format!("the confidence is {c}, expected 0 (lost) to 1");
            Err(DecodeError::new("confidence_out_of_range", sentence))
        }
    }
}

/// The rotation, or nothing for four zeros, which is how Kinect writes "none".
fn checked_orientation(q: [f64; 4]) -> Result<Option<UnitQuaternion<f64>>, DecodeError> {
    if q == [0.0; 4] {
        return Ok(None);
    }
    let quaternion = Quaternion::new(q[0], q[1], q[2], q[3]);
    let deviation = (quaternion.norm() - 1.0).abs();
    if deviation.is_nan() || deviation > QUATERNION_TOLERANCE {
        let sentence = format!(
            "the quaternion's norm is {}, expected 1 ± {QUATERNION_TOLERANCE}; write w, x, y, z, or null for none",
            quaternion.norm()
        );
        return Err(DecodeError::new("bad_quaternion", sentence));
    }
    Ok(Some(if deviation < QUATERNION_EXACT {
        UnitQuaternion::new_unchecked(quaternion)
    } else {
        UnitQuaternion::new_normalize(quaternion)
    }))
}

/// The declared axes, or what is wrong with them.
pub(super) fn coordinates_from_names(
    handedness: &str,
    up: &str,
    length_unit: &str,
    place: &str,
) -> Result<Coordinates, DecodeError> {
    let refuse = |field: &str, found: &str, expected: &str| {
        let shown: String = found.chars().take(MAX_TEXT).collect();
        let sentence = format!("`{field}` is `{shown}`, expected {expected}");
        Err(DecodeError::new("invalid_value", sentence).at(format!("{place}.{field}")))
    };
    let Some(handedness) = Handedness::from_name(handedness) else {
        return refuse("handedness", handedness, "`right` or `left`");
    };
    let Some(up) = Up::from_name(up) else {
        return refuse("up", up, "one of `+x`, `-x`, `+y`, `-y`, `+z`, `-z`");
    };
    if length_unit != "m" {
        return refuse("length_unit", length_unit, "`m`: convert the positions to metres");
    }
    Ok(Coordinates { handedness, up })
}

/// The first segment whose name is none or whose length no human one has, and what is wrong with it.
pub(super) fn check_segment_lengths(lengths: &BTreeMap<String, f64>) -> Result<(), (&str, String)> {
    for (name, length_m) in lengths {
        let names: Vec<String> = Limb::ALL.into_iter().flat_map(Limb::segment_names).collect();
        if !names.contains(name) {
            return Err((name, format!("this is no segment; there are {}", names.join(", "))));
        }
        if !PLAUSIBLE_SEGMENT_M.contains(length_m) {
            let Range { start, end } = PLAUSIBLE_SEGMENT_M;
            return Err((name, format!("the length is {length_m}, expected metres from {start} to {end}")));
        }
    }
    Ok(())
}
