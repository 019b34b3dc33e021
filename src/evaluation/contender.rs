//! What is compared with the reference.

use crate::assessment::Method;
use std::fmt;
use std::str::FromStr;

/// What is compared: a method of the pipeline, or the angle of the raw joints.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Contender {
    /// The three-point angle of the recorded joints; knees only.
    Raw,
    /// A method of the pipeline.
    Method(Method),
}

impl Contender {
    /// Raw first, then every method.
    pub fn all() -> Vec<Contender> {
        std::iter::once(Contender::Raw).chain(Method::ALL.map(Contender::Method)).collect()
    }

    /// Name in tables.
    pub fn name(self) -> &'static str {
        match self {
            Contender::Raw => "raw",
            Contender::Method(method) => method.name(),
        }
    }
}

/// A name that no contender has.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("`{0}` is not a method; there are raw, iekf, ukf, guided, particle, ik and nite")]
pub struct UnknownContender(pub String);

impl FromStr for Contender {
    type Err = UnknownContender;

    fn from_str(name: &str) -> Result<Self, Self::Err> {
        Self::all().into_iter().find(|c| c.name() == name).ok_or_else(|| UnknownContender(name.to_owned()))
    }
}

impl fmt::Display for Contender {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_parse_back_and_unknown_ones_are_refused() {
        for contender in Contender::all() {
            assert_eq!(contender.name().parse(), Ok(contender));
        }
        assert!("smoother".parse::<Contender>().unwrap_err().to_string().contains("iekf"));
    }
}
