//! The part of `surefoot simulate` that is about inertial units, other people's motions and a camera whose view is
//! blocked.

use super::Args;
use crate::body::Bone;
use crate::recording::{Format, Limits, Segment, decode};
use crate::synthetic::inertial::clock::ClockErrors;
use crate::synthetic::inertial::errors::UnitErrors;
use crate::synthetic::inertial::mounting::Mounting;
use crate::synthetic::inertial::protocol::Protocol;
use crate::synthetic::inertial::tissue::TissueSettings;
use crate::synthetic::movement::recorded::RecordedMotion;
use crate::synthetic::{FusionSimulation, Movement, Preset};
use anyhow::{Context, bail};
use std::fs;
use std::ops::Range;
use std::path::Path;
use std::str::FromStr;
use std::sync::Arc;

#[derive(Debug, clap::Args)]
#[command(next_help_heading = "Inertial units")]
pub(super) struct FusionArgs {
    /// Add inertial units at 256 Hz, and the protocol before the movement: units on a plank, putting on, T-posture, five
    /// vertical jumps
    #[arg(long)]
    pub(super) imu: bool,
    /// Segments with a unit, separated by commas, or all: chest, left_upper_arm, left_forearm, left_thigh, left_shank and
    /// the same with right_
    #[arg(long, default_value = "all", value_name = "SEGMENTS", requires = "imu")]
    units: Units,
    /// Start with the units on the body
    #[arg(long, requires = "imu")]
    no_plank: bool,
    /// Leave the jumps out
    #[arg(long, requires = "imu")]
    no_jumps: bool,
    /// Angle by which each unit is turned against the mounting scheme, degrees: one number or LOWEST..HIGHEST
    #[arg(long, default_value = "5..10", value_name = "DEGREES", requires = "imu")]
    misalignment_deg: Degrees,
    /// How units sit on their segments: by the paper's scheme, or any way round
    #[arg(long, value_enum, default_value_t = MountingName::Scheme, requires = "imu")]
    mounting: MountingName,
    /// Segments whose unit is upside down against the scheme
    #[arg(long, value_name = "SEGMENTS", requires = "imu")]
    upside_down: Option<Units>,
    /// Largest offset of a unit's clock against the camera's, either way, seconds
    #[arg(long, default_value_t = ClockErrors::default().offset_s, value_name = "SECONDS", requires = "imu")]
    clock_offset_s: f64,
    /// Largest drift of a unit's clock, either way, millionths
    #[arg(long, default_value_t = ClockErrors::default().drift_ppm, value_name = "PPM", requires = "imu")]
    drift_ppm: f64,
    /// Units without bias, noise, gaps and soft tissue under them
    #[arg(long, requires = "imu")]
    ideal_units: bool,
}

impl FusionArgs {
    /// The simulation of a movement.
    pub(super) fn simulation(&self, args: &Args, movement: Movement) -> FusionSimulation {
        let usual = FusionSimulation::new(movement, args.seed);
        let default_s = match &usual.movement {
            Movement::Recorded(motion) => motion.pass_s().max(super::DEFAULT_S),
            _ => super::DEFAULT_S,
        };
        let (errors, tissue) = match self.ideal_units {
            true => (UnitErrors::NONE, TissueSettings::RIGID),
            false => (usual.errors, usual.tissue),
        };
        let protocol = match self.imu {
            true => Protocol { plank: !self.no_plank, jumps: if self.no_jumps { 0 } else { Protocol::FULL.jumps } },
            false => Protocol::NONE,
        };
        FusionSimulation {
            movement_s: args.seconds.unwrap_or(default_s),
            protocol,
            units: if self.imu { self.units.0.clone() } else { Vec::new() },
            upside_down: self.upside_down.as_ref().map_or_else(Vec::new, |units| units.0.clone()),
            mounting: match self.mounting {
                MountingName::Scheme => Mounting::Scheme(self.misalignment_deg.0.clone()),
                MountingName::Arbitrary => Mounting::Arbitrary,
            },
            errors,
            tissue,
            clocks: ClockErrors { offset_s: self.clock_offset_s, drift_ppm: self.drift_ppm },
            camera: args.noise.unwrap_or(if self.imu { Preset::KinectOffset } else { super::DEFAULT_NOISE }),
            camera_rate_hz: args.rate,
            camera_jitter: args.jitter,
            occlusion_s: args.occlusion,
            stature_m: args.stature,
            yaw_deg: args.yaw_deg,
            ..usual
        }
    }
}

/// The motion of a recording.
pub(super) fn motion_of(path: &Path) -> anyhow::Result<Movement> {
    let place = || format!("cannot take the motion of {}", path.display());
    let bytes = fs::read(path).with_context(place)?;
    let Some(format) = Format::sniff(&bytes) else { bail!("{} is neither MCAP nor JSON", path.display()) };
    let recording = decode(&bytes[..], format, &Limits::default()).with_context(place)?;
    Ok(Movement::Recorded(Arc::new(RecordedMotion::fit(&recording).with_context(place)?)))
}

#[derive(Debug, Clone, Copy, clap::ValueEnum)]
enum MountingName {
    /// By the paper's scheme, turned by the misalignment
    Scheme,
    /// Any way round
    Arbitrary,
}

/// Bones that carry a unit.
#[derive(Debug, Clone, PartialEq)]
struct Units(Vec<Bone>);

impl FromStr for Units {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        if text == "all" {
            return Ok(Self(Bone::ALL.to_vec()));
        }
        let bone = |name: &str| {
            let segment: Segment = name.trim().parse().map_err(|error| format!("{error}"))?;
            segment.bone().ok_or_else(|| format!("`{segment}` is not simulated; the nine segments of the skeleton are"))
        };
        text.split(',').map(bone).collect::<Result<_, _>>().map(Self)
    }
}

/// A range of angles, degrees.
#[derive(Debug, Clone, PartialEq)]
struct Degrees(Range<f64>);

impl FromStr for Degrees {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let number = |text: &str| text.trim().parse::<f64>().map_err(|_| format!("`{text}` is not a number"));
        let (low, high) = text.split_once("..").unwrap_or((text, text));
        Ok(Self(number(low)?..number(high)?))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::body::Limb;

    #[test]
    fn units_are_named_by_their_segment_and_unknown_ones_refused() {
        assert_eq!("all".parse::<Units>().map(|units| units.0.len()), Ok(9));
        let named = Units(vec![Bone::Proximal(Limb::LeftLeg), Bone::Trunk]);
        assert_eq!("left_thigh, chest".parse(), Ok(named));
        assert!("left_tail".parse::<Units>().is_err() && "left_foot".parse::<Units>().is_err());
    }

    #[test]
    fn an_angle_or_a_range_of_angles_is_read() {
        assert_eq!("5..10".parse(), Ok(Degrees(5.0..10.0)));
        assert_eq!("7".parse(), Ok(Degrees(7.0..7.0)));
        assert!("5..".parse::<Degrees>().is_err());
    }
}
