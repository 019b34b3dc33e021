//! Recordings with known truth.
