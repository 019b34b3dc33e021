//! Agreement of estimates with a reference.

pub mod agreement;
pub mod joint_angles;
pub mod reference;
pub mod signed_rank;
pub mod three_point;

pub use joint_angles::{Contender, Evaluation, Failure, Row, Trial, TrialSource};
