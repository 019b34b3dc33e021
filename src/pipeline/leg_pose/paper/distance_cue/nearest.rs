//! How far the nearest of many points is: exact, after looking at a small part of them.
//!
//! Points are kept in blocks of sixteen neighbours with a sphere around each. Space is divided into cells; the first
//! question in a cell lists the blocks that can hold the nearest point of any place in it, by
//!
//! ```text
//! bound = |cell − block| − radius of the block's sphere         a place at distance s from the cell's centre
//!                                                               has none of the block's points nearer than bound − s
//! ```
//!
//! in ascending order, so that a search ends at the first block whose bound shows that it comes too late. Lists are made
//! once, by whichever thread comes first; they do not depend on who that is.

use crate::geometry::lanes::{LANES, Lanes};
use pulp::Simd;
use std::sync::OnceLock;

/// Edge of a cell, metres: smaller cells have shorter lists but more of them are asked for.
const CELL: f32 = 0.03;
/// Places farther from all points than this lie outside the cells and are compared with every point, metres.
const MARGIN: f32 = 0.15;
/// Blocks that are searched between two looks at the bound.
const STRIDE: usize = 4;

/// Sixteen points, coordinate by coordinate, with the square of their norm.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Block {
    coordinates: [[f32; LANES]; 4],
}

impl Block {
    fn new(points: &[[f32; 3]; LANES]) -> Self {
        let mut coordinates = [[0.0; LANES]; 4];
        for (lane, point) in points.iter().enumerate() {
            for axis in 0..3 {
                coordinates[axis][lane] = point[axis];
            }
            coordinates[3][lane] = squared_norm(point);
        }
        Self { coordinates }
    }

    /// One register of x, y, z (axes 0 to 2) or squared norm (3).
    #[inline(always)]
    pub fn lanes<S: Simd>(&self, simd: S, axis: usize, register: usize) -> Lanes<S> {
        Lanes::new(simd, S::as_simd_f32s(&self.coordinates[axis]).0[register])
    }

    /// The smaller, lane by lane, of `best` and the squared distances of the points.
    #[inline(always)]
    fn nearer<S: Simd>(&self, simd: S, place: &[Lanes<S>; 3], best: Lanes<S>) -> Lanes<S> {
        let mut best = best;
        for register in 0..LANES / S::F32_LANES {
            let dx = self.lanes(simd, 0, register) - place[0];
            let dy = self.lanes(simd, 1, register) - place[1];
            let dz = self.lanes(simd, 2, register) - place[2];
            best = best.min(dx.mul_add(dx, dy.mul_add(dy, dz * dz)));
        }
        best
    }

    /// A sphere around the points: centre and radius.
    fn sphere(&self) -> ([f32; 3], f32) {
        let mut centre = [0.0; 3];
        for (middle, coordinate) in centre.iter_mut().zip(&self.coordinates) {
            let low = coordinate.iter().copied().fold(f32::INFINITY, f32::min);
            let high = coordinate.iter().copied().fold(f32::NEG_INFINITY, f32::max);
            *middle = 0.5 * (low + high);
        }
        let [x, y, z, _] = &self.coordinates;
        let radius = (0..LANES).map(|lane| distance(&[x[lane], y[lane], z[lane]], &centre)).fold(0.0, f32::max);
        (centre, radius)
    }

    fn distance_to(&self, place: &[f32; 3]) -> f32 {
        let [x, y, z, _] = &self.coordinates;
        (0..LANES).map(|lane| distance(&[x[lane], y[lane], z[lane]], place)).fold(f32::INFINITY, f32::min)
    }
}

/// The spheres around sixteen blocks; the last one is repeated where blocks are fewer.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Spheres {
    /// Their centres.
    pub centres: Block,
    radii: [f32; LANES],
}

impl Spheres {
    fn new(spheres: &[([f32; 3], f32)]) -> Self {
        let at = |lane: usize| spheres[lane.min(spheres.len() - 1)];
        Self {
            centres: Block::new(&std::array::from_fn(|lane| at(lane).0)),
            radii: std::array::from_fn(|lane| at(lane).1),
        }
    }

    /// One register of radii.
    #[inline(always)]
    pub fn radii<S: Simd>(&self, simd: S, register: usize) -> Lanes<S> {
        Lanes::new(simd, S::as_simd_f32s(&self.radii).0[register])
    }
}

/// A block that may hold the nearest point of a place in a cell.
#[derive(Debug, Clone, Copy)]
struct Candidate {
    bound: f32,
    block: u32,
}

/// The points and the cells around them.
#[derive(Debug)]
pub struct NearestField {
    blocks: Vec<Block>,
    spheres: Vec<([f32; 3], f32)>,
    grouped_spheres: Vec<Spheres>,
    low: [f32; 3],
    counts: [usize; 3],
    cells: Vec<OnceLock<Box<[Candidate]>>>,
}

impl NearestField {
    /// The field of some points, a multiple of [`LANES`] and at least as many.
    ///
    /// # Panics
    /// When there are fewer.
    pub fn new(mut points: Vec<[f32; 3]>) -> Self {
        assert!(points.len() >= LANES, "at least one block");
        split(&mut points);
        let blocks: Vec<Block> = points.as_chunks::<LANES>().0.iter().map(Block::new).collect();
        let (mut low, mut high) = ([f32::INFINITY; 3], [f32::NEG_INFINITY; 3]);
        for point in &points {
            for axis in 0..3 {
                low[axis] = low[axis].min(point[axis] - MARGIN);
                high[axis] = high[axis].max(point[axis] + MARGIN);
            }
        }
        let counts: [usize; 3] = std::array::from_fn(|axis| ((high[axis] - low[axis]) / CELL) as usize + 1);
        let mut cells = Vec::new();
        cells.resize_with(counts.iter().product(), OnceLock::new);
        let spheres: Vec<_> = blocks.iter().map(Block::sphere).collect();
        let grouped_spheres = spheres.chunks(LANES).map(Spheres::new).collect();
        Self { spheres, grouped_spheres, blocks, low, counts, cells }
    }

    /// The points, in blocks.
    pub fn blocks(&self) -> &[Block] {
        &self.blocks
    }

    /// The spheres around the blocks, sixteen together.
    pub fn spheres(&self) -> &[Spheres] {
        &self.grouped_spheres
    }

    /// Distance from a place to the nearest point.
    #[inline(always)]
    pub fn distance<S: Simd>(&self, simd: S, place: &[f32; 3]) -> f32 {
        let at = Lanes::splat_point(simd, place);
        let mut best = Lanes::splat(simd, f32::INFINITY);
        let Some((cell, centre)) = self.cell_of(place) else {
            for block in &self.blocks {
                best = block.nearer(simd, &at, best);
            }
            return simd.reduce_min_f32s(best.values).sqrt();
        };
        let candidates = self.cells[cell].get_or_init(|| self.candidates(&centre));
        let aside = distance(place, &centre);
        let mut nearest = f32::INFINITY;
        for group in candidates.chunks(STRIDE) {
            if group[0].bound > nearest + aside {
                break;
            }
            for candidate in group {
                best = self.blocks[candidate.block as usize].nearer(simd, &at, best);
            }
            nearest = simd.reduce_min_f32s(best.values).sqrt();
        }
        nearest
    }

    /// The cell that a place lies in, and its centre.
    #[inline(always)]
    fn cell_of(&self, place: &[f32; 3]) -> Option<(usize, [f32; 3])> {
        let (mut index, mut centre) = (0, [0.0; 3]);
        for axis in 0..3 {
            let along = (place[axis] - self.low[axis]) * (1.0 / CELL);
            if !(along >= 0.0 && along < self.counts[axis] as f32) {
                return None;
            }
            let cell = along as usize;
            index = index * self.counts[axis] + cell;
            centre[axis] = self.low[axis] + (cell as f32 + 0.5) * CELL;
        }
        Some((index, centre))
    }

    /// Blocks that may hold the nearest point of a place in the cell around a centre.
    #[inline(never)]
    fn candidates(&self, centre: &[f32; 3]) -> Box<[Candidate]> {
        /// Half the diagonal of a cell (½ √3 of its edge), and what rounding may add to it.
        const REACH: f32 = 0.866_026 * CELL + 1e-4;
        let bounds: Vec<f32> = self.spheres.iter().map(|(c, radius)| distance(c, centre) - radius).collect();
        let mut nearest = f32::INFINITY;
        for (block, bound) in self.blocks.iter().zip(&bounds) {
            if *bound < nearest {
                nearest = nearest.min(block.distance_to(centre));
            }
        }
        let is_candidate = |bound: f32| bound <= nearest + 2.0 * REACH;
        let mut list: Vec<Candidate> = (0..).zip(bounds).map(|(block, bound)| Candidate { bound, block }).collect();
        list.retain(|candidate| is_candidate(candidate.bound));
        list.sort_unstable_by(|a, b| a.bound.total_cmp(&b.bound).then(a.block.cmp(&b.block)));
        list.into_boxed_slice()
    }
}

fn squared_norm(point: &[f32; 3]) -> f32 {
    point[0] * point[0] + point[1] * point[1] + point[2] * point[2]
}

#[inline(always)]
fn distance(a: &[f32; 3], b: &[f32; 3]) -> f32 {
    squared_norm(&[a[0] - b[0], a[1] - b[1], a[2] - b[2]]).sqrt()
}

/// Orders points so that each block holds neighbours: halves along the longest side, at a whole number of blocks.
fn split(points: &mut [[f32; 3]]) {
    if points.len() <= LANES {
        return;
    }
    let (mut axis, mut longest) = (0, f32::NEG_INFINITY);
    for candidate in 0..3 {
        let low = points.iter().map(|p| p[candidate]).fold(f32::INFINITY, f32::min);
        let high = points.iter().map(|p| p[candidate]).fold(f32::NEG_INFINITY, f32::max);
        if high - low > longest {
            (axis, longest) = (candidate, high - low);
        }
    }
    let middle = (points.len() / LANES).div_ceil(2) * LANES;
    if middle < points.len() {
        points.select_nth_unstable_by(middle, |a, b| a[axis].total_cmp(&b[axis]));
    }
    let (first, second) = points.split_at_mut(middle);
    split(first);
    split(second);
}
