//! Histograms of colours and of oriented gradients, and sums of them along the columns of an image.
//!
//! A region's histogram is a sum over its pixels. The regions of projected solids are few stretches of rows in each column,
//! and the sum over a stretch is the difference of two running sums, so a region costs two reads for each column instead of
//! a visit to each pixel.

use crate::geometry::colour_image::ColourImage;
use crate::geometry::lanes::LANES;
use std::f32::consts::PI;

/// Bins of hue, saturation and value, in each of which every pixel counts once.
const HUES: usize = 16;
const SATURATIONS: usize = 8;
const VALUES: usize = 8;
/// Bins of colour together.
pub const COLOURS: usize = HUES + SATURATIONS + VALUES;
/// Bins of the gradient's direction, without its sign: half a turn.
const DIRECTIONS: usize = 16;
/// All bins: colours, then directions; whole registers.
pub const BINS: usize = COLOURS + DIRECTIONS;

const _: () = assert!(BINS.is_multiple_of(LANES), "whole registers");

/// Contents of the bins: pixels for colours, magnitudes of the gradient (levels) for directions.
pub type Sums = [f32; BINS];

/// Both histograms of a region, each with the sum 1.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Histograms(Sums);

impl Histograms {
    /// The histograms of some sums; `None` of a region without pixels.
    pub fn of_sums(sums: &Sums) -> Option<Self> {
        let colours: f32 = sums[..COLOURS].iter().sum();
        let directions: f32 = sums[COLOURS..].iter().sum();
        if colours < 1.0 {
            return None;
        }
        let mut shares = *sums;
        shares[..COLOURS].iter_mut().for_each(|bin| *bin /= colours);
        // A region of one level throughout has no direction.
        shares[COLOURS..].iter_mut().for_each(|bin| *bin /= directions.max(1.0));
        Some(Self(shares))
    }

    /// L1 distances of the colours and of the directions, 0 to 2 each.
    pub fn distances(&self, other: &Self) -> [f32; 2] {
        let distance = |range: std::ops::Range<usize>| {
            self.0[range.clone()].iter().zip(&other.0[range]).map(|(a, b)| (a - b).abs()).sum()
        };
        [distance(0..COLOURS), distance(COLOURS..BINS)]
    }
}

/// Running sums down each column of an image.
#[derive(Debug, Clone)]
pub struct ColumnSums {
    /// Rows of the image.
    pub height: usize,
    /// Columns of the image.
    pub width: usize,
    sums: Vec<Sums>,
}

impl ColumnSums {
    /// The running sums of an image.
    pub fn new(image: &ColourImage) -> Self {
        let (width, height) = (image.width, image.height);
        let mut sums = Vec::with_capacity(width * (height + 1));
        for i in 0..width {
            let mut running = [0.0; BINS];
            sums.push(running);
            for j in 0..height {
                add_pixel(image, i, j, &mut running);
                sums.push(running);
            }
        }
        Self { height, width, sums }
    }

    /// Adds the pixels of a column from a row to before another one.
    #[inline(always)]
    pub fn add(&self, column: usize, rows: [usize; 2], to: &mut Sums) {
        let at = column * (self.height + 1);
        let [before, after] = rows.map(|row| &self.sums[at + row]);
        for ((sum, before), after) in to.iter_mut().zip(before).zip(after) {
            *sum += after - before;
        }
    }
}

/// Adds one pixel.
pub fn add_pixel(image: &ColourImage, i: usize, j: usize, to: &mut Sums) {
    let [hue, saturation, value] = hsv(image.pixels[j * image.width + i]);
    let bin = |share: f32, bins: usize| ((share * bins as f32) as usize).min(bins - 1);
    to[bin(hue, HUES)] += 1.0;
    to[HUES + bin(saturation, SATURATIONS)] += 1.0;
    to[HUES + SATURATIONS + bin(value, VALUES)] += 1.0;
    let level = |i: usize, j: usize| {
        let [r, g, b] = image.pixels[j * image.width + i];
        f32::from(r) + f32::from(g) + f32::from(b)
    };
    let across = level((i + 1).min(image.width - 1), j) - level(i.saturating_sub(1), j);
    let down = level(i, (j + 1).min(image.height - 1)) - level(i, j.saturating_sub(1));
    let direction = down.atan2(across).rem_euclid(PI) / PI;
    to[COLOURS + bin(direction, DIRECTIONS)] += across.hypot(down) / 3.0;
}

/// Hue, saturation and value of a colour, 0 to 1 each; grey has hue 0.
fn hsv([r, g, b]: [u8; 3]) -> [f32; 3] {
    let [r, g, b] = [r, g, b].map(|level| f32::from(level) / 255.0);
    let (high, low) = (r.max(g).max(b), r.min(g).min(b));
    let range = high - low;
    if range == 0.0 {
        return [0.0, 0.0, high];
    }
    let sixths = if high == r {
        ((g - b) / range).rem_euclid(6.0)
    } else if high == g {
        (b - r) / range + 2.0
    } else {
        (r - g) / range + 4.0
    };
    [sixths / 6.0, range / high, high]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn colours_have_the_hue_saturation_and_value_of_the_text_book() {
        for (rgb, expected) in [
            ([255, 0, 0], [0.0, 1.0, 1.0]),
            ([0, 255, 0], [1.0 / 3.0, 1.0, 1.0]),
            ([0, 0, 255], [2.0 / 3.0, 1.0, 1.0]),
            ([255, 0, 255], [5.0 / 6.0, 1.0, 1.0]),
            ([51, 51, 51], [0.0, 0.0, 0.2]),
            ([102, 51, 51], [0.0, 0.5, 0.4]),
        ] {
            for (found, expected) in hsv(rgb).iter().zip(expected) {
                assert!((found - expected).abs() < 1e-6, "{rgb:?}: {found} instead of {expected}");
            }
        }
    }

    #[test]
    fn sums_over_stretches_are_those_of_their_pixels() {
        let mut image = ColourImage::black(5, 40);
        for (k, pixel) in image.pixels.iter_mut().enumerate() {
            *pixel = [(k * 37 % 251) as u8, (k * 91 % 241) as u8, (k * 53 % 239) as u8];
        }
        let sums = ColumnSums::new(&image);
        let (mut fast, mut plain) = ([0.0; BINS], [0.0; BINS]);
        for (column, rows) in [(0, [3, 17]), (3, [0, 40]), (4, [39, 40]), (2, [8, 8])] {
            sums.add(column, rows, &mut fast);
            (rows[0]..rows[1]).for_each(|j| add_pixel(&image, column, j, &mut plain));
        }
        assert!(fast.iter().zip(plain).all(|(a, b)| (a - b).abs() < 1e-2 + 1e-4 * b), "{fast:?} {plain:?}");
        assert_eq!(plain[..COLOURS].iter().sum::<f32>(), 3.0 * 55.0);
    }

    #[test]
    fn stripes_have_the_direction_across_them_and_plain_cloth_has_none() {
        let mut stripes = ColourImage::black(24, 24);
        for (k, pixel) in stripes.pixels.iter_mut().enumerate() {
            *pixel = [if (k % 24) % 6 < 3 { 200 } else { 40 }; 3];
        }
        let of = |image: &ColourImage| {
            let mut sums = [0.0; BINS];
            (0..24).for_each(|j| (0..24).for_each(|i| add_pixel(image, i, j, &mut sums)));
            Histograms::of_sums(&sums).expect("pixels")
        };
        assert!((of(&stripes).0[COLOURS] - 1.0).abs() < 1e-6);
        let plain = of(&ColourImage { pixels: vec![[90; 3]; 24 * 24], ..stripes.clone() });
        assert_eq!(plain.0[COLOURS..].iter().sum::<f32>(), 0.0);
        assert_eq!(plain.distances(&plain), [0.0, 0.0]);
        let [colours, directions] = plain.distances(&of(&stripes));
        assert!(colours > 0.3 && (directions - 1.0).abs() < 1e-6, "{colours} {directions}");
        assert!(Histograms::of_sums(&[0.0; BINS]).is_none());
    }
}
