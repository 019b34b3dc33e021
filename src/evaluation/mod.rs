//! Agreement of estimates with a reference.

pub mod agreement;
pub mod contender;
pub mod error_analysis;
pub mod joint_angles;
pub mod reference;
pub mod rows;
pub mod signed_rank;
pub mod three_point;
pub mod trial;

pub use contender::Contender;
pub use rows::{Evaluation, Failure, Row};
pub use trial::{Trial, TrialSource};
