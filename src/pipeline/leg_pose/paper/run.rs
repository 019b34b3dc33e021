//! A recording through the paper's tracker: legs in the form that steps, reports and pictures are made of.
//!
//! The paper reads a pose from each frame and leaves the rest to a hand; what contacts and steps need beside the pose is
//! found here. A background that does not see everywhere, or is not there, is filled with the floor's plane. Velocities are
//! slopes of lines through the poses of some frames to either side; poses themselves are as the filter gives them.

use super::colour_cue::Templates;
use super::settings::PaperSettings;
use super::tracker::{LegEstimate, Tracker};
use super::visibility::Visibility;
use crate::assessment::LegPoseSettings;
use crate::assessment::quality::EffectiveSampleSize;
use crate::body::legs::solids::solids;
use crate::geometry::camera::{DepthMap, Intrinsics};
use crate::geometry::floor::Floor as LevelFloor;
use crate::pipeline::leg_pose::floor::Floor;
use crate::pipeline::leg_pose::foreground::Region;
use crate::pipeline::leg_pose::leg_model::{POINTS, ShapeVector};
use crate::pipeline::leg_pose::{Legs, seconds};
use crate::recording::side_camera::SideImages;
use nalgebra::{Unit, Vector3};

/// Pixels that a leg's calf and foot must have for the leg to count as seen.
const MIN_LEG_PIXELS: f64 = 250.0;
/// A leg unseen for longer is lost, seconds.
const LOST_AFTER: f64 = 0.5;
/// Frames this far to either side say how fast a point moves, seconds: noise of a pose is centimetres, and a swing lasts
/// for 0.3 s and more.
const VELOCITY_WINDOW: f64 = 0.1;

/// A recording half-way through.
pub struct PaperRun {
    settings: PaperSettings,
    camera: Intrinsics,
    floor: Floor,
    background: Option<DepthMap>,
    /// What legs look like from the sides, until the tracker has it.
    templates: Option<Templates>,
    /// Made when the first image tells its size.
    tracker: Option<Tracker>,
    last_seen: [f64; 2],
    frames: Vec<PaperFrame>,
    sample_sizes: Vec<f64>,
    /// Sum of the shapes of all frames.
    shapes: ShapeVector,
}

/// One frame.
struct PaperFrame {
    time_ns: i64,
    legs: Legs,
    /// True when nothing connects the frame with the one before it.
    starts: bool,
}

/// What the paper's tracker made of a recording.
pub struct PaperResult {
    /// Frames with legs, their times in nanoseconds, and whether a track begins with them.
    pub frames: Vec<(i64, Legs, bool)>,
    /// Mean of the frames' lengths and radii; none without legs.
    pub shape: Option<ShapeVector>,
    /// Effective sample size over the frames; none without legs.
    pub effective_sample_size: Option<EffectiveSampleSize>,
}

impl PaperRun {
    /// Begins with a camera over a floor, and the scene without anybody when it was recorded.
    pub fn new(
        settings: &LegPoseSettings,
        camera: Intrinsics,
        floor: Floor,
        background: Option<DepthMap>,
        templates: Option<Templates>,
    ) -> Self {
        let settings = PaperSettings {
            particles: settings.particles as usize,
            cues: settings.cues,
            seed: settings.seed,
            region: Region { depth: settings.depth_m, x: settings.x_m },
            ..PaperSettings::default()
        };
        Self {
            settings,
            camera,
            floor,
            background,
            templates,
            tracker: None,
            last_seen: [f64::NEG_INFINITY; 2],
            frames: Vec::new(),
            sample_sizes: Vec::new(),
            shapes: ShapeVector::zeros(),
        }
    }

    /// Takes the next image, and what the cameras at the sides saw at its time.
    pub fn take(&mut self, time_ns: i64, image: &DepthMap, sides: Option<&SideImages>) {
        let tracker = self.tracker.get_or_insert_with(|| {
            let level = level_floor(&self.floor);
            let mut background = self.background.take().unwrap_or_else(|| DepthMap::empty(image.width, image.height));
            fill_with_floor(&mut background, &self.camera, &level);
            Tracker::new(self.settings, self.camera, level, background).with_templates(self.templates.take())
        });
        if let Some(images) = sides {
            tracker.see_sides(images);
        }
        // A frame without an estimate is a frame without legs; the reasons are those that the default has.
        let Ok(estimate) = tracker.step(time_ns, image) else { return };
        let time = seconds(time_ns);
        for (leg, last) in self.last_seen.iter_mut().enumerate() {
            let own = &estimate.visibility.pixels[3 * leg..3 * leg + 3];
            if own[1] + own[2] > MIN_LEG_PIXELS {
                *last = time;
            }
        }
        let lost = self.last_seen.map(|seen| time - seen > LOST_AFTER);
        if lost == [true; 2] {
            return;
        }
        self.sample_sizes.push(estimate.effective_sample_size);
        self.shapes += shape_of(&estimate);
        let starts = estimate.started;
        self.frames.push(PaperFrame { time_ns, legs: self.legs(&estimate, lost), starts });
    }

    fn legs(&self, estimate: &LegEstimate, lost: [bool; 2]) -> Legs {
        let turn = self.floor.floor_from_sensor.matrix();
        let squares = turn.component_mul(turn);
        let joints = estimate.legs.joints();
        let Visibility { shares, unexplained, .. } = estimate.visibility;
        Legs {
            points: std::array::from_fn(|k| self.floor.point_from_sensor(&joints[k])),
            deviations: std::array::from_fn(|k| {
                let variance = squares * estimate.joint_sd[k].map(|sd| sd * sd);
                variance.map(f64::sqrt)
            }),
            velocities: [Vector3::zeros(); POINTS],
            visibility: shares,
            misfit: unexplained,
            lost,
        }
    }

    /// Ends the recording.
    pub fn finish(mut self) -> PaperResult {
        let particles = u32::try_from(self.settings.particles).unwrap_or(u32::MAX);
        let count = self.frames.len() as f64;
        let has_legs = !self.frames.is_empty();
        for stretch in self.frames.chunk_by_mut(|_, next| !next.starts) {
            add_velocities(stretch);
        }
        PaperResult {
            frames: self.frames.into_iter().map(|frame| (frame.time_ns, frame.legs, frame.starts)).collect(),
            shape: has_legs.then(|| self.shapes / count),
            effective_sample_size: has_legs.then(|| EffectiveSampleSize::of_frames(particles, self.sample_sizes)),
        }
    }
}

/// Lengths and radii of a frame's legs as the default's model has them.
fn shape_of(estimate: &LegEstimate) -> ShapeVector {
    let state = &estimate.state;
    let [thigh, calf, foot, ..] = solids(state, &estimate.legs).map(|solid| solid.radii);
    ShapeVector::from([state.thigh, state.calf, state.foot, thigh[0], thigh[1], calf[1], foot[0], foot[1]])
}

/// Gives each frame of a stretch the slopes of lines through its neighbours.
fn add_velocities(stretch: &mut [PaperFrame]) {
    let velocities: Vec<[Vector3<f64>; POINTS]> = (0..stretch.len())
        .map(|k| {
            let time = |n: usize| (stretch[n].time_ns - stretch[k].time_ns) as f64 * 1e-9;
            let is_near = |n: &usize| time(*n).abs() <= VELOCITY_WINDOW;
            let first = (0..=k).rev().take_while(is_near).last().unwrap_or(k);
            let last = (k..stretch.len()).take_while(is_near).last().unwrap_or(k);
            let count = (last - first + 1) as f64;
            let middle = (first..=last).map(time).sum::<f64>() / count;
            let spread: f64 = (first..=last).map(|n| (time(n) - middle).powi(2)).sum();
            std::array::from_fn(|point| {
                let sum = |n: usize| stretch[n].legs.points[point] * (time(n) - middle);
                // A frame on its own says nothing of speed.
                if spread > 0.0 { (first..=last).map(sum).sum::<Vector3<f64>>() / spread } else { Vector3::zeros() }
            })
        })
        .collect();
    for (frame, velocities) in stretch.iter_mut().zip(velocities) {
        frame.legs.velocities = velocities;
    }
}

/// The same floor on the leg model's axes.
fn level_floor(floor: &Floor) -> LevelFloor {
    let up = floor.floor_from_sensor.inverse() * Vector3::y();
    LevelFloor { up: Unit::new_normalize(up), camera_height: floor.camera_height }
}

/// Puts the floor's plane where a background saw nothing: otherwise the floor there would be foreground.
fn fill_with_floor(background: &mut DepthMap, camera: &Intrinsics, floor: &LevelFloor) {
    let width = background.width;
    for (pixel, z) in background.depth.iter_mut().enumerate() {
        if *z > 0.0 {
            continue;
        }
        let ray = camera.point_in_sensor((pixel % width) as f64, (pixel / width) as f64, 1.0);
        let towards = -floor.up.dot(&ray);
        if towards > 0.0 {
            *z = (floor.camera_height / towards) as f32;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::scene::{CAMERA, HEIGHT, REGION, WIDTH, floor, image, walking};
    use super::*;
    use crate::assessment::LegPoseMode;
    use crate::body::Side;
    use crate::pipeline::leg_pose::leg_model::LegPoint;

    /// The scene with its floor drawn in.
    fn on_floor(mut map: DepthMap) -> DepthMap {
        fill_with_floor(&mut map, &CAMERA, &floor());
        for z in &mut map.depth {
            *z = if *z > 4.0 { 0.0 } else { *z };
        }
        map
    }

    fn run(background: Option<DepthMap>, frames: u32) -> PaperResult {
        let settings = LegPoseSettings {
            mode: LegPoseMode::Paper,
            particles: 500,
            depth_m: REGION.depth,
            x_m: REGION.x,
            ..LegPoseSettings::default()
        };
        let found = Floor::find(&on_floor(DepthMap::empty(WIDTH, HEIGHT)), &CAMERA).expect("a floor");
        let mut run = PaperRun::new(&settings, CAMERA, found, background, None);
        for k in 0..frames {
            let phase = f64::from(k) * std::f64::consts::PI / 30.0;
            run.take(i64::from(k) * 33_333_333, &on_floor(image(&walking(phase).2)), None);
        }
        run.finish()
    }

    #[test]
    fn ankles_are_found_on_the_floors_axes_without_a_background_as_with_one() {
        for background in [None, Some(on_floor(DepthMap::empty(WIDTH, HEIGHT)))] {
            let found = run(background, 8);
            assert_eq!(found.frames.len(), 8);
            let truth = walking(7.0 * std::f64::consts::PI / 30.0).1;
            let axes = level_floor(&Floor::find(&on_floor(DepthMap::empty(WIDTH, HEIGHT)), &CAMERA).expect("a floor"));
            for side in Side::BOTH {
                let ankle = found.frames[7].1.point(side, LegPoint::Ankle);
                let true_ankle = truth.side(side).ankle;
                // 500 particles wander by centimetres; on other axes the camera's height would be between them.
                assert!((ankle.y - axes.height(&true_ankle)).abs() < 0.12, "{side:?}: {ankle}");
                assert!(found.frames[7].1.is_seen(side));
            }
            // Facing the camera, the left leg is to the right in the image.
            let across = |side| found.frames[7].1.point(side, LegPoint::Ankle).x;
            assert!(across(Side::Left) > across(Side::Right) + 0.05);
            assert!(found.effective_sample_size.is_some_and(|size| size.particles == 500 && size.median > 1.0));
        }
    }

    #[test]
    fn velocities_are_those_of_points_that_move_evenly_and_stop_where_a_track_does() {
        let mut found = run(None, 6);
        let legs = found.frames.remove(0).1;
        let mut stretch: Vec<PaperFrame> = (0..9)
            .map(|k| {
                let mut legs = legs.clone();
                legs.points[2].z = 0.6 * f64::from(k) / 30.0;
                PaperFrame { time_ns: i64::from(k) * 33_333_333, legs, starts: k == 0 }
            })
            .collect();
        add_velocities(&mut stretch);
        assert!(stretch.iter().all(|frame| (frame.legs.velocities[2].z - 0.6).abs() < 1e-6));
        add_velocities(&mut stretch[..1]);
        assert_eq!(stretch[0].legs.velocities[2], Vector3::zeros());
    }
}
