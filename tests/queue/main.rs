//! The queue, driven by hand: nobody sleeps, time is turned, faults are injected.

#![expect(clippy::unwrap_used, reason = "a test that cannot go on should stop where it stands, its helpers too")]

mod access;
mod claiming;
mod consent;
mod order;
mod support;
mod training;
mod working;
