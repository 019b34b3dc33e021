//! What a rule is, and what it finds.

use super::Known;
use serde::Serialize;
use utoipa::ToSchema;

/// Half the width of a 95 % interval in standard errors.
pub(super) const Z95: f64 = 1.959_963_985;

/// How well a number is confirmed.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, ToSchema)]
#[serde(rename_all = "snake_case")]
pub enum Evidence {
    /// Stated in the cited source.
    Stated,
    /// Stated in a source that quotes it.
    Quoted,
    /// Not confirmed against the source: must not guide care.
    Unconfirmed,
}

impl Evidence {
    /// The word at the API.
    pub fn name(self) -> &'static str {
        match self {
            Evidence::Stated => "stated",
            Evidence::Quoted => "quoted",
            Evidence::Unconfirmed => "unconfirmed",
        }
    }
}

/// What a rule says of a person.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, ToSchema)]
#[serde(rename_all = "snake_case")]
pub enum Status {
    /// The limit is passed: the factor is present.
    Positive,
    /// It is not.
    Negative,
    /// Nearer to the limit than 1.96 standard errors.
    Indeterminate,
    /// Something that the rule needs is not known.
    Unknown,
    /// The rule cannot be applied, whatever else were known.
    NotAssessable,
}

impl Status {
    /// The word at the API.
    pub fn name(self) -> &'static str {
        match self {
            Status::Positive => "positive",
            Status::Negative => "negative",
            Status::Indeterminate => "indeterminate",
            Status::Unknown => "unknown",
            Status::NotAssessable => "not_assessable",
        }
    }
}

/// On which side of its limit a value is a risk.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, ToSchema)]
#[serde(rename_all = "snake_case")]
pub enum RiskSide {
    /// Values at or above it.
    AtLeast,
    /// Values above it.
    Above,
    /// Values at or below it.
    AtMost,
    /// Values below it.
    Below,
}

/// A limit of a rule.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, ToSchema)]
pub struct Cutoff {
    /// The limit, in the rule's unit.
    pub value: f64,
    /// Where the risk is.
    pub side: RiskSide,
    /// How well the limit is confirmed.
    pub evidence: Evidence,
}

impl Cutoff {
    /// A limit at or above which there is a risk.
    pub const fn at_least(value: f64, evidence: Evidence) -> Self {
        Self { value, side: RiskSide::AtLeast, evidence }
    }

    /// A limit above which there is a risk.
    pub const fn above(value: f64, evidence: Evidence) -> Self {
        Self { value, side: RiskSide::Above, evidence }
    }

    /// A limit at or below which there is a risk.
    pub const fn at_most(value: f64, evidence: Evidence) -> Self {
        Self { value, side: RiskSide::AtMost, evidence }
    }

    /// A limit below which there is a risk.
    pub const fn below(value: f64, evidence: Evidence) -> Self {
        Self { value, side: RiskSide::Below, evidence }
    }

    /// True of a value on the side of risk.
    pub fn is_passed(&self, value: f64) -> bool {
        match self.side {
            RiskSide::AtLeast => value >= self.value,
            RiskSide::Above => value > self.value,
            RiskSide::AtMost => value <= self.value,
            RiskSide::Below => value < self.value,
        }
    }

    /// Whether a measured value is on the side of risk; none where it lies nearer to the limit than 1.96 standard errors.
    pub(super) fn is_surely_passed(&self, measured: &super::Measured) -> Option<bool> {
        let tells = measured.standard_error.is_none_or(|se| (measured.value - self.value).abs() >= Z95 * se);
        tells.then(|| self.is_passed(measured.value))
    }
}

/// What is known of a rule without a person.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, ToSchema)]
pub struct RuleInfo {
    /// Identifier; never given to another rule.
    pub id: &'static str,
    /// Measures that it looks at, by their names.
    pub measures: &'static [&'static str],
    /// Version of its text and numbers.
    pub version: u32,
    /// What it says, for a clinician.
    pub statement: &'static str,
    /// UCUM unit of value and limits; none for categories.
    pub unit: Option<&'static str>,
    /// Limits that do not depend on the person.
    pub cutoffs: &'static [Cutoff],
    /// Whom it was developed on.
    pub population: &'static str,
    /// Where it comes from.
    pub citation: &'static str,
    /// How well its weakest number is confirmed.
    pub evidence: Evidence,
    /// What is known of the tool's accuracy.
    pub accuracy: &'static str,
}

/// A rule: what it says, and how it is applied.
#[derive(Debug)]
pub struct Rule {
    /// What it says.
    pub info: RuleInfo,
    pub(super) find: fn(&RuleInfo, &Known) -> Finding,
}

impl Rule {
    /// Applies the rule to what is known of a person.
    pub fn apply(&self, known: &Known) -> Finding {
        let mut finding = (self.find)(&self.info, known);
        finding.population_match = known.person.matches_population();
        // No rule was developed on users of walking aids, on younger people or in homes: no probability is told then, nor
        // while nobody has said so.
        if finding.population_match != Some(true) && finding.probability.is_some() {
            finding.probability = None;
            finding.reason.push_str(match finding.population_match {
                Some(false) => "; no probability, as the person is not of the population that it was measured in",
                _ => "; no probability until age, walking aid and place of living are known",
            });
        }
        finding
    }
}

/// What a rule finds in one person.
#[derive(Debug, Clone, PartialEq, Serialize, ToSchema)]
pub struct Finding {
    /// The rule.
    pub rule_id: &'static str,
    /// Its version.
    pub rule_version: u32,
    /// What the rule says.
    pub statement: &'static str,
    /// Measures that the rule looks at, by their names.
    pub measures: &'static [&'static str],
    /// What was found; null for rules that inform without a limit.
    pub status: Option<Status>,
    /// Category, points or stage, where the rule has them.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub category: Option<String>,
    /// What was measured, in the rule's unit.
    pub value: Option<f64>,
    /// UCUM unit.
    pub unit: Option<&'static str>,
    /// Lower end of the 95 % interval of the value; null without a standard error, which `reason` then says.
    pub ci95_low: Option<f64>,
    /// Upper end.
    pub ci95_high: Option<f64>,
    /// The limit that was applied.
    pub cutoff: Option<Cutoff>,
    /// How far the value lies on the side of risk, in standard errors; negative on the safe side.
    pub distance_se: Option<f64>,
    /// Observations that the value rests on.
    pub n_observations: Option<u32>,
    /// Whether the person is of the population that the rule was developed on; null when that is not known.
    pub population_match: Option<bool>,
    /// Probability of the rule's outcome, between what is possible with the unknown items: low, high.
    pub probability: Option<[f64; 2]>,
    /// Whom the rule was developed on.
    pub population: &'static str,
    /// Where the rule comes from.
    pub citation: &'static str,
    /// How well the numbers are confirmed.
    pub evidence: Evidence,
    /// What is known of the tool's accuracy.
    pub accuracy: &'static str,
    /// Why the status is what it is, for a clinician.
    pub reason: String,
}

impl Finding {
    /// A finding with a reason and nothing else.
    pub(super) fn new(info: &RuleInfo, status: Option<Status>, reason: impl Into<String>) -> Self {
        Self {
            rule_id: info.id,
            rule_version: info.version,
            statement: info.statement,
            measures: info.measures,
            status,
            category: None,
            value: None,
            unit: info.unit,
            ci95_low: None,
            ci95_high: None,
            cutoff: None,
            distance_se: None,
            n_observations: None,
            population_match: None,
            probability: None,
            population: info.population,
            citation: info.citation,
            evidence: info.evidence,
            accuracy: info.accuracy,
            reason: reason.into(),
        }
    }

    /// Something that the rule needs is not known.
    pub(super) fn unknown(info: &RuleInfo, missing: &str) -> Self {
        Self::new(info, Some(Status::Unknown), format!("not known: {missing}"))
    }

    /// A value without a limit: information.
    pub(super) fn information(info: &RuleInfo, measured: &super::Measured, reason: impl Into<String>) -> Self {
        Self::new(info, None, reason).with_value(measured)
    }

    /// A value against a limit.
    pub(super) fn against(info: &RuleInfo, measured: &super::Measured, cutoff: Cutoff) -> Self {
        let is_passed = cutoff.is_passed(measured.value);
        let gap = measured.value - cutoff.value;
        let towards_risk = if matches!(cutoff.side, RiskSide::Below | RiskSide::AtMost) { -gap } else { gap };
        let distance_se = measured.standard_error.filter(|se| *se > 0.0).map(|se| towards_risk / se);
        let (status, reason) = match (distance_se, is_passed) {
            (Some(distance), _) if distance.abs() < Z95 => (
                Status::Indeterminate,
                format!("{:.1} standard errors from the limit: the measurement does not tell", distance.abs()),
            ),
            (Some(distance), true) => (Status::Positive, format!("{distance:.1} standard errors beyond the limit")),
            (Some(distance), false) => (Status::Negative, format!("{:.1} standard errors within the limit", -distance)),
            (None, true) => (Status::Positive, "beyond the limit; how sure the value is, is not known".to_owned()),
            (None, false) => (Status::Negative, "within the limit; how sure the value is, is not known".to_owned()),
        };
        Self { cutoff: Some(cutoff), distance_se, ..Self::new(info, Some(status), reason).with_value(measured) }
    }

    pub(super) fn with_value(self, measured: &super::Measured) -> Self {
        let half = measured.standard_error.map(|se| Z95 * se);
        Self {
            value: Some(measured.value),
            ci95_low: half.map(|half| measured.value - half),
            ci95_high: half.map(|half| measured.value + half),
            n_observations: measured.n_observations,
            ..self
        }
    }

    pub(super) fn with_category(self, category: impl Into<String>) -> Self {
        Self { category: Some(category.into()), ..self }
    }
}
