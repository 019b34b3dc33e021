//! The REST API, asked through its real router on a temporary data directory. Every answer is compared with the
//! OpenAPI document on its way back.

mod assessments;
mod clients;
mod events;
mod health;
mod jobs;
mod patients;
mod problems;
mod recordings;
mod series;
mod serving;
mod sessions;
mod support;
mod upload_defects;
