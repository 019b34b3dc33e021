//! What can be asked of the tracker of a walker user's legs.

use serde::{Deserialize, Serialize};
use std::fmt;
use std::str::FromStr;
use utoipa::ToSchema;

/// How legs are tracked.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default, Serialize, Deserialize, ToSchema)]
#[serde(rename_all = "snake_case")]
pub enum LegPoseMode {
    /// The default: a model of two legs is fitted to the points of each frame; a pass back over the recording smooths.
    #[default]
    Fitted,
    /// The paper's particle filter over 23 elements.
    Paper,
}

/// What weighs the paper's particles.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default, Serialize, Deserialize, ToSchema)]
#[serde(rename_all = "snake_case")]
pub enum LegCues {
    /// Cue 1: distances between model and foreground points in space.
    Distance,
    /// Cue 2: depths of the model's projection against the image.
    Projection,
    /// The product of both.
    #[default]
    Both,
    /// The paper's comparison: colours and gradients in two cameras at the sides, which the recording must then have.
    Rgb,
}

impl LegCues {
    /// Every choice, in the order of the paper's tables.
    pub const ALL: [LegCues; 4] = [LegCues::Distance, LegCues::Projection, LegCues::Both, LegCues::Rgb];

    /// True when cue 1 counts.
    pub fn has_distance(self) -> bool {
        matches!(self, LegCues::Distance | LegCues::Both)
    }

    /// True when cue 2 counts.
    pub fn has_projection(self) -> bool {
        matches!(self, LegCues::Projection | LegCues::Both)
    }

    /// True when the cameras at the sides count.
    pub fn has_colour(self) -> bool {
        self == LegCues::Rgb
    }

    /// Name in settings and on the command line.
    pub fn name(self) -> &'static str {
        match self {
            LegCues::Distance => "distance",
            LegCues::Projection => "projection",
            LegCues::Both => "both",
            LegCues::Rgb => "rgb",
        }
    }
}

impl LegPoseMode {
    /// Both modes, the default first.
    pub const ALL: [LegPoseMode; 2] = [LegPoseMode::Fitted, LegPoseMode::Paper];

    /// Name in settings, tables and provenance.
    pub fn name(self) -> &'static str {
        match self {
            LegPoseMode::Fitted => "fitted",
            LegPoseMode::Paper => "paper",
        }
    }
}

/// A way of tracking legs that does not exist.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error(
    "`{0}` is no way of tracking legs; there are fitted and paper, with the cues distance, projection, both and rgb"
)]
pub struct UnknownLegPoseMode(pub String);

impl FromStr for LegPoseMode {
    type Err = UnknownLegPoseMode;

    fn from_str(name: &str) -> Result<Self, Self::Err> {
        Self::ALL.into_iter().find(|m| m.name() == name).ok_or_else(|| UnknownLegPoseMode(name.to_owned()))
    }
}

impl FromStr for LegCues {
    type Err = UnknownLegPoseMode;

    fn from_str(name: &str) -> Result<Self, Self::Err> {
        Self::ALL.into_iter().find(|m| m.name() == name).ok_or_else(|| UnknownLegPoseMode(name.to_owned()))
    }
}

impl fmt::Display for LegPoseMode {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

/// Settings of the leg-pose pipeline; every field has a default.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(default, deny_unknown_fields)]
pub struct LegPoseSettings {
    /// How legs are tracked.
    pub mode: LegPoseMode,
    /// What weighs the particles of `paper`.
    pub cues: LegCues,
    /// Particles of `paper`, 64 to 65536.
    #[schema(minimum = 64, maximum = 65536)]
    pub particles: u32,
    /// Seed of the random streams of `paper`, at most 2^53 - 1.
    #[schema(maximum = 9_007_199_254_740_991_i64)]
    pub seed: u64,
    /// Where legs are looked for, in the camera's axes, metres: nearest and farthest z.
    pub depth_m: [f64; 2],
    /// Where legs are looked for: leftmost and rightmost x in the image, metres.
    pub x_m: [f64; 2],
}

impl Default for LegPoseSettings {
    /// A region that is wide enough for any walker. The paper's box (z up to 1.5, x from -0.245 to 0.175) is that of its
    /// own camera.
    fn default() -> Self {
        Self {
            mode: LegPoseMode::Fitted,
            cues: LegCues::Both,
            particles: 5000,
            seed: 1,
            depth_m: [0.3, 1.9],
            x_m: [-0.5, 0.5],
        }
    }
}
