//! Exercises and tests that a recording can hold: which movement it is, its repetitions, and what is measured of them.
//!
//! Pure: an `Assessment` in, a `Performance` out. [`motion`] puts angles and places on one grid; each protocol of
//! [`catalogue`] says which excursions of which angle are its repetitions ([`repetitions`], on [`transition`]) or which stand
//! is its hold ([`stance`]); `recognition` asks all of them, so that a movement declared as another one gets no numbers.
//!
//! A new protocol is a file in [`catalogue`] and a line in its `mod.rs`.

pub mod catalogue;
pub mod chair;
#[cfg(test)]
mod chair_tests;
mod info;
pub mod look;
pub mod measures;
pub mod motion;
pub mod places;
mod recognition;
pub mod repetitions;
pub mod stance;
pub mod transition;
pub mod walking;

pub use catalogue::PROTOCOLS;
pub use info::{MeasureSpec, ProtocolInfo, ProtocolKind, ProtocolMeasure, ProtocolSensor};
pub use recognition::{perform, recognize};

use crate::assessment::PerformanceMeasure;
use motion::Motion;
use repetitions::Found;

/// What a protocol's movement is made of.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Movement {
    /// Repetitions; at least so many are needed to recognise it.
    Repeated(usize),
    /// A stand that is held.
    Held,
    /// A walk.
    Walked,
}

/// An exercise or a test: what is known of it, and how it is found and measured.
#[derive(Debug, Clone, Copy)]
pub struct Protocol {
    /// Name in recordings.
    pub id: &'static str,
    /// Other names that mean the same.
    pub aliases: &'static [&'static str],
    /// Version of the rules of measurement.
    pub version: u32,
    /// Name for people.
    pub title: &'static str,
    /// Whether it trains or tests.
    pub kind: ProtocolKind,
    /// What to do, step by step.
    pub instructions: &'static [&'static str],
    /// What it must be recorded with.
    pub sensor: ProtocolSensor,
    /// True when it needs a chair.
    pub needs_chair: bool,
    /// Where the camera stands.
    pub view: &'static str,
    /// What is measured, in addition to what all of its kind have.
    pub measures: &'static [&'static [MeasureSpec]],
    /// How repetitions or holds are found.
    pub method: &'static str,
    /// Where the test is published.
    pub source: &'static str,
    /// What it is made of.
    pub movement: Movement,
    /// Finds it in a motion.
    pub find: fn(&Motion) -> Found,
    /// Measures what was found.
    pub measure: fn(&Motion, &Found) -> Vec<PerformanceMeasure>,
}

impl Protocol {
    /// What clients are told of it; `rules_of` names the rules about falls that look at a measure.
    pub fn info(&self, rules_of: impl Fn(&str) -> Vec<&'static str>) -> ProtocolInfo {
        let owned = |words: &[&str]| words.iter().map(|word| (*word).to_owned()).collect::<Vec<String>>();
        let measures = self.measures.iter().flat_map(|list| list.iter());
        let mut fall_risk_rules: Vec<String> = Vec::new();
        for rule in measures.clone().flat_map(|(name, ..)| rules_of(name)) {
            if !fall_risk_rules.iter().any(|known| known == rule) {
                fall_risk_rules.push(rule.to_owned());
            }
        }
        ProtocolInfo {
            id: self.id.to_owned(),
            aliases: owned(self.aliases),
            version: self.version,
            title: self.title.to_owned(),
            kind: self.kind,
            instructions: owned(self.instructions),
            sensor: self.sensor,
            needs_chair: self.needs_chair,
            view: self.view.to_owned(),
            measures: measures
                .map(|(name, unit, what)| ProtocolMeasure {
                    name: (*name).to_owned(),
                    unit: (*unit).to_owned(),
                    what: (*what).to_owned(),
                })
                .collect(),
            method: self.method.to_owned(),
            fall_risk_rules,
            source: self.source.to_owned(),
        }
    }
}

/// The protocol of an id or another name of it.
pub fn find(id: &str) -> Option<&'static Protocol> {
    PROTOCOLS.iter().copied().find(|protocol| protocol.id == id || protocol.aliases.contains(&id))
}

/// The protocols that give a measure.
pub fn protocols_measuring(measure: &str) -> Vec<&'static str> {
    let gives = |protocol: &&&Protocol| {
        protocol.measures.iter().flat_map(|list| list.iter()).any(|(name, ..)| *name == measure)
    };
    PROTOCOLS.iter().filter(gives).map(|protocol| protocol.id).collect()
}
