//! A noise model as an argument: a name, or the file of a trained one.

use crate::assessment::noise_model::{ADAPTIVE, find_shipped, shipped};
use crate::assessment::{NoiseModel, NoiseModelName};
use anyhow::{Context, anyhow, bail};
use std::fs;
use std::path::Path;
use std::str::FromStr;

/// The noise that a command is to use.
#[derive(Debug, Clone, PartialEq)]
pub(super) enum NoiseModelChoice {
    /// Estimated from each recording itself.
    Adaptive,
    /// A shipped model, or that of a file.
    Model(Box<NoiseModel>),
}

impl NoiseModelChoice {
    /// What settings call it.
    pub(super) fn name(&self) -> String {
        match self {
            Self::Adaptive => ADAPTIVE.to_owned(),
            Self::Model(model) => model.name().to_string(),
        }
    }

    /// The model, unless noise is estimated.
    pub(super) fn model(&self) -> Option<NoiseModel> {
        match self {
            Self::Adaptive => None,
            Self::Model(model) => Some((**model).clone()),
        }
    }
}

impl FromStr for NoiseModelChoice {
    type Err = anyhow::Error;

    /// A name of a shipped model, or else a file.
    fn from_str(text: &str) -> anyhow::Result<Self> {
        if let Ok(name) = text.parse::<NoiseModelName>() {
            if name.is_adaptive() {
                return Ok(Self::Adaptive);
            }
            if let Some(model) = find_shipped(&name) {
                return Ok(Self::Model(Box::new(model.clone())));
            }
        }
        let path = Path::new(text);
        if !path.is_file() {
            let names: Vec<&str> = shipped().iter().map(|model| model.document().name.as_str()).collect();
            bail!("`{text}` is neither a noise model nor a file; there are {ADAPTIVE}, {}", names.join(", "));
        }
        let bytes = fs::read(path).with_context(|| format!("cannot read {text}"))?;
        let model = serde_json::from_slice(&bytes).map_err(|error| anyhow!("{text} holds no noise model: {error}"))?;
        Ok(Self::Model(Box::new(model)))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_shipped_name_a_file_and_adaptive_are_understood_and_anything_else_says_what_there_is() {
        assert_eq!("adaptive".parse::<NoiseModelChoice>().unwrap(), NoiseModelChoice::Adaptive);
        let shipped: NoiseModelChoice = "kinect-v2".parse().unwrap();
        assert_eq!(shipped.name(), "kinect-v2@1");
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("mine.json");
        fs::write(&file, serde_json::to_vec(&shipped.model().unwrap()).unwrap()).unwrap();
        assert_eq!(file.to_str().unwrap().parse::<NoiseModelChoice>().unwrap(), shipped);
        fs::write(&file, "{}").unwrap();
        assert!(file.to_str().unwrap().parse::<NoiseModelChoice>().unwrap_err().to_string().contains("no noise model"));
        let error = "kinect-v9".parse::<NoiseModelChoice>().unwrap_err().to_string();
        assert!(error.contains("adaptive, nite-table1, kinect-v1, kinect-v2"), "{error}");
    }
}
