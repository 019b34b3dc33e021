//! The clinician's pages: their routes in this process, and the whole of them in a real browser where one is installed.

#![expect(clippy::unwrap_used, reason = "all of this crate is tests; helpers of tests fail by panic too")]

mod api_with_cookie;
mod browser;
mod privacy;
mod reading;
mod sign_in;
mod support;
mod users;
