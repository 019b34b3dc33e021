//! Means over recordings.

use super::angles::AngleErrors;
use super::clocks::UnitErrors;
use super::contender::Contender;
use super::simulated::Outcome;
use crate::evaluation::agreement::quantiles;
use serde::Serialize;

/// Means of the errors of some angles in some recordings, each recording and angle counting once.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Means {
    /// Recordings times angles.
    pub n: usize,
    /// Mean share of the time with an estimate, 0 to 1.
    pub coverage: f64,
    /// Mean of the root mean square errors, degrees.
    pub rmse_deg: f64,
    /// The same after each one's mean error was taken out, degrees.
    pub offset_free_deg: f64,
    /// Mean zero-mean normalised cross-correlation of those that have one.
    pub ncc: Option<f64>,
    /// Lowest of them.
    pub lowest_ncc: Option<f64>,
    /// Mean root mean square error of the angular velocity, degrees per second.
    pub speed_rmse_deg_s: Option<f64>,
    /// Mean share of 95 % intervals that hold the reference; none for contenders without intervals.
    pub held: Option<f64>,
}

impl Means {
    /// Means of some errors; none without any.
    pub fn of<'a>(errors: impl IntoIterator<Item = &'a AngleErrors>) -> Option<Self> {
        let errors: Vec<&AngleErrors> = errors.into_iter().collect();
        let over = |value: fn(&AngleErrors) -> Option<f64>| mean(errors.iter().filter_map(|error| value(error)));
        Some(Self {
            n: errors.len(),
            coverage: over(|error| Some(error.coverage))?,
            rmse_deg: over(|error| Some(error.rmse_deg))?,
            offset_free_deg: over(|error| Some(error.offset_free_deg))?,
            ncc: over(|error| error.ncc),
            lowest_ncc: errors.iter().filter_map(|error| error.ncc).reduce(f64::min),
            speed_rmse_deg_s: over(|error| error.speed_rmse_deg_s),
            held: over(|error| error.held),
        })
    }
}

/// One contender over all recordings in one kind of joint, both sides.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Total {
    /// What was compared.
    pub contender: Contender,
    /// The joint, for example `knee_flexion`.
    pub joint: String,
    /// Means over recordings and sides.
    pub means: Means,
    /// Largest root mean square error, degrees.
    pub worst_deg: f64,
    /// Where it is: movement, seed and side.
    pub worst: String,
    /// Recordings of which the contender gave nothing.
    pub n_failed: usize,
}

/// Totals of some joints, given by the ends of their channels' names without unit; contenders in the order of the outcomes.
pub fn totals(outcomes: &[Outcome], joints: &[&str]) -> Vec<Total> {
    let mut totals = Vec::new();
    for joint in joints {
        for contender in contenders(outcomes) {
            let own = || outcomes.iter().filter(|outcome| outcome.contender == contender);
            let errors =
                || own().flat_map(|o| o.angles.iter().map(move |error| (o, error))).filter(|(_, e)| is(e, joint));
            let worst = errors().max_by(|(_, a), (_, b)| a.rmse_deg.total_cmp(&b.rmse_deg));
            let (Some(means), Some((trial, error))) = (Means::of(errors().map(|(_, error)| error)), worst) else {
                continue;
            };
            let side = ["left", "right"].into_iter().find(|side| error.channel.starts_with(side)).unwrap_or("");
            totals.push(Total {
                contender,
                joint: (*joint).to_owned(),
                means,
                worst_deg: error.rmse_deg,
                worst: format!("{} {} {side}", trial.movement, trial.seed).trim_end().to_owned(),
                n_failed: own().filter(|outcome| outcome.failure.is_some()).count(),
            });
        }
    }
    totals
}

/// How far clocks and mountings are off, over all units of all recordings.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct UnitTotal {
    /// What was compared.
    pub contender: Contender,
    /// Units times recordings.
    pub n: usize,
    /// Those whose clock was taken from the jumps.
    pub n_by_jumps: usize,
    /// Largest error of a unit's clock over its recording: median, 90 % quantile and largest over the units, milliseconds.
    pub clock_ms: [f64; 3],
    /// Lower bound of the mounting's error ([`UnitErrors::mounting_at_least_deg`]): the same three, degrees.
    pub mounting_at_least_deg: [f64; 3],
}

/// One line for each contender that used units.
pub fn unit_totals(outcomes: &[Outcome]) -> Vec<UnitTotal> {
    let total = |contender: Contender| {
        let own = outcomes.iter().filter(|outcome| outcome.contender == contender);
        let units: Vec<&UnitErrors> = own.flat_map(|outcome| &outcome.units).collect();
        let spread = |value: fn(&UnitErrors) -> f64| {
            let values: Vec<f64> = units.iter().map(|unit| value(unit)).collect();
            quantiles(&values, [0.5, 0.9, 1.0])
        };
        Some(UnitTotal {
            contender,
            n: units.len(),
            n_by_jumps: units.iter().filter(|unit| unit.evidence == "jumps").count(),
            clock_ms: spread(|unit| unit.clock_ms)?,
            mounting_at_least_deg: spread(|unit| unit.mounting_at_least_deg)?,
        })
    };
    contenders(outcomes).into_iter().filter_map(total).collect()
}

/// Contenders of some outcomes, each once, in their order.
pub fn contenders(outcomes: &[Outcome]) -> Vec<Contender> {
    let mut found = Vec::new();
    for outcome in outcomes {
        if !found.contains(&outcome.contender) {
            found.push(outcome.contender);
        }
    }
    found
}

/// True of the errors of a joint on either side.
pub fn is(error: &AngleErrors, joint: &str) -> bool {
    error.channel.strip_suffix("_deg").is_some_and(|name| name.ends_with(joint))
}

/// Mean of some numbers; none without any.
pub fn mean(values: impl IntoIterator<Item = f64>) -> Option<f64> {
    let (n, sum) = values.into_iter().fold((0, 0.0), |(n, sum), value| (n + 1, sum + value));
    (n > 0).then(|| sum / f64::from(n))
}
