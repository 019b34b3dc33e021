//! Agreement of estimates with a reference.
