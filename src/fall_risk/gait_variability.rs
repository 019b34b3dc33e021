//! How much steps vary, with the part of it that measurement adds taken out.
//!
//! ```text
//! SD_true² = SD_observed² − SD_error²
//! ```

use super::known::{Known, Measured};
use super::rule::{Cutoff, Evidence, Finding, Rule, RuleInfo, Status};

/// Fewest steps that tell a variability; our own choice.
const FEWEST_STEPS: u32 = 20;
/// Share of the limit up to which the error of measurement may vary; our own choice.
const LARGEST_ERROR: f64 = 0.5;

/// Speed from which on extreme variation of step width goes with falls, m/s.
const BRACH_SPEED_MPS: f64 = 1.0;
/// Coefficients of variation below and above which step width varies extremely, %.
const BRACH_EXTREME_PCT: [f64; 2] = [7.0, 30.0];

/// Standard deviations of step width: usual below the first, excessive above the second, metres.
const SKIADOPOULOS_M: [f64; 2] = [0.0197, 0.0250];

/// `step_width_cv`.
pub(super) static STEP_WIDTH_CV: Rule = Rule {
    info: RuleInfo {
        id: "step_width_cv",
        measures: &["step_width_m", "step_width_sd_m", "usual_speed_mps"],
        version: 1,
        statement: "Step width that varies extremely little (under about 7 %) or much (over about 30 %) goes with falls in \
                    people who walk at 1.0 m/s or faster",
        unit: Some("%"),
        cutoffs: &[
            Cutoff::below(BRACH_EXTREME_PCT[0], Evidence::Unconfirmed),
            Cutoff::above(BRACH_EXTREME_PCT[1], Evidence::Unconfirmed),
        ],
        population: "503 people, mean age 79 years",
        citation: "Brach 2005, doi 10.1186/1743-0003-2-21",
        evidence: Evidence::Unconfirmed,
        accuracy: "odds ratio 4.38 (1.79-10.72) at 1.0 m/s or faster; not significant below",
    },
    find: |info, known| {
        let (Some(width), Some(sd)) = (&known.measures.step_width_m, &known.measures.step_width_sd_m) else {
            return Finding::unknown(info, "step width and how much it varies");
        };
        let Some(speed) = &known.measures.usual_speed_mps else {
            return Finding::unknown(info, "the walking speed, on which the rule depends");
        };
        if speed.value < BRACH_SPEED_MPS {
            return Finding::new(info, Some(Status::NotAssessable), "the rule holds for 1.0 m/s and faster only");
        }
        let in_percent = |m: f64| 100.0 * m / width.value;
        let percent = Measured {
            value: in_percent(sd.value),
            standard_error: sd.standard_error.map(in_percent),
            n_observations: sd.n_observations,
            error_sd: sd.error_sd.map(in_percent),
        };
        let [low, high] = BRACH_EXTREME_PCT;
        let true_sd = match without_error(&percent, high) {
            Ok(found) => found,
            Err(reason) => return refused(info, &percent, reason),
        };
        let nearer_low = true_sd.value < 0.5 * (low + high);
        Finding::against(info, &true_sd, info.cutoffs[usize::from(!nearer_low)])
    },
};

/// `step_width_sd`.
pub(super) static STEP_WIDTH_SD: Rule = Rule {
    info: RuleInfo {
        id: "step_width_sd",
        measures: &["step_width_sd_m"],
        version: 1,
        statement: "Step width varies by less than 1.97 cm usually; more than 2.50 cm is excessive. It separates old from \
                    young people, not those who fall",
        unit: Some("m"),
        cutoffs: &[Cutoff::above(SKIADOPOULOS_M[1], Evidence::Stated)],
        population: "304 old and 219 young people",
        citation: "Skiadopoulos 2020, doi 10.1186/s12984-020-00671-9",
        evidence: Evidence::Stated,
        accuracy: "not one of falls",
    },
    find: |info, known| {
        let Some(sd) = &known.measures.step_width_sd_m else {
            return Finding::unknown(info, "how much step width varies");
        };
        let [usual, excessive] = SKIADOPOULOS_M;
        let true_sd = match without_error(sd, excessive) {
            Ok(found) => found,
            Err(reason) => return refused(info, sd, reason),
        };
        let category = match true_sd.value {
            sd if sd < usual => "usual",
            sd if sd > excessive => "excessive",
            _ => "between usual and excessive",
        };
        Finding::against(info, &true_sd, info.cutoffs[0]).with_category(category)
    },
};

/// `stride_time_sd`.
pub(super) static STRIDE_TIME_SD: Rule = Rule {
    info: RuleInfo {
        id: "stride_time_sd",
        measures: &["stride_time_sd_s"],
        version: 1,
        statement: "Stride time of people who fell varied by 106 +- 30 ms, of others by 49 +- 4 ms; there is no limit",
        unit: Some("s"),
        cutoffs: &[],
        population: "52 outpatients of 70 years and more",
        citation: "Hausdorff 2001, doi 10.1053/apmr.2001.24893",
        evidence: Evidence::Stated,
        accuracy: "no limit, so none",
    },
    find: |info, known: &Known| match &known.measures.stride_time_sd_s {
        Some(sd) => Finding::information(info, sd, "both groups' means are shown; the source names no limit"),
        None => Finding::unknown(info, "how much stride time varies"),
    },
};

/// The standard deviation without what measurement adds, or why there is none; `limit` is the rule's, in the same unit.
fn without_error(observed: &Measured, limit: f64) -> Result<Measured, String> {
    let n = observed.n_observations.unwrap_or(0);
    if n < FEWEST_STEPS {
        return Err(format!("{n} steps are too few: a variability needs at least {FEWEST_STEPS}"));
    }
    let Some(error_sd) = observed.error_sd else {
        return Err("how much the measurement itself varies is not known, and adds to what is seen".to_owned());
    };
    if error_sd > LARGEST_ERROR * limit {
        return Err("the measurement itself varies by more than half of the limit".to_owned());
    }
    let value = (observed.value.powi(2) - error_sd.powi(2)).max(0.0).sqrt();
    Ok(Measured { value, ..*observed })
}

fn refused(info: &RuleInfo, observed: &Measured, reason: String) -> Finding {
    Finding::new(info, Some(Status::NotAssessable), reason).with_value(observed)
}
