//! A figure in trousers and shoes that is made here, so that a simulation needs no file.
//!
//! Legs are tubes whose cross sections are neither round nor centred on the bone: thighs bulge forwards, calves
//! backwards, cloth hangs in folds and widens over the shoe. Shoes have a flat sole, a rounded upper and a toe that bends.

use super::body::{Body, Vertex, vertex_normals};
use super::bones::{LegPart, LegPoints, PART_COUNT, PELVIS, RestLeg, part_index};
use super::course::lateral;
use super::noise::{smooth, smoothstep};
use nalgebra::Point3;
use std::f64::consts::TAU;

/// Height of the figure as it is made, metres; it is scaled afterwards. Proportions are those of adults (hip at 53 %,
/// knee at 28.5 %, ankle at 4 to 5 % of the stature; Drillis and Contini 1966 as reprinted by Winter).
const STATURE_M: f64 = 1.7;
const HIP_M: Point3<f64> = Point3::new(0.088, 0.90, 0.0);
const KNEE_M: Point3<f64> = Point3::new(0.090, 0.485, 0.012);
const ANKLE_M: Point3<f64> = Point3::new(0.088, 0.085, -0.005);

/// Rear, ball and front of the shoe along z, metres.
const SHOE_M: [f64; 3] = [-0.080, 0.118, 0.205];

/// Points around a tube, rings along a leg and along a shoe.
const AROUND: usize = 36;
const LEG_RINGS: usize = 60;
const SHOE_RINGS: usize = 28;

/// Depth of the folds of the cloth, metres, and their size across and along.
const FOLDS_M: f64 = 0.010;
const FOLD_SIZE_M: [f64; 3] = [0.045, 0.09, 0.045];

/// Noise of the folds.
const FOLD_SEED: u64 = 0x666f_6c64;

/// Half width, half depth and forward shift of a leg's cross sections with cloth, at heights, metres.
const LEG_SECTIONS: [[f64; 4]; 7] = [
    [0.98, 0.088, 0.110, 0.000],
    [0.80, 0.082, 0.098, 0.012],
    [0.62, 0.070, 0.080, 0.012],
    [0.485, 0.060, 0.066, 0.006],
    [0.36, 0.060, 0.068, -0.016],
    [0.18, 0.058, 0.066, -0.010],
    [0.035, 0.068, 0.082, 0.004],
];

/// Half width and height of a shoe's cross sections along z, metres.
const SHOE_SECTIONS: [[f64; 3]; 7] = [
    [-0.080, 0.018, 0.055],
    [-0.060, 0.034, 0.095],
    [0.000, 0.038, 0.105],
    [0.060, 0.042, 0.085],
    [0.118, 0.049, 0.062],
    [0.180, 0.040, 0.048],
    [0.205, 0.016, 0.026],
];

/// Height of the trunk's lower end, and half its width and depth, metres.
const TRUNK_M: [f64; 3] = [0.84, 0.170, 0.120];

/// Length over which the surface passes from one part to the next, metres.
const BLEND_M: f64 = 0.12;
/// The same at the ball of the foot.
const BALL_BLEND_M: f64 = 0.03;

/// The figure, 1.7 m high.
pub fn trousers() -> Body {
    let mut mesh = Mesh::default();
    for side in 0..2 {
        mesh.add_leg(side);
        mesh.add_shoe(side);
    }
    mesh.add_trunk();
    let normals = vertex_normals(&mesh.places, &mesh.triangles);
    let vertices = mesh.places.iter().zip(normals).zip(&mesh.weights);
    let vertices =
        vertices.map(|((rest, normal), weights)| Vertex { rest: *rest, normal, weights: *weights }).collect();
    Body { vertices, triangles: mesh.triangles, legs: [rest_leg(0), rest_leg(1)], height: STATURE_M }
}

fn rest_leg(side: usize) -> RestLeg {
    let own = |p: Point3<f64>| Point3::new(lateral(side) * p.x, p.y, p.z);
    let on_floor = |z: f64| own(Point3::new(ANKLE_M.x, 0.0, z));
    let points = LegPoints {
        hip: own(HIP_M),
        knee: own(KNEE_M),
        ankle: own(ANKLE_M),
        heel: on_floor(SHOE_M[0]),
        toe: on_floor(SHOE_M[2]),
    };
    RestLeg { points, ball: on_floor(SHOE_M[1]) }
}

#[derive(Default)]
struct Mesh {
    places: Vec<Point3<f64>>,
    weights: Vec<[f32; PART_COUNT]>,
    triangles: Vec<[u32; 3]>,
}

impl Mesh {
    fn add_leg(&mut self, side: usize) {
        let (top, bottom) = (LEG_SECTIONS[0][0], LEG_SECTIONS[LEG_SECTIONS.len() - 1][0]);
        let rings = (0..LEG_RINGS).map(|ring| {
            let y = top + (bottom - top) * ring as f64 / (LEG_RINGS - 1) as f64;
            let [half_width, half_depth, shift] = interpolated(&LEG_SECTIONS, y);
            let centre = leg_axis(side, y);
            std::array::from_fn(|k| {
                let (sin, cos) = (TAU * k as f64 / AROUND as f64).sin_cos();
                let fold = [centre.x + 0.06 * cos, y, 0.06 * sin];
                let fold: [f64; 3] = std::array::from_fn(|axis| fold[axis] / FOLD_SIZE_M[axis]);
                let out = FOLDS_M * (smooth(FOLD_SEED, fold) - 0.5);
                Point3::new(centre.x + (half_width + out) * cos, y, centre.z + shift + (half_depth + out) * sin)
            })
        });
        let rings: Vec<[Point3<f64>; AROUND]> = rings.collect();
        self.add_tube(&rings, |place| {
            let below_hip = smoothstep((HIP_M.y - place.y) / BLEND_M + 0.5) as f32;
            let below_knee = smoothstep((KNEE_M.y - place.y) / BLEND_M + 0.5) as f32;
            let mut weights = [0.0; PART_COUNT];
            weights[PELVIS] = 1.0 - below_hip;
            weights[part_index(side, LegPart::Thigh)] = below_hip * (1.0 - below_knee);
            weights[part_index(side, LegPart::Shank)] = below_hip * below_knee;
            weights
        });
    }

    fn add_shoe(&mut self, side: usize) {
        let rings = (0..SHOE_RINGS).map(|ring| {
            let z = SHOE_M[0] + (SHOE_M[2] - SHOE_M[0]) * ring as f64 / (SHOE_RINGS - 1) as f64;
            let [half_width, height] = interpolated(&SHOE_SECTIONS, z);
            std::array::from_fn(|k| {
                let (sin, cos) = (TAU * k as f64 / AROUND as f64).sin_cos();
                // The upper half is round; the lower half is the sole.
                Point3::new(lateral(side) * ANKLE_M.x + half_width * cos, height * sin.max(0.0), z)
            })
        });
        let rings: Vec<[Point3<f64>; AROUND]> = rings.collect();
        self.add_tube(&rings, |place| {
            let toes = smoothstep((place.z - SHOE_M[1]) / BALL_BLEND_M + 0.5) as f32;
            let mut weights = [0.0; PART_COUNT];
            weights[part_index(side, LegPart::Foot)] = 1.0 - toes;
            weights[part_index(side, LegPart::Toes)] = toes;
            weights
        });
    }

    fn add_trunk(&mut self) {
        let [bottom, half_width, half_depth] = TRUNK_M;
        let rings: Vec<[Point3<f64>; AROUND]> = [bottom, 1.0, 1.2, STATURE_M]
            .iter()
            .map(|y| {
                std::array::from_fn(|k| {
                    let (sin, cos) = (TAU * k as f64 / AROUND as f64).sin_cos();
                    Point3::new(half_width * cos, *y, half_depth * sin)
                })
            })
            .collect();
        self.add_tube(&rings, |_| {
            let mut weights = [0.0; PART_COUNT];
            weights[PELVIS] = 1.0;
            weights
        });
    }

    /// Joins rings of points, and closes the first and the last one.
    fn add_tube(&mut self, rings: &[[Point3<f64>; AROUND]], weights: impl Fn(&Point3<f64>) -> [f32; PART_COUNT]) {
        let first = self.places.len() as u32;
        let around = AROUND as u32;
        for place in rings.as_flattened() {
            self.places.push(*place);
            self.weights.push(weights(place));
        }
        let last = first + (rings.len() as u32 - 1) * around;
        // Normals must point outwards: whether the rings are listed up or down, forwards or back, decides the order.
        let [a, b, c] = [rings[0][0], rings[0][1], rings[rings.len() - 1][0]];
        let middle = rings[0].iter().fold(nalgebra::Vector3::zeros(), |sum, p| sum + p.coords) / f64::from(around);
        let is_outward = (b - a).cross(&(c - a)).dot(&(a.coords - middle)) > 0.0;
        let mut push = |[a, b, c]: [u32; 3]| self.triangles.push(if is_outward { [a, b, c] } else { [a, c, b] });
        for ring in (first..last).step_by(AROUND) {
            for k in 0..around {
                let next = (k + 1) % around;
                push([ring + k, ring + next, ring + around + k]);
                push([ring + next, ring + around + next, ring + around + k]);
            }
        }
        for k in 1..around - 1 {
            push([first, first + k + 1, first + k]);
            push([last, last + k, last + k + 1]);
        }
    }
}

/// Point of a leg's bones at a height; above the hip and below the ankle it goes on straight.
fn leg_axis(side: usize, y: f64) -> Point3<f64> {
    let (upper, lower) = if y > KNEE_M.y { (HIP_M, KNEE_M) } else { (KNEE_M, ANKLE_M) };
    let place = upper + (lower - upper) * ((upper.y - y) / (upper.y - lower.y));
    Point3::new(lateral(side) * place.x, y, place.z)
}

/// Columns of a table at a value of its first one, linear between rows.
fn interpolated<const COLUMNS: usize, const VALUES: usize>(table: &[[f64; COLUMNS]], at: f64) -> [f64; VALUES] {
    let between = |w: &&[[f64; COLUMNS]]| (w[0][0] - at) * (w[1][0] - at) <= 0.0;
    let pair = table.windows(2).find(between).unwrap_or(&table[..2]);
    let part = ((at - pair[0][0]) / (pair[1][0] - pair[0][0])).clamp(0.0, 1.0);
    std::array::from_fn(|k| pair[0][k + 1] + part * (pair[1][k + 1] - pair[0][k + 1]))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_figure_stands_on_the_floor_is_mirrored_and_its_normals_point_outwards() {
        let body = trousers();
        let lowest = body.vertices.iter().map(|v| v.rest.y).fold(f64::INFINITY, f64::min);
        assert!(lowest.abs() < 1e-9, "{lowest}");
        assert_eq!(body.legs[0].points.knee.x, -body.legs[1].points.knee.x);
        let knee = body.legs[0].points.knee;
        let around = body.vertices.iter().filter(|v| v.rest.x > 0.0 && (v.rest.y - knee.y).abs() < 0.03);
        assert!(around.clone().count() > 30);
        for vertex in around {
            let out = nalgebra::Vector3::new(vertex.rest.x - knee.x, 0.0, vertex.rest.z - knee.z);
            assert!(vertex.normal.dot(&out) > 0.0);
        }
    }

    #[test]
    fn every_vertex_hangs_on_its_parts_with_a_sum_of_one() {
        for vertex in trousers().vertices {
            assert!((vertex.weights.iter().sum::<f32>() - 1.0).abs() < 1e-5);
        }
    }

    #[test]
    fn sections_are_linear_between_their_rows() {
        let [half_width, height] = interpolated(&SHOE_SECTIONS, 0.030);
        assert!((half_width - 0.040).abs() < 1e-9 && (height - 0.095).abs() < 1e-9);
    }
}
