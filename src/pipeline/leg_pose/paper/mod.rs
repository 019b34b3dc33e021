//! The paper's tracker: a particle filter over the 23-element leg state, weighed by two cues (\[walker\]).

pub mod colour_cue;
pub mod distance_cue;
pub mod foreground;
pub mod model;
pub mod projection_cue;
pub mod render;
pub mod run;
pub mod settings;
pub mod start;
pub mod tracker;
pub mod visibility;

#[cfg(test)]
mod scene;

pub use foreground::Foreground;
pub use model::Fit;
pub use run::{PaperResult, PaperRun};
pub use settings::{PAPER_REGION, PaperSettings, TransitionNoise};
pub use tracker::{LegEstimate, NoEstimate, Tracker};
