//! The human body as a model: joints, the linked skeleton, ranges of motion, anatomical angles.

pub mod joint;

pub use joint::{Joint, Side};
