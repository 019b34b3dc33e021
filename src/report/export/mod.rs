//! Series and places in the forms that other programs read. Text in, nothing is estimated here.

mod bvh;
mod csv;
mod mot;
mod samples;
mod trc;

pub use bvh::bvh;
pub use csv::csv;
pub use mot::mot;
pub use samples::Samples;
pub use trc::trc;

/// A form of export.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Form {
    /// Every channel with its interval and flags, as comma separated values.
    Csv,
    /// Joint angles as an OpenSim motion file.
    Mot,
    /// Joint places as an OpenSim marker file.
    Trc,
    /// Joint angles as a Biovision hierarchy.
    Bvh,
}

/// A result that cannot be written in a form.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("{0}")]
pub struct NotExportable(pub &'static str);
