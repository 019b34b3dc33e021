//! The methods of all pipelines by one name, for the command line.

use crate::assessment::{FusionMethod, LegPoseMode, Method};
use std::fmt;
use std::str::FromStr;

/// A method, and with it the pipeline that has it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum AnyMethod {
    /// Of the joint-angle pipeline.
    JointAngles(Method),
    /// Of the fusion pipeline.
    Fusion(FusionMethod),
    /// Of the leg-pose pipeline.
    LegPose(LegPoseMode),
}

/// A method that no pipeline has.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error(
    "`{0}` is no method; there are iekf, ukf, guided, particle, ik and nite for skeletons, fused, hierarchy, camera and \
     inertial for recordings with inertial units, and fitted and paper for depth images"
)]
pub(super) struct UnknownAnyMethod(String);

impl FromStr for AnyMethod {
    type Err = UnknownAnyMethod;

    fn from_str(name: &str) -> Result<Self, Self::Err> {
        let of_angles = name.parse().map(AnyMethod::JointAngles).ok();
        let of_fusion = || name.parse().map(AnyMethod::Fusion).ok();
        let of_legs = || name.parse().map(AnyMethod::LegPose).ok();
        of_angles.or_else(of_fusion).or_else(of_legs).ok_or_else(|| UnknownAnyMethod(name.to_owned()))
    }
}

impl fmt::Display for AnyMethod {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            AnyMethod::JointAngles(method) => method.fmt(f),
            AnyMethod::Fusion(method) => method.fmt(f),
            AnyMethod::LegPose(mode) => mode.fmt(f),
        }
    }
}
