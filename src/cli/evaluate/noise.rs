//! The sensors of simulated exercises, as given on the command line.

use crate::synthetic::Preset;
use crate::synthetic::sensor::UnknownPreset;
use std::str::FromStr;

/// One or more presets in the order of [`Preset::ALL`], each once.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct Noise(pub(super) Vec<Preset>);

impl FromStr for Noise {
    type Err = UnknownPreset;

    fn from_str(text: &str) -> Result<Self, Self::Err> {
        if text == "all" {
            return Ok(Self(Preset::OF_JOINT_ANGLES.to_vec()));
        }
        let given = text.split(',').map(str::parse).collect::<Result<Vec<Preset>, _>>()?;
        Ok(Self(Preset::ALL.into_iter().filter(|preset| given.contains(preset)).collect()))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn several_presets_or_all_are_taken_once_each_and_unknown_ones_refused() {
        assert_eq!("failures,clean,failures".parse(), Ok(Noise(vec![Preset::Clean, Preset::Failures])));
        assert_eq!("all".parse(), Ok(Noise(Preset::OF_JOINT_ANGLES.to_vec())));
        assert!("table1,".parse::<Noise>().is_err() && "fog".parse::<Noise>().is_err());
    }
}
