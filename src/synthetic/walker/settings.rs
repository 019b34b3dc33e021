//! What is simulated: who walks how, and what the camera on the walker is like.

use super::camera::CameraMount;
use super::course::{Course, Stride, normal};
use super::kinect::SensorErrors;
use crate::geometry::camera::Intrinsics;
use crate::synthetic::SettingOutOfRange;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

/// Intrinsics of a Kinect v1's depth camera as its calibrations give them, pixels (f about 580 in 640 × 480).
pub const KINECT_V1: Intrinsics = Intrinsics { fx: 580.0, fy: 580.0, cx: 319.5, cy: 239.5 };

/// Pixels of the image.
pub const WIDTH: usize = 640;
/// See [`WIDTH`].
pub const HEIGHT: usize = 480;

/// The nearest floor point that the camera sees by default, metres in front of the user's pelvis: toes stay in sight.
const FLOOR_SEEN_AHEAD_M: f64 = 0.45;

/// The surface of the figure over its own: metres, and the share of its pixels that patterned cloth swallows.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Clothes {
    /// Thickness of the cloth.
    pub thickness_m: f64,
    /// Depth of its folds.
    pub folds_m: f64,
    /// By how much it stands off farther at the ankle than at the knee.
    pub flare_m: f64,
    /// Share of the cloth that is a pattern of holes of two to eight pixels, 0 to 0.3.
    pub holes: f64,
}

/// One walk in front of the camera of a walker.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct WalkerSettings {
    /// Seed of the steps' scatter, the walker's drift, the room and the sensor.
    pub seed: u64,
    /// Where the walk goes.
    pub course: Course,
    /// Length of the recording, seconds; 1 to 3600.
    pub duration_s: f64,
    /// Frames per second; 1 to 60.
    pub rate_hz: f64,
    /// Height of the person, metres; 1.2 to 2.1.
    pub stature_m: f64,
    /// How the person walks.
    pub stride: Stride,
    /// Largest share of its length to which a leg is stretched, 0.9 to 0.999.
    pub stretch: f64,
    /// The person's clothes.
    pub clothes: Clothes,
    /// The camera's place on the walker.
    pub mount: CameraMount,
    /// Its intrinsics.
    pub camera: Intrinsics,
    /// Its errors.
    pub errors: SensorErrors,
    /// Whether the walker's sides are in sight.
    pub has_frame: bool,
    /// Whether things stand in the room.
    pub has_things: bool,
}

impl WalkerSettings {
    /// A walk whose person, gait, camera mount and clothes are drawn from the seed: speeds of 0.3 to 1.0 m/s, statures of
    /// 1.5 to 1.9 m, tilts of 0 to 15 degrees.
    pub fn of_seed(course: Course, seed: u64) -> Self {
        let mut random = ChaCha8Rng::seed_from_u64(seed);
        let mut between = |low: f64, high: f64| random.random_range(low..=high);
        let speed = between(0.3, 1.0);
        // Slow walkers take short steps; the exponent is that of the walk ratio's fall with speed.
        let step_m = 0.55 * f64::sqrt(speed) * between(0.9, 1.1);
        let stride = Stride {
            step_m,
            asymmetry: between(-0.12, 0.12),
            width_m: between(0.08, 0.2),
            step_s: step_m / speed,
            // Both feet are down for 40 % of a slow gait cycle and for 24 % of a normal one.
            double_support: 0.40 - 0.16 * (speed - 0.3) / 0.7,
            left_first: between(0.0, 1.0) < 0.5,
        };
        let clothes = Clothes {
            thickness_m: between(0.0, 0.01),
            folds_m: between(0.0, 0.012),
            flare_m: between(0.0, 0.025),
            holes: between(0.0, 0.03),
        };
        let stature_m = between(1.5, 1.9);
        let stretch = between(0.95, 0.985);
        let (tilt, distance) = (between(0.0, 15.0), between(1.05, 1.3));
        let yaw = 1.0f64.to_radians() * normal(&mut random);
        Self {
            seed,
            course,
            duration_s: 20.0,
            rate_hz: 30.0,
            stature_m,
            stride,
            stretch,
            clothes,
            mount: mount(tilt.to_radians(), distance, yaw),
            camera: KINECT_V1,
            errors: SensorErrors { is_noisy: true, missing_share: 0.0, code_noise: 1.0 },
            has_frame: true,
            has_things: true,
        }
    }

    /// The same with the camera tilted otherwise, at the height from which it then sees the feet.
    pub fn with_tilt(mut self, tilt: f64) -> Self {
        self.mount = mount(tilt, self.mount.distance_m, self.mount.yaw);
        self
    }

    /// The same at another speed, metres a second, with the steps that go with it.
    pub fn with_speed(mut self, speed: f64) -> Self {
        self.stride.step_m = 0.55 * speed.max(0.0).sqrt();
        self.stride.step_s = self.stride.step_m / speed;
        self.stride.double_support = (0.40 - 0.16 * (speed - 0.3) / 0.7).clamp(0.15, 0.5);
        self
    }

    /// Checks the ranges.
    ///
    /// # Errors
    /// [`SettingOutOfRange`] names the first setting that is outside.
    pub fn check(&self) -> Result<(), SettingOutOfRange> {
        let ranges = [
            ("seconds", self.duration_s, 1.0, 3600.0),
            ("rate", self.rate_hz, 1.0, 60.0),
            ("stature", self.stature_m, 1.2, 2.1),
            ("step-length", self.stride.step_m, 0.05, 0.9),
            ("step-width", self.stride.width_m, -0.1, 0.5),
            ("step-time", self.stride.step_s, 0.3, 5.0),
            ("asymmetry", self.stride.asymmetry, -0.5, 0.5),
            ("double-support", self.stride.double_support, 0.05, 0.6),
            ("stretch", self.stretch, 0.9, 0.999),
            ("holes", self.clothes.holes, 0.0, 0.3),
            ("camera-height", self.mount.height_m, 0.1, 1.5),
            ("tilt-deg", self.mount.tilt.to_degrees(), -10.0, 45.0),
            ("roll-deg", self.mount.roll.to_degrees(), -20.0, 20.0),
            ("distance", self.mount.distance_m, 0.7, 2.0),
            ("missing", self.errors.missing_share, 0.0, 0.9),
            ("code-noise", self.errors.code_noise, 0.0, 10.0),
        ];
        for (name, value, low, high) in ranges {
            if !(low..=high).contains(&value) {
                return Err(SettingOutOfRange { name, value, low, high });
            }
        }
        Ok(())
    }
}

/// The mount with a tilt, at the height from which the lowest row of the image sees the floor in front of the user.
fn mount(tilt: f64, distance_m: f64, yaw: f64) -> CameraMount {
    let down = tilt + (KINECT_V1.cy / KINECT_V1.fy).atan();
    CameraMount { height_m: (distance_m - FLOOR_SEEN_AHEAD_M) * down.tan(), tilt, yaw, roll: 0.0, distance_m }
}
