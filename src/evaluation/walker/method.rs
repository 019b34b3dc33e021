//! Ways of finding legs that are compared with each other.

use crate::assessment::{LegCues, LegPoseMode, LegPoseSettings};
use std::str::FromStr;

/// A way of finding a walker user's legs.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum WalkerMethod {
    /// Neither model nor filter: the foreground is split into two legs, and the lowest part of each is the foot.
    Baseline,
    /// The default of the pipeline.
    Fitted,
    /// The paper's particle filter with some of its cues.
    Paper(LegCues),
}

impl WalkerMethod {
    /// Every method: what the paper is compared with, then the paper's in the order of its Tables 2 and 3.
    pub const ALL: [WalkerMethod; 6] = [
        WalkerMethod::Baseline,
        WalkerMethod::Fitted,
        WalkerMethod::Paper(LegCues::Distance),
        WalkerMethod::Paper(LegCues::Projection),
        WalkerMethod::Paper(LegCues::Both),
        WalkerMethod::Paper(LegCues::Rgb),
    ];

    /// Name on the command line and in tables.
    pub fn name(self) -> &'static str {
        match self {
            WalkerMethod::Baseline => "baseline",
            WalkerMethod::Fitted => LegPoseMode::Fitted.name(),
            WalkerMethod::Paper(LegCues::Distance) => "cue1",
            WalkerMethod::Paper(LegCues::Projection) => "cue2",
            WalkerMethod::Paper(LegCues::Both) => "both",
            WalkerMethod::Paper(LegCues::Rgb) => "rgb",
        }
    }

    /// Settings of the pipeline; the baseline sees the frames that the default does.
    pub fn settings(self, particles: u32) -> LegPoseSettings {
        match self {
            WalkerMethod::Baseline | WalkerMethod::Fitted => LegPoseSettings::default(),
            WalkerMethod::Paper(cues) => {
                LegPoseSettings { mode: LegPoseMode::Paper, cues, particles, ..LegPoseSettings::default() }
            }
        }
    }
}

/// A method that there is not.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("`{0}` is no method; there are baseline, fitted, and of the paper cue1, cue2, both and rgb")]
pub struct UnknownWalkerMethod(pub String);

impl FromStr for WalkerMethod {
    type Err = UnknownWalkerMethod;

    fn from_str(name: &str) -> Result<Self, Self::Err> {
        Self::ALL.into_iter().find(|method| method.name() == name).ok_or_else(|| UnknownWalkerMethod(name.to_owned()))
    }
}
