//! A figure's surface: triangles whose vertices hang on the parts of the lower body.

use super::bones::{LegPart, PART_COUNT, Posture, RestLeg, part_index};
use super::noise::smooth;
use nalgebra::{Point3, Vector3};

/// A triangle mesh in the rest posture, with its legs. Lengths are metres once it has been scaled to a stature.
#[derive(Debug, Clone)]
pub struct Body {
    /// Vertices at rest.
    pub vertices: Vec<Vertex>,
    /// Indices of each triangle's vertices.
    pub triangles: Vec<[u32; 3]>,
    /// The left and the right leg at rest.
    pub legs: [RestLeg; 2],
    /// Height from the soles to the top.
    pub height: f64,
}

/// A point of the surface.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Vertex {
    /// Place at rest.
    pub rest: Point3<f64>,
    /// Outward normal at rest.
    pub normal: Vector3<f64>,
    /// Share of each part in its motion; the sum is 1.
    pub weights: [f32; PART_COUNT],
}

impl Vertex {
    /// How far the vertex is part of a foot, 0 to 1.
    pub fn foot_share(&self) -> f32 {
        let feet = [0, 1].map(|side| [LegPart::Foot, LegPart::Toes].map(|part| part_index(side, part)));
        feet.as_flattened().iter().map(|part| self.weights[*part]).sum()
    }
}

impl Body {
    /// The figure with another height.
    pub fn of_stature(mut self, stature_m: f64) -> Self {
        let scale = stature_m / self.height;
        for vertex in &mut self.vertices {
            vertex.rest *= scale;
        }
        self.legs = self.legs.map(|leg| leg.scaled(scale));
        self.height = stature_m;
        self
    }

    /// Moves the surface outwards: cloth of a thickness, with folds, and a shank that widens towards the ankle by
    /// `flare`, all metres. Feet stay as they are.
    pub fn dressed(mut self, thickness: f64, folds: f64, flare: f64, seed: u64) -> Self {
        /// Size of a fold, metres: across and along the leg.
        const FOLD_M: [f64; 3] = [0.05, 0.12, 0.05];
        let (knee, ankle) = (self.legs[0].points.knee.y, self.legs[0].points.ankle.y);
        for vertex in &mut self.vertices {
            let cloth = 1.0 - vertex.foot_share();
            let place: [f64; 3] = std::array::from_fn(|k| vertex.rest[k] / FOLD_M[k]);
            let down = ((knee - vertex.rest.y) / (knee - ankle)).clamp(0.0, 1.0);
            let out = thickness + folds * smooth(seed, place) + flare * down;
            vertex.rest += vertex.normal * (f64::from(cloth) * out);
        }
        self
    }

    /// The surface in a posture: the vertices in the posture's frame.
    pub fn skinned(&self, posture: &Posture, out: &mut Vec<Point3<f64>>) {
        let parts = posture.parts.map(|part| part.to_homogeneous());
        out.clear();
        out.extend(self.vertices.iter().map(|vertex| {
            let mut place = Vector3::zeros();
            for (weight, part) in vertex.weights.iter().zip(&parts) {
                if *weight > 0.0 {
                    place += part.transform_point(&vertex.rest).coords * f64::from(*weight);
                }
            }
            Point3::from(place)
        }));
    }
}

/// Outward unit normals of vertices: the mean of their triangles' normals, weighted by area.
pub(super) fn vertex_normals(places: &[Point3<f64>], triangles: &[[u32; 3]]) -> Vec<Vector3<f64>> {
    let mut normals = vec![Vector3::zeros(); places.len()];
    for corners in triangles {
        let [a, b, c] = corners.map(|corner| places[corner as usize]);
        let normal = (b - a).cross(&(c - a));
        for corner in corners {
            normals[*corner as usize] += normal;
        }
    }
    normals.into_iter().map(|normal| normal.try_normalize(1e-12).unwrap_or_else(Vector3::y)).collect()
}
