//! The faces that cover a strip of columns, and the sum over their pixels.
//!
//! A register holds one row of a strip. A run is a face with the rows that it covers in each of the columns; runs are sorted
//! by their first rows, and between two ends of runs the rows are gone through once: where one run is, its depths are compared
//! as they come, where several are, the nearest depths are found first.
//!
//! With `s` the depth that is seen and `z ≥ 0` that of the model, `|z − s| − s = −min(2 s − z, z)`.

use super::face::{DepthInColumns, FaceKind, Faces};
use super::outline::Extents;
use super::side::Side;
use super::strip::{Rows, Span, Strip};
use crate::body::legs::solids::SOLID_COUNT;
use crate::geometry::camera::Intrinsics;
use crate::geometry::lanes::{Group, LANES, Lanes};
use pulp::Simd;

/// Most runs in a strip: of each solid the disc, and the flat side and the side in what it leaves above and below.
const MAX_RUNS: usize = 7 * SOLID_COUNT;

/// Rows whose nearest depths are kept at a time.
const BUFFERED: usize = 32;

/// Rows of one face.
#[derive(Debug, Clone, Copy, Default)]
struct Run {
    rows: Rows,
    /// First row in any column, and the one after the last.
    ends: [u32; 2],
    solid: u8,
    kind: FaceKind,
}

/// The runs of a strip; used again for each strip.
#[derive(Debug, Clone)]
pub struct Runs {
    runs: [Run; MAX_RUNS],
    /// Numbers of the runs in the order of their first rows.
    order: [u8; MAX_RUNS],
    count: usize,
    sides: [Side; SOLID_COUNT],
    /// Where `sides` is true enough; elsewhere the face itself is used, with a division.
    is_smooth: [bool; SOLID_COUNT],
    spans: [Span; SOLID_COUNT],
    nearest: [Group; BUFFERED],
}

impl Default for Runs {
    fn default() -> Self {
        Self {
            runs: [Run::default(); MAX_RUNS],
            order: [0; MAX_RUNS],
            count: 0,
            sides: [Side::default(); SOLID_COUNT],
            is_smooth: [false; SOLID_COUNT],
            spans: [Span::default(); SOLID_COUNT],
            nearest: [Group::default(); BUFFERED],
        }
    }
}

/// The solids in a strip, as the camera sees them.
#[derive(Debug, Clone, Copy)]
pub struct Scene<'a> {
    /// Faces of each solid.
    pub faces: &'a [Faces; SOLID_COUNT],
    /// The columns.
    pub strip: &'a Strip,
    /// The camera.
    pub camera: &'a Intrinsics,
}

impl Runs {
    /// Empties the strip.
    #[inline(always)]
    pub fn clear(&mut self) {
        self.count = 0;
    }

    /// Adds the runs of a solid: disc and flat side where they are, the side in what they leave.
    #[inline(always)]
    pub fn add_solid<S: Simd>(&mut self, simd: S, scene: &Scene, solid: usize, extents: &Extents) {
        let Scene { faces, strip, camera } = *scene;
        let Some(ends) = ends(simd, &extents.whole) else { return };
        let (span, faces) = (Span::new(ends, camera), &faces[solid]);
        self.spans[solid] = span;
        if faces.shows_side {
            let side = faces.face(FaceKind::Side);
            self.is_smooth[solid] = self.sides[solid].fit(simd, side, strip, &span, &extents.whole);
        }
        let [before, disc, after] = match faces.disc {
            Some(_) => cut(simd, &extents.whole, &extents.disc),
            None => [extents.whole, NO_ROWS, NO_ROWS],
        };
        self.add_run(simd, &disc, solid, FaceKind::Disc);
        for part in [before, after] {
            let [before, flat, after] = match faces.shows_flat {
                true => cut(simd, &part, &extents.flat),
                false => [part, NO_ROWS, NO_ROWS],
            };
            self.add_run(simd, &flat, solid, FaceKind::Flat);
            if faces.shows_side {
                self.add_run(simd, &before, solid, FaceKind::Side);
                self.add_run(simd, &after, solid, FaceKind::Side);
            }
        }
    }

    /// Adds a run, unless it has no rows, in the order of first rows.
    #[inline(always)]
    fn add_run<S: Simd>(&mut self, simd: S, rows: &Rows, solid: usize, kind: FaceKind) {
        let Some(ends) = ends(simd, rows) else { return };
        let mut place = self.count;
        while place > 0 && self.runs[self.order[place - 1] as usize].ends[0] > ends[0] {
            self.order[place] = self.order[place - 1];
            place -= 1;
        }
        self.order[place] = self.count as u8;
        self.runs[self.count] = Run { rows: *rows, ends, solid: solid as u8, kind };
        self.count += 1;
    }

    /// Takes `min(2 s − z, z)` of the covered pixels from the sums, one for each column of the strip.
    #[inline(always)]
    pub fn sum<S: Simd>(&mut self, simd: S, scene: &Scene, twice_seen: &[Group], sums: &mut Group) {
        let (mut next, mut row) = (0, 0);
        let mut together = [0u8; MAX_RUNS];
        // From stretch to stretch of rows in which the same runs are.
        while next < self.count {
            row = row.max(self.run(next).ends[0]);
            let mut end = u32::MAX;
            let mut count = 0;
            for place in next..self.count {
                let [low, high] = self.run(place).ends;
                if low > row {
                    end = end.min(low);
                    break;
                }
                if high > row {
                    end = end.min(high);
                    together[count] = self.order[place];
                    count += 1;
                }
            }
            match together[..count] {
                [run] => self.sum_one(simd, scene, run, row, &twice_seen[row as usize..end as usize], sums),
                _ => {
                    let mut row = row;
                    for seen in twice_seen[row as usize..end as usize].chunks(BUFFERED) {
                        self.sum_nearest(simd, scene, &together[..count], row, seen, sums);
                        row += BUFFERED as u32;
                    }
                }
            }
            row = end;
            while next < self.count && self.run(next).ends[1] <= row {
                next += 1;
            }
        }
    }

    /// The run with the so-many-th first row.
    #[inline(always)]
    fn run(&self, place: usize) -> &Run {
        &self.runs[self.order[place] as usize]
    }

    /// Adds the rows from one on, which one run covers.
    #[inline(always)]
    fn sum_one<S: Simd>(&self, simd: S, scene: &Scene, run: u8, row: u32, twice_seen: &[Group], sums: &mut Group) {
        let run = &self.runs[run as usize];
        let solid = run.solid as usize;
        for register in 0..Group::registers::<S>() {
            if run.kind == FaceKind::Side && self.is_smooth[solid] {
                let side = self.sides[solid].in_columns(simd, register);
                add_rows(simd, register, &side, run, row, twice_seen, sums);
            } else {
                let face = scene.faces[solid].face(run.kind);
                let face = face.in_columns(simd, register, scene.strip, &self.spans[solid]);
                add_rows(simd, register, &face, run, row, twice_seen, sums);
            }
        }
    }

    /// Adds the rows from one on, at most [`BUFFERED`], which several runs cover: the nearest counts.
    #[inline(always)]
    fn sum_nearest<S: Simd>(
        &mut self,
        simd: S,
        scene: &Scene,
        runs: &[u8],
        row: u32,
        twice_seen: &[Group],
        sums: &mut Group,
    ) {
        let Self { runs: all, sides, is_smooth, spans, nearest, .. } = self;
        let nearest = &mut nearest[..twice_seen.len()];
        for (k, run) in runs.iter().enumerate() {
            let run = &all[*run as usize];
            let solid = run.solid as usize;
            for register in 0..Group::registers::<S>() {
                if run.kind == FaceKind::Side && is_smooth[solid] {
                    let side = sides[solid].in_columns(simd, register);
                    take_nearer(simd, register, &side, run, row, k == 0, nearest);
                } else {
                    let face = scene.faces[solid].face(run.kind);
                    let face = face.in_columns(simd, register, scene.strip, &spans[solid]);
                    take_nearer(simd, register, &face, run, row, k == 0, nearest);
                }
            }
        }
        let (zero, infinity) = (Lanes::splat(simd, 0.0), Lanes::splat(simd, f32::INFINITY));
        for register in 0..Group::registers::<S>() {
            let mut total = sums.lanes(simd, register);
            for (nearest, seen) in nearest.iter().zip(twice_seen) {
                let z = nearest.lanes(simd, register);
                let z = z.or_else(simd.less_than_f32s(z.values, infinity.values), zero);
                total = total - (seen.lanes(simd, register) - z).min(z);
            }
            sums.set(register, total);
        }
    }
}

const NO_ROWS: Rows = [Group([0.0; LANES]); 2];

/// First row in any column and the one after the last; `None` when there is no row.
#[inline(always)]
fn ends<S: Simd>(simd: S, rows: &Rows) -> Option<[u32; 2]> {
    let (mut low, mut high) = (f32::INFINITY, 0.0f32);
    let (zero, infinity) = (Lanes::splat(simd, 0.0), Lanes::splat(simd, f32::INFINITY));
    for register in 0..Group::registers::<S>() {
        let (start, end) = (rows[0].lanes(simd, register), rows[1].lanes(simd, register));
        let has_rows = simd.less_than_f32s(start.values, end.values);
        low = low.min(simd.reduce_min_f32s(start.or_else(has_rows, infinity).values));
        high = high.max(simd.reduce_max_f32s(end.or_else(has_rows, zero).values));
    }
    (low < high).then_some([low as u32, high as u32])
}

/// Rows before others, those that both have, and those after them; all of them after, where none are in both.
#[inline(always)]
fn cut<S: Simd>(simd: S, rows: &Rows, by: &Rows) -> [Rows; 3] {
    let [mut before, mut inside, mut after] = [*rows; 3];
    for register in 0..Group::registers::<S>() {
        let start = rows[0].lanes(simd, register);
        let from = by[0].lanes(simd, register).max(start);
        let to = by[1].lanes(simd, register).min(rows[1].lanes(simd, register));
        let are_in_both = simd.less_than_f32s(from.values, to.values);
        let (from, to) = (from.or_else(are_in_both, start), to.or_else(are_in_both, start));
        before[1].set(register, from);
        inside[0].set(register, from);
        inside[1].set(register, to);
        after[0].set(register, to);
    }
    [before, inside, after]
}

/// Adds rows that one run covers.
#[inline(always)]
fn add_rows<S: Simd>(
    simd: S,
    register: usize,
    face: &impl DepthInColumns<S>,
    run: &Run,
    first: u32,
    twice_seen: &[Group],
    sums: &mut Group,
) {
    let (zero, one) = (Lanes::splat(simd, 0.0), Lanes::splat(simd, 1.0));
    let (start, end) = (run.rows[0].lanes(simd, register), run.rows[1].lanes(simd, register));
    let mut total = sums.lanes(simd, register);
    let mut row = Lanes::splat(simd, first as f32);
    for seen in twice_seen {
        let z = face.depth(row).or_else(is_within(simd, row, start, end), zero);
        total = total - (seen.lanes(simd, register) - z).min(z);
        row += one;
    }
    sums.set(register, total);
}

/// Keeps the nearer of some depths, when there are some, and those of a run.
#[inline(always)]
fn take_nearer<S: Simd>(
    simd: S,
    register: usize,
    face: &impl DepthInColumns<S>,
    run: &Run,
    first: u32,
    is_first: bool,
    nearest: &mut [Group],
) {
    let (infinity, one) = (Lanes::splat(simd, f32::INFINITY), Lanes::splat(simd, 1.0));
    let (start, end) = (run.rows[0].lanes(simd, register), run.rows[1].lanes(simd, register));
    let mut row = Lanes::splat(simd, first as f32);
    if is_first {
        for nearest in nearest {
            nearest.set(register, face.depth(row).or_else(is_within(simd, row, start, end), infinity));
            row += one;
        }
        return;
    }
    for nearest in nearest {
        let z = face.depth(row).or_else(is_within(simd, row, start, end), infinity);
        nearest.set(register, nearest.lanes(simd, register).min(z));
        row += one;
    }
}

#[inline(always)]
fn is_within<S: Simd>(simd: S, row: Lanes<S>, start: Lanes<S>, end: Lanes<S>) -> S::m32s {
    simd.and_m32s(simd.less_than_or_equal_f32s(start.values, row.values), simd.less_than_f32s(row.values, end.values))
}
