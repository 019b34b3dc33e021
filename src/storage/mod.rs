//! SQLite rows and blobs of bytes.
