//! Recordings with a reference, loaded when their turn comes.

use crate::recording::Recording;

/// One recording with a reference.
#[derive(Debug, Clone, PartialEq)]
pub struct Trial {
    /// Where it comes from, for example `uiprmd`.
    pub dataset: String,
    /// What was done, for example `m01_deep_squat`.
    pub exercise: String,
    /// The recording.
    pub recording: Recording,
}

/// A trial that is loaded when its turn comes, so that a large data set is never in memory as a whole.
pub struct TrialSource {
    /// Which recording, for messages.
    pub name: String,
    pub(super) load: Box<dyn Fn() -> Result<Trial, String> + Send + Sync>,
}

impl TrialSource {
    /// A trial that `load` reads or makes; its error is a sentence.
    pub fn new(name: impl Into<String>, load: impl Fn() -> Result<Trial, String> + Send + Sync + 'static) -> Self {
        Self { name: name.into(), load: Box::new(load) }
    }

    /// Reads or makes the trial.
    ///
    /// # Errors
    /// A sentence that says why it cannot be had.
    pub fn load(&self) -> Result<Trial, String> {
        (self.load)()
    }
}
