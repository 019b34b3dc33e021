//! Does the default beat the others? One answer for each data set, exercise, angle and contender, by a stated rule.

use super::agreement::{Agreement, median};
use super::contender::Contender;
use super::joint_angles::{MEASURES, TrialOutcome};
use super::rows::{ALL_EXERCISES, Sets, agreement_in_trial};
use super::signed_rank::signed_rank;
use crate::body::Side;
use serde::Serialize;

/// Largest median difference that counts as none, degrees: less than the second decimal of the tables can tell.
pub const CLOSE_DEG: f64 = 0.05;

/// Probability from which on a difference over trials counts as chance.
pub const SIGNIFICANCE: f64 = 0.05;

/// Fewest trials with which the signed-rank test can reach [`SIGNIFICANCE`]: 2 / 2⁶ = 0.03.
pub const TESTABLE_FROM: usize = 6;

/// The rule, for those who read the answers.
pub const RULE: &str = "Each trial gives one error for both sides together; the difference is the default's error less \
    the other's, and its median over the trials decides. It is a tie within 0.05 degrees, and when Wilcoxon's \
    signed-rank test over six or more trials has p >= 0.05. With fewer than six trials no test can be significant: then \
    it is a tie unless all trials have the same sign, and the row says `untested`. A trial that only the default could \
    not compare loses the row.";

/// Error of a trial that is compared.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Statistic {
    /// Mean absolute error.
    Mae,
    /// Root mean square error.
    Rmse,
}

impl Statistic {
    /// Both.
    pub const ALL: [Statistic; 2] = [Statistic::Mae, Statistic::Rmse];

    /// Name in tables.
    pub fn name(self) -> &'static str {
        match self {
            Statistic::Mae => "MAE",
            Statistic::Rmse => "RMSE",
        }
    }

    fn of(self, agreement: &Agreement) -> Option<f64> {
        match self {
            Statistic::Mae => agreement.mae(),
            Statistic::Rmse => agreement.rmse(),
        }
    }
}

/// How the default did.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Outcome {
    /// Its error is smaller.
    Beats,
    /// There is no difference that counts.
    Ties,
    /// Its error is larger.
    Loses,
}

/// What the outcome rests on.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Ground {
    /// The difference is within [`CLOSE_DEG`].
    Close,
    /// The test sees no difference.
    NotSignificant,
    /// The test sees a difference.
    Significant,
    /// Too few trials for the test: their signs decide.
    Untested,
    /// The default has no number where the other has one.
    Missing,
}

impl Ground {
    /// Name in tables.
    pub fn name(self) -> &'static str {
        match self {
            Ground::Close => "close",
            Ground::NotSignificant => "not significant",
            Ground::Significant => "significant",
            Ground::Untested => "untested",
            Ground::Missing => "missing",
        }
    }
}

/// The answer for one pair of error lists.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Judgement {
    /// How the default did.
    pub outcome: Outcome,
    /// What that rests on.
    pub ground: Ground,
    /// Median error of the default, degrees.
    pub default_deg: Option<f64>,
    /// Median error of the other, degrees, in the same trials.
    pub against_deg: Option<f64>,
    /// Median of default less other, degrees.
    pub difference_deg: Option<f64>,
    /// Trials that both could compare.
    pub n_trials: usize,
    /// Probability of the signed-rank test over the trials, none when all differences are zero.
    pub p: Option<f64>,
}

/// Judges the default's errors beside another's, trial by trial, degrees; none when the other has no error at all.
pub fn judge(default: &[Option<f64>], against: &[Option<f64>]) -> Option<Judgement> {
    let pairs: Vec<(f64, f64)> = default.iter().zip(against).filter_map(|(a, b)| Some(((*a)?, (*b)?))).collect();
    let missing = default.iter().zip(against).any(|(a, b)| a.is_none() && b.is_some());
    if pairs.is_empty() && !missing {
        return None;
    }
    let differences: Vec<f64> = pairs.iter().map(|(a, b)| a - b).collect();
    let difference_deg = median(&differences);
    let p = signed_rank(&differences).map(|test| test.p);
    let difference = difference_deg.unwrap_or(0.0);
    let by_sign = if difference < 0.0 { Outcome::Beats } else { Outcome::Loses };
    let same_sign = differences.iter().all(|d| *d < 0.0) || differences.iter().all(|d| *d > 0.0);
    let (outcome, ground) = if missing {
        (Outcome::Loses, Ground::Missing)
    } else if difference.abs() <= CLOSE_DEG {
        (Outcome::Ties, Ground::Close)
    } else if pairs.len() < TESTABLE_FROM {
        (if same_sign { by_sign } else { Outcome::Ties }, Ground::Untested)
    } else if p.is_none_or(|p| p >= SIGNIFICANCE) {
        (Outcome::Ties, Ground::NotSignificant)
    } else {
        (by_sign, Ground::Significant)
    };
    let middle = |of: fn(&(f64, f64)) -> f64| median(&pairs.iter().map(of).collect::<Vec<f64>>());
    Some(Judgement {
        outcome,
        ground,
        default_deg: middle(|pair| pair.0),
        against_deg: middle(|pair| pair.1),
        difference_deg,
        n_trials: pairs.len(),
        p,
    })
}

/// The default beside one other contender in one angle of one exercise.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct VerdictRow {
    /// Where the trials come from.
    pub dataset: String,
    /// What was done in them, or `all`.
    pub exercise: String,
    /// The angle, both sides together.
    pub measure: &'static str,
    /// The error that is compared.
    pub statistic: Statistic,
    /// The other.
    pub against: String,
    /// The answer.
    #[serde(flatten)]
    pub judgement: Judgement,
}

/// Number of rows of each outcome against one contender.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct Score {
    /// The other.
    pub against: String,
    /// The error that is compared.
    pub statistic: Statistic,
    /// Rows that the default wins.
    pub beats: usize,
    /// Rows without a difference that counts.
    pub ties: usize,
    /// Rows that the default loses.
    pub loses: usize,
}

/// The default beside every other contender.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Verdict {
    /// The default.
    pub default: String,
    /// [`RULE`].
    pub rule: &'static str,
    /// Whether the default loses no row at all.
    pub default_beats_or_ties_everywhere: bool,
    /// Sums over the rows of single exercises (`all` not counted again).
    pub scores: Vec<Score>,
    /// In the order of data set, exercise (`all` last), angle, contender, statistic.
    pub rows: Vec<VerdictRow>,
}

impl Verdict {
    /// The rows that the default loses.
    pub fn losses(&self) -> impl Iterator<Item = &VerdictRow> {
        self.rows.iter().filter(|row| row.judgement.outcome == Outcome::Loses)
    }
}

/// The verdict over all data sets; none when the default or every other contender was left out.
pub(super) fn verdict(sets: &Sets<'_>, contenders: &[Contender]) -> Option<Verdict> {
    let default = contenders.iter().position(|contender| contender.is_default())?;
    if contenders.len() < 2 {
        return None;
    }
    let mut rows = Vec::new();
    for (dataset, exercises) in sets {
        for (exercise, trials) in exercises {
            for (measure, _) in MEASURES {
                let agreements: Vec<Vec<Option<Agreement>>> =
                    (0..contenders.len()).map(|contender| agreements(trials, contender, measure)).collect();
                for (i, contender) in contenders.iter().enumerate().filter(|(i, _)| *i != default) {
                    for statistic in Statistic::ALL {
                        let errors = |contender: usize| -> Vec<Option<f64>> {
                            agreements[contender].iter().map(|a| statistic.of(a.as_ref()?)).collect()
                        };
                        let Some(judgement) = judge(&errors(default), &errors(i)) else { continue };
                        rows.push(VerdictRow {
                            dataset: (*dataset).to_owned(),
                            exercise: (*exercise).to_owned(),
                            measure,
                            statistic,
                            against: contender.name(),
                            judgement,
                        });
                    }
                }
            }
        }
    }
    let others = contenders.iter().enumerate().filter(|(i, _)| *i != default).map(|(_, contender)| contender.name());
    let scores = others.flat_map(|against| Statistic::ALL.map(|statistic| score(&rows, &against, statistic))).collect();
    let default_beats_or_ties_everywhere = rows.iter().all(|row| row.judgement.outcome != Outcome::Loses);
    Some(Verdict { default: contenders[default].name(), rule: RULE, default_beats_or_ties_everywhere, scores, rows })
}

/// Agreement of a contender in one angle of each trial, both sides together.
fn agreements(trials: &[&TrialOutcome], contender: usize, measure: &str) -> Vec<Option<Agreement>> {
    let in_trial = |trial: &&TrialOutcome| {
        let compared = trial.results[contender].as_ref().ok()?;
        let pooled = agreement_in_trial(&compared.comparisons, measure, &Side::BOTH);
        (pooled.n() > 0).then_some(pooled)
    };
    trials.iter().map(in_trial).collect()
}

fn score(rows: &[VerdictRow], against: &str, statistic: Statistic) -> Score {
    let count = |outcome: Outcome| {
        let own = rows.iter().filter(|row| row.against == against && row.statistic == statistic);
        own.filter(|row| row.exercise != ALL_EXERCISES && row.judgement.outcome == outcome).count()
    };
    Score {
        against: against.to_owned(),
        statistic,
        beats: count(Outcome::Beats),
        ties: count(Outcome::Ties),
        loses: count(Outcome::Loses),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn some(errors: &[f64]) -> Vec<Option<f64>> {
        errors.iter().copied().map(Some).collect()
    }

    fn outcome(default: &[f64], against: &[f64]) -> (Outcome, Ground) {
        let found = judge(&some(default), &some(against)).unwrap();
        (found.outcome, found.ground)
    }

    #[test]
    fn a_smaller_error_in_each_of_six_trials_beats_and_a_larger_one_loses() {
        let small = [1.0, 2.0, 3.0, 4.0, 5.0, 6.0];
        let large = small.map(|error| error + 0.2);
        assert_eq!(outcome(&small, &large), (Outcome::Beats, Ground::Significant));
        assert_eq!(outcome(&large, &small), (Outcome::Loses, Ground::Significant));
        let found = judge(&some(&small), &some(&large)).unwrap();
        assert_eq!((found.n_trials, found.default_deg), (6, Some(3.5)));
        assert!((found.difference_deg.unwrap() + 0.2).abs() < 1e-12 && (found.p.unwrap() - 2.0 / 64.0).abs() < 1e-12);
    }

    #[test]
    fn a_difference_within_a_twentieth_of_a_degree_is_a_tie_however_certain() {
        let small = [1.0; 20];
        assert_eq!(outcome(&small.map(|e| e + 0.04), &small), (Outcome::Ties, Ground::Close));
        assert_eq!(outcome(&small.map(|e| e + 0.06), &small), (Outcome::Loses, Ground::Significant));
        assert_eq!(outcome(&small, &small), (Outcome::Ties, Ground::Close));
    }

    #[test]
    fn a_difference_that_the_test_does_not_see_is_a_tie() {
        // Median +0.3, but two trials are far better: rank sums 10 and 11 of 21.
        let found = outcome(&[1.1, 1.2, 1.4, 1.5, 0.1, 0.0], &[1.0; 6]);
        assert_eq!(found, (Outcome::Ties, Ground::NotSignificant));
    }

    #[test]
    fn too_few_trials_do_not_hide_a_loss_behind_the_test() {
        assert_eq!(outcome(&[7.0, 8.0, 9.0], &[6.0, 7.0, 8.0]), (Outcome::Loses, Ground::Untested));
        assert_eq!(outcome(&[6.0], &[7.0]), (Outcome::Beats, Ground::Untested));
        let mixed = outcome(&[7.0, 8.0, 1.0], &[6.0, 7.0, 8.0]);
        assert_eq!(mixed, (Outcome::Ties, Ground::Untested), "the trials disagree");
    }

    #[test]
    fn a_trial_without_the_default_is_a_loss_and_one_without_the_other_is_left_out() {
        let found = judge(&[Some(1.0), None], &[Some(9.0), Some(9.0)]).unwrap();
        assert_eq!((found.outcome, found.ground, found.n_trials), (Outcome::Loses, Ground::Missing, 1));
        let found = judge(&[Some(1.0), Some(1.0)], &[Some(9.0), None]).unwrap();
        assert_eq!((found.outcome, found.n_trials), (Outcome::Beats, 1));
        assert_eq!(judge(&[Some(1.0)], &[None]), None);
        assert_eq!(judge(&[None], &[Some(1.0)]).unwrap().outcome, Outcome::Loses);
    }
}
