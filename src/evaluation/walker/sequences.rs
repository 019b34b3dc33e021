//! The walks that a tracker is judged on: what can make one hard, one thing at a time.

use crate::synthetic::walker::{Course, WalkerSettings};

/// Length of a sequence, seconds.
const DURATION_S: f64 = 9.0;

/// What makes a sequence differ from a plain walk of the same seed.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Condition {
    /// Person, gait, clothes and mount as the seed draws them.
    Plain,
    /// A turn by a quarter in the middle.
    Turn,
    /// Walking and standing by turns.
    StopAndGo,
    /// Slow, short steps.
    Shuffle,
    /// Fast, long steps.
    LongSteps,
    /// Feet close together, so that the near leg hides the far one.
    Narrow,
    /// A camera 0.75 to 1.05 m high that looks down by 25 to 40 degrees.
    HighCamera,
    /// A camera that is turned by up to 6 and rolled by up to 5 degrees.
    SkewedCamera,
    /// No image of the floor without the person.
    NoBackground,
    /// 30 % of the person's pixels are missing, in patches.
    Missing,
    /// Twice the random error of a Kinect v1, patterned trousers.
    Noisy,
    /// A person of 1.35 m.
    Small,
    /// A person of 2 m in wide trousers.
    Large,
}

impl Condition {
    /// Every condition.
    pub const ALL: [Condition; 13] = [
        Condition::Plain,
        Condition::Turn,
        Condition::StopAndGo,
        Condition::Shuffle,
        Condition::LongSteps,
        Condition::Narrow,
        Condition::HighCamera,
        Condition::SkewedCamera,
        Condition::NoBackground,
        Condition::Missing,
        Condition::Noisy,
        Condition::Small,
        Condition::Large,
    ];

    /// Name in tables.
    pub fn name(self) -> &'static str {
        match self {
            Condition::Plain => "plain",
            Condition::Turn => "turn",
            Condition::StopAndGo => "stop_and_go",
            Condition::Shuffle => "shuffle",
            Condition::LongSteps => "long_steps",
            Condition::Narrow => "narrow",
            Condition::HighCamera => "high_camera",
            Condition::SkewedCamera => "skewed_camera",
            Condition::NoBackground => "no_background",
            Condition::Missing => "missing",
            Condition::Noisy => "noisy",
            Condition::Small => "small",
            Condition::Large => "large",
        }
    }

    /// Whether the recording has an image of the floor without the person.
    pub fn has_background(self) -> bool {
        self != Condition::NoBackground
    }

    /// The walk of a seed under this condition.
    pub fn settings(self, seed: u64) -> WalkerSettings {
        let course = match self {
            Condition::Turn => Course::Turn,
            Condition::StopAndGo => Course::StopAndGo,
            _ => Course::Straight,
        };
        let mut settings = WalkerSettings::of_seed(course, seed);
        settings.duration_s = DURATION_S;
        // Somewhere in a range, differently for each seed: multiples of the golden ratio fill it evenly.
        let part = (seed as f64 * 0.618_033_988_749_895).fract();
        let between = |low: f64, high: f64| low + (high - low) * part;
        match self {
            Condition::Plain | Condition::Turn | Condition::StopAndGo | Condition::NoBackground => {}
            Condition::Shuffle => {
                settings = settings.with_speed(0.25);
                settings.stride.step_m = between(0.12, 0.2);
                settings.stride.step_s = settings.stride.step_m / 0.25;
            }
            Condition::LongSteps => settings = settings.with_speed(between(1.0, 1.3)),
            Condition::Narrow => settings.stride.width_m = between(0.03, 0.07),
            Condition::HighCamera => {
                // Above and behind the handles; the lower edge of the image still shows the toes.
                settings.mount.tilt = between(25.0_f64.to_radians(), 40.0_f64.to_radians());
                settings.mount.height_m = between(0.75, 1.05);
            }
            Condition::SkewedCamera => {
                settings.mount.yaw = between(-6.0_f64.to_radians(), 6.0_f64.to_radians());
                settings.mount.roll = between(5.0_f64.to_radians(), -5.0_f64.to_radians());
            }
            Condition::Missing => settings.errors.missing_share = 0.3,
            Condition::Noisy => {
                settings.errors.code_noise = 2.0;
                settings.clothes.holes = 0.15;
            }
            Condition::Small => settings.stature_m = 1.35,
            Condition::Large => {
                settings.stature_m = 2.0;
                settings.clothes.thickness_m = 0.015;
                settings.clothes.flare_m = 0.03;
            }
        }
        settings
    }
}
