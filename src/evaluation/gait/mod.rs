//! Gait measures of disturbed walks beside those of the walks themselves.

pub mod baseline;
pub mod disturbed;
pub mod truth;
pub mod walks;

#[cfg(test)]
mod tests;

use crate::assessment::PerformanceMeasure;
use crate::body::Side;
use crate::gait::steps::{StepValues, steps};
use crate::gait::{GaitContact, HEEL_TO_OPPOSITE_LINE, PlaceDefinition, findings};
use serde::Serialize;
use truth::TrueContact;

/// A found contact farther than this from a true one of the same foot is none, seconds.
const SAME_S: f64 = 0.2;

/// Measures that are compared.
pub const COMPARED: [&str; 12] = [
    "step_time_s",
    "stride_time_s",
    "step_length_m",
    "stride_length_m",
    "step_width_m",
    "cadence_spm",
    "usual_speed_mps",
    "swing_pct",
    "double_support_pct",
    "step_length_sd_m",
    "step_width_sd_m",
    "stride_time_sd_s",
];

/// Errors of found contacts on one walk. All are over the contacts that were found, before any is excluded.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct GaitErrors {
    /// True contacts, and those of them that were found.
    pub n_contacts: [usize; 2],
    /// Contacts that were found and are none.
    pub n_extra: usize,
    /// Mean of found − true initial contact, seconds.
    pub contact_bias_s: f64,
    /// Largest error of a single step time, seconds.
    pub worst_step_time_s: f64,
    /// Mean absolute error of single step lengths, metres.
    pub step_length_m: f64,
    /// Standard deviations of the errors of single step lengths and step widths, each side about its own mean, metres.
    pub scatter_m: [f64; 2],
    /// Measures by name: found, true.
    pub measures: Vec<(String, [f64; 2])>,
}

impl GaitErrors {
    /// Found − true of a measure.
    pub fn error(&self, name: &str) -> Option<f64> {
        self.measures.iter().find(|(measure, _)| measure == name).map(|(_, [found, truth])| found - truth)
    }

    /// The same as a share of the truth.
    pub fn relative(&self, name: &str) -> Option<f64> {
        self.measures.iter().find(|(measure, _)| measure == name).map(|(_, [found, truth])| found / truth - 1.0)
    }
}

/// Compares found contacts with true ones; none without two contacts that were found.
///
/// Both have the same definitions of measures, so what differs is when and where contacts were found.
pub fn compare(found: &[GaitContact], truth: &[TrueContact]) -> Option<GaitErrors> {
    let mut pairs: Vec<(GaitContact, GaitContact)> = Vec::new();
    for (i, contact) in truth.iter().enumerate() {
        let near = |c: &&GaitContact| c.side == contact.side && (c.contact_s - contact.contact_s).abs() < SAME_S;
        let Some(own) = found.iter().find(near) else { continue };
        let before = truth[..i].iter().rev().find(|other| other.side == contact.side);
        let twin = GaitContact {
            toe_off_s: before.and_then(|before| before.release_s).filter(|_| own.toe_off_s.is_some()),
            place_m: contact.place_m.filter(|_| own.place_m.is_some()),
            walk: own.walk,
            ..GaitContact::new(contact.side, contact.contact_s, [0.0; 2])
        };
        let own = GaitContact {
            place_m: own.place_m.filter(|_| contact.place_m.is_some()),
            toe_off_s: own.toe_off_s.filter(|_| twin.toe_off_s.is_some()),
            ..own.clone()
        };
        pairs.push((own, twin));
    }
    if pairs.len() < 2 {
        return None;
    }
    let (own, twins): (Vec<GaitContact>, Vec<GaitContact>) = pairs.into_iter().unzip();
    let steps = [&own, &twins].map(|contacts| steps(contacts));
    let step_pairs = || steps[0].iter().zip(&steps[1]);
    let lengths: Vec<f64> = step_pairs().filter_map(|(a, b)| Some((a.length_m? - b.length_m?).abs())).collect();
    let scatter = |value: fn(&StepValues) -> Option<f64>| {
        let errors = |side: Side| -> Vec<f64> {
            step_pairs().filter(|(a, _)| a.side == side).filter_map(|(a, b)| Some(value(a)? - value(b)?)).collect()
        };
        let sides = Side::BOTH.map(errors);
        let squares = sides.iter().flat_map(|errors| {
            let mean = errors.iter().sum::<f64>() / errors.len().max(1) as f64;
            errors.iter().map(move |error| (error - mean).powi(2))
        });
        let free = sides.iter().map(|errors| errors.len().saturating_sub(1)).sum::<usize>();
        (squares.sum::<f64>() / free.max(1) as f64).sqrt()
    };
    let scatter_m = [scatter(|s| s.length_m), scatter(|s| s.width_m)];
    let heels = PlaceDefinition { id: Some(HEEL_TO_OPPOSITE_LINE), ..PlaceDefinition::default() };
    let [first, last] = [0, truth.len() - 1].map(|i| truth[i].contact_s);
    // The truth does not say what was before its first and after its last contact.
    let within = found.iter().filter(|c| (first - SAME_S..=last + SAME_S).contains(&c.contact_s)).count();
    let n_extra = within.saturating_sub(own.len());
    let bias = own.iter().zip(&twins).map(|(a, b)| a.contact_s - b.contact_s).sum::<f64>() / own.len() as f64;
    let worst = step_pairs().map(|(a, b)| (a.time_s - b.time_s).abs()).fold(0.0, f64::max);
    let n_contacts = [truth.len(), own.len()];
    let all = [own, twins].map(|contacts| findings(contacts, &heels, "").measures_of_all_steps);
    let value = |measures: &[PerformanceMeasure], name: &str| {
        measures.iter().find(|m| m.name == name && m.side.is_none()).and_then(|m| m.value)
    };
    let both = |name: &&str| Some(((*name).to_owned(), [value(&all[0], name)?, value(&all[1], name)?]));
    Some(GaitErrors {
        n_contacts,
        n_extra,
        contact_bias_s: bias,
        worst_step_time_s: worst,
        step_length_m: lengths.iter().sum::<f64>() / lengths.len().max(1) as f64,
        scatter_m,
        measures: COMPARED.iter().filter_map(both).collect(),
    })
}
