//! From depth images to leg poses, frame by frame.
//!
//! A track starts by itself: the first state ([`first_state`]) is spread wide and the filter is run several times
//! on the same image, with noise that falls and a likelihood that rises to its full power. A track whose model stays far
//! from the image is given up and started anew.
//!
//! With the colour cue the first pose of a track is that of both depth cues, where the paper's first image is labelled by
//! hand; from then on depth says nothing, and so the track is not given up either.

use super::colour_cue::{ColourCue, Templates};
use super::foreground::Foreground;
use super::model::{Fit, LegParticleModel, Observation, PARTICLE_DIMENSION};
use super::settings::PaperSettings;
use super::start::first_state;
use super::visibility::Visibility;
use crate::assessment::LegCues;
use crate::body::legs::constraints::stand;
use crate::body::legs::{LEG_DIMENSION, LegPose, LegState, LegVector, forward_kinematics};
use crate::estimation::particle_filter::ParticleFilter;
use crate::geometry::camera::{DepthMap, Intrinsics};
use crate::geometry::floor::Floor;
use crate::geometry::lanes::LANES;
use crate::recording::side_camera::SideImages;
use nalgebra::{SMatrix, Vector3};

/// Nominal interval between frames, seconds.
const INTERVAL_S: f64 = 1.0 / 30.0;
/// After a longer gap the track is started anew, seconds: a leg can be anywhere after half a step.
const LONGEST_GAP_S: f64 = 0.5;
/// Rounds of the search: noise relative to the transition's, and power of the likelihood.
const SEARCH: [(f64, f64); 10] = [
    (16.0, 0.05),
    (12.0, 0.1),
    (10.0, 0.15),
    (8.0, 0.25),
    (6.0, 0.4),
    (4.0, 0.5),
    (3.0, 0.7),
    (2.0, 1.0),
    (1.5, 1.0),
    (1.0, 1.0),
];
/// Mean distance of cue 1 beyond which the estimate is not on the legs, metres. Provisional: half of a calf's width.
const LOST_DISTANCE: f64 = 0.030;
/// Frames in a row after which the track is given up.
const LOST_FRAMES: u32 = 5;
/// Fewest foreground pixels, as a share of the image, that a track is continued on.
const LEAST_FOREGROUND: f64 = 0.004;

/// What is known of the legs in one frame.
#[derive(Debug, Clone, PartialEq)]
pub struct LegEstimate {
    /// Time of the frame, nanoseconds.
    pub time_ns: i64,
    /// Joints in `sensor`, metres.
    pub legs: LegPose,
    /// The state that they are of: the mean of the particles.
    pub state: LegState,
    /// Standard deviation of the joints (in the order of [`LegPose::joints`]) over the particles along x, y and z of
    /// `sensor`, metres. It says how sharp the likelihood is, not how near to the truth the model comes.
    pub joint_sd: [Vector3<f64>; 8],
    /// Effective sample size before resampling, particles.
    pub effective_sample_size: f64,
    /// How well the estimate fits the image.
    pub fit: Fit,
    /// What the image shows of it.
    pub visibility: Visibility,
    /// Pixels of the foreground.
    pub foreground_pixels: usize,
    /// Share of the image that saw nothing, 0 to 1.
    pub missing: f64,
    /// True when the track was started in this frame.
    pub started: bool,
}

/// Why a frame has no estimate.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
pub enum NoEstimate {
    /// The image is not of the camera's size.
    #[error("the image has another size than the background")]
    WrongSize,
    /// The frame is not later than the one before it.
    #[error("the frame is not later than the one before it")]
    OutOfOrder,
    /// There is nobody in the region, or the camera does not see.
    #[error("too few pixels of the image belong to legs")]
    NoForeground,
    /// The colour cue is asked for, and the cameras at the sides saw nothing at the time of the image.
    #[error("no image of the cameras at the sides belongs to this one")]
    NoColour,
    /// What is in the region is not two legs.
    #[error("what the image shows is not two legs")]
    NotTwoLegs,
}

/// A track between two frames.
#[derive(Debug, Clone)]
struct Track {
    filter: ParticleFilter,
    time_ns: i64,
    frames_lost: u32,
}

/// The paper's tracker. The same frames give the same estimates on any number of threads.
#[derive(Debug, Clone)]
pub struct Tracker {
    settings: PaperSettings,
    camera: Intrinsics,
    floor: Floor,
    background: DepthMap,
    model: LegParticleModel,
    track: Option<Track>,
    templates: Option<Templates>,
    /// What the cameras at the sides see at the time of the next image.
    colour: Option<ColourCue>,
    last_time_ns: Option<i64>,
    /// Tracks so far: each has its own random numbers.
    starts: u64,
}

impl Tracker {
    /// A tracker for a camera over a floor; `background` is the image of the floor without anybody, all zero when there is
    /// none.
    pub fn new(settings: PaperSettings, camera: Intrinsics, floor: Floor, background: DepthMap) -> Self {
        let model = LegParticleModel::new(floor, settings.cues, &settings.noise);
        Self {
            settings,
            camera,
            floor,
            background,
            model,
            track: None,
            templates: None,
            colour: None,
            last_time_ns: None,
            starts: 0,
        }
    }

    /// The same, knowing what legs look like from the sides.
    #[must_use]
    pub fn with_templates(self, templates: Option<Templates>) -> Self {
        Self { templates, ..self }
    }

    /// Takes what the cameras at the sides see at the time of the next image.
    pub fn see_sides(&mut self, images: &SideImages) {
        self.colour = self.templates.as_ref().map(|templates| templates.cue(images));
    }

    /// The foreground of an image, as the tracker sees it.
    ///
    /// # Errors
    /// [`NoEstimate::WrongSize`].
    pub fn foreground(&self, image: &DepthMap) -> Result<Foreground, NoEstimate> {
        let DepthMap { width, height, .. } = self.background;
        if (image.width, image.height) != (width, height) || image.depth.len() != width * height {
            return Err(NoEstimate::WrongSize);
        }
        let PaperSettings { region, threshold_steps, .. } = &self.settings;
        Ok(Foreground::find(image, &self.background, &self.camera, region, *threshold_steps))
    }

    /// The next frame.
    ///
    /// # Errors
    /// Says why the frame has no estimate; the next one may have one.
    pub fn step(&mut self, time_ns: i64, image: &DepthMap) -> Result<LegEstimate, NoEstimate> {
        let foreground = self.foreground(image)?;
        if self.last_time_ns.is_some_and(|last| time_ns <= last) {
            return Err(NoEstimate::OutOfOrder);
        }
        self.last_time_ns = Some(time_ns);
        let least = (LEAST_FOREGROUND * (image.width * image.height) as f64) as usize;
        if foreground.pixels < least {
            return Err(NoEstimate::NoForeground);
        }
        let colour = self.colour.take();
        if self.settings.cues.has_colour() && colour.is_none() {
            return Err(NoEstimate::NoColour);
        }
        let observation = Observation::new(foreground, self.camera).ok_or(NoEstimate::NoForeground)?;
        let observation = observation.with_colour(colour);
        if let Some(track) = self.track.take()
            && let Some(estimate) = self.follow(track, time_ns, &observation)
        {
            return Ok(estimate);
        }
        self.start(time_ns, &observation)
    }

    /// Continues a track; `None` when it ends.
    fn follow(&mut self, mut track: Track, time_ns: i64, observation: &Observation) -> Option<LegEstimate> {
        let interval_s = (time_ns - track.time_ns) as f64 * 1e-9;
        if interval_s > LONGEST_GAP_S {
            return None;
        }
        track.filter.step(&mut self.model, interval_s, Some(observation));
        track.time_ns = time_ns;
        let estimate = self.estimate(&track, observation, false);
        let distance = estimate.fit.distances.mean();
        let is_far = !self.settings.cues.has_colour() && (distance.is_nan() || distance >= LOST_DISTANCE);
        track.frames_lost = if is_far { track.frames_lost + 1 } else { 0 };
        if track.frames_lost >= LOST_FRAMES {
            return None;
        }
        self.track = Some(track);
        Some(estimate)
    }

    /// Starts a track on one image.
    fn start(&mut self, time_ns: i64, observation: &Observation) -> Result<LegEstimate, NoEstimate> {
        let state = first_state(&observation.foreground().points, &self.floor).ok_or(NoEstimate::NotTwoLegs)?;
        let mut coordinates = state.to_vector().as_slice().to_vec();
        coordinates.resize(PARTICLE_DIMENSION, 0.0);
        let count = self.settings.particles.next_multiple_of(LANES).max(LANES);
        let seed = self.settings.seed.wrapping_add(self.starts.rotate_left(32));
        self.starts += 1;
        let mut filter = ParticleFilter::new(&coordinates, count, seed);
        self.model.moves = false;
        if self.settings.cues.has_colour() {
            self.model.cues = LegCues::Both;
        }
        for (noise, power) in SEARCH {
            self.model.noise_factor = noise;
            self.model.likelihood_power = power;
            filter.step(&mut self.model, INTERVAL_S, Some(observation));
        }
        self.model.cues = self.settings.cues;
        self.model.moves = true;
        self.model.noise_factor = 1.0;
        self.model.likelihood_power = 1.0;
        let track = Track { filter, time_ns, frames_lost: 0 };
        let estimate = self.estimate(&track, observation, true);
        self.track = Some(track);
        Ok(estimate)
    }

    fn estimate(&self, track: &Track, observation: &Observation, started: bool) -> LegEstimate {
        let moments = track.filter.moments();
        let mean = LegVector::from_fn(|i, _| moments.mean[i]);
        let (state, legs, solids) = stand(&LegState::from_vector(&mean), &self.floor);
        let covariance: SMatrix<f64, LEG_DIMENSION, LEG_DIMENSION> =
            moments.covariance.fixed_view::<LEG_DIMENSION, LEG_DIMENSION>(0, 0).into_owned();
        LegEstimate {
            time_ns: track.time_ns,
            legs,
            joint_sd: joint_sd(&state, &covariance, &self.floor),
            state,
            effective_sample_size: moments.effective_sample_size,
            fit: self.model.fit(observation, &state),
            visibility: Visibility::new(observation.foreground(), &solids, &self.camera),
            foreground_pixels: observation.foreground().pixels,
            missing: observation.foreground().missing,
            started,
        }
    }
}

/// Standard deviation of the joints from the covariance of the state, by differences of the forward kinematics.
fn joint_sd(
    state: &LegState,
    covariance: &SMatrix<f64, LEG_DIMENSION, LEG_DIMENSION>,
    floor: &Floor,
) -> [Vector3<f64>; 8] {
    /// Step of the differences: far above rounding, far below any curvature; metres, radians and factors.
    const STEP: f64 = 1e-5;
    let x = state.to_vector();
    let joints = |x: &LegVector| forward_kinematics(&LegState::from_vector(x), floor).joints();
    let at = joints(&x);
    let mut jacobian = SMatrix::<f64, 24, LEG_DIMENSION>::zeros();
    for element in 0..LEG_DIMENSION {
        let mut moved = x;
        moved[element] += STEP;
        for (joint, place) in joints(&moved).iter().enumerate() {
            jacobian.fixed_view_mut::<3, 1>(3 * joint, element).copy_from(&((place - at[joint]) / STEP));
        }
    }
    let spread = jacobian * covariance * jacobian.transpose();
    std::array::from_fn(|joint| {
        Vector3::from_fn(|axis, _| spread[(3 * joint + axis, 3 * joint + axis)].max(0.0).sqrt())
    })
}

#[cfg(test)]
mod tests;
