//! The faces that cover a strip of columns, and the sum over their pixels.
//!
//! A register holds one row of a strip. A run is a face with the rows that it covers in each of the columns; runs are sorted
//! by their first rows, and between two ends of runs the rows are gone through once: where one run is, its depths are compared
//! as they come, where several are, the nearest depths are found first.
//!
//! With `s` the depth that is seen and `z ≥ 0` that of the model, `|z − s| − s = −min(2 s − z, z)`.

use super::face::{DepthInColumns, FaceKind, Faces};
use super::outline::{Extents, Rows, Strip};
use super::smooth_side::SmoothSide;
use crate::body::legs::solids::SOLID_COUNT;
use crate::geometry::lanes::{Group, LANES, Lanes};
use pulp::Simd;

/// Most runs in a strip: of each solid the side before the other faces, between and behind them, the disc and the flat side.
const MAX_RUNS: usize = 5 * SOLID_COUNT;

/// Rows whose nearest depths are kept at a time.
const BUFFERED: usize = 32;

/// Rows of one face: in each column from `start` to the one before `end`.
#[derive(Debug, Clone, Copy, Default)]
struct Run {
    rows: Rows,
    /// First row in any column, and the one after the last.
    low: u32,
    high: u32,
    solid: u8,
    kind: FaceKind,
}

/// The runs of a strip, in the order of their first rows; used again for each strip.
#[derive(Debug, Clone)]
pub struct Runs {
    runs: [Run; MAX_RUNS],
    count: usize,
    sides: [Option<SmoothSide>; SOLID_COUNT],
    nearest: [Group; BUFFERED],
}

impl Default for Runs {
    fn default() -> Self {
        Self {
            runs: [Run::default(); MAX_RUNS],
            count: 0,
            sides: [None; SOLID_COUNT],
            nearest: [Group::default(); BUFFERED],
        }
    }
}

impl Runs {
    /// Empties the strip.
    #[inline(always)]
    pub fn clear(&mut self) {
        self.count = 0;
    }

    /// Adds the runs of a solid: disc and flat side where they are, the side in what they leave. `height` is that of the image.
    #[inline(always)]
    pub fn add_solid<S: Simd>(
        &mut self,
        simd: S,
        solid: usize,
        faces: &Faces,
        strip: &Strip,
        extents: &Extents,
        height: usize,
    ) {
        let whole = whole_rows(&extents.whole, height);
        let Some([low, high]) = ends(&whole) else { return };
        if faces.shows_side {
            self.sides[solid] = smooth_side(simd, faces, strip, &whole, height);
        }
        if faces.disc.is_none() && !faces.shows_flat {
            if faces.shows_side {
                self.add_run(Run { rows: whole, low, high, solid: solid as u8, kind: FaceKind::Side });
            }
            return;
        }
        let (disc, flat) = (whole_rows(&extents.disc, height), whole_rows(&extents.flat, height));
        let parts = split(&whole, &disc, &flat);
        for (rows, kind) in parts.iter().zip(KINDS) {
            if let Some([low, high]) = ends(rows)
                && (faces.shows_side || kind != FaceKind::Side)
            {
                self.add_run(Run { rows: *rows, low, high, solid: solid as u8, kind });
            }
        }
    }

    /// Adds a run in the order of first rows.
    #[inline(always)]
    fn add_run(&mut self, run: Run) {
        let mut place = self.count;
        while place > 0 && self.runs[place - 1].low > run.low {
            self.runs[place] = self.runs[place - 1];
            place -= 1;
        }
        self.runs[place] = run;
        self.count += 1;
    }

    /// Takes `min(2 s − z, z)` of the covered pixels from the sums, one for each column of the strip.
    #[inline(always)]
    pub fn sum<S: Simd>(
        &mut self,
        simd: S,
        faces: &[Faces; SOLID_COUNT],
        strip: &Strip,
        twice_seen: &[Group],
        sums: &mut Group,
    ) {
        let runs = &self.runs[..self.count];
        let (mut next, mut row) = (0, 0);
        let mut together = [0u8; MAX_RUNS];
        // From stretch to stretch of rows in which the same runs are.
        while next < runs.len() {
            row = row.max(runs[next].low);
            let mut end = u32::MAX;
            let mut count = 0;
            for (k, run) in runs.iter().enumerate().skip(next) {
                if run.low > row {
                    end = end.min(run.low);
                    break;
                }
                if run.high > row {
                    end = end.min(run.high);
                    together[count] = k as u8;
                    count += 1;
                }
            }
            if let [run] = together[..count] {
                let run = &runs[run as usize];
                let rows = [row, end];
                match (run.kind, &self.sides[run.solid as usize]) {
                    (FaceKind::Side, Some(side)) => {
                        for register in 0..Group::registers::<S>() {
                            let side = side.in_columns(simd, register);
                            sum_one(simd, register, &side, run, rows, twice_seen, sums);
                        }
                    }
                    (kind, _) => {
                        let face = faces[run.solid as usize].face(kind);
                        for register in 0..Group::registers::<S>() {
                            let face = face.in_columns(simd, register, strip);
                            sum_one(simd, register, &face, run, rows, twice_seen, sums);
                        }
                    }
                }
            } else {
                let mut from = row;
                while from < end {
                    let to = end.min(from + BUFFERED as u32);
                    let nearest = &mut self.nearest[..(to - from) as usize];
                    nearest.fill(Group([f32::INFINITY; LANES]));
                    for run in &together[..count] {
                        let run = &runs[*run as usize];
                        match (run.kind, &self.sides[run.solid as usize]) {
                            (FaceKind::Side, Some(side)) => {
                                for register in 0..Group::registers::<S>() {
                                    let side = side.in_columns(simd, register);
                                    take_nearer(simd, register, &side, run, from, nearest);
                                }
                            }
                            (kind, _) => {
                                let face = faces[run.solid as usize].face(kind);
                                for register in 0..Group::registers::<S>() {
                                    let face = face.in_columns(simd, register, strip);
                                    take_nearer(simd, register, &face, run, from, nearest);
                                }
                            }
                        }
                    }
                    sum_nearest(simd, nearest, &twice_seen[from as usize..to as usize], sums);
                    from = to;
                }
            }
            row = end;
            while next < runs.len() && runs[next].high <= row {
                next += 1;
            }
        }
    }
}

/// What the parts of [`split`] are.
const KINDS: [FaceKind; 5] = [FaceKind::Side, FaceKind::Side, FaceKind::Side, FaceKind::Disc, FaceKind::Flat];

/// Whole rows of an extent inside an image: the first, and the one after the last.
#[inline(always)]
fn whole_rows(rows: &Rows, height: usize) -> Rows {
    let height = height as f32;
    let mut whole = Rows::default();
    for lane in 0..LANES {
        whole[0].0[lane] = rows[0].0[lane].ceil().max(0.0).min(height);
        whole[1].0[lane] = (rows[1].0[lane].floor() + 1.0).max(0.0).min(height);
    }
    whole
}

/// First row in any column and the one after the last; `None` when there is no row.
#[inline(always)]
fn ends(rows: &Rows) -> Option<[u32; 2]> {
    let (mut low, mut high) = (f32::INFINITY, 0.0f32);
    for lane in 0..LANES {
        let (start, end) = (rows[0].0[lane], rows[1].0[lane]);
        let is_empty = start >= end;
        low = low.min(if is_empty { f32::INFINITY } else { start });
        high = high.max(if is_empty { 0.0 } else { end });
    }
    (low < high).then_some([low as u32, high as u32])
}

/// Side before, between and after the other two, disc, flat side.
#[inline(always)]
fn split(whole: &Rows, disc: &Rows, flat: &Rows) -> [Rows; 5] {
    let mut parts = [Rows::default(); 5];
    for lane in 0..LANES {
        let (start, end) = (whole[0].0[lane], whole[1].0[lane]);
        let disc_is_first = disc[0].0[lane] <= flat[0].0[lane];
        let (first, second) = if disc_is_first { (disc, flat) } else { (flat, disc) };
        let first = within([first[0].0[lane], first[1].0[lane]], [start, end]);
        let second = within([second[0].0[lane], second[1].0[lane]], [first[1], end]);
        let (disc, flat) = if disc_is_first { (first, second) } else { (second, first) };
        let rows = [[start, first[0]], [first[1], second[0]], [second[1], end], disc, flat];
        for (part, rows) in parts.iter_mut().zip(rows) {
            [part[0].0[lane], part[1].0[lane]] = rows;
        }
    }
    parts
}

/// Rows inside others; where there are none, none at the start of the others.
#[inline(always)]
fn within(rows: [f32; 2], [start, end]: [f32; 2]) -> [f32; 2] {
    let (from, to) = (rows[0].max(start), rows[1].min(end));
    if from < to { [from, to] } else { [start; 2] }
}

/// The polynomials of a solid's side, when they are true in all the columns that it covers.
#[inline(always)]
fn smooth_side<S: Simd>(simd: S, faces: &Faces, strip: &Strip, whole: &Rows, height: usize) -> Option<SmoothSide> {
    let mut side = SmoothSide::default();
    let last = Lanes::splat(simd, height as f32 - 1.0);
    for register in 0..Group::registers::<S>() {
        let face = faces.face(FaceKind::Side).in_columns(simd, register, strip);
        let rows = [whole[0].lanes(simd, register), (whole[1].lanes(simd, register) - 1.0).min(last)];
        side.fit(simd, register, &face, &rows);
    }
    let mut untrue = 0;
    for lane in 0..LANES {
        untrue += u32::from(whole[0].0[lane] < whole[1].0[lane] && side.pitch.0[lane] == 0.0);
    }
    (untrue == 0).then_some(side)
}

/// Takes the rows of a stretch that one run covers from the sums.
#[inline(always)]
fn sum_one<S: Simd>(
    simd: S,
    register: usize,
    face: &impl DepthInColumns<S>,
    run: &Run,
    [from, to]: [u32; 2],
    twice_seen: &[Group],
    sums: &mut Group,
) {
    let (zero, one) = (Lanes::splat(simd, 0.0), Lanes::splat(simd, 1.0));
    let (start, end) = (run.rows[0].lanes(simd, register), run.rows[1].lanes(simd, register));
    let mut total = sums.lanes(simd, register);
    let mut row = Lanes::splat(simd, from as f32);
    for seen in &twice_seen[from as usize..to as usize] {
        let z = face.depth(row).or_else(is_within(simd, row, start, end), zero);
        total = total - (seen.lanes(simd, register) - z).min(z);
        row += one;
    }
    sums.set(register, total);
}

/// Keeps the nearer of some depths and those of a run, from a row on.
#[inline(always)]
fn take_nearer<S: Simd>(
    simd: S,
    register: usize,
    face: &impl DepthInColumns<S>,
    run: &Run,
    from: u32,
    nearest: &mut [Group],
) {
    let (infinity, one) = (Lanes::splat(simd, f32::INFINITY), Lanes::splat(simd, 1.0));
    let (start, end) = (run.rows[0].lanes(simd, register), run.rows[1].lanes(simd, register));
    let mut row = Lanes::splat(simd, from as f32);
    for nearest in nearest {
        let z = face.depth(row).or_else(is_within(simd, row, start, end), infinity);
        nearest.set(register, nearest.lanes(simd, register).min(z));
        row += one;
    }
}

/// Takes the rows with these depths, infinite where nothing is, from the sums.
#[inline(always)]
fn sum_nearest<S: Simd>(simd: S, nearest: &[Group], twice_seen: &[Group], sums: &mut Group) {
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

#[inline(always)]
fn is_within<S: Simd>(simd: S, row: Lanes<S>, start: Lanes<S>, end: Lanes<S>) -> S::m32s {
    simd.and_m32s(
        simd.less_than_or_equal_f32s(start.values, row.values),
        simd.less_than_f32s(row.values, end.values),
    )
}
