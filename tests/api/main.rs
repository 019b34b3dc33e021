//! The REST API, asked through its real router on a temporary data directory. Every answer is compared with the
//! OpenAPI document on its way back.

#![expect(clippy::unwrap_used, reason = "all of this crate is tests; helpers of tests fail by panic too")]

mod assessments;
mod audit;
mod authorisation;
mod clients;
#[path = "../common/mod.rs"]
mod common;
mod consents;
mod crowd;
mod erasures;
mod events;
mod fall_risk;
mod fusion;
mod health;
mod hostile_http;
mod jobs;
mod leg_pose;
mod noise_models;
mod oidc;
mod patient_calibration;
mod patient_export;
mod patients;
mod performance;
mod problems;
mod rates;
mod recordings;
mod report;
mod resumable;
mod series;
mod serving;
mod sessions;
mod shares;
mod support;
mod upload_defects;
mod users;
