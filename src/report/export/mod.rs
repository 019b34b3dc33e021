//! Series and places in the forms that other programs read. Nothing is estimated here.
//!
//! An export is made piece by piece, so that its text is never in memory as a whole.

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

use std::ops::Range;

/// Rows of one piece.
const PIECE_ROWS: usize = 256;

/// A text that is made piece by piece.
pub struct Export {
    head: String,
    n_rows: usize,
    rows: Box<dyn Fn(Range<usize>) -> String + Send>,
}

impl std::fmt::Debug for Export {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Export").field("n_rows", &self.n_rows).finish_non_exhaustive()
    }
}

impl Export {
    fn new(head: String, n_rows: usize, rows: impl Fn(Range<usize>) -> String + Send + 'static) -> Self {
        Self { head, n_rows, rows: Box::new(rows) }
    }

    /// The pieces of the text, in order.
    pub fn pieces(self) -> impl Iterator<Item = String> + Send {
        let Self { head, n_rows, rows } = self;
        let ranges = (0..n_rows).step_by(PIECE_ROWS).map(move |start| start..n_rows.min(start + PIECE_ROWS));
        std::iter::once(head).chain(ranges.map(rows))
    }
}

/// A result that cannot be written in a form.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("{0}")]
pub struct NotExportable(pub &'static str);
