//! A depth image in colour, with legs drawn over it.

use crate::body::Side;
use crate::geometry::camera::DepthMap;
use crate::pipeline::leg_pose::leg_model::{LegSegment, adult_shape};
use crate::pipeline::leg_pose::{Legs, Track, TrackedFrame};
use anyhow::anyhow;
use plotters::backend::BitMapBackend;
use plotters::prelude::*;
use std::io::Write;

/// Depths at the ends of the colour scale, metres: where legs are before a walker.
const SCALE_M: [f32; 2] = [0.4, 2.2];

/// The left leg's colour and the right one's.
const COLOURS: [RGBColor; 2] = [RGBColor(255, 70, 60), RGBColor(255, 255, 255)];

/// Pixels of 8 bits for red, green and blue, row by row from the upper left corner.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Picture {
    pub(super) width: usize,
    pub(super) height: usize,
    pub(super) rgb: Vec<u8>,
}

impl Picture {
    /// Depth in colour, from yellow (near) to violet; black where nothing was seen.
    pub(super) fn of_depth(map: &DepthMap) -> Self {
        let [near, far] = SCALE_M;
        let mut rgb = Vec::with_capacity(3 * map.depth.len());
        for z in &map.depth {
            if *z > 0.0 {
                let share = ((far - z) / (far - near)).clamp(0.0, 1.0);
                let RGBColor(r, g, b) = ViridisRGB.get_color(share);
                rgb.extend([r, g, b]);
            } else {
                rgb.extend([0; 3]);
            }
        }
        Self { width: map.width, height: map.height, rgb }
    }

    /// Draws the legs of a frame: the outline of each segment that was seen, and the line through its middle of each that is
    /// not lost.
    pub(super) fn draw_legs(&mut self, frame: &TrackedFrame, track: &Track) -> anyhow::Result<()> {
        let Some(legs) = &frame.legs else { return Ok(()) };
        let size = (self.width as u32, self.height as u32);
        let sheet = BitMapBackend::<plotters::backend::RGBPixel>::with_buffer_and_format(&mut self.rgb, size)
            .map_err(|error| anyhow!("the picture has no room: {error}"))?
            .into_drawing_area();
        let drawn = |error: DrawingAreaErrorKind<_>| anyhow!("the legs could not be drawn: {error}");
        for side in Side::BOTH.into_iter().filter(|side| !legs.lost[*side as usize]) {
            let colour = COLOURS[side as usize];
            for segment in LegSegment::ALL {
                let Some(ends) = discs(legs, side, segment, track) else { continue };
                let [a, b] = ends.map(|disc| rounded(disc.centre));
                sheet.draw(&PathElement::new(vec![a, b], colour.stroke_width(2))).map_err(drawn)?;
                sheet.draw(&Circle::new(b, 4, colour.filled())).map_err(drawn)?;
                if legs.is_seen(side) {
                    let [left, right] = tangents(&ends);
                    for edge in [left, right] {
                        sheet.draw(&PathElement::new(edge.to_vec(), colour.stroke_width(1))).map_err(drawn)?;
                    }
                }
            }
        }
        sheet.present().map_err(drawn)
    }

    /// The same with one pixel of so many along each side.
    pub(super) fn shrunk(&self, factor: usize) -> Self {
        let (width, height) = (self.width / factor, self.height / factor);
        let mut rgb = Vec::with_capacity(3 * width * height);
        for j in 0..height {
            for i in 0..width {
                let at = 3 * (factor * j * self.width + factor * i);
                rgb.extend(&self.rgb[at..at + 3]);
            }
        }
        Self { width, height, rgb }
    }

    /// Writes the picture as PNG.
    pub(super) fn write(&self, out: impl Write) -> anyhow::Result<()> {
        let mut encoder = png::Encoder::new(out, self.width as u32, self.height as u32);
        encoder.set_color(png::ColorType::Rgb);
        encoder.set_depth(png::BitDepth::Eight);
        let mut writer = encoder.write_header()?;
        writer.write_image_data(&self.rgb)?;
        Ok(writer.finish()?)
    }
}

/// A round end of a segment in the image, pixels.
#[derive(Debug, Clone, Copy)]
struct Disc {
    centre: [f64; 2],
    radius: f64,
}

/// Both ends of a segment in the image; nothing behind the camera.
fn discs(legs: &Legs, side: Side, segment: LegSegment, track: &Track) -> Option<[Disc; 2]> {
    let shape = track.shape.unwrap_or_else(adult_shape);
    let (_, radii) = segment.shape_indices();
    let disc = |point, radius: usize| {
        let in_sensor = track.floor.sensor_from_point(legs.point(side, point));
        let centre = track.camera.pixel_of_point(&in_sensor)?;
        Some(Disc { centre, radius: shape[radius] * track.camera.fx / in_sensor.z })
    };
    Some([disc(segment.start(), radii[0])?, disc(segment.end(), radii[1])?])
}

/// The two lines that touch both discs on the outside; short sides when one disc hides the other.
fn tangents([a, b]: &[Disc; 2]) -> [[(i32, i32); 2]; 2] {
    let (dx, dy) = (b.centre[0] - a.centre[0], b.centre[1] - a.centre[1]);
    let distance = dx.hypot(dy).max(1e-9);
    // The touching points lie in this direction from the centres, seen from the line between them.
    let cosine = ((a.radius - b.radius) / distance).clamp(-1.0, 1.0);
    let sine = (1.0 - cosine * cosine).sqrt();
    let (ux, uy) = (dx / distance, dy / distance);
    [-1.0, 1.0].map(|side| {
        let (nx, ny) = (ux * cosine - side * uy * sine, uy * cosine + side * ux * sine);
        [a, b].map(|disc| rounded([disc.centre[0] + nx * disc.radius, disc.centre[1] + ny * disc.radius]))
    })
}

fn rounded([i, j]: [f64; 2]) -> (i32, i32) {
    // Conversions saturate: what lies far outside stays outside, and the sum of two such numbers does not overflow.
    let pixel = |x: f64| x.round().clamp(-1e5, 1e5) as i32;
    (pixel(i), pixel(j))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn near_is_yellow_far_is_violet_and_nothing_is_black() {
        let map = DepthMap { width: 3, height: 1, depth: vec![0.3, 2.5, 0.0] };
        let picture = Picture::of_depth(&map);
        let [near, far, nothing] = [0, 1, 2].map(|k| [0, 1, 2].map(|c| i32::from(picture.rgb[3 * k + c])));
        assert!(near[0] > 200 && near[1] > 200 && near[2] < 80, "{near:?}");
        assert!(far[2] > far[1] + 50, "{far:?}");
        assert_eq!(nothing, [0, 0, 0]);
    }

    #[test]
    fn tangents_touch_both_discs() {
        let discs = [Disc { centre: [100.0, 50.0], radius: 40.0 }, Disc { centre: [130.0, 200.0], radius: 20.0 }];
        for [a, b] in tangents(&discs) {
            let [a, b] = [a, b].map(|(x, y)| [f64::from(x), f64::from(y)]);
            let length = (b[0] - a[0]).hypot(b[1] - a[1]);
            for disc in &discs {
                let area = (b[0] - a[0]) * (disc.centre[1] - a[1]) - (b[1] - a[1]) * (disc.centre[0] - a[0]);
                assert!((area.abs() / length - disc.radius).abs() < 1.5, "{a:?} {b:?}");
            }
        }
    }
}
