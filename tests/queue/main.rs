//! The queue, driven by hand: nobody sleeps, time is turned, faults are injected.

mod claiming;
mod support;
mod working;
