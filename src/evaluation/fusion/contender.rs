//! What is compared: a method of the pipeline, or the angle of the camera's own joints.

use crate::assessment::{FusionMethod, SkeletonFusionSettings};
use serde::{Serialize, Serializer};
use std::fmt;
use std::str::FromStr;

/// One line of a table.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Contender {
    /// The three-point angle of the recorded joints: the "Kinect" of \[fusion\] Table 1.
    Raw,
    /// A method of the pipeline.
    Method(FusionMethod),
}

impl Contender {
    /// From what the camera alone gives to the default.
    pub const ALL: [Contender; 5] = [
        Contender::Raw,
        Contender::Method(FusionMethod::Camera),
        Contender::Method(FusionMethod::Inertial),
        Contender::Method(FusionMethod::Hierarchy),
        Contender::Method(FusionMethod::Fused),
    ];

    /// Name in tables, which parses back.
    pub fn name(self) -> &'static str {
        match self {
            Contender::Raw => "raw",
            Contender::Method(method) => method.name(),
        }
    }

    /// Settings with which the pipeline runs this contender; none for the raw angle.
    pub fn settings(self, others: &SkeletonFusionSettings) -> Option<SkeletonFusionSettings> {
        match self {
            Contender::Raw => None,
            Contender::Method(method) => Some(SkeletonFusionSettings { method, ..others.clone() }),
        }
    }
}

/// A name that no contender has.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("`{name}` is not compared; there are {}", Contender::ALL.map(Contender::name).join(", "))]
pub struct UnknownContender {
    /// What was given.
    pub name: String,
}

impl FromStr for Contender {
    type Err = UnknownContender;

    fn from_str(name: &str) -> Result<Self, Self::Err> {
        let found = Self::ALL.into_iter().find(|contender| contender.name() == name);
        found.ok_or_else(|| UnknownContender { name: name.to_owned() })
    }
}

impl fmt::Display for Contender {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

impl Serialize for Contender {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.serialize_str(self.name())
    }
}
