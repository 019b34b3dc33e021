//! What a Kinect v1 makes of a scene: its raw values with its errors.
//!
//! - Depth is a disparity in whole codes (Khoshelham and Elberink, Sensors 2012: quantisation and random error of about
//!   half a code). The random part is partly white and partly shared by neighbouring pixels, because each value comes
//!   from a window of the image.
//! - Edges are ragged by one to three pixels (Nguyen, Izadi and Lovell, 3DIMPVT 2012: lateral noise SD 0.8 pixels; real
//!   frames of Skeltrack's tests), and values drop out along them.
//! - The projector stands 7.5 cm beside the camera, so near things cast an infrared shadow to their left.
//! - Surfaces seen at a grazing angle, holes in patterned cloth, and what is too near or too far give nothing.

use crate::estimation::random::RandomStreams;
use crate::geometry::camera::Intrinsics;
use crate::recording::depth::{DepthImage, DepthUnit, MISSING_RAW, raw_from_depth};

use super::noise::{lattice, smooth, smoothstep};

/// Distance of projector and camera, metres (Khoshelham and Elberink).
const BASELINE_M: f64 = 0.075;

/// Nearest and farthest depth that gives a value, metres.
const NEAREST_M: f32 = 0.45;
/// See [`NEAREST_M`].
const FARTHEST_M: f32 = 6.0;

/// SD of the white and of the shared part of the random error, codes.
const WHITE_CODES: f64 = 0.25;
/// See [`WHITE_CODES`].
const SHARED_CODES: f64 = 0.3;

/// Size of the window that shares an error, pixels.
const WINDOW_PX: f64 = 5.0;

/// SD of `smooth` noise between lattice points, and so the factor that gives it unit variance.
const SMOOTH_SD: f64 = 0.19;

/// Reach of ragged edges, pixels, and the size of their teeth.
const RAGGED_PX: f64 = 3.0;
/// See [`RAGGED_PX`].
const TOOTH_PX: f64 = 3.0;

/// Difference of depth, as a share of it, that makes an edge.
const EDGE_SHARE: f32 = 0.03;

/// Share of the pixels on the far side of an edge that give nothing.
const EDGE_DROP_OUT: f64 = 0.35;

/// Angles between a surface's normal and the ray from which on values drop out, and beyond which none is left, degrees.
const GRAZING_DEG: [f64; 2] = [78.0, 89.0];

/// Size of the patches in which values are missing on request, pixels, and how long one stays, frames.
const PATCH_PX: f64 = 14.0;
/// See [`PATCH_PX`].
const PATCH_FRAMES: f64 = 8.0;

/// Columns at the right edge that have no value, because the matching window ends there.
const BLIND_COLUMNS: usize = 8;

/// The errors that can be chosen.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SensorErrors {
    /// Whether there are any but quantisation.
    pub is_noisy: bool,
    /// Share of the person's pixels that are missing in patches, 0 to 0.9.
    pub missing_share: f64,
    /// Factor of the random error of the codes; 1 is a Kinect v1's half a code.
    pub code_noise: f64,
}

/// A scene as an ideal camera sees it.
#[derive(Debug, Clone)]
pub struct View {
    /// Pixels in a row.
    pub width: usize,
    /// Depth of each pixel, metres; infinite for none.
    pub depth: Vec<f32>,
    /// Cosine of the angle between normal and ray.
    pub cosine: Vec<f32>,
    /// Whether the pixel shows the person.
    pub is_person: Vec<bool>,
    /// Whether the pixel shows a spot of cloth that swallows the light.
    pub is_hole: Vec<bool>,
}

/// Streams of lattice noise in an image.
#[derive(Debug, Clone, Copy)]
#[repr(u64)]
enum Field {
    Shared = 0x11,
    RaggedX,
    RaggedY,
    DropOut,
    Grazing,
    Patch,
}

/// The image that the sensor makes of a view; `frame` numbers the noise.
pub fn image(view: &View, camera: &Intrinsics, errors: &SensorErrors, seed: u64, frame: u64) -> DepthImage {
    let height = view.depth.len() / view.width;
    let mut out = DepthImage::missing(view.width, height, DepthUnit::Raw11);
    if !errors.is_noisy {
        for (value, z) in out.values.iter_mut().zip(&view.depth) {
            *value = code(*z, 0.0);
        }
        drop_patches(&mut out, view, errors.missing_share, seed, frame);
        return out;
    }
    let field = |field: Field, cell: f64, i: usize, j: usize| {
        smooth(seed ^ ((field as u64) << 56), [i as f64 / cell, j as f64 / cell, frame as f64])
    };
    let lit = lit_by_projector(view, camera);
    let mut white = vec![0.0; view.depth.len()];
    let mut random = RandomStreams::new(seed);
    random.start_frame(frame);
    random.fill_normal(&mut white);
    for j in 0..height {
        for i in 0..view.width.saturating_sub(BLIND_COLUMNS) {
            let own = j * view.width + i;
            let shift = |name: Field| (2.0 * field(name, TOOTH_PX, i, j) - 1.0) * RAGGED_PX;
            let other = neighbour(view.width, height, i, j, shift(Field::RaggedX), shift(Field::RaggedY));
            // Inside a surface nothing is shifted: its slope is not noise.
            let pixel = if is_edge(view.depth[own], view.depth[other]) { other } else { own };
            if !lit[pixel] || view.is_hole[pixel] {
                continue;
            }
            if is_beside_nearer(view, height, i, j)
                && lattice(seed ^ ((Field::DropOut as u64) << 56), i as i64, j as i64, frame as i64) < EDGE_DROP_OUT
            {
                continue;
            }
            let angle = f64::from(view.cosine[pixel]).clamp(0.0, 1.0).acos().to_degrees();
            let grazing = smoothstep((angle - GRAZING_DEG[0]) / (GRAZING_DEG[1] - GRAZING_DEG[0]));
            if grazing > 0.0 && field(Field::Grazing, TOOTH_PX, i, j) < grazing {
                continue;
            }
            let shared = (field(Field::Shared, WINDOW_PX, i, j) - 0.5) / SMOOTH_SD;
            let error = errors.code_noise * (WHITE_CODES * f64::from(white[own]) + SHARED_CODES * shared);
            out.values[own] = code(view.depth[pixel], error);
        }
    }
    drop_patches(&mut out, view, errors.missing_share, seed, frame);
    out
}

/// The code of a depth with an error in codes.
fn code(z: f32, error: f64) -> u16 {
    if !(NEAREST_M..FARTHEST_M).contains(&z) {
        return MISSING_RAW;
    }
    (raw_from_depth(f64::from(z)) + error).round().clamp(0.0, f64::from(MISSING_RAW - 1)) as u16
}

fn is_edge(a: f32, b: f32) -> bool {
    // Also when one of them is infinite; two infinite ones compare as no edge.
    (a - b).abs() > EDGE_SHARE * a.min(b)
}

/// The pixel at an offset, at the image's edge when it lies outside.
fn neighbour(width: usize, height: usize, i: usize, j: usize, dx: f64, dy: f64) -> usize {
    let within = |k: usize, d: f64, n: usize| (k as f64 + d).round().clamp(0.0, n as f64 - 1.0) as usize;
    within(j, dy, height) * width + within(i, dx, width)
}

/// Whether something nearer begins within two pixels to the left, right, above or below.
fn is_beside_nearer(view: &View, height: usize, i: usize, j: usize) -> bool {
    let own = view.depth[j * view.width + i];
    [(-2.0, 0.0), (2.0, 0.0), (0.0, -2.0), (0.0, 2.0)].iter().any(|(dx, dy)| {
        let other = view.depth[neighbour(view.width, height, i, j, *dx, *dy)];
        other < own && is_edge(own, other)
    })
}

/// Which pixels the projector lights. It stands to the right of the camera: a point at column i and depth z is in its
/// column i − f b / z, and the nearest point of a column takes the light.
fn lit_by_projector(view: &View, camera: &Intrinsics) -> Vec<bool> {
    let shift = camera.fx * BASELINE_M;
    let margin = (shift / f64::from(NEAREST_M)).ceil() as usize + 2;
    let mut nearest = vec![f32::INFINITY; view.width + margin];
    let mut lit = Vec::with_capacity(view.depth.len());
    for row in view.depth.chunks(view.width) {
        let column = |i: usize| i as f64 - shift / f64::from(row[i].max(NEAREST_M)) + margin as f64;
        nearest.fill(f32::INFINITY);
        for i in 0..row.len() {
            if !row[i].is_finite() {
                continue;
            }
            // A surface that goes on to the next pixel fills the columns between the two.
            let joined = i + 1 < row.len() && !is_edge(row[i], row[i + 1]);
            let end = if joined { column(i + 1) } else { column(i) };
            let (first, last) = (column(i).min(end).floor().max(0.0) as usize, column(i).max(end).floor() as usize);
            for cell in nearest.iter_mut().take(last + 1).skip(first) {
                *cell = cell.min(row[i]);
            }
        }
        lit.extend((0..row.len()).map(|i| {
            row[i].is_finite() && {
                let other = nearest[column(i).floor().max(0.0) as usize];
                !(other < row[i] && is_edge(row[i], other))
            }
        }));
    }
    lit
}

/// Removes a share of the person's pixels, in patches that stay for a few frames.
fn drop_patches(out: &mut DepthImage, view: &View, share: f64, seed: u64, frame: u64) {
    if share <= 0.0 {
        return;
    }
    let time = frame as f64 / PATCH_FRAMES;
    let mut person: Vec<(f64, usize)> = (0..view.depth.len())
        .filter(|pixel| view.is_person[*pixel])
        .map(|pixel| {
            let (i, j) = (pixel % view.width, pixel / view.width);
            let place = [i as f64 / PATCH_PX, j as f64 / PATCH_PX, time];
            (smooth(seed ^ ((Field::Patch as u64) << 56), place), pixel)
        })
        .collect();
    let n = (share * person.len() as f64) as usize;
    if n == 0 || n >= person.len() {
        return;
    }
    person.select_nth_unstable_by(n, |a, b| a.0.total_cmp(&b.0));
    for (_, pixel) in &person[..n] {
        out.values[*pixel] = MISSING_RAW;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const CAMERA: Intrinsics = Intrinsics { fx: 580.0, fy: 580.0, cx: 319.5, cy: 239.5 };
    const NOISY: SensorErrors = SensorErrors { is_noisy: true, missing_share: 0.0, code_noise: 1.0 };

    /// A wall at `far` with a board at `near` in front of its middle.
    fn board(near: f32, far: f32) -> View {
        let depth: Vec<f32> =
            (0..640 * 480).map(|pixel| if (250..390).contains(&(pixel % 640)) { near } else { far }).collect();
        let is_person = depth.iter().map(|z| *z == near).collect();
        let n = depth.len();
        View { width: 640, depth, cosine: vec![1.0; n], is_person, is_hole: vec![false; n] }
    }

    #[test]
    fn neighbouring_values_are_whole_codes_and_the_random_error_is_about_half_a_code() {
        let view = board(1.3, 1.3);
        let image = image(&view, &CAMERA, &NOISY, 1, 0);
        let truth = raw_from_depth(1.3);
        let errors: Vec<f64> =
            image.values.iter().filter(|v| **v != MISSING_RAW).map(|v| f64::from(*v) - truth).collect();
        let rms = (errors.iter().map(|e| e * e).sum::<f64>() / errors.len() as f64).sqrt();
        assert!((0.4..0.65).contains(&rms), "{rms}");
    }

    #[test]
    fn near_things_cast_a_shadow_to_their_left_of_the_width_that_the_baseline_gives() {
        let view = board(0.8, 1.4);
        let image = image(&view, &CAMERA, &NOISY, 1, 0);
        let expected = 580.0 * BASELINE_M * (1.0 / 0.8 - 1.0 / 1.4);
        let missing = |columns: std::ops::Range<usize>| {
            let pixels = (0..480).flat_map(|j| columns.clone().map(move |i| j * 640 + i));
            pixels.filter(|pixel| image.values[*pixel] == MISSING_RAW).count() as f64 / 480.0
        };
        let left = missing(210..255);
        assert!((left - expected).abs() < 4.0, "{left} px for {expected}");
        assert!(missing(395..440) < 3.0);
    }

    #[test]
    fn edges_are_ragged_by_a_few_pixels() {
        let view = board(0.8, 1.4);
        let image = image(&view, &CAMERA, &NOISY, 1, 0);
        let ends: Vec<f64> = (0..480)
            .map(|j| {
                let near = |i: &usize| (image.unit.depth_m(image.values[j * 640 + i]) - 0.8).abs() < 0.05;
                (300..420).filter(near).max().unwrap() as f64
            })
            .collect();
        let mean = ends.iter().sum::<f64>() / 480.0;
        let sd = (ends.iter().map(|e| (e - mean).powi(2)).sum::<f64>() / 480.0).sqrt();
        assert!((0.5..2.0).contains(&sd) && (mean - 389.0).abs() < 2.0, "{mean} {sd}");
    }

    #[test]
    fn the_asked_for_share_of_the_person_is_missing() {
        let view = board(0.8, 1.4);
        let errors = SensorErrors { is_noisy: false, missing_share: 0.3, code_noise: 1.0 };
        let image = image(&view, &CAMERA, &errors, 1, 5);
        let person = (0..640 * 480).filter(|p| view.is_person[*p]);
        let missing = person.clone().filter(|p| image.values[*p] == MISSING_RAW).count();
        assert!((missing as f64 / person.count() as f64 - 0.3).abs() < 0.01);
        assert_eq!(image.values[0], code(1.4, 0.0));
    }

    #[test]
    fn grazing_near_and_far_surfaces_give_nothing() {
        for (z, cosine) in [(0.4, 1.0), (7.0, 1.0), (1.0, 0.01)] {
            let mut view = board(z, z);
            view.cosine.fill(cosine);
            assert!(image(&view, &CAMERA, &NOISY, 1, 0).missing_share() > 0.99, "{z} {cosine}");
        }
    }
}
