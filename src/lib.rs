//! Surefoot: cloud assessment of human movement.
//!
//! People do balance and strength exercises in front of a depth camera; their app uploads the recording; workers
//! estimate what the body did; clinicians read the result.
//!
//! # The map
//!
//! A module uses only what stands above it in this list (`tests/layering.rs` checks it).
//!
//! | module | what it holds |
//! |---|---|
//! | [`geometry`] | rotations, camera, floor, solids |
//! | [`estimation`] | filters that know no body |
//! | [`signal`] | time series |
//! | [`progress`] | steps done, and the request to stop |
//! | [`config`] | what the operator can set |
//! | [`body`] | the human body as a model |
//! | [`recording`] | what a client uploads, decoded |
//! | [`assessment`] | what one pipeline found |
//! | [`gait`] | footfalls → gait measures |
//! | [`pipeline`] | recording → assessment, pure |
//! | [`protocol`] | exercises and tests: which movement, its repetitions, its measures |
//! | [`synthetic`] | recordings with known truth |
//! | [`evaluation`] | agreement with a reference |
//! | [`fall_risk`] | rules with id, unit, citation |
//! | [`report`] | what a clinician reads |
//! | [`storage`] | rows in SQLite or PostgreSQL, blobs of bytes |
//! | [`queue`] | durable jobs |
//! | [`worker`] | claim, load, assess, save |
//! | [`api`] | HTTP, one file per resource |
//! | [`pages`] | the clinician's pages: HTML, one file per page |
//! | [`cli`] | the commands |
//!
//! # One recording's journey
//!
//! `POST` → [`api`] streams the body to a blob and checks it while it arrives → one transaction: recording row and
//! job row → `202` and the job's address → [`queue`] wakes the [`worker`] → claim with a lease →
//! [`recording`] decodes → [`pipeline::assess`] on a blocking thread → one transaction: assessment and job done →
//! `GET` reads rows.
//!
//! # Sources
//!
//! - \[angles\]: joint angles by a particle filter over the joint positions of a depth sensor's skeleton.
//! - \[walker\]: leg pose of a walker user from depth images, tapered cylinders and a particle filter.
//! - \[fusion\]: camera skeleton fused with nine inertial sensors.

pub mod api;
pub mod assessment;
pub mod body;
pub mod cli;
pub mod config;
pub mod estimation;
pub mod evaluation;
pub mod fall_risk;
pub mod gait;
pub mod geometry;
pub mod pages;
pub mod pipeline;
pub mod progress;
pub mod protocol;
pub mod queue;
pub mod recording;
pub mod report;
pub mod signal;
pub mod storage;
pub mod synthetic;
pub mod worker;
