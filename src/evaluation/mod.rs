//! Agreement of estimates with a reference.

pub mod agreement;
pub mod contender;
pub mod error_analysis;
pub mod figures;
pub mod fusion;
pub mod gait;
pub mod hinge;
pub mod joint_angles;
pub mod orientation;
pub mod overview;
pub mod protocols;
pub mod reference;
pub mod rows;
pub mod segment_lengths;
pub mod signed_rank;
pub mod three_point;
pub mod trial;
pub mod verdict;
pub mod walker;

pub use contender::Contender;
pub use joint_angles::{MEASURE_NAMES, Outcomes};
pub use overview::OverviewRow;
pub use rows::{Evaluation, Failure, Row};
pub use trial::{Trial, TrialSource};
pub use verdict::Verdict;
