//! What can be set of the paper's tracker.

use crate::assessment::LegCues;
use crate::body::legs::{FIRST_ANGLE, LEG_DIMENSION};
use crate::pipeline::leg_pose::foreground::Region;

/// The box of \[walker\], section 4.2: it belongs to the authors' walker.
pub const PAPER_REGION: Region = Region { depth: [0.0, 1.5], x: [-0.245, 0.175] };

/// Standard deviations of the transition's noise, manually set as in \[walker\]; radians, metres and factors per 1/30 s.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TransitionNoise {
    /// Distance between the hips.
    pub hip_distance: f64,
    /// Turn and elevation of the line of the hips.
    pub hip_direction: f64,
    /// Right hip along x, y and z.
    pub right_hip: f64,
    /// Lengths of thigh, calf and foot.
    pub length: f64,
    /// Both widths.
    pub width: f64,
    /// Hip flexion.
    pub hip_flexion: f64,
    /// Hip abduction and internal rotation.
    pub hip_sideways: f64,
    /// Knee flexion.
    pub knee: f64,
    /// Ankle dorsiflexion and inversion.
    pub ankle: f64,
}

impl Default for TransitionNoise {
    fn default() -> Self {
        Self {
            hip_distance: 0.001,
            hip_direction: 0.25f64.to_radians(),
            right_hip: 0.003,
            length: 0.001,
            width: 0.005,
            hip_flexion: 0.9f64.to_radians(),
            hip_sideways: 0.35f64.to_radians(),
            knee: 1.5f64.to_radians(),
            ankle: 1.0f64.to_radians(),
        }
    }
}

impl TransitionNoise {
    /// Standard deviation of each element of the state.
    pub fn by_element(&self) -> [f64; LEG_DIMENSION] {
        let mut sd = [0.0; LEG_DIMENSION];
        sd[0] = self.hip_distance;
        sd[1..3].fill(self.hip_direction);
        sd[3..6].fill(self.right_hip);
        sd[6..9].fill(self.length);
        sd[9..FIRST_ANGLE].fill(self.width);
        for hip in [11, 14] {
            sd[hip] = self.hip_flexion;
            sd[hip + 1..hip + 3].fill(self.hip_sideways);
        }
        sd[17..19].fill(self.knee);
        sd[19..LEG_DIMENSION].fill(self.ankle);
        sd
    }
}

/// Settings of the paper's tracker.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PaperSettings {
    /// Particles; rounded up to whole registers ([`LANES`](crate::geometry::lanes::LANES)).
    pub particles: usize,
    /// Cues that weigh them.
    pub cues: LegCues,
    /// Seed of the random numbers.
    pub seed: u64,
    /// Where legs are looked for.
    pub region: Region,
    /// Steps of raw depth by which the foreground differs from the background (\[walker\] sets it by hand).
    pub threshold_steps: f64,
    /// Noise of the transition.
    pub noise: TransitionNoise,
}

impl Default for PaperSettings {
    fn default() -> Self {
        Self {
            particles: 5000,
            cues: LegCues::Both,
            seed: 1,
            region: PAPER_REGION,
            threshold_steps: 4.0,
            noise: TransitionNoise::default(),
        }
    }
}
