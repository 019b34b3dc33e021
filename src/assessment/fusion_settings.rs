//! What can be asked of the fusion of a camera skeleton with inertial units.

use crate::estimation::orientation_filter::OrientationMethod;
use serde::{Deserialize, Serialize};
use std::fmt;
use std::str::FromStr;
use utoipa::ToSchema;

/// How camera and inertial units are brought together.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default, Serialize, Deserialize, ToSchema)]
#[serde(rename_all = "snake_case")]
pub enum FusionMethod {
    /// The default: both are weighted by what each knows; mounting, heading and clocks are estimated from the recording.
    #[default]
    Fused,
    /// The paper's: bones of a reference skeleton, rotated by their units from the root outwards.
    Hierarchy,
    /// The camera alone, by the default method of joint angles.
    Camera,
    /// The inertial units alone.
    Inertial,
}

impl FusionMethod {
    /// Every method, the default first.
    pub const ALL: [FusionMethod; 4] = [Self::Fused, Self::Hierarchy, Self::Camera, Self::Inertial];

    /// Name in settings, tables and provenance.
    pub fn name(self) -> &'static str {
        match self {
            Self::Fused => "fused",
            Self::Hierarchy => "hierarchy",
            Self::Camera => "camera",
            Self::Inertial => "inertial",
        }
    }

    /// The orientation filter that the method takes when the settings name none.
    pub fn default_orientation(self) -> OrientationMethod {
        match self {
            Self::Hierarchy => OrientationMethod::Madgwick,
            _ => OrientationMethod::Smoother,
        }
    }
}

/// A fusion method that does not exist.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("`{0}` is no fusion method; there are fused, hierarchy, camera and inertial")]
pub struct UnknownFusionMethod(pub String);

impl FromStr for FusionMethod {
    type Err = UnknownFusionMethod;

    fn from_str(name: &str) -> Result<Self, Self::Err> {
        Self::ALL.into_iter().find(|m| m.name() == name).ok_or_else(|| UnknownFusionMethod(name.to_owned()))
    }
}

impl fmt::Display for FusionMethod {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

/// What is taken as known of how units sit on the body.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default, Serialize, Deserialize, ToSchema)]
#[serde(rename_all = "snake_case")]
pub enum Mounting {
    /// The recording decides: the scheme where a unit's movement agrees with it, otherwise nothing.
    #[default]
    Auto,
    /// The paper's scheme, give or take some degrees: X along the bone to the ground, Z to the inside of the limb; on the
    /// chest Z to the back.
    Scheme,
    /// Nothing: any rotation.
    Unknown,
}

/// Where the units' clocks come from.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default, Serialize, Deserialize, ToSchema)]
#[serde(rename_all = "snake_case")]
pub enum Clocks {
    /// Offset and drift of each unit from what camera and unit both saw. Where they show nothing of it the declared clock is
    /// taken, with a warning; a unit that contradicts the camera is left out.
    #[default]
    Estimated,
    /// As the recording declares them.
    Declared,
}

/// Settings of the fusion pipeline; every field has a default.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(default, deny_unknown_fields)]
pub struct SkeletonFusionSettings {
    /// How camera and units are brought together.
    pub method: FusionMethod,
    /// Orientation filter of the units. Null means `madgwick` for `hierarchy`, as the paper has it, and `smoother` for
    /// the others.
    pub orientation: Option<OrientationMethod>,
    /// Gain β of the orientation filter `madgwick`, rad/s, 0 to 10. Null means 0.033. Refused with other filters.
    #[schema(minimum = 0, maximum = 10)]
    pub gain: Option<f64>,
    /// Samples per second of the result, 1 to 1000, of which it can have a million. Null means the units' own rate, or as
    /// much of it as makes a million samples. Refused with the method `camera`, which gives the camera's frames.
    #[schema(minimum = 1, maximum = 1000)]
    pub rate_hz: Option<f64>,
    /// Where the units' clocks come from.
    pub clocks: Clocks,
    /// What is known of how the units sit.
    pub mounting: Mounting,
    /// Joints in which the camera's confidence is lower count as not seen, 0 to 1.
    #[schema(minimum = 0, maximum = 1)]
    pub min_confidence: f32,
}

impl Default for SkeletonFusionSettings {
    fn default() -> Self {
        Self {
            method: FusionMethod::Fused,
            orientation: None,
            gain: None,
            rate_hz: None,
            clocks: Clocks::Estimated,
            mounting: Mounting::Auto,
            min_confidence: 0.3,
        }
    }
}

impl SkeletonFusionSettings {
    /// The orientation filter that runs: the one asked for, or the method's own.
    pub fn chosen_orientation(&self) -> OrientationMethod {
        self.orientation.unwrap_or_else(|| self.method.default_orientation())
    }

    /// Name of a setting that was given and that nothing takes, and why not.
    pub fn unused(&self) -> Option<(&'static str, &'static str)> {
        if self.method == FusionMethod::Camera {
            let given = [
                ("orientation", self.orientation.is_some()),
                ("gain", self.gain.is_some()),
                ("rate_hz", self.rate_hz.is_some()),
            ];
            let (name, _) = given.into_iter().find(|(_, is_given)| *is_given)?;
            return Some((name, "is not of the method camera, which gives the camera's own frames; leave it out"));
        }
        let is_needless = self.gain.is_some() && self.chosen_orientation() != OrientationMethod::Madgwick;
        is_needless.then_some(("gain", "is of the orientation filter madgwick alone; choose it, or leave the gain out"))
    }
}
