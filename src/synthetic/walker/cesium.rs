//! The figure `CesiumMan.glb` (© 2017 Cesium, CC-BY 4.0), read from a file that is not part of this repository.

use super::body::{Body, Vertex, vertex_normals};
use super::bones::{LegPart, LegPoints, PART_COUNT, PELVIS, RestLeg, part_index};
use super::noise::smoothstep;
use nalgebra::{Matrix4, Point3};
use std::collections::HashMap;
use std::panic::catch_unwind;

/// A file that is not the figure.
#[derive(Debug, thiserror::Error)]
pub enum FigureError {
    /// The file is no binary glTF.
    #[error("not a binary glTF file: {0}")]
    Gltf(#[from] gltf::Error),
    /// The file is damaged.
    #[error("the binary glTF file is damaged")]
    Damaged,
    /// Something that the figure has is missing.
    #[error("the file has no {0}: it is not CesiumMan.glb")]
    Missing(&'static str),
}

/// Joints of the left and the right leg: hip, knee, ankle.
const LEG_JOINTS: [[&str; 3]; 2] =
    [["leg_joint_L_1", "leg_joint_L_2", "leg_joint_L_3"], ["leg_joint_R_1", "leg_joint_R_2", "leg_joint_R_3"]];

/// Joints behind the toes; their weights count as the foot's.
const TOE_JOINTS: [&str; 2] = ["leg_joint_L_5", "leg_joint_R_5"];

/// Where the sole bends, as a share of its length from the heel: the balls of feet lie at about 70 % of them. The
/// figure's own joint lies at 41 % and is not used.
const BALL_SHARE: f64 = 0.7;

/// Share of a foot's length over which its vertices pass from the foot to the toes.
const BEND_SHARE: f64 = 0.1;

/// Vertices of a foot that are this low (share of the ankle's height) are its sole.
const SOLE_SHARE: f64 = 0.25;

/// Reads the figure, 1.5 units high.
///
/// # Errors
/// [`FigureError`] when the bytes are not that figure.
pub fn body_from_glb(bytes: &[u8]) -> Result<Body, FigureError> {
    // The parser panics at some damaged files: at a length that is less than its own, at indices that lead nowhere.
    catch_unwind(|| parse(bytes)).unwrap_or(Err(FigureError::Damaged))
}

fn parse(bytes: &[u8]) -> Result<Body, FigureError> {
    let gltf::Gltf { document, blob } = gltf::Gltf::from_slice(bytes)?;
    let buffer = |_: gltf::Buffer<'_>| blob.as_deref();
    let skin = document.skins().next().ok_or(FigureError::Missing("skin"))?;
    let inverse_binds = skin.reader(buffer).read_inverse_bind_matrices().ok_or(FigureError::Missing("bind pose"))?;
    let joints: HashMap<String, (usize, Point3<f64>)> = skin
        .joints()
        .zip(inverse_binds)
        .enumerate()
        .filter_map(|(index, (node, inverse))| {
            let bind = Matrix4::from(inverse).cast::<f64>().try_inverse()?;
            Some((node.name()?.to_owned(), (index, Point3::new(bind[(0, 3)], bind[(1, 3)], bind[(2, 3)]))))
        })
        .collect();
    let joint = |name: &str| joints.get(name).copied().ok_or(FigureError::Missing("leg joints"));

    let mesh =
        document.meshes().next().and_then(|mesh| mesh.primitives().next()).ok_or(FigureError::Missing("mesh"))?;
    let reader = mesh.reader(buffer);
    let places: Vec<Point3<f64>> = reader
        .read_positions()
        .ok_or(FigureError::Missing("vertices"))?
        .map(|p| Point3::from(p).cast::<f64>())
        .collect();
    let indices: Vec<u32> = reader.read_indices().ok_or(FigureError::Missing("triangles"))?.into_u32().collect();
    let triangles: Vec<[u32; 3]> = indices.as_chunks::<3>().0.to_vec();
    if triangles.iter().flatten().any(|corner| *corner as usize >= places.len()) {
        return Err(FigureError::Missing("valid triangles"));
    }
    let bound: Vec<[u16; 4]> = reader.read_joints(0).ok_or(FigureError::Missing("weights"))?.into_u16().collect();
    let shares: Vec<[f32; 4]> = reader.read_weights(0).ok_or(FigureError::Missing("weights"))?.into_f32().collect();

    // What does not hang on a leg hangs on the pelvis: the arms and the head are out of the camera's sight.
    let mut part_of_joint = vec![PELVIS; joints.len()];
    let mut legs = Vec::new();
    for (side, names) in LEG_JOINTS.iter().enumerate() {
        let [hip, knee, ankle] = [joint(names[0])?, joint(names[1])?, joint(names[2])?];
        for ((index, _), part) in [
            (hip, LegPart::Thigh),
            (knee, LegPart::Shank),
            (ankle, LegPart::Foot),
            (joint(TOE_JOINTS[side])?, LegPart::Foot),
        ] {
            *part_of_joint.get_mut(index).ok_or(FigureError::Missing("leg joints"))? = part_index(side, part);
        }
        legs.push(rest_leg(hip.1, knee.1, ankle.1, &places));
    }
    let legs = [legs[0], legs[1]];
    let normals = vertex_normals(&places, &triangles);
    let vertices =
        places.iter().zip(normals).zip(bound.iter().zip(&shares)).map(|((rest, normal), (bound, shares))| {
            let mut weights = [0.0; PART_COUNT];
            for (joint, share) in bound.iter().zip(shares) {
                weights[part_of_joint.get(usize::from(*joint)).copied().unwrap_or(PELVIS)] += share;
            }
            bend_toes(&mut weights, rest, &legs);
            let total: f32 = weights.iter().sum();
            let weights = if total > 0.0 { weights.map(|weight| weight / total) } else { only_pelvis() };
            Vertex { rest: *rest, normal, weights }
        });
    let height = places.iter().map(|place| place.y).fold(0.0, f64::max);
    Ok(Body { vertices: vertices.collect(), triangles, legs, height })
}

fn only_pelvis() -> [f32; PART_COUNT] {
    std::array::from_fn(|part| f32::from(u8::from(part == PELVIS)))
}

/// The leg with a hip, knee and ankle; heel, ball and toe are found on the sole below.
fn rest_leg(hip: Point3<f64>, knee: Point3<f64>, ankle: Point3<f64>, places: &[Point3<f64>]) -> RestLeg {
    let sole = places.iter().filter(|p| p.x * ankle.x > 0.0 && p.y < SOLE_SHARE * ankle.y).map(|p| p.z);
    let (rear, front) = sole.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), z| (low.min(z), high.max(z)));
    let at = |z: f64| Point3::new(ankle.x, 0.0, z);
    let points = LegPoints { hip, knee, ankle, heel: at(rear), toe: at(front) };
    RestLeg { points, ball: at(rear + BALL_SHARE * (front - rear)) }
}

/// Gives the weight of a foot in front of its ball to the toes.
fn bend_toes(weights: &mut [f32; PART_COUNT], rest: &Point3<f64>, legs: &[RestLeg; 2]) {
    for (side, leg) in legs.iter().enumerate() {
        let length = leg.points.toe.z - leg.points.heel.z;
        let share = smoothstep((rest.z - leg.ball.z) / (BEND_SHARE * length) + 0.5) as f32;
        let foot = weights[part_index(side, LegPart::Foot)];
        weights[part_index(side, LegPart::Foot)] = foot * (1.0 - share);
        weights[part_index(side, LegPart::Toes)] = foot * share;
    }
}
