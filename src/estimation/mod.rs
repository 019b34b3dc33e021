//! Filters that know no body: state-space models in, estimates out.
