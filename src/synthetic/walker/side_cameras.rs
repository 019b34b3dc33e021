//! Two colour cameras to the sides of the depth camera: what the paper compares depth with (\[walker\], section 4.4.4).
//!
//! The same scene in colour, with what the paper blames for its poor result: a background that changes while the walker
//! rolls on and has things in the colours of the clothes, and light that changes along the way. Clothes are patterned; their
//! pattern moves with the surface. Which pixels show which segment comes along for the first image.

use super::bones::{LegPart, PART_COUNT, part_index};
use super::noise::{lattice, smooth};
use super::raster::{NOTHING, ZBuffer};
use super::{FLOOR, Triangles, WalkerSimulation};
use crate::geometry::camera::Intrinsics;
use crate::geometry::colour_image::ColourImage;
use crate::recording::side_camera::{SideCamera, SideImages};
use nalgebra::{Isometry3, Point3, Translation3, UnitQuaternion, Vector3};

/// The cameras' intrinsics, pixels: the depth camera's view in half as many pixels each way.
const CAMERA: Intrinsics = Intrinsics { fx: 290.0, fy: 290.0, cx: 159.5, cy: 119.5 };
const WIDTH: usize = 320;
const HEIGHT: usize = 240;

/// Distance of each from the depth camera, metres: the two are about 20 cm apart.
const ASIDE_M: f64 = 0.10;

/// Distance of the lamps along the way, metres, and by which share of its mean the light changes below them.
const LAMPS_M: f64 = 2.5;
const LIGHT_CHANGE: f64 = 0.35;

/// Share of the light that comes from everywhere.
const AMBIENT: f64 = 0.5;

/// Where the rest comes from, in `world`: from above, behind the walker and a little from its left.
const LIGHT: Vector3<f64> = Vector3::new(0.35, 0.80, 0.49);

/// Noise of a level, SD.
const NOISE_LEVELS: f64 = 3.0;

/// Streams of the patterns' noise.
const CLOTH: u64 = 0x636c_6f74;
const GROUND: u64 = 0x6772_6f75;
const WALL: u64 = 0x7761_6c6c;

/// Red, green and blue as shares of white.
type Colour = [f64; 3];

/// Trousers by the seed: blue, brown, grey-green, dark red.
const TROUSERS: [Colour; 4] = [[0.22, 0.30, 0.52], [0.50, 0.38, 0.25], [0.34, 0.40, 0.32], [0.45, 0.18, 0.20]];
const SHIRT: Colour = [0.70, 0.66, 0.58];
const SHOES: Colour = [0.16, 0.12, 0.10];
const TUBES: Colour = [0.62, 0.64, 0.66];
const FLOOR_TILES: [Colour; 2] = [[0.58, 0.54, 0.48], [0.44, 0.42, 0.40]];

impl WalkerSimulation {
    /// The cameras to the sides, the left one in the image of the depth camera first, with the labels of frame 0.
    pub fn side_cameras(&self) -> [SideCamera; 2] {
        let (scene, _) = self.scene(0);
        let camera = |pose: Isometry3<f64>, first: ColourImage| {
            let seen = self.seen(&scene, &pose);
            let label = |number: &u32| match *number {
                number if (number as usize) < scene.n_body => self.segment(number as usize).map_or(0, |k| k as u8 + 1),
                _ => 0,
            };
            SideCamera {
                intrinsics: CAMERA,
                camera_from_sensor: pose,
                first,
                labels: seen.triangle.iter().map(label).collect(),
            }
        };
        let ([left, right], [left_image, right_image]) = (poses(), self.side_images(0));
        [camera(left, left_image), camera(right, right_image)]
    }

    /// What both cameras see at the time of a frame.
    pub fn side_images(&self, frame: usize) -> SideImages {
        let (scene, world_from_sensor) = self.scene(frame);
        let poses = poses();
        let image = |k: usize| self.colour_image(&scene, &poses[k], &world_from_sensor, (2 * frame + k) as u64);
        let (left, right) = rayon::join(|| image(0), || image(1));
        [left, right]
    }

    fn scene(&self, frame: usize) -> (Triangles, Isometry3<f64>) {
        let time = self.time_s(frame);
        let world_from_sensor = self.path.world_from_sensor(time);
        (self.triangles(&world_from_sensor, Some(&self.gait.posture(time))), world_from_sensor)
    }

    /// What a camera sees, in its own axes, with the floor.
    fn seen(&self, scene: &Triangles, camera_from_sensor: &Isometry3<f64>) -> ZBuffer {
        let corners: Vec<Point3<f64>> = scene.corners.iter().map(|corner| camera_from_sensor * corner).collect();
        let mut buffer = ZBuffer::new(WIDTH, HEIGHT);
        for (number, triangle) in scene.triangles.iter().enumerate() {
            let [a, b, c] = triangle.map(|corner| &corners[corner as usize]);
            buffer.draw(&CAMERA, [a, b, c], number as u32);
        }
        buffer
    }

    fn colour_image(
        &self,
        scene: &Triangles,
        camera_from_sensor: &Isometry3<f64>,
        world_from_sensor: &Isometry3<f64>,
        number: u64,
    ) -> ColourImage {
        let mut buffer = self.seen(scene, camera_from_sensor);
        let world_from_camera = world_from_sensor * camera_from_sensor.inverse();
        let up = world_from_camera.inverse_transform_vector(&Vector3::y());
        buffer.draw_plane(&CAMERA, &up, -world_from_camera.translation.y, FLOOR);
        let seed = self.settings.seed;
        let along = world_from_sensor.translation.z;
        let light = 1.0 + LIGHT_CHANGE * (std::f64::consts::TAU * along / LAMPS_M).sin();
        let sensor_from_camera = camera_from_sensor.inverse();
        let mut image = ColourImage::black(WIDTH, HEIGHT);
        for (pixel, (rgb, triangle)) in image.pixels.iter_mut().zip(&buffer.triangle).enumerate() {
            let (i, j) = (pixel % WIDTH, pixel / WIDTH);
            let in_camera = |z: f64| Point3::from(CAMERA.point_in_sensor(i as f64, j as f64, z));
            let colour = if *triangle == NOTHING {
                wall(seed, &(world_from_camera * (in_camera(1.0).coords)))
            } else {
                let in_sensor = sensor_from_camera * in_camera(f64::from(buffer.depth[pixel]));
                self.surface(scene, *triangle, &in_sensor, world_from_sensor)
            };
            for (channel, (level, share)) in rgb.iter_mut().zip(colour).enumerate() {
                let noise = lattice(seed ^ number.rotate_left(40), i as i64, j as i64, channel as i64) - 0.5;
                // A uniform number has a standard deviation of 1/√12.
                *level =
                    (255.0 * share * light + noise * NOISE_LEVELS * 12.0f64.sqrt()).round().clamp(0.0, 255.0) as u8;
            }
        }
        image
    }

    /// The colour of a surface in the light.
    fn surface(
        &self,
        scene: &Triangles,
        number: u32,
        in_sensor: &Point3<f64>,
        world_from_sensor: &Isometry3<f64>,
    ) -> Colour {
        let seed = self.settings.seed;
        if number == FLOOR {
            let place = world_from_sensor * in_sensor;
            return floor(seed, &place).map(|share| share * lit(&Vector3::y()));
        }
        let number = number as usize;
        let [a, b, c] = scene.triangles[number].map(|corner| &scene.corners[corner as usize]);
        let normal = world_from_sensor * (b - a).cross(&(c - a)).try_normalize(1e-12).unwrap_or_else(Vector3::y);
        let n_room = self.room.triangles.len();
        let albedo = match number {
            number if number < scene.n_body => self.clothes(number, &self.rest_at(number, [a, b, c], in_sensor)),
            // Twelve triangles for each box; every second one in the colour of the trousers.
            number if number < scene.n_body + n_room => {
                let box_number = ((number - scene.n_body) / 12) as i64;
                if box_number % 2 == 0 {
                    self.trousers()
                } else {
                    [0, 1, 2].map(|channel| 0.15 + 0.7 * lattice(seed ^ WALL, box_number, channel, 7))
                }
            }
            _ => TUBES,
        };
        albedo.map(|share| share * lit(&normal))
    }

    fn trousers(&self) -> Colour {
        TROUSERS[(self.settings.seed % TROUSERS.len() as u64) as usize]
    }

    /// The colour of the figure's surface at a place at rest.
    fn clothes(&self, triangle: usize, rest: &Vector3<f64>) -> Colour {
        /// Size of the weave's blotches and of its stripes, metres.
        const BLOTCH_M: f64 = 0.02;
        const STRIPE_M: f64 = 0.015;
        let vertex = &self.body.vertices[self.body.triangles[triangle][0] as usize];
        let blotch = smooth(self.settings.seed ^ CLOTH, (rest / BLOTCH_M).into()) - 0.5;
        let (base, pattern) = if vertex.foot_share() > 0.5 {
            (SHOES, 0.5 * blotch)
        } else if self.segment(triangle).is_some() {
            let stripe = (std::f64::consts::TAU * rest.x / STRIPE_M).sin();
            (self.trousers(), 0.7 * blotch + 0.12 * stripe)
        } else {
            (SHIRT, 0.4 * blotch)
        };
        base.map(|share| (share * (1.0 + pattern)).clamp(0.0, 1.0))
    }

    /// The leg segment that a triangle of the figure belongs to: thigh, calf, foot of the left leg, then of the right.
    fn segment(&self, triangle: usize) -> Option<usize> {
        let vertex = &self.body.vertices[self.body.triangles[triangle][0] as usize];
        let heaviest = (0..PART_COUNT).max_by(|a, b| vertex.weights[*a].total_cmp(&vertex.weights[*b]))?;
        (0..2).find_map(|side| {
            let of = |part: LegPart| part_index(side, part) == heaviest;
            let parts = [of(LegPart::Thigh), of(LegPart::Shank), of(LegPart::Foot) || of(LegPart::Toes)];
            parts.iter().position(|is| *is).map(|part| 3 * side + part)
        })
    }
}

/// The left camera has smaller x: a point is farther to its right.
fn poses() -> [Isometry3<f64>; 2] {
    [ASIDE_M, -ASIDE_M].map(|x| Isometry3::from_parts(Translation3::new(x, 0.0, 0.0), UnitQuaternion::identity()))
}

/// Share of the light that a surface with this normal (in `world`, either way) sends back.
fn lit(normal: &Vector3<f64>) -> f64 {
    AMBIENT + (1.0 - AMBIENT) * normal.dot(&LIGHT).abs()
}

/// Tiles with stains.
fn floor(seed: u64, place: &Point3<f64>) -> Colour {
    const TILE_M: f64 = 0.3;
    let (x, z) = ((place.x / TILE_M).floor() as i64, (place.z / TILE_M).floor() as i64);
    let stain = smooth(seed ^ GROUND, [place.x / 0.08, 0.0, place.z / 0.08]) - 0.5;
    FLOOR_TILES[((x + z).rem_euclid(2)) as usize].map(|share| share * (1.0 + 0.4 * stain))
}

/// A far wall with pictures, by the direction in which it is seen.
fn wall(seed: u64, direction: &Vector3<f64>) -> Colour {
    let (azimuth, height) = (direction.x.atan2(direction.z), direction.y / direction.x.hypot(direction.z).max(1e-6));
    let cell = [(azimuth / 0.15).floor() as i64, (height / 0.12).floor() as i64];
    [0, 1, 2].map(|channel| 0.25 + 0.5 * lattice(seed ^ WALL, cell[0], cell[1], channel))
}

#[cfg(test)]
mod tests {
    use super::super::trousers::trousers;
    use super::super::{Course, WalkerSettings};
    use super::*;

    fn simulation() -> WalkerSimulation {
        let settings = WalkerSettings { duration_s: 4.0, rate_hz: 5.0, ..WalkerSettings::of_seed(Course::Straight, 3) };
        WalkerSimulation::new(&settings, trousers()).unwrap()
    }

    #[test]
    fn labels_lie_where_the_true_joints_are_seen() {
        let simulation = simulation();
        let truth = simulation.truth(0);
        for camera in simulation.side_cameras() {
            for (side, leg) in truth.legs.iter().enumerate() {
                // Halfway down the shank.
                let middle = nalgebra::center(&leg.knee, &leg.ankle);
                let [i, j] = CAMERA.pixel_of_point(&(camera.camera_from_sensor * middle).coords).unwrap();
                let label = camera.labels[j.round() as usize * WIDTH + i.round() as usize];
                assert!(label as usize == 3 * side + 2, "side {side}: {label}");
            }
            let n_labelled = camera.labels.iter().filter(|label| **label > 0).count();
            assert!((4_000..40_000).contains(&n_labelled), "{n_labelled}");
        }
    }

    #[test]
    fn light_changes_on_the_way_and_the_same_frame_has_the_same_bytes() {
        let simulation = simulation();
        assert_eq!(simulation.side_images(3), simulation.side_images(3));
        let brightness = |k: usize| {
            let [left, _] = simulation.side_images(k);
            left.pixels.iter().flatten().map(|level| f64::from(*level)).sum::<f64>() / (3 * left.pixels.len()) as f64
        };
        let [darkest, brightest] = (0..simulation.len())
            .step_by(3)
            .map(brightness)
            .fold([255.0, 0.0], |[low, high], b| [f64::min(low, b), f64::max(high, b)]);
        assert!(brightest > 1.2 * darkest && darkest > 20.0 && brightest < 220.0, "{darkest} to {brightest}");
    }

    #[test]
    fn near_things_are_seen_apart_by_the_distance_of_the_cameras() {
        let simulation = simulation();
        let [left, right] = simulation.side_cameras();
        let centre = |camera: &SideCamera| {
            let own: Vec<usize> =
                (0..camera.labels.len()).filter(|k| camera.labels[*k] == 2).map(|k| k % WIDTH).collect();
            own.iter().sum::<usize>() as f64 / own.len() as f64
        };
        let expected = 2.0 * ASIDE_M * CAMERA.fx / simulation.truth(0).legs[0].knee.z;
        let found = centre(&left) - centre(&right);
        assert!((found / expected - 1.0).abs() < 0.15, "{found} instead of {expected} pixels");
    }
}
