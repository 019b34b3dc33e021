//! What is compared with the reference.
//!
//! A contender is written as in tables and on the command line:
//!
//! ```text
//! raw                    the three-point angle of the recorded joints
//! iekf                   a method with its own pass
//! iekf-filter            a method with a pass that is not its own
//! particle/512           a method with its number of particles
//! ```

use crate::assessment::{JointAngleSettings, Method, Pass};
use serde::{Serialize, Serializer};
use std::fmt;
use std::ops::RangeInclusive;
use std::str::FromStr;

/// Numbers of particles that the pipeline accepts.
pub const PARTICLES: RangeInclusive<u32> = 16..=65_536;

/// Numbers of particles that the paper compares (\[angles\] Figure 3).
pub const PAPER_PARTICLES: [u32; 3] = [128, 512, 2048];

/// What is compared: a method of the pipeline, or the angle of the raw joints.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Contender {
    /// The three-point angle of the recorded joints; knees only.
    Raw,
    /// A method of the pipeline.
    Method {
        /// The method.
        method: Method,
        /// Its pass; none means the one that the method takes by itself.
        pass: Option<Pass>,
        /// Its number of particles; none means that of the settings, and stands with every method without particles.
        particles: Option<u32>,
    },
}

impl Contender {
    /// The middleware's rotations: what the paper's gain is counted from.
    pub const MIDDLEWARE: Contender = Contender::of(Method::Nite);

    /// A method as the pipeline runs it by itself.
    pub const fn of(method: Method) -> Self {
        Contender::Method { method, pass: None, particles: None }
    }

    /// The pipeline's default.
    pub fn default_method() -> Self {
        Self::of(JointAngleSettings::default().method)
    }

    /// Raw first, then every method once.
    pub fn all() -> Vec<Contender> {
        std::iter::once(Contender::Raw).chain(Method::ALL.map(Contender::of)).collect()
    }

    /// Raw first, then every method with its own pass, the filter of those that can smooth and have no particles, and the
    /// paper's filter with each number of particles. Another method with particles has its own number: its cost is not
    /// that of the paper's, and neither is its accuracy at the paper's numbers.
    pub fn table2(particles: &[u32]) -> Vec<Contender> {
        let mut all = vec![Contender::Raw];
        for method in Method::ALL {
            match method {
                Method::Particle => all.extend(Contender::of(method).with_each(particles)),
                _ if method.has_particles() => {
                    let particles = Some(method.default_particles());
                    all.push(Contender::Method { method, pass: None, particles });
                }
                _ => all.push(Contender::of(method)),
            }
            if method.can_smooth() && !method.has_particles() {
                all.push(Contender::Method { method, pass: Some(Pass::Filter), particles: None });
            }
        }
        all
    }

    /// This contender once for each number of particles, or only itself when it has none or says how many.
    pub fn with_each(self, counts: &[u32]) -> Vec<Contender> {
        match self {
            Contender::Method { method, pass, particles: None } if method.has_particles() && !counts.is_empty() => {
                counts.iter().map(|count| Contender::Method { method, pass, particles: Some(*count) }).collect()
            }
            _ => vec![self],
        }
    }

    /// Settings with which the pipeline runs this contender; none for the raw angle.
    pub fn settings(self, others: &JointAngleSettings) -> Option<JointAngleSettings> {
        match self {
            Contender::Raw => None,
            Contender::Method { method, pass, particles } => {
                let particles = particles.or(others.particles);
                Some(JointAngleSettings { method, pass, particles, ..others.clone() })
            }
        }
    }

    /// True of the contender that does what the pipeline does when nobody asks for anything else.
    pub fn is_default(self) -> bool {
        self.settings(&JointAngleSettings::default()) == Some(JointAngleSettings::default())
    }

    /// Name in tables, which parses back.
    pub fn name(self) -> String {
        self.to_string()
    }
}

/// Why a name is no contender.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum UnknownContender {
    /// No method has the name.
    #[error("`{name}` is not a method; there are raw, {}", Method::ALL.map(Method::name).join(", "))]
    Method {
        /// What was given.
        name: String,
    },
    /// The method has no backward pass.
    #[error("the method `{method}` has no backward pass; leave out `-smooth`")]
    NoBackwardPass {
        /// The method.
        method: &'static str,
    },
    /// The method has no particles.
    #[error("the method `{method}` has no particles; leave out what follows the slash")]
    NoParticles {
        /// The method.
        method: &'static str,
    },
    /// The number of particles is no number or outside its range.
    #[error("`{given}` is no number of particles between {} and {}", PARTICLES.start(), PARTICLES.end())]
    Particles {
        /// What was given.
        given: String,
    },
}

impl FromStr for Contender {
    type Err = UnknownContender;

    fn from_str(text: &str) -> Result<Self, Self::Err> {
        if text == "raw" {
            return Ok(Contender::Raw);
        }
        let (name, count) = match text.split_once('/') {
            Some((name, count)) => (name, Some(count)),
            None => (text, None),
        };
        // The whole name first: a method's own name may hold a hyphen.
        let (method, pass) = match (name.parse::<Method>(), name.rsplit_once('-')) {
            (Ok(method), _) => (method, None),
            (Err(_), Some((method, pass))) => match (method.parse(), pass.parse()) {
                (Ok(method), Ok(pass)) => (method, Some(pass)),
                _ => return Err(UnknownContender::Method { name: text.to_owned() }),
            },
            (Err(_), None) => return Err(UnknownContender::Method { name: text.to_owned() }),
        };
        if pass == Some(Pass::Smooth) && !method.can_smooth() {
            return Err(UnknownContender::NoBackwardPass { method: method.name() });
        }
        let particles = match count {
            None => None,
            Some(_) if !method.has_particles() => return Err(UnknownContender::NoParticles { method: method.name() }),
            Some(given) => {
                let count = given.parse().ok().filter(|count| PARTICLES.contains(count));
                Some(count.ok_or_else(|| UnknownContender::Particles { given: given.to_owned() })?)
            }
        };
        Ok(Contender::Method { method, pass, particles })
    }
}

impl fmt::Display for Contender {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Contender::Method { method, pass, particles } = self else { return f.write_str("raw") };
        f.write_str(method.name())?;
        if let Some(pass) = pass {
            f.write_str(if *pass == Pass::Filter { "-filter" } else { "-smooth" })?;
        }
        if let Some(particles) = particles {
            write!(f, "/{particles}")?;
        }
        Ok(())
    }
}

impl Serialize for Contender {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.collect_str(self)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::collections::HashSet;

    #[test]
    fn names_parse_back_with_their_pass_and_their_particles() {
        let mut all = Contender::table2(&[16, 512]);
        all.extend(Contender::all());
        for method in Method::ALL.into_iter().filter(|method| method.can_smooth()) {
            all.push(Contender::Method { method, pass: Some(Pass::Smooth), particles: None });
        }
        for contender in all {
            assert_eq!(contender.name().parse(), Ok(contender));
        }
        let written = |text: &str| text.parse::<Contender>().unwrap();
        let particle = |pass, particles| Contender::Method { method: Method::Particle, pass, particles };
        assert_eq!(written("particle/2048"), particle(None, Some(2048)));
        assert_eq!(written("particle-filter/128"), particle(Some(Pass::Filter), Some(128)));
        assert_eq!(written("iekf"), Contender::default_method());
    }

    #[test]
    fn what_no_method_can_do_is_refused_with_the_reason() {
        let refusal = |text: &str| text.parse::<Contender>().unwrap_err().to_string();
        for unknown in ["optical", "iekf-", "-filter", "", "iekf-backwards", "raw/16", "raw-filter"] {
            let said = refusal(unknown);
            assert!(said.contains("is not a method") && said.contains("iekf"), "{unknown}: {said}");
        }
        assert!(refusal("ik-smooth").contains("no backward pass"));
        assert!(refusal("ik/512").contains("no particles"));
        for count in ["particle/", "particle/15", "particle/65537", "particle/many", "particle/5/6"] {
            assert!(refusal(count).contains("between 16 and 65536"), "{count}");
        }
    }

    #[test]
    fn table_2_holds_every_method_once_and_the_papers_filter_with_every_number_of_particles() {
        let contenders = Contender::table2(&PAPER_PARTICLES);
        assert_eq!(contenders.iter().collect::<HashSet<_>>().len(), contenders.len());
        for method in Method::ALL {
            let counts: Vec<_> = contenders
                .iter()
                .filter_map(|contender| match contender {
                    Contender::Method { method: own, pass: None, particles } if *own == method => Some(*particles),
                    _ => None,
                })
                .collect();
            let expected = match method {
                Method::Particle => PAPER_PARTICLES.map(Some).to_vec(),
                Method::Guided => vec![Some(96)],
                _ => vec![None],
            };
            assert_eq!(counts, expected, "{method}");
        }
        assert!(contenders.contains(&"iekf-filter".parse().unwrap()) && contenders.contains(&Contender::Raw));
    }

    #[test]
    fn a_contender_s_settings_are_the_run_s_with_its_own_method_pass_and_particles() {
        let run = JointAngleSettings { seed: 7, ..JointAngleSettings::default() };
        let own = "particle/128".parse::<Contender>().unwrap().settings(&run).unwrap();
        assert_eq!((own.method, own.particles, own.seed), (Method::Particle, Some(128), 7));
        assert_eq!(Contender::of(Method::Ik).settings(&run).unwrap().particles, run.particles);
        assert_eq!(Contender::Raw.settings(&run), None);
        let defaults: Vec<_> = Contender::table2(&PAPER_PARTICLES).into_iter().filter(|c| c.is_default()).collect();
        assert_eq!(defaults.len(), 1, "{defaults:?}");
    }
}
