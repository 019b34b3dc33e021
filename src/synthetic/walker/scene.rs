//! What there is to see besides the person: the walker's frame and things that stand in the room.

use super::noise::lattice;
use nalgebra::{Point3, Vector3};

/// Triangles of things.
#[derive(Debug, Clone, Default)]
pub struct Things {
    /// Corners, metres.
    pub corners: Vec<Point3<f64>>,
    /// Three corners for each triangle.
    pub triangles: Vec<[u32; 3]>,
}

/// Half the distance of the walker's sides, and half the thickness of its tubes, metres. Walkers are 0.55 to 0.65 m wide.
const HALF_WIDTH_M: f64 = 0.31;
/// See [`HALF_WIDTH_M`].
const HALF_TUBE_M: f64 = 0.014;

/// Where the sides begin and end behind the camera, metres along the floor.
const SIDE_RANGE_M: [f64; 2] = [0.35, 0.75];

/// Things that stand in the room for each metre of the way, how far from it and how large they are, metres.
const THINGS_PER_M: f64 = 0.5;
/// See [`THINGS_PER_M`].
const ASIDE_M: [f64; 2] = [0.9, 2.5];
/// See [`THINGS_PER_M`].
const SIZE_M: [f64; 2] = [0.1, 0.5];

impl Things {
    /// The sides of a walker in its own axes: the camera's floor point at the origin, x to the left, y up, z ahead. Two
    /// legs and two bars on each side.
    pub fn walker_frame() -> Self {
        let mut things = Self::default();
        let [front, rear] = SIDE_RANGE_M.map(|z| -z);
        for x in [-HALF_WIDTH_M, HALF_WIDTH_M] {
            for z in [front, rear] {
                things.add_box(Point3::new(x, 0.45, z), Vector3::new(HALF_TUBE_M, 0.45, HALF_TUBE_M));
            }
            for y in [0.2, 0.88] {
                let half = Vector3::new(HALF_TUBE_M, HALF_TUBE_M, 0.5 * (front - rear));
                things.add_box(Point3::new(x, y, 0.5 * (front + rear)), half);
            }
        }
        things
    }

    /// Boxes beside and behind a way along z of a length, in `world`.
    pub fn in_room(length_m: f64, seed: u64) -> Self {
        let mut things = Self::default();
        let n = (length_m * THINGS_PER_M).ceil() as i64;
        for k in 0..n {
            let draw = |what: i64, [low, high]: [f64; 2]| low + (high - low) * lattice(seed, k, what, 0);
            let side = if k % 2 == 0 { 1.0 } else { -1.0 };
            let half = Vector3::new(draw(0, SIZE_M), draw(1, SIZE_M) * 1.5, draw(2, SIZE_M));
            let x = side * (draw(3, ASIDE_M) + half.x);
            things.add_box(Point3::new(x, half.y, draw(4, [-2.0, length_m])), half);
        }
        things
    }

    fn add_box(&mut self, centre: Point3<f64>, half: Vector3<f64>) {
        /// Corners of the six faces; corner `k` has the signs of the bits of `k`.
        const FACES: [[u32; 4]; 6] =
            [[0, 1, 3, 2], [4, 5, 7, 6], [0, 1, 5, 4], [2, 3, 7, 6], [0, 2, 6, 4], [1, 3, 7, 5]];
        let first = self.corners.len() as u32;
        for k in 0..8 {
            let sign = |bit: u32| if k >> bit & 1 == 1 { 1.0 } else { -1.0 };
            self.corners.push(centre + half.component_mul(&Vector3::new(sign(0), sign(1), sign(2))));
        }
        for [a, b, c, d] in FACES {
            self.triangles.push([first + a, first + b, first + c]);
            self.triangles.push([first + a, first + c, first + d]);
        }
    }
}
