//! What stands still before the camera, learned while somebody walks, for recordings without an image of the empty floor.
//!
//! The walker's own bars travel with the camera: a pixel that shows them keeps its depth while legs come and go. A leg
//! that walks moves by decimetres along the view, so its pixels do not keep theirs. Nothing can be learned while
//! everything stands still, as when the user does.

use super::foreground::Preparation;
use crate::geometry::camera::DepthMap;

/// Raw steps by which a still pixel's inverse depth may differ between frames: the sensor's noise and its rounding.
const STILL_STEPS: f32 = 6.0;
/// Share of the frames in which a still pixel has a depth.
const LEAST_SEEN: f32 = 0.5;
/// Share of what stands above the floor that may be still; with more nobody walks.
const MOST_STILL: f64 = 0.6;
/// Edges of still things flicker between them and what is behind: they count this many cells around.
const EDGE_CELLS: usize = 2;

/// Nearest and farthest inverse depth of each looked-at pixel so far.
#[derive(Debug, Clone)]
pub struct StaticScene {
    stride: usize,
    size: [usize; 2],
    cells: Vec<Cell>,
    n_frames: u32,
}

#[derive(Debug, Clone, Copy)]
struct Cell {
    least: f32,
    most: f32,
    n_seen: u32,
}

impl StaticScene {
    /// Nothing is known; every `stride`th pixel of every `stride`th row will be looked at.
    pub fn new(stride: usize) -> Self {
        Self { stride, size: [0; 2], cells: Vec::new(), n_frames: 0 }
    }

    /// Takes an image.
    pub fn add(&mut self, image: &DepthMap) {
        let size = [image.width.div_ceil(self.stride), image.height.div_ceil(self.stride)];
        if self.size != size {
            self.size = size;
            self.cells = vec![Cell { least: f32::INFINITY, most: 0.0, n_seen: 0 }; size[0] * size[1]];
            self.n_frames = 0;
        }
        self.n_frames += 1;
        for (at, cell) in self.cells.iter_mut().enumerate() {
            let z = image.depth[(at / size[0] * image.width + at % size[0]) * self.stride];
            if z > 0.0 {
                cell.least = cell.least.min(1.0 / z);
                cell.most = cell.most.max(1.0 / z);
                cell.n_seen += 1;
            }
        }
    }

    /// Inverse depth of what stands still, 1/m, 0 elsewhere, for every pixel of an image `width` wide that was looked at.
    /// Nothing when too much stands still for anybody to be walking.
    pub fn background(&self, preparation: &Preparation, width: usize, height: usize) -> Option<Vec<f32>> {
        let tolerance = STILL_STEPS * super::foreground::INVERSE_DEPTH_STEP;
        let is_seen = |cell: &Cell| cell.n_seen as f32 > LEAST_SEEN * self.n_frames as f32;
        let is_still = |cell: &Cell| is_seen(cell) && cell.most - cell.least <= tolerance;
        let [columns, rows] = self.size;
        let (mut n_standing, mut n_still) = (0_usize, 0_usize);
        for (at, cell) in self.cells.iter().enumerate().filter(|(_, cell)| is_seen(cell)) {
            let pixel = [at % columns * self.stride, at / columns * self.stride];
            if preparation.is_above_floor(pixel, 2.0 / (cell.least + cell.most)) {
                n_standing += 1;
                n_still += usize::from(is_still(cell));
            }
        }
        if n_still as f64 > MOST_STILL * n_standing as f64 {
            return None;
        }
        let mut background = vec![0.0; width * height];
        let around = |k: usize, n: usize| k.saturating_sub(EDGE_CELLS)..(k + EDGE_CELLS + 1).min(n);
        for (at, _) in self.cells.iter().enumerate() {
            let (i, j) = (at % columns, at / columns);
            // The nearest still thing around: what is behind it goes by the floor's plane.
            let near = around(j, rows)
                .flat_map(|row| around(i, columns).map(move |column| row * columns + column))
                .map(|other| &self.cells[other])
                .filter(|cell| is_still(cell));
            let own = Some(&self.cells[at]).filter(|cell| is_still(cell));
            let cell = own.or_else(|| near.max_by(|a, b| a.most.total_cmp(&b.most)));
            if let Some(cell) = cell {
                background[(j * width + i) * self.stride] = 0.5 * (cell.least + cell.most);
            }
        }
        Some(background)
    }
}

#[cfg(test)]
mod tests {
    use super::super::floor::Floor;
    use super::super::foreground::Region;
    use super::*;
    use crate::geometry::camera::Intrinsics;

    const CAMERA: Intrinsics = Intrinsics { fx: 580.0, fy: 580.0, cx: 319.5, cy: 239.5 };
    /// Pixels of a bar that stands still and of a leg that moves.
    const BAR: usize = 300 * 640 + 90;
    const LEG: usize = 300 * 640 + 360;

    fn image(leg_m: f32) -> DepthMap {
        let mut image = DepthMap::empty(640, 480);
        for j in 0..480 {
            for i in 0..640 {
                let down = CAMERA.point_in_sensor(i as f64, j as f64, 1.0).y;
                let floor = if down > 0.05 { (0.5 / down) as f32 } else { 0.0 };
                image.depth[j * 640 + i] = match i {
                    80..100 => floor.min(0.6).max(if floor > 0.0 { 0.0 } else { 0.6 }),
                    280..420 if floor == 0.0 || floor > leg_m => leg_m,
                    _ => floor,
                };
            }
        }
        image
    }

    fn learned(depths: &[f32]) -> (Preparation, Option<Vec<f32>>) {
        let floor = Floor::find(&image(5.0), &CAMERA).unwrap();
        let preparation = Preparation::new(CAMERA, floor, Region::default(), None);
        let mut scene = StaticScene::new(3);
        depths.iter().for_each(|z| scene.add(&image(*z)));
        let background = scene.background(&preparation, 640, 480);
        (preparation, background)
    }

    #[test]
    fn a_bar_that_stands_still_while_legs_walk_is_learned_and_the_legs_are_not() {
        let (_, background) = learned(&[0.8, 0.9, 1.0, 0.9]);
        let background = background.unwrap();
        assert!((background[BAR] - 1.0 / 0.6).abs() < 0.01, "{}", background[BAR]);
        assert_eq!(background[LEG], 0.0);
    }

    #[test]
    fn nothing_is_learned_while_everything_stands_still() {
        assert_eq!(learned(&[0.9; 4]).1, None);
    }
}
