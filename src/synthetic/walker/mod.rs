//! Depth recordings of a walker's user, with known truth.
//!
//! A figure with a surface of its own walks over a floor behind a walker; the camera on the walker looks back at the
//! legs. Steps are planned as footprints ([`course`]), legs follow them ([`gait`]), the surface follows the legs
//! ([`body`]), and a sensor model makes raw values of what a z-buffer sees ([`kinect`]). The figure is no tapered
//! cylinder, so the simulation judges models instead of repeating them.
//!
//! In `world` (right-handed, y up) the floor is y = 0 and the walk begins at the origin along z, with the left at +x. The
//! `sensor` frame is x right in the image, y down, z away.

pub mod body;
pub mod bones;
pub mod camera;
pub mod cesium;
pub mod course;
pub mod gait;
pub mod kinect;
mod noise;
mod raster;
mod reference;
mod scene;
pub mod settings;
pub mod side_cameras;
pub mod trousers;
pub mod truth;

pub use body::Body;
pub use course::Course;
pub use settings::WalkerSettings;
pub use truth::{FrameTruth, StepTruth};

use crate::geometry::camera::Intrinsics;
use crate::recording::depth::DepthImage;
use crate::synthetic::SettingOutOfRange;
use bones::{LegPoints, Posture};
use camera::CameraPath;
use gait::Gait;
use kinect::View;
use nalgebra::{Isometry3, Point3, Vector3};
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use raster::{NOTHING, ZBuffer};
use rayon::prelude::*;
use scene::Things;
use settings::{HEIGHT, WIDTH};

/// Number of the floor among the triangles.
const FLOOR: u32 = NOTHING - 1;

/// Frames that are rendered at once by [`WalkerSimulation::frames`].
const BATCH: usize = 8;

/// Number of the background's noise: no frame has it.
const BACKGROUND_FRAME: u64 = u64::MAX >> 44;

/// Cell of the pattern of holes in cloth, metres: two to eight pixels at the distance of legs.
const HOLE_M: f64 = 0.011;

/// Share of a hole's noise that changes from frame to frame.
const HOLE_FLICKER: f64 = 0.15;

/// A walk that can be looked at frame by frame, in any order; each frame is a function of its number.
#[derive(Debug, Clone)]
pub struct WalkerSimulation {
    settings: WalkerSettings,
    body: Body,
    gait: Gait,
    path: CameraPath,
    frame: Things,
    room: Things,
}

/// What is drawn, in `sensor`: the figure's triangles come first.
struct Triangles {
    corners: Vec<Point3<f64>>,
    triangles: Vec<[u32; 3]>,
    n_body: usize,
}

/// One frame and its truth.
#[derive(Debug, Clone, PartialEq)]
pub struct WalkerFrame {
    /// What the sensor gave.
    pub image: DepthImage,
    /// What was there.
    pub truth: FrameTruth,
}

impl WalkerSimulation {
    /// Plans the walk of a figure, which is scaled to the settings' stature and dressed.
    ///
    /// # Errors
    /// [`SettingOutOfRange`] for settings that make no sense.
    pub fn new(settings: &WalkerSettings, body: Body) -> Result<Self, SettingOutOfRange> {
        settings.check()?;
        let clothes = &settings.clothes;
        let body = body.of_stature(settings.stature_m).dressed(
            clothes.thickness_m,
            clothes.folds_m,
            clothes.flare_m,
            settings.seed,
        );
        let mut random = ChaCha8Rng::seed_from_u64(settings.seed);
        random.set_stream(1);
        let stride = &settings.stride;
        let prints = course::footprints(settings.course, stride, settings.duration_s, &mut random);
        let length = prints.iter().map(|print| print.place.coords.norm()).fold(0.0, f64::max);
        let gait = Gait::new(body.legs, prints, stride.step_m, stride.step_s, settings.stretch, settings.duration_s);
        let path = CameraPath::new(settings.mount, gait.pelvis_path(), settings.seed);
        let frame = if settings.has_frame { Things::walker_frame() } else { Things::default() };
        let room = if settings.has_things { Things::in_room(length, settings.seed) } else { Things::default() };
        Ok(Self { settings: *settings, body, gait, path, frame, room })
    }

    /// The settings of the simulation.
    pub fn settings(&self) -> &WalkerSettings {
        &self.settings
    }

    /// The camera's intrinsics.
    pub fn intrinsics(&self) -> &Intrinsics {
        &self.settings.camera
    }

    /// Number of frames.
    pub fn len(&self) -> usize {
        (self.settings.duration_s * self.settings.rate_hz) as usize
    }

    /// Whether there is no frame.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// The scene without the person and without the room: the floor and the walker.
    pub fn background(&self) -> DepthImage {
        let world_from_sensor = self.path.world_from_sensor(0.0);
        let view = self.view(&world_from_sensor, None, BACKGROUND_FRAME);
        let errors = kinect::SensorErrors { missing_share: 0.0, ..self.settings.errors };
        kinect::image(&view, &self.settings.camera, &errors, self.settings.seed, BACKGROUND_FRAME)
    }

    /// One frame, from 0.
    pub fn frame(&self, k: usize) -> WalkerFrame {
        let truth = self.truth(k);
        let posture = self.gait.posture(self.time_s(k));
        let view = self.view(&truth.world_from_sensor, Some(&posture), k as u64);
        let image = kinect::image(&view, &self.settings.camera, &self.settings.errors, self.settings.seed, k as u64);
        WalkerFrame { image, truth }
    }

    /// All frames in order; a few are in memory at a time.
    pub fn frames(&self) -> impl Iterator<Item = WalkerFrame> + '_ {
        let starts = (0..self.len()).step_by(BATCH);
        starts.flat_map(move |first| {
            let batch = first..(first + BATCH).min(self.len());
            batch.into_par_iter().map(|k| self.frame(k)).collect::<Vec<_>>()
        })
    }

    /// The truth of one frame without its image.
    pub fn truth(&self, k: usize) -> FrameTruth {
        let time = self.time_s(k);
        let world_from_sensor = self.path.world_from_sensor(time);
        let seen = |point: &Point3<f64>| world_from_sensor.inverse_transform_point(point);
        let legs = self.gait.posture(time).legs.map(|leg| LegPoints {
            hip: seen(&leg.hip),
            knee: seen(&leg.knee),
            ankle: seen(&leg.ankle),
            heel: seen(&leg.heel),
            toe: seen(&leg.toe),
        });
        FrameTruth {
            time_ns: (k as f64 / self.settings.rate_hz * 1e9).round() as i64,
            legs,
            contacts: self.gait.contacts(time),
            floor_normal: world_from_sensor.inverse_transform_vector(&Vector3::y()),
            camera_height_m: self.settings.mount.height_m,
            world_from_sensor,
        }
    }

    /// Every footprint of the plan, in order of contact; the last ones may lie beyond the recording.
    pub fn footprints(&self) -> &[course::Footprint] {
        self.gait.footprints()
    }

    /// All steps whose double support ends within the recording, in order.
    pub fn steps(&self) -> Vec<StepTruth> {
        let prints = self.gait.footprints();
        let mut bouts: Vec<usize> = Vec::new();
        for k in 2..prints.len() {
            let new = k == 2 || prints[k].contact_s - prints[k - 1].contact_s > 1.8 * self.settings.stride.step_s;
            bouts.push(bouts.last().map_or(0, |bout| bout + usize::from(new)));
        }
        (2..prints.len()).filter_map(|k| self.step(k, &bouts)).collect()
    }

    fn step(&self, k: usize, bouts: &[usize]) -> Option<StepTruth> {
        let prints = self.gait.footprints();
        let print = prints[k];
        let standing = *prints[..k].iter().rev().find(|other| other.side != print.side)?;
        let support = self.settings.stride.double_support * self.settings.stride.step_s;
        // Both feet of a person who stops stay down: then the double support of a step counts.
        let lasts = (standing.release_s - print.contact_s).min(2.0 * support);
        let mid = print.contact_s + 0.5 * lasts;
        if print.contact_s + lasts > self.settings.duration_s {
            return None;
        }
        let camera = self.path.world_from_sensor(mid);
        let legs = self.gait.posture(mid).legs;
        let left_minus_right = course::lateral(print.side);
        let [ankle_length, ankle_left] =
            truth::length_and_width(&camera, &legs[standing.side].ankle, &legs[print.side].ankle);
        let [footprint_length, footprint_left] = truth::length_and_width(&camera, &standing.place, &print.place);
        let bout = bouts[k - 2];
        Some(StepTruth {
            side: print.side,
            contact_s: print.contact_s,
            release_s: standing.release_s.is_finite().then_some(standing.release_s),
            mid_double_support_s: mid,
            ankle_length_m: ankle_length,
            ankle_width_m: ankle_left * left_minus_right,
            footprint_length_m: footprint_length,
            footprint_width_m: footprint_left * left_minus_right,
            place_in_bout: bouts[..k - 2].iter().filter(|other| **other == bout).count(),
            steps_to_come: bouts[k - 1..].iter().filter(|other| **other == bout).count(),
            is_turning: (print.heading - standing.heading).abs() > 1e-9,
            footprint: print,
            standing,
        })
    }

    fn time_s(&self, k: usize) -> f64 {
        k as f64 / self.settings.rate_hz
    }

    /// What an ideal camera sees; without a posture there is neither person nor room.
    fn view(&self, world_from_sensor: &Isometry3<f64>, posture: Option<&Posture>, frame: u64) -> View {
        let camera = &self.settings.camera;
        let Triangles { corners, triangles, n_body } = self.triangles(world_from_sensor, posture);
        let mut buffer = ZBuffer::new(WIDTH, HEIGHT);
        for (number, triangle) in triangles.iter().enumerate() {
            let [a, b, c] = triangle.map(|corner| &corners[corner as usize]);
            buffer.draw(camera, [a, b, c], number as u32);
        }
        let up = world_from_sensor.inverse_transform_vector(&Vector3::y());
        buffer.draw_plane(camera, &up, -self.settings.mount.height_m, FLOOR);
        self.shaded(buffer, &corners, &triangles, n_body, &up, frame)
    }

    /// All there is but the floor, in `sensor`: the person and the room when there is a posture, then the walker's sides.
    fn triangles(&self, world_from_sensor: &Isometry3<f64>, posture: Option<&Posture>) -> Triangles {
        let sensor_from_world = world_from_sensor.inverse();
        let mut corners: Vec<Point3<f64>> = Vec::new();
        let mut triangles: Vec<[u32; 3]> = Vec::new();
        let n_body = match posture {
            Some(posture) => {
                self.body.skinned(posture, &mut corners);
                triangles.extend(&self.body.triangles);
                add(&mut corners, &mut triangles, &self.room);
                for corner in &mut corners {
                    *corner = sensor_from_world * *corner;
                }
                self.body.triangles.len()
            }
            None => 0,
        };
        let first = corners.len();
        add(&mut corners, &mut triangles, &self.frame);
        for corner in &mut corners[first..] {
            *corner = self.sensor_from_walker(corner);
        }
        Triangles { corners, triangles, n_body }
    }

    /// A point in the walker's axes (on the floor below the camera, x left, y up, z ahead) as the camera sees it.
    fn sensor_from_walker(&self, point: &Point3<f64>) -> Point3<f64> {
        let camera = self.path.world_from_sensor(0.0);
        let heading = nalgebra::Rotation3::from_axis_angle(&Vector3::y_axis(), self.path.heading(0.0));
        let floor_point = Point3::new(camera.translation.x, 0.0, camera.translation.z);
        camera.inverse_transform_point(&(floor_point + heading * point.coords))
    }

    /// Adds the slope of what is seen, and where the cloth swallows the light.
    fn shaded(
        &self,
        buffer: ZBuffer,
        corners: &[Point3<f64>],
        triangles: &[[u32; 3]],
        n_body: usize,
        up: &Vector3<f64>,
        frame: u64,
    ) -> View {
        let pixels = buffer.depth.len();
        let mut view = View {
            width: buffer.width,
            depth: buffer.depth,
            cosine: vec![0.0; pixels],
            is_person: vec![false; pixels],
            is_hole: vec![false; pixels],
        };
        let normals: Vec<Vector3<f64>> = triangles
            .iter()
            .map(|t| {
                let [a, b, c] = t.map(|corner| corners[corner as usize]);
                (b - a).cross(&(c - a)).try_normalize(1e-12).unwrap_or_else(Vector3::zeros)
            })
            .collect();
        for (pixel, number) in buffer.triangle.iter().enumerate() {
            if *number == NOTHING {
                continue;
            }
            let (i, j) = ((pixel % view.width) as f64, (pixel / view.width) as f64);
            let point = self.settings.camera.point_in_sensor(i, j, f64::from(view.depth[pixel]));
            let ray = point.normalize();
            if *number == FLOOR {
                view.cosine[pixel] = ray.dot(up).abs() as f32;
                continue;
            }
            let triangle = *number as usize;
            view.cosine[pixel] = ray.dot(&normals[triangle]).abs() as f32;
            if triangle < n_body {
                view.is_person[pixel] = true;
                view.is_hole[pixel] = self.is_hole(triangle, corners, &Point3::from(point), frame);
            }
        }
        view
    }

    /// Whether a point of the figure's surface is a hole in the cloth's pattern, which moves with the surface.
    fn is_hole(&self, triangle: usize, corners: &[Point3<f64>], point: &Point3<f64>, frame: u64) -> bool {
        let holes = self.settings.clothes.holes;
        if holes <= 0.0 || !self.settings.errors.is_noisy {
            return false;
        }
        let indices = self.body.triangles[triangle].map(|corner| corner as usize);
        let [a, b, c] = indices.map(|corner| corners[corner]);
        if self.body.vertices[indices[0]].foot_share() > 0.5 {
            return false;
        }
        let rest = self.rest_at(triangle, [&a, &b, &c], point);
        let place = (rest / HOLE_M).into();
        let pattern = noise::smooth(self.settings.seed, place);
        let flicker = noise::smooth(self.settings.seed ^ frame.wrapping_mul(0x9e37_79b9), place);
        (1.0 - HOLE_FLICKER) * pattern + HOLE_FLICKER * flicker > hole_threshold(holes)
    }

    /// Where a point of one of the figure's triangles is at rest; point and corners in one frame.
    fn rest_at(&self, triangle: usize, [a, b, c]: [&Point3<f64>; 3], point: &Point3<f64>) -> Vector3<f64> {
        let normal = (b - a).cross(&(c - a));
        let area = normal.norm_squared();
        let share = |u: &Point3<f64>, v: &Point3<f64>| (v - u).cross(&(point - u)).dot(&normal) / area;
        let (wa, wb) = (share(b, c), share(c, a));
        let rest = self.body.triangles[triangle].map(|corner| self.body.vertices[corner as usize].rest.coords);
        rest[0] * wa + rest[1] * wb + rest[2] * (1.0 - wa - wb)
    }
}

/// The value that the pattern's noise exceeds in a share of all places. Smooth noise is about normal, mean 0.5.
fn hole_threshold(share: f64) -> f64 {
    /// SD of the pattern, and its value at shares of 30, 10, 3, 1 and 0.1 percent in units of it.
    const SD: f64 = 0.16;
    const QUANTILES: [(f64, f64); 5] = [(0.3, 0.524), (0.1, 1.282), (0.03, 1.881), (0.01, 2.326), (0.001, 3.090)];
    let after = QUANTILES.iter().position(|(s, _)| *s <= share).unwrap_or(QUANTILES.len() - 1).max(1);
    let ((s0, q0), (s1, q1)) = (QUANTILES[after - 1], QUANTILES[after]);
    let part = ((share.max(s1) / s0).ln() / (s1 / s0).ln()).clamp(0.0, 1.0);
    0.5 + SD * (q0 + part * (q1 - q0))
}

fn add(corners: &mut Vec<Point3<f64>>, triangles: &mut Vec<[u32; 3]>, things: &Things) {
    let first = corners.len() as u32;
    corners.extend(&things.corners);
    triangles.extend(things.triangles.iter().map(|triangle| triangle.map(|corner| corner + first)));
}

#[cfg(test)]
mod tests;
