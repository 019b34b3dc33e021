//! A walker user's legs from depth images, and the steps that they make (\[walker\]).
//!
//! ```text
//! depth image → foreground points on the floor's axes → pose of both legs → backward pass → contacts → steps
//! ```
//!
//! The floor comes from the background image, or from the first frames; nothing is set by hand. The legs' shape is
//! estimated from the first seconds in which legs are seen ([`shape_fit::calibrate`]); then each frame is tracked
//! ([`tracker`]) and smoothed ([`smoother`]). Images are read one by one, so memory does not grow with the recording but
//! by the poses.
//!
//! Deviations from the paper, with what they were worth on simulated walks, are in `docs/walker.md`.

pub mod floor;
pub mod floor_motion;
pub mod foot_contact;
pub mod foreground;
pub mod leg_model;
pub mod paper;
mod report;
pub mod shape_fit;
pub mod smoother;
pub mod static_scene;
pub mod steps;
pub mod surface_fit;
pub mod tracker;
pub mod two_legs;

use crate::assessment::quality::EffectiveSampleSize;
use crate::assessment::{Assessment, LegPoseMode, LegPoseSettings};
use crate::body::Side;
use crate::geometry::camera::{DepthMap, Intrinsics};
use crate::pipeline::PipelineError;
use crate::progress::{Monitor, Step};
use crate::recording::DecodeError;
use crate::recording::depth::{DepthImage, DepthReader, DepthUnit};
use crate::recording::side_camera::{SideCamera, SideImages};
use floor::Floor;
use foreground::{Foreground, Preparation, Region};
use leg_model::{LegPoint, LegSegment, POINTS, ShapePrior, ShapeVector, point_of};
use nalgebra::Vector3;
use paper::PaperRun;
use paper::colour_cue::Templates;
use shape_fit::calibrate;
use smoother::{SmoothedFrame, Smoother};
use static_scene::StaticScene;
use std::io::Read;
use surface_fit::{SEGMENTS, SLIVER_SHARE};
use tracker::{Tracker, visibility};
use two_legs::TwoLegs;

/// Frames with two legs that the shape is estimated from.
const CALIBRATION_FRAMES: usize = 150;
/// Every how many of them are used: neighbours say the same.
const CALIBRATION_STRIDE: usize = 2;
/// Frames that are waited for until there are so many; then those at hand must do.
const CALIBRATION_PATIENCE: usize = 450;
/// Frames in which a floor is looked for when there is no background.
const FLOOR_PATIENCE: usize = 30;
/// A leg of which less than this share of shank and foot is seen is bridged.
const SEEN_SHARE: f64 = 0.08;
/// How far a leg may be from where it is guessed to be when it is hidden, along the axes of `floor`: standard deviations,
/// metres; from simulated walks in which one leg hides the other.
const HIDDEN_SD: Vector3<f64> = Vector3::new(0.04, 0.02, 0.03);

/// Depth images one by one, with what is known of their camera.
pub trait DepthFrames {
    /// Reads the next image over another one and answers its time in nanoseconds; nothing at the end.
    ///
    /// # Errors
    /// The first defect of the recording.
    fn next_into(&mut self, image: &mut DepthImage) -> Result<Option<i64>, DecodeError>;
    /// The camera, when it was described.
    fn intrinsics(&self) -> Option<Intrinsics>;
    /// The scene without the person, when there is such an image.
    fn background(&self) -> Option<&DepthImage>;
    /// The colour cameras at the sides, when there are any.
    fn side_cameras(&self) -> Option<&[SideCamera; 2]> {
        None
    }
    /// What they saw at the time of the last image; nothing when there is no image of both.
    ///
    /// # Errors
    /// The defect of an image.
    fn side_images(&self) -> Result<Option<SideImages>, DecodeError> {
        Ok(None)
    }
    /// What the recording says of the camera's mount.
    fn declared_mount(&self) -> DeclaredMount {
        DeclaredMount::default()
    }
}

/// What a recording says of the camera's mount, when it says anything.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct DeclaredMount {
    /// Height of the camera above the floor, metres.
    pub height: Option<f64>,
    /// Tilt of the camera downwards, radians.
    pub tilt: Option<f64>,
}

impl<R: Read> DepthFrames for DepthReader<R> {
    fn next_into(&mut self, image: &mut DepthImage) -> Result<Option<i64>, DecodeError> {
        DepthReader::next_into(self, image)
    }

    fn intrinsics(&self) -> Option<Intrinsics> {
        self.calibration().map(|calibration| calibration.intrinsics())
    }

    fn background(&self) -> Option<&DepthImage> {
        DepthReader::background(self)
    }

    fn side_cameras(&self) -> Option<&[SideCamera; 2]> {
        DepthReader::side_cameras(self)
    }

    fn side_images(&self) -> Result<Option<SideImages>, DecodeError> {
        DepthReader::side_images(self)
    }

    fn declared_mount(&self) -> DeclaredMount {
        self.calibration().map_or_else(DeclaredMount::default, |calibration| DeclaredMount {
            height: calibration.camera_height_m,
            tilt: calibration.camera_tilt_deg.map(f64::to_radians),
        })
    }
}

/// Both legs in one frame.
#[derive(Debug, Clone, PartialEq)]
pub struct Legs {
    /// Hip, knee, ankle and toe of the left leg, then of the right, in `floor`, metres.
    pub points: [Vector3<f64>; POINTS],
    /// Standard deviations along the axes of `floor` as the images have them, without what differs from body to body,
    /// metres.
    pub deviations: [Vector3<f64>; POINTS],
    /// Velocities of the points, m/s.
    pub velocities: [Vector3<f64>; POINTS],
    /// Share of each segment's visible side that was seen: thigh, shank, foot of the left leg, then of the right.
    pub visibility: [f32; SEGMENTS],
    /// Share of the foreground that is on neither leg, 0 to 1.
    pub misfit: f64,
    /// True of a leg that has been out of sight for too long.
    pub lost: [bool; 2],
}

impl Legs {
    /// A point of a leg in `floor`, metres.
    pub fn point(&self, side: Side, point: LegPoint) -> &Vector3<f64> {
        &self.points[point.index(side)]
    }

    /// True when enough of the leg's shank and foot was seen.
    pub fn is_seen(&self, side: Side) -> bool {
        let at = 3 * side as usize;
        !self.lost[side as usize] && f64::from(self.visibility[at + 1].max(self.visibility[at + 2])) > SEEN_SHARE
    }

    fn exchange_sides(&mut self) {
        let half = POINTS / 2;
        for k in 0..half {
            self.points.swap(k, half + k);
            self.deviations.swap(k, half + k);
            self.velocities.swap(k, half + k);
        }
        for k in 0..SEGMENTS / 2 {
            self.visibility.swap(k, SEGMENTS / 2 + k);
        }
        self.lost.swap(0, 1);
    }
}

/// One frame of a tracked recording.
#[derive(Debug, Clone, PartialEq)]
pub struct TrackedFrame {
    /// Time, nanoseconds.
    pub time_ns: i64,
    /// The legs; none when there are none in the image.
    pub legs: Option<Legs>,
    /// True when the camera saw nothing, or something filled its image.
    pub blocked: bool,
}

/// A tracked recording.
#[derive(Debug, Clone, PartialEq)]
pub struct Track {
    /// The floor.
    pub floor: Floor,
    /// The camera.
    pub camera: Intrinsics,
    /// What the recording says of its mount.
    pub declared_mount: DeclaredMount,
    /// The legs' shape; none when there were no legs.
    pub shape: Option<ShapeVector>,
    /// Every frame of the recording.
    pub frames: Vec<TrackedFrame>,
    /// Effective sample size of a tracker with particles.
    pub effective_sample_size: Option<EffectiveSampleSize>,
    /// Mean share of pixels without depth, 0 to 1.
    pub missing: f64,
    /// Mean share of seen pixels that are as in the background, 0 to 1; none without a background.
    pub unchanged: Option<f64>,
}

/// Tracks a recording and finds its steps. The recording's digest is added to the provenance by the caller.
///
/// # Errors
/// [`PipelineError::Unsuitable`] says what the recording lacks; [`PipelineError::Defect`] where it is damaged;
/// [`PipelineError::Cancelled`] when the monitor was asked to stop.
pub fn assess(
    frames: impl DepthFrames,
    settings: &LegPoseSettings,
    monitor: &Monitor,
) -> Result<Assessment, PipelineError> {
    Ok(assess_watched(frames, settings, &mut |_, _| {}, monitor)?.0)
}

/// As [`assess`], with the track that the assessment rests on; `watch` sees each prepared frame.
///
/// # Errors
/// As [`assess`].
pub fn assess_watched(
    frames: impl DepthFrames,
    settings: &LegPoseSettings,
    watch: &mut dyn FnMut(i64, &Foreground),
    monitor: &Monitor,
) -> Result<(Assessment, Track), PipelineError> {
    let track = track(frames, settings, watch, monitor)?;
    monitor.begin(Step::Summarizing, 0)?;
    Ok((report::assessment(&track, settings)?, track))
}

/// Tracks a recording; `watch` sees each prepared frame.
///
/// # Errors
/// As [`assess`].
pub fn track(
    mut frames: impl DepthFrames,
    settings: &LegPoseSettings,
    watch: &mut dyn FnMut(i64, &Foreground),
    monitor: &Monitor,
) -> Result<Track, PipelineError> {
    let Some(camera) = frames.intrinsics() else {
        return Err(PipelineError::unsuitable(
            "no_calibration",
            "without the camera's intrinsics nothing can be measured; send `/depth/calibration`",
        ));
    };
    monitor.begin(Step::Calibrating, 0)?;
    let mut run = Run::start(&mut frames, camera, settings)?;
    let mut paper = None;
    if settings.mode == LegPoseMode::Paper {
        let background = frames.background().map(DepthImage::to_depth_map);
        let templates = settings.cues.has_colour().then(|| templates(&frames)).transpose()?;
        paper = Some(PaperRun::new(settings, camera, run.preparation.floor().clone(), background, templates));
    }
    while let Some((time_ns, foreground)) = run.next(&mut frames)? {
        watch(time_ns, &foreground);
        match &mut paper {
            Some(paper) => {
                run.count(time_ns, &foreground);
                // Of images that were read ahead, only the last one is of the time at which the sides are seen.
                let sees_sides = settings.cues.has_colour() && run.early.is_empty();
                let sides = if sees_sides { frames.side_images()? } else { None };
                paper.take(time_ns, &run.map, sides.as_ref());
            }
            None => run.take(time_ns, foreground),
        }
        monitor.advance(1)?;
    }
    Ok(run.finish(paper))
}

/// What the legs look like from the sides, for the colour cue.
fn templates(frames: &impl DepthFrames) -> Result<Templates, PipelineError> {
    frames.side_cameras().and_then(Templates::new).ok_or_else(|| {
        PipelineError::unsuitable(
            "no_side_images",
            "the cue `rgb` needs two colour cameras at the sides, calibrated and with legs labelled in their first images \
             (`/side/left`, `/side/right`), and the recording has none; depth alone is weighed by `distance`, `projection` \
             or `both`",
        )
    })
}

/// A recording half-way through.
struct Run {
    preparation: Preparation,
    image: DepthImage,
    map: DepthMap,
    /// Frames that wait for the shape.
    waiting: Vec<(i64, Foreground)>,
    waiting_with_legs: usize,
    /// Images that were read before the floor was known.
    early: std::collections::VecDeque<(i64, DepthMap)>,
    declared_mount: DeclaredMount,
    tracker: Option<(Tracker, ShapeVector)>,
    smoother: Smoother,
    /// Time of each frame, and whether it was blocked.
    times: Vec<(i64, bool)>,
    /// Time and legs of tracked frames, and whether a track begins with them.
    smoothed: Vec<(i64, Legs, bool)>,
    has_background: bool,
    /// What stands still, as long as it is being learned: without a background, until the tracker begins.
    static_scene: Option<StaticScene>,
    sums: [f64; 2],
}

impl Run {
    fn start(
        frames: &mut impl DepthFrames,
        camera: Intrinsics,
        settings: &LegPoseSettings,
    ) -> Result<Self, PipelineError> {
        let mut image = DepthImage::missing(0, 0, DepthUnit::Raw11);
        let background = frames.background().map(DepthImage::to_depth_map);
        let mut floor = background.as_ref().and_then(|map| Floor::find(map, &camera));
        let mut early = std::collections::VecDeque::new();
        if let Some(time_ns) = frames.next_into(&mut image)? {
            check_intrinsics(&camera, &image)?;
            early.push_back((time_ns, image.to_depth_map()));
        }
        if let (None, Some((_, map))) = (&floor, early.front()) {
            floor = Floor::find(map, &camera);
        }
        while floor.is_none() && early.len() < FLOOR_PATIENCE {
            let Some(time_ns) = frames.next_into(&mut image)? else { break };
            let map = image.to_depth_map();
            floor = Floor::find(&map, &camera);
            early.push_back((time_ns, map));
        }
        let Some(floor) = floor else {
            return Err(PipelineError::unsuitable(
                "no_floor",
                "no floor was found in the background or in the first images; the camera must see the floor before the \
                 user's feet, and its intrinsics must be its own",
            ));
        };
        let region = Region { depth: settings.depth_m, x: settings.x_m };
        let preparation = Preparation::new(camera, floor, region, background.as_ref());
        Ok(Self {
            has_background: background.is_some(),
            static_scene: background.is_none().then(|| StaticScene::new(preparation.stride())),
            preparation,
            image,
            map: DepthMap::empty(0, 0),
            waiting: Vec::new(),
            waiting_with_legs: 0,
            early,
            declared_mount: frames.declared_mount(),
            tracker: None,
            smoother: Smoother::default(),
            times: Vec::new(),
            smoothed: Vec::new(),
            sums: [0.0; 2],
        })
    }

    /// The next frame, prepared.
    fn next(&mut self, frames: &mut impl DepthFrames) -> Result<Option<(i64, Foreground)>, PipelineError> {
        let time_ns = if let Some((time_ns, map)) = self.early.pop_front() {
            self.map = map;
            time_ns
        } else {
            let Some(time_ns) = frames.next_into(&mut self.image)? else { return Ok(None) };
            self.image.write_depth(&mut self.map);
            time_ns
        };
        if let Some(scene) = &mut self.static_scene {
            scene.add(&self.map);
        }
        Ok(Some((time_ns, self.preparation.prepare(&self.map))))
    }

    /// Notes what is known of a frame whoever tracks it.
    fn count(&mut self, time_ns: i64, foreground: &Foreground) {
        self.times.push((time_ns, foreground.blocked));
        self.sums[0] += foreground.missing;
        self.sums[1] += foreground.unchanged;
    }

    /// Tracks a frame, or lets it wait until the shape is known.
    fn take(&mut self, time_ns: i64, foreground: Foreground) {
        self.count(time_ns, &foreground);
        if self.tracker.is_some() {
            self.track(time_ns, &foreground);
            return;
        }
        self.waiting_with_legs += usize::from(TwoLegs::find(&foreground.points).is_some());
        self.waiting.push((time_ns, foreground));
        let is_enough = self.waiting_with_legs >= CALIBRATION_FRAMES;
        if is_enough || (self.waiting.len() >= CALIBRATION_PATIENCE && self.waiting_with_legs > 0) {
            self.begin_tracking();
        } else if self.waiting.len() >= CALIBRATION_PATIENCE {
            // Nobody is there yet.
            self.waiting.clear();
        }
    }

    /// Finds the shape and catches up with the frames that waited for it.
    fn begin_tracking(&mut self) {
        if let Some(scene) = self.static_scene.take()
            && let Some(still) = scene.background(&self.preparation, self.map.width, self.map.height)
        {
            self.preparation.learn(still, self.map.width, self.waiting.iter_mut().map(|(_, foreground)| foreground));
        }
        let height = self.preparation.floor().camera_height;
        let used = self.waiting.iter().step_by(CALIBRATION_STRIDE);
        let used = used.map(|(time_ns, foreground)| (*time_ns, foreground.points.as_slice()));
        let shape = calibrate(height, used, &ShapePrior::people());
        self.tracker = Some((Tracker::new(height, shape), shape));
        for (time_ns, foreground) in std::mem::take(&mut self.waiting) {
            self.track(time_ns, &foreground);
        }
    }

    fn track(&mut self, time_ns: i64, foreground: &Foreground) {
        let Some((tracker, _)) = &mut self.tracker else { return };
        let mut ready = Vec::new();
        match tracker.advance(time_ns, &foreground.points) {
            Some(fit) => self.smoother.push(fit, &mut ready),
            None => self.smoother.finish(&mut ready),
        }
        self.keep(ready);
    }

    fn keep(&mut self, ready: Vec<SmoothedFrame>) {
        let Some((_, shape)) = &self.tracker else { return };
        let camera_height = self.preparation.floor().camera_height;
        self.smoothed.extend(ready.into_iter().map(|frame| {
            let legs = legs_of(&frame, shape, camera_height);
            (frame.fit.time_ns, legs, frame.fit.restarted)
        }));
    }

    /// The track; `paper` has the legs when the paper's tracker found them.
    fn finish(mut self, paper: Option<PaperRun>) -> Track {
        if self.tracker.is_none() && self.waiting_with_legs > 0 {
            self.begin_tracking();
        }
        let mut ready = Vec::new();
        self.smoother.finish(&mut ready);
        self.keep(ready);
        let paper = paper.map(PaperRun::finish);
        let mut shape = self.tracker.map(|(_, shape)| shape);
        let mut effective_sample_size = None;
        if let Some(paper) = paper {
            (self.smoothed, shape) = (paper.frames, paper.shape);
            effective_sample_size = paper.effective_sample_size;
        }
        put_sides_right(&mut self.smoothed);
        let mut tracked = self.smoothed.into_iter().peekable();
        let frames: Vec<TrackedFrame> = self
            .times
            .iter()
            .map(|&(time_ns, blocked)| TrackedFrame {
                time_ns,
                legs: tracked.next_if(|(time, ..)| *time == time_ns).map(|(_, legs, _)| legs),
                blocked,
            })
            .collect();
        let count = frames.len().max(1) as f64;
        Track {
            floor: self.preparation.floor().clone(),
            camera: *self.preparation.camera(),
            declared_mount: self.declared_mount,
            shape,
            frames,
            effective_sample_size,
            missing: self.sums[0] / count,
            unchanged: self.has_background.then_some(self.sums[1] / count),
        }
    }
}

/// Refuses intrinsics that cannot be those of the images' camera.
fn check_intrinsics(camera: &Intrinsics, image: &DepthImage) -> Result<(), PipelineError> {
    /// Where the optical axis of an image that is not cut out of another one may be, as a share of its sides.
    const CENTRE: std::ops::Range<f64> = 0.3..0.7;
    /// Angles of view of depth cameras, degrees: a Kinect v1 has 58, wide ones 120.
    const VIEW_DEG: std::ops::Range<f64> = 25.0..125.0;
    let (width, height) = (image.width as f64, image.height as f64);
    let view = 2.0 * (0.5 * width / camera.fx).atan().to_degrees();
    let is_own = CENTRE.contains(&(camera.cx / width))
        && CENTRE.contains(&(camera.cy / height))
        && VIEW_DEG.contains(&view)
        && (0.8..1.25).contains(&(camera.fx / camera.fy));
    if is_own {
        return Ok(());
    }
    Err(PipelineError::unsuitable(
        "intrinsics_mismatch",
        format!(
            "the intrinsics (fx {:.0}, fy {:.0}, cx {:.0}, cy {:.0} pixels) are not those of a camera with images of \
             {width} × {height} pixels; send those of the depth camera at this resolution",
            camera.fx, camera.fy, camera.cx, camera.cy
        ),
    ))
}

fn seconds(time_ns: i64) -> f64 {
    time_ns as f64 * 1e-9
}

fn legs_of(frame: &SmoothedFrame, shape: &ShapeVector, camera_height: f64) -> Legs {
    let place = |k: usize| (Side::BOTH[k / 4], LegPoint::ALL[k % 4]);
    let visibility: [f32; SEGMENTS] = std::array::from_fn(|s| {
        visibility(&frame.fit, shape, Side::BOTH[s / 3], LegSegment::ALL[s % 3], camera_height) as f32
    });
    // Of a leg behind the other one an edge is seen, if anything: whose edge that is, is a guess.
    let hidden = Side::BOTH.map(|side| {
        let shank = f64::from(visibility[3 * side as usize + LegSegment::Shank as usize]);
        HIDDEN_SD * (1.0 - shank / SLIVER_SHARE).max(0.0)
    });
    Legs {
        points: std::array::from_fn(|k| point_of(&frame.pose, place(k).0, place(k).1)),
        deviations: std::array::from_fn(|k| {
            let (side, point) = place(k);
            point_of(&frame.deviation, side, point).zip_map(&hidden[side as usize], f64::hypot)
        }),
        velocities: std::array::from_fn(|k| point_of(&frame.velocity, place(k).0, place(k).1)),
        visibility,
        misfit: frame.fit.misfit,
        lost: frame.fit.lost,
    }
}

/// Exchanges left and right where a track began with the legs crossed: over a track the left leg is on the right in the
/// image.
fn put_sides_right(frames: &mut [(i64, Legs, bool)]) {
    for track in frames.chunk_by_mut(|_, (.., begins)| !begins) {
        let apart: f64 = track
            .iter()
            .map(|(_, legs, _)| legs.point(Side::Left, LegPoint::Knee).x - legs.point(Side::Right, LegPoint::Knee).x)
            .sum();
        if apart < 0.0 {
            track.iter_mut().for_each(|(_, legs, _)| legs.exchange_sides());
        }
    }
}
