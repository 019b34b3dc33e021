//! What settings call a noise model: `name` or `name@version`.

use super::ADAPTIVE;
use std::fmt;
use std::str::FromStr;

/// Longest name of a model, characters.
const MAX_NAME: usize = 64;

/// A noise model by its name, and its version when one is meant.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct NoiseModelName {
    /// The name.
    pub name: String,
    /// The version; `None` means the newest.
    pub version: Option<u32>,
}

impl NoiseModelName {
    /// True of the noise that is estimated from the recording itself.
    pub fn is_adaptive(&self) -> bool {
        self.name == ADAPTIVE && self.version.is_none()
    }
}

/// A text that names no noise model.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("`{0}` is no name of a noise model; write `name` or `name@version`, for example `kinect-v2` or `ward-3@2`")]
pub struct InvalidNoiseModelName(pub String);

/// True of 1 to 64 lower-case letters, digits and hyphens that begin with a letter, and are no UUID: a name must never
/// be taken for an id.
pub fn is_model_name(text: &str) -> bool {
    let plain = text.bytes().all(|b| b.is_ascii_lowercase() || b.is_ascii_digit() || b == b'-');
    let begins = text.bytes().next().is_some_and(|b| b.is_ascii_lowercase());
    plain && begins && text.len() <= MAX_NAME && uuid::Uuid::parse_str(text).is_err()
}

impl FromStr for NoiseModelName {
    type Err = InvalidNoiseModelName;

    fn from_str(text: &str) -> Result<Self, Self::Err> {
        let wrong = || InvalidNoiseModelName(text.to_owned());
        let (name, version) = match text.split_once('@') {
            Some((name, version)) => {
                let number: u32 = version.parse().map_err(|_| wrong())?;
                // One spelling for one version: no sign, no leading zeros.
                if number == 0 || number.to_string() != version {
                    return Err(wrong());
                }
                (name, Some(number))
            }
            None => (text, None),
        };
        if is_model_name(name) { Ok(Self { name: name.to_owned(), version }) } else { Err(wrong()) }
    }
}

impl fmt::Display for NoiseModelName {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.version {
            Some(version) => write!(f, "{}@{version}", self.name),
            None => f.write_str(&self.name),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_name_with_and_without_version_is_read_and_written_back() {
        for (text, version) in [("kinect-v2", None), ("ward-3@12", Some(12)), ("adaptive", None)] {
            let name: NoiseModelName = text.parse().unwrap();
            assert_eq!((name.version, name.to_string().as_str()), (version, text));
        }
    }

    #[test]
    fn whatever_is_no_name_is_refused() {
        let id = "a1b2c3d4-0000-7000-8000-000000000000";
        for bad in ["", "@1", "a@", "a@0", "a@01", "a@+1", "a@1@2", "Ä", "A", "-a", "3a", "a b", id, &"a".repeat(65)] {
            assert!(bad.parse::<NoiseModelName>().is_err(), "{bad}");
        }
    }
}
