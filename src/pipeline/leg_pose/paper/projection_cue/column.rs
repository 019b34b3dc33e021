//! The sum over one column of the image.

use super::face::{FaceInColumn, FaceKind, Faces};
use super::outline::{Extents, Outlines, Rows};
use super::smooth_side::{SmoothSide, depth_at};
use crate::body::legs::solids::SOLID_COUNT;
use crate::geometry::camera::Intrinsics;
use crate::geometry::lanes::{LANES, Lanes};
use pulp::Simd;

/// Most runs in a column: of each solid the side before the other faces and behind them, the disc and the flat side.
const MAX_RUNS: usize = 5 * SOLID_COUNT;

/// Rows `start..end` in which a face of a solid is in front of its others.
#[derive(Debug, Clone, Copy, Default)]
struct Run {
    start: u32,
    end: u32,
    solid: u8,
    kind: FaceKind,
}

/// The solids as the camera sees them.
#[derive(Debug, Clone, Copy)]
pub struct ModelInImage<'a> {
    /// Faces of each solid.
    pub faces: &'a [Faces; SOLID_COUNT],
    /// Outline of each solid.
    pub outlines: &'a [Outlines; SOLID_COUNT],
    /// The camera.
    pub camera: &'a Intrinsics,
}

/// The runs of faces in one column, in the order of their starts; used again for each column.
#[derive(Debug, Clone, Default)]
pub struct Column {
    height: u32,
    runs: [Run; MAX_RUNS],
    count: usize,
    /// Faces that cover the same rows.
    together: [Depth; MAX_RUNS],
}

impl Column {
    /// Empties the column; `height` is that of the image.
    #[inline(always)]
    pub fn clear(&mut self, height: usize) {
        self.height = height as u32;
        self.count = 0;
    }

    /// Adds the runs of a solid: disc and flat side where they are, the side in what they leave.
    #[inline(always)]
    pub fn add_solid(&mut self, solid: usize, extents: &Extents) {
        let [start, end] = self.whole_rows(&extents.whole, [0, self.height]);
        if start >= end {
            return;
        }
        let disc = self.whole_rows(&extents.disc, [start, end]);
        let flat = self.whole_rows(&extents.flat, [start, end]);
        let [mut first, mut second] = [(disc, FaceKind::Disc), (flat, FaceKind::Flat)];
        if second.0[0] < first.0[0] {
            std::mem::swap(&mut first, &mut second);
        }
        let mut next = start;
        for (rows, kind) in [first, second] {
            let from = rows[0].max(next);
            if from < rows[1] {
                self.add_run(next, from, solid, FaceKind::Side);
                self.add_run(from, rows[1], solid, kind);
                next = rows[1];
            }
        }
        self.add_run(next, end, solid, FaceKind::Side);
    }

    /// Whole rows of an extent, cut to a range: first row and the one after the last.
    #[inline(always)]
    fn whole_rows(&self, rows: &Rows, within: [u32; 2]) -> [u32; 2] {
        // Conversions saturate, also at infinity.
        let start = (rows[0].ceil() as u32).max(within[0]);
        let end = ((rows[1].floor() + 1.0) as u32).min(within[1]);
        [start, end]
    }

    /// Adds a run in the order of starts.
    #[inline(always)]
    fn add_run(&mut self, start: u32, end: u32, solid: usize, kind: FaceKind) {
        if start >= end {
            return;
        }
        let mut place = self.count;
        while place > 0 && self.runs[place - 1].start > start {
            self.runs[place] = self.runs[place - 1];
            place -= 1;
        }
        self.runs[place] = Run { start, end, solid: solid as u8, kind };
        self.count += 1;
    }

    /// Adds `|zP − zK| − zK` of the covered rows to the sums, one for each lane of a group of rows. `depths` are those of
    /// the foreground in column `i`, [`LANES`] more than there are rows.
    #[inline(always)]
    pub fn sum<S: Simd>(&mut self, simd: S, model: &ModelInImage, i: usize, depths: &[f32], sums: &mut [f32; LANES]) {
        let ModelInImage { faces, outlines, camera } = *model;
        let (x, pitch) = ((i as f64 - camera.cx) / camera.fx, 1.0 / camera.fy);
        let runs = &self.runs[..self.count];
        let (mut next, mut row) = (0, 0);
        // From stretch to stretch of rows that the same runs cover.
        while next < runs.len() {
            row = row.max(runs[next].start);
            let mut end = u32::MAX;
            let mut count = 0;
            for run in &runs[next..] {
                if run.start > row {
                    end = end.min(run.start);
                    break;
                }
                let faces = &faces[run.solid as usize];
                if run.end > row {
                    end = end.min(run.end);
                    if faces.shows_side || run.kind != FaceKind::Side {
                        let smooth = match run.kind {
                            FaceKind::Side => outlines[run.solid as usize].sides.at(i, row),
                            _ => None,
                        };
                        self.together[count] = match smooth {
                            Some(side) => Depth::Smooth(side),
                            None => {
                                let y = (f64::from(row) - camera.cy) * pitch;
                                Depth::Exact(faces.face(run.kind).in_column(x, y, pitch))
                            }
                        };
                        count += 1;
                    }
                }
            }
            let rows = (end - row) as usize;
            let depths = &depths[row as usize..];
            match &self.together[..count] {
                [] => {}
                [face] => add_one(simd, face, depths, rows, sums),
                faces => add_nearest(simd, faces, depths, rows, sums),
            }
            row = end;
            while next < runs.len() && runs[next].end <= row {
                next += 1;
            }
        }
    }
}

const NUMBERS: [f32; LANES] = [0.0, 1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0, 8.0, 9.0, 10.0, 11.0, 12.0, 13.0, 14.0, 15.0];

/// A face's numbers in every lane.
#[derive(Clone, Copy)]
struct Broadcast<S: Simd> {
    c: Lanes<S>,
    b: [Lanes<S>; 2],
    e: [Lanes<S>; 3],
}

impl<S: Simd> Broadcast<S> {
    #[inline(always)]
    fn new(simd: S, face: &FaceInColumn) -> Self {
        Self {
            c: Lanes::splat(simd, face.c),
            b: [Lanes::splat(simd, face.b[0]), Lanes::splat(simd, face.b[1])],
            e: Lanes::splat_point(simd, &face.e),
        }
    }

    /// Depth at some rows.
    #[inline(always)]
    fn depth(&self, zero: Lanes<S>, row: Lanes<S>) -> Lanes<S> {
        let squared = row.mul_add(row.mul_add(self.e[2], self.e[1]), self.e[0]);
        self.c / (row.mul_add(self.b[1], self.b[0]) + squared.max(zero).sqrt())
    }
}

/// A face over a stretch of rows.
#[derive(Debug, Clone, Copy)]
enum Depth {
    /// By the face itself.
    Exact(FaceInColumn),
    /// By the polynomial of a side.
    Smooth(SmoothSide),
}

impl Default for Depth {
    fn default() -> Self {
        Self::Exact(FaceInColumn::default())
    }
}

/// A polynomial's numbers in every lane.
#[derive(Clone, Copy)]
struct BroadcastSide<S: Simd> {
    coefficients: [Lanes<S>; 5],
    first: Lanes<S>,
    pitch: Lanes<S>,
}

impl<S: Simd> BroadcastSide<S> {
    #[inline(always)]
    fn new(simd: S, side: &SmoothSide) -> Self {
        let [c0, c1, c2, c3, c4] = side.coefficients;
        let [c0, c1, c2] = Lanes::splat_point(simd, &[c0, c1, c2]);
        let coefficients = [c0, c1, c2, Lanes::splat(simd, c3), Lanes::splat(simd, c4)];
        Self { coefficients, first: Lanes::splat(simd, side.first), pitch: Lanes::splat(simd, side.pitch) }
    }

    /// Depth at some rows.
    #[inline(always)]
    fn depth(&self, row: Lanes<S>) -> Lanes<S> {
        depth_at(&self.coefficients, row.mul_add(self.pitch, self.first))
    }
}

/// Adds the rows of a stretch that one face covers.
#[inline(always)]
fn add_one<S: Simd>(simd: S, depth: &Depth, depths: &[f32], rows: usize, sums: &mut [f32; LANES]) {
    let zero = Lanes::splat(simd, 0.0);
    let (whole, rest) = (rows / LANES, rows % LANES);
    let groups = depths[..(whole + 1) * LANES].as_chunks::<LANES>().0;
    let step = Lanes::splat(simd, LANES as f32);
    for register in 0..LANES / S::F32_LANES {
        let number = Lanes::new(simd, S::as_simd_f32s(&NUMBERS).0[register]);
        let sum = &mut S::as_mut_simd_f32s(sums).0[register];
        let mut total = Lanes::new(simd, *sum);
        let mut row = number;
        let last = match depth {
            Depth::Exact(face) => {
                let face = Broadcast::new(simd, face);
                for group in &groups[..whole] {
                    let seen = Lanes::new(simd, S::as_simd_f32s(group).0[register]);
                    total += (face.depth(zero, row) - seen).abs() - seen;
                    row += step;
                }
                face.depth(zero, row)
            }
            Depth::Smooth(side) => {
                let side = BroadcastSide::new(simd, side);
                for group in &groups[..whole] {
                    let seen = Lanes::new(simd, S::as_simd_f32s(group).0[register]);
                    total += (side.depth(row) - seen).abs() - seen;
                    row += step;
                }
                side.depth(row)
            }
        };
        let seen = Lanes::new(simd, S::as_simd_f32s(&groups[whole]).0[register]);
        let term = (last - seen).abs() - seen;
        let is_covered = simd.less_than_f32s(number.values, simd.splat_f32s(rest as f32));
        total += Lanes::new(simd, simd.select_f32s(is_covered, term.values, zero.values));
        *sum = total.values;
    }
}

/// Adds the rows of a stretch that several faces cover: the nearest counts.
#[inline(always)]
fn add_nearest<S: Simd>(simd: S, faces: &[Depth], depths: &[f32], rows: usize, sums: &mut [f32; LANES]) {
    let zero = Lanes::splat(simd, 0.0);
    for register in 0..LANES / S::F32_LANES {
        let number = Lanes::new(simd, S::as_simd_f32s(&NUMBERS).0[register]);
        let sum = &mut S::as_mut_simd_f32s(sums).0[register];
        let mut total = Lanes::new(simd, *sum);
        let mut first = 0;
        while first < rows {
            let row = number + first as f32;
            let mut nearest = Lanes::splat(simd, f32::INFINITY);
            for face in faces {
                let depth = match face {
                    Depth::Exact(face) => Broadcast::new(simd, face).depth(zero, row),
                    Depth::Smooth(side) => BroadcastSide::new(simd, side).depth(row),
                };
                nearest = nearest.min(depth);
            }
            let group: &[f32] = &depths[first..first + LANES];
            let seen = Lanes::new(simd, S::as_simd_f32s(group).0[register]);
            let term = (nearest - seen).abs() - seen;
            let is_covered = simd.less_than_f32s(row.values, simd.splat_f32s(rows as f32));
            total += Lanes::new(simd, simd.select_f32s(is_covered, term.values, zero.values));
            first += LANES;
        }
        *sum = total.values;
    }
}
