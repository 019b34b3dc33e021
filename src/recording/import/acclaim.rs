//! Acclaim skeletons (ASF) and their motions (AMC).
//!
//! ```text
//! root:  W = Rz Ry Rx of its channels, p = its translation
//! bone:  W = W_parent C (Rz Ry Rx of its degrees of freedom) Cᵀ,  C = Rz Ry Rx of its axis;  end = parent's end + W direction length
//! ```

use super::ImportError;
use nalgebra::{Rotation3, Vector3};
use std::collections::HashMap;
use std::path::Path;

const M_PER_INCH: f64 = 0.0254;

/// A bone of the skeleton.
#[derive(Debug, Clone, Default)]
struct Bone {
    name: String,
    direction: Vector3<f64>,
    length: f64,
    axis: Rotation3<f64>,
    /// Axis (0 x, 1 y, 2 z) of each channel, in the order of the motion file.
    freedoms: Vec<usize>,
    parent: Option<usize>,
}

/// Bones, each after its parent; the first is the root, whose length is zero.
#[derive(Debug, Clone)]
pub(super) struct Skeleton {
    bones: Vec<Bone>,
    m_per_unit: f64,
}

/// One frame of motion: values of each bone by name.
pub(super) type Frame<'a> = HashMap<&'a str, Vec<f64>>;

fn rotation_xyz(degrees: &Vector3<f64>) -> Rotation3<f64> {
    let a = degrees.map(f64::to_radians);
    Rotation3::from_axis_angle(&Vector3::z_axis(), a.z)
        * Rotation3::from_axis_angle(&Vector3::y_axis(), a.y)
        * Rotation3::from_axis_angle(&Vector3::x_axis(), a.x)
}

impl Skeleton {
    /// Reads an ASF text; `file` is only named in errors.
    pub(super) fn parse(text: &str, file: &Path) -> Result<Self, ImportError> {
        let root = Bone { name: "root".into(), axis: Rotation3::identity(), ..Bone::default() };
        let mut bones = vec![root];
        let mut m_per_unit = M_PER_INCH;
        let mut section = String::new();
        let mut parents = Vec::new();
        for (i, line) in text.lines().enumerate() {
            let malformed =
                |reason: &str| ImportError::Malformed { file: file.to_owned(), row: i + 1, reason: reason.to_owned() };
            let words: Vec<&str> = line.split_whitespace().collect();
            let Some(&first) = words.first() else { continue };
            if let Some(name) = first.strip_prefix(':') {
                name.clone_into(&mut section);
                continue;
            }
            match (section.as_str(), first) {
                ("units", "length") => {
                    let scale = numbers(&words[1..], 1).ok_or_else(|| malformed("`length` needs a number"))?[0];
                    if scale <= 0.0 {
                        return Err(malformed("the unit of length is not positive"));
                    }
                    m_per_unit = M_PER_INCH / scale;
                }
                ("bonedata", "begin") => bones.push(Bone { axis: Rotation3::identity(), ..Bone::default() }),
                ("bonedata", _) if bones.len() > 1 => {
                    let last = bones.len() - 1;
                    bone_line(&mut bones[last], first, &words[1..]).map_err(malformed)?;
                }
                ("hierarchy", "begin" | "end") => {}
                ("hierarchy", parent) => {
                    for child in &words[1..] {
                        parents.push((parent.to_owned(), (*child).to_owned(), i + 1));
                    }
                }
                _ => {}
            }
        }
        let index: HashMap<String, usize> = bones.iter().enumerate().map(|(i, b)| (b.name.clone(), i)).collect();
        for (parent, child, row) in parents {
            match (index.get(&parent), index.get(&child)) {
                (Some(&p), Some(&c)) if c > 0 => bones[c].parent = Some(p),
                _ => {
                    let reason = format!("`{parent}` or `{child}` is not a bone");
                    return Err(ImportError::Malformed { file: file.to_owned(), row, reason });
                }
            }
        }
        Ok(Self { bones: parents_first(bones, file)?, m_per_unit })
    }

    /// End of every bone in one frame, metres; the root's own place under `root`.
    pub(super) fn ends(&self, frame: &Frame<'_>) -> HashMap<&str, Vector3<f64>> {
        let mut ends: HashMap<&str, Vector3<f64>> = HashMap::new();
        let mut rotations = vec![Rotation3::identity(); self.bones.len()];
        let mut points = vec![Vector3::zeros(); self.bones.len()];
        for (i, bone) in self.bones.iter().enumerate() {
            let values = frame.get(bone.name.as_str()).map(Vec::as_slice).unwrap_or_default();
            match bone.parent {
                None => {
                    if let [tx, ty, tz, rx, ry, rz] = *values {
                        points[i] = Vector3::new(tx, ty, tz);
                        rotations[i] = rotation_xyz(&Vector3::new(rx, ry, rz));
                    }
                }
                Some(parent) => {
                    let mut degrees = Vector3::zeros();
                    for (axis, value) in bone.freedoms.iter().zip(values) {
                        degrees[*axis] = *value;
                    }
                    rotations[i] = rotations[parent] * bone.axis * rotation_xyz(&degrees) * bone.axis.inverse();
                    points[i] = points[parent] + rotations[i] * bone.direction * bone.length;
                }
            }
            ends.insert(&bone.name, points[i] * self.m_per_unit);
        }
        ends
    }
}

fn bone_line(bone: &mut Bone, key: &str, words: &[&str]) -> Result<(), &'static str> {
    match key {
        "name" => words.first().ok_or("`name` needs a name")?.to_string().clone_into(&mut bone.name),
        "direction" => {
            bone.direction = Vector3::from_column_slice(&numbers(words, 3).ok_or("`direction` needs three numbers")?);
        }
        "length" => bone.length = numbers(words, 1).ok_or("`length` needs a number")?[0],
        "axis" => {
            let degrees = numbers(words, 3).ok_or("`axis` needs three numbers")?;
            bone.axis = rotation_xyz(&Vector3::from_column_slice(&degrees));
        }
        "dof" => {
            for word in words {
                bone.freedoms.push(match *word {
                    "rx" => 0,
                    "ry" => 1,
                    "rz" => 2,
                    _ => return Err("only rx, ry and rz are known degrees of freedom"),
                });
            }
        }
        _ => {}
    }
    Ok(())
}

/// The first `n` words as finite numbers.
fn numbers(words: &[&str], n: usize) -> Option<Vec<f64>> {
    let values: Vec<f64> =
        words.iter().take(n).filter_map(|w| w.parse().ok()).filter(|v: &f64| v.is_finite()).collect();
    (values.len() == n).then_some(values)
}

/// Bones in an order in which every parent stands before its children; a loop or a loose bone is refused.
fn parents_first(bones: Vec<Bone>, file: &Path) -> Result<Vec<Bone>, ImportError> {
    let mut place = vec![None; bones.len()];
    let mut sorted: Vec<Bone> = Vec::with_capacity(bones.len());
    loop {
        let before = sorted.len();
        for (i, bone) in bones.iter().enumerate() {
            if place[i].is_some() {
                continue;
            }
            let parent = match bone.parent {
                None if i == 0 => None,
                Some(p) if place[p].is_some() => place[p],
                _ => continue,
            };
            place[i] = Some(sorted.len());
            sorted.push(Bone { parent, ..bone.clone() });
        }
        if sorted.len() == bones.len() {
            return Ok(sorted);
        }
        if sorted.len() == before {
            let reason = "the hierarchy does not reach every bone from the root".to_owned();
            return Err(ImportError::Inconsistent { file: file.to_owned(), reason });
        }
    }
}

/// Frames of an AMC text; `file` is only named in errors.
pub(super) fn parse_motion<'a>(text: &'a str, file: &Path) -> Result<Vec<Frame<'a>>, ImportError> {
    let mut frames: Vec<Frame<'a>> = Vec::new();
    for (i, line) in text.lines().enumerate() {
        let malformed = |reason: String| ImportError::Malformed { file: file.to_owned(), row: i + 1, reason };
        let mut words = line.split_whitespace();
        let Some(first) = words.next() else { continue };
        if first.starts_with('#') || first.starts_with(':') {
            continue;
        }
        if first.bytes().all(|b| b.is_ascii_digit()) {
            frames.push(HashMap::new());
            continue;
        }
        let Some(frame) = frames.last_mut() else {
            return Err(malformed("a bone stands before the first frame's number".into()));
        };
        let mut values = Vec::new();
        for word in words {
            match word.parse::<f64>() {
                Ok(value) if value.is_finite() => values.push(value),
                _ => {
                    return Err(malformed(format!(
                        "`{}` is not a finite number",
                        word.chars().take(32).collect::<String>()
                    )));
                }
            }
        }
        frame.insert(first, values);
    }
    Ok(frames)
}
