//! What is known of a person: who, what was answered, what was measured. Whatever is not known is `None`.

use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

/// Age from which on people are of the population that the rules were developed on, years.
const LEAST_AGE: f64 = 65.0;

/// A person's sex where norms differ by it.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
#[serde(rename_all = "snake_case")]
pub enum Sex {
    /// Female.
    Female,
    /// Male.
    Male,
}

/// Who it is.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Person {
    /// Age, years.
    pub age_years: Option<f64>,
    /// Sex.
    pub sex: Option<Sex>,
    /// Whether a walking aid is used.
    pub uses_walking_aid: Option<bool>,
    /// Whether the person lives at home.
    pub lives_in_community: Option<bool>,
}

impl Person {
    /// Whether the person is of the population that the rules were developed on (at least 65, at home, without a walking
    /// aid): false as soon as one is known not to hold, none while one is not known.
    pub fn matches_population(&self) -> Option<bool> {
        let holds = [
            self.age_years.map(|age| age >= LEAST_AGE),
            self.uses_walking_aid.map(|uses| !uses),
            self.lives_in_community,
        ];
        if holds.contains(&Some(false)) {
            return Some(false);
        }
        holds.iter().all(Option::is_some).then_some(true)
    }
}

/// Answers to the questionnaire; a missing one is not known.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize, ToSchema)]
#[serde(default, deny_unknown_fields)]
pub struct Answers {
    /// Falls in the past twelve months.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schema(minimum = 0, maximum = 366)]
    pub falls_12_months: Option<u32>,
    /// A fall in that time caused an injury that needed care.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub injury_needing_care: Option<bool>,
    /// After a fall in that time the person lay on the floor and could not rise.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub lay_unable_to_rise: Option<bool>,
    /// A fall in that time came with a loss of consciousness.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub loss_of_consciousness: Option<bool>,
    /// The person is frail.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub is_frail: Option<bool>,
    /// Feels unsteady when standing or walking.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub feels_unsteady: Option<bool>,
    /// Worries about falling.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub worries_about_falling: Option<bool>,
    /// Medicines taken.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schema(minimum = 0, maximum = 100)]
    pub medicines: Option<u32>,
    /// Takes a psychotropic medicine.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub takes_psychotropic: Option<bool>,
    /// Reads all letters of line 10 of a 10 % contrast chart at 3 m.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub reads_low_contrast_line_10: Option<bool>,
    /// Feels the pressure filament at the lateral malleolus of the dominant side.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub feels_ankle_filament: Option<bool>,
    /// Falls Efficacy Scale International, 16 to 64.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schema(minimum = 16, maximum = 64)]
    pub falls_efficacy: Option<u32>,
    /// Physiological Profile Assessment, z-score, as measured with its instruments.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schema(minimum = -10, maximum = 10)]
    pub physiological_profile_z: Option<f64>,
    /// Lives at home, not in an institution.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub lives_in_community: Option<bool>,
}

impl Answers {
    /// What contradicts itself or cannot be, the name of the answer and a sentence each.
    pub fn contradictions(&self) -> Vec<(&'static str, String)> {
        let mut found = Vec::new();
        let severity = [
            ("injury_needing_care", self.injury_needing_care),
            ("lay_unable_to_rise", self.lay_unable_to_rise),
            ("loss_of_consciousness", self.loss_of_consciousness),
        ];
        for (name, answer) in severity {
            if self.falls_12_months == Some(0) && answer == Some(true) {
                found.push((name, "is true of a fall, but falls_12_months is 0".to_owned()));
            }
        }
        if self.takes_psychotropic == Some(true) && self.medicines == Some(0) {
            found.push(("takes_psychotropic", "is true, but medicines is 0".to_owned()));
        }
        if self.falls_efficacy.is_some_and(|sum| !(16..=64).contains(&sum)) {
            found.push(("falls_efficacy", "is a sum of sixteen items from 1 to 4: between 16 and 64".to_owned()));
        }
        if self.falls_12_months.is_some_and(|falls| falls > 366) {
            found.push(("falls_12_months", "is more than one fall a day".to_owned()));
        }
        if self.medicines.is_some_and(|medicines| medicines > 100) {
            found.push(("medicines", "is more than 100".to_owned()));
        }
        if self.physiological_profile_z.is_some_and(|z| !z.is_finite() || z.abs() > 10.0) {
            found.push(("physiological_profile_z", "is a z-score: between -10 and 10".to_owned()));
        }
        found
    }
}

/// A measured value.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct Measured {
    /// The value, in the unit of the measure's name.
    pub value: f64,
    /// Its standard error, in the same unit; for the mean of n steps their SD / √n.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(minimum = 0)]
    pub standard_error: Option<f64>,
    /// Observations that it rests on.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(minimum = 1, maximum = 1000000)]
    pub n_observations: Option<u32>,
    /// Standard deviation of the error of one observation, in the same unit, for measures of variability.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(minimum = 0)]
    pub error_sd: Option<f64>,
}

impl Measured {
    /// A value of which nothing else is known.
    pub fn of(value: f64) -> Self {
        Self { value, standard_error: None, n_observations: None, error_sd: None }
    }
}

/// What was measured, by the tests and by gait.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize, ToSchema)]
#[serde(default, deny_unknown_fields)]
pub struct Measures {
    /// Five rises from a chair, arms folded, seconds.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub five_times_sit_to_stand_s: Option<Measured>,
    /// Rises in thirty seconds; 0 when the arms were used.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub chair_stands_30_s: Option<Measured>,
    /// Eight alternate steps onto an 18 cm step, seconds.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub alternate_step_s: Option<Measured>,
    /// Near tandem stand, eyes closed, held for, seconds.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub near_tandem_hold_s: Option<Measured>,
    /// Side-by-side stand, held for, seconds.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub side_by_side_hold_s: Option<Measured>,
    /// Semi-tandem stand, held for, seconds.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub semi_tandem_hold_s: Option<Measured>,
    /// Tandem stand, held for, seconds.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub tandem_hold_s: Option<Measured>,
    /// Timed up and go, seconds.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub timed_up_and_go_s: Option<Measured>,
    /// Walk of four metres, seconds.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub walk_4_m_s: Option<Measured>,
    /// Walking speed at the person's own choice, m/s.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub usual_speed_mps: Option<Measured>,
    /// Walking speed at its highest, m/s.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub highest_speed_mps: Option<Measured>,
    /// Mean step width, metres.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub step_width_m: Option<Measured>,
    /// Standard deviation of step width as observed, metres.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub step_width_sd_m: Option<Measured>,
    /// Standard deviation of stride time as observed, seconds.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub stride_time_sd_s: Option<Measured>,
}

/// What each measure may be without being a slip of the pen: far beyond what people do.
const POSSIBLE_S: std::ops::RangeInclusive<f64> = 0.0..=600.0;
const POSSIBLE_COUNT: std::ops::RangeInclusive<f64> = 0.0..=100.0;
const POSSIBLE_MPS: std::ops::RangeInclusive<f64> = 0.0..=5.0;
const POSSIBLE_OBSERVATIONS: std::ops::RangeInclusive<u32> = 1..=1_000_000;
const POSSIBLE_M: std::ops::RangeInclusive<f64> = -1.0..=1.0;

impl Measures {
    /// Each measure by its name, with the values that it may have.
    fn entries(&mut self) -> [(&'static str, &mut Option<Measured>, std::ops::RangeInclusive<f64>); 14] {
        [
            ("five_times_sit_to_stand_s", &mut self.five_times_sit_to_stand_s, POSSIBLE_S),
            ("chair_stands_30_s", &mut self.chair_stands_30_s, POSSIBLE_COUNT),
            ("alternate_step_s", &mut self.alternate_step_s, POSSIBLE_S),
            ("near_tandem_hold_s", &mut self.near_tandem_hold_s, POSSIBLE_S),
            ("side_by_side_hold_s", &mut self.side_by_side_hold_s, POSSIBLE_S),
            ("semi_tandem_hold_s", &mut self.semi_tandem_hold_s, POSSIBLE_S),
            ("tandem_hold_s", &mut self.tandem_hold_s, POSSIBLE_S),
            ("timed_up_and_go_s", &mut self.timed_up_and_go_s, POSSIBLE_S),
            ("walk_4_m_s", &mut self.walk_4_m_s, POSSIBLE_S),
            ("usual_speed_mps", &mut self.usual_speed_mps, POSSIBLE_MPS),
            ("highest_speed_mps", &mut self.highest_speed_mps, POSSIBLE_MPS),
            ("step_width_m", &mut self.step_width_m, POSSIBLE_M),
            ("step_width_sd_m", &mut self.step_width_sd_m, POSSIBLE_M),
            ("stride_time_sd_s", &mut self.stride_time_sd_s, POSSIBLE_S),
        ]
    }

    /// Names of the measures that there are.
    pub fn names(mut self) -> Vec<&'static str> {
        self.entries().into_iter().filter(|(_, measured, _)| measured.is_some()).map(|(name, ..)| name).collect()
    }

    /// The measures that there are, by name.
    pub fn entered(mut self) -> Vec<(&'static str, Measured)> {
        self.entries().into_iter().filter_map(|(name, measured, _)| Some((name, (*measured)?))).collect()
    }

    /// Takes a measure by its name; false when rules know no such measure, or its value cannot be.
    pub fn take(&mut self, name: &str, measured: Measured) -> bool {
        let found = self.entries().into_iter().find(|(known, ..)| *known == name);
        let Some((_, place, possible)) = found else { return false };
        let is_possible = possible.contains(&measured.value);
        if is_possible {
            *place = Some(measured);
        }
        is_possible
    }

    /// What cannot be, the name of the measure and a sentence each.
    pub fn impossible(mut self) -> Vec<(&'static str, String)> {
        let mut found = Vec::new();
        for (name, measured, possible) in self.entries() {
            let Some(measured) = measured else { continue };
            if !possible.contains(&measured.value) {
                found.push((name, format!("must be between {} and {}", possible.start(), possible.end())));
            }
            let is_error = |sd: Option<f64>| sd.is_none_or(|sd| sd.is_finite() && sd >= 0.0);
            if !is_error(measured.standard_error) || !is_error(measured.error_sd) {
                found.push((name, "standard_error and error_sd must be at least 0".to_owned()));
            }
            if measured.n_observations.is_some_and(|n| !POSSIBLE_OBSERVATIONS.contains(&n)) {
                found.push((name, "n_observations must be between 1 and 1000000".to_owned()));
            }
        }
        found
    }
}

/// Everything that rules look at.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Known {
    /// Who it is.
    pub person: Person,
    /// What was answered.
    pub answers: Answers,
    /// What was measured.
    pub measures: Measures,
}
