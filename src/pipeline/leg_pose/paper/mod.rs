//! The paper's tracker: a particle filter over the 23-element leg state, weighed by two cues (\[walker\]).

pub mod distance_cue;
pub mod foreground;
pub mod model;
pub mod projection_cue;
pub mod render;
pub mod settings;
pub mod start;
pub mod tracker;

#[cfg(test)]
mod scene;

pub use foreground::Foreground;
pub use model::Fit;
pub use settings::{Cues, PaperSettings, Region, TransitionNoise};
pub use tracker::{LegEstimate, NoEstimate, Tracker};
