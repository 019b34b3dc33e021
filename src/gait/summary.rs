//! Means, variability, symmetry and phases over the steps that count.

use super::contact::GaitContact;
use super::spread::{ConstantError, Observation, Spread};
use super::steps::{StepValues, StridePhases, steps};
use crate::assessment::PerformanceMeasure;
#[cfg(test)]
use crate::body::Side;
use nalgebra::Vector2;

/// Definition id: distances between the places of the heels at initial contact; the width is the distance of a heel from
/// the line through the other foot's heels before and after it.
pub const HEEL_TO_OPPOSITE_LINE: &str = "heel_to_opposite_line";

/// How the places of contacts were measured.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct PlaceDefinition {
    /// Definition id of the lengths and widths made of them; none without places.
    pub id: Option<&'static str>,
    /// Standard deviation of the error of one step length and of one step width, metres; none when not known.
    pub error_sd_m: Option<[f64; 2]>,
    /// Standard deviation, over sensors and people, of how far one foot is seen aside from where it is against the other, in
    /// each axis of the floor, metres; none when there is no such error.
    pub offset_sd_m: Option<f64>,
}

/// Which steps the measures are taken over.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum StepSelection {
    /// Those that no rule leaves out.
    Counted,
    /// Every step, also first and last ones and turns.
    All,
}

/// A part of a stride, percent.
type ShareOfStride = fn(&StridePhases) -> f64;

/// The measures of contacts in order of time, as their exclusions are marked.
pub fn measures(
    contacts: &[GaitContact],
    places: &PlaceDefinition,
    selection: StepSelection,
) -> Vec<PerformanceMeasure> {
    let all = steps(contacts);
    let is_all = selection == StepSelection::All;
    let counted: Vec<&StepValues> = all.iter().filter(|s| is_all || s.counts).collect();
    let strides: Vec<&StepValues> = all.iter().filter(|s| is_all || s.stride_counts).collect();
    let mut found = Vec::new();
    let id = places.id.map(str::to_owned);
    let [length_error, width_error] = match places.error_sd_m {
        Some([length, width]) => [Some(length), Some(width)],
        None => [None, None],
    };
    if id.is_some() {
        let length = Spread::of(counted.iter().filter_map(|s| observation(s, s.length_m)).collect(), length_error);
        let length = length.with_constant(places.offset_sd_m.map_or(ConstantError::None, ConstantError::Opposed));
        found.extend(length.all("step_length_m", &id));
        let width = Spread::of(counted.iter().filter_map(|s| observation(s, s.width_m)).collect(), width_error);
        let width = width.with_constant(places.offset_sd_m.map_or(ConstantError::None, ConstantError::Shared));
        found.extend(width.variability("step_width_m", &id));
        let stride = Spread::of(strides.iter().filter_map(|s| observation(s, s.stride_length_m)).collect(), None);
        found.extend(stride.all("stride_length_m", &id));
    }
    let time = Spread::of(counted.iter().filter_map(|s| observation(s, Some(s.time_s))).collect(), None);
    found.extend(time.all("step_time_s", &None));
    let stride_time = Spread::of(strides.iter().filter_map(|s| observation(s, s.stride_time_s)).collect(), None);
    found.extend(stride_time.all("stride_time_s", &None));
    found.extend(phases(&strides));
    found.extend(rates(contacts, &counted, &id));
    found
}

fn observation(step: &StepValues, value: Option<f64>) -> Option<Observation> {
    value.filter(|value| value.is_finite()).map(|value| Observation { side: step.side, value })
}

/// Shares and times of stance, swing and support.
fn phases(strides: &[&StepValues]) -> Vec<PerformanceMeasure> {
    let of = |value: &dyn Fn(&StridePhases, f64) -> f64| {
        let value =
            |s: &&&StepValues| observation(s, s.phases.zip(s.stride_time_s).map(|(p, stride)| value(&p, stride)));
        Spread::of(strides.iter().filter_map(|s| value(&s)).collect(), None)
    };
    let mut found = Vec::new();
    let stance = of(&|p, _| p.stance_s);
    if stance.is_empty() {
        return found;
    }
    found.extend(stance.variability("stance_time_s", &None));
    found.extend(of(&|p, _| p.swing_s).all("swing_time_s", &None));
    let shares: [(&str, ShareOfStride); 4] = [
        ("stance_pct", |p| p.stance_s),
        ("swing_pct", |p| p.swing_s),
        ("double_support_pct", |p| p.double_support_s),
        ("single_support_pct", |p| p.single_support_s),
    ];
    for (name, part) in shares {
        let share = of(&|p, stride| 100.0 * part(p) / stride);
        found.extend(share.means(name, &None));
    }
    found
}

/// Cadence and speed over the runs of steps that count:
///
/// ```text
/// cadence = 60 (contacts − 1) / (t_last − t_first)      speed = way / (t_last − t_first)
/// ```
///
/// The way is from a place of a foot to a later place of the same foot, so that a sensor which sees one foot ahead of
/// where it is adds nothing to it. A run that ends with the other foot is the mean of its two such spans, each with its
/// own time.
fn rates(contacts: &[GaitContact], counted: &[&StepValues], id: &Option<String>) -> Vec<PerformanceMeasure> {
    let (mut n_steps, mut time_s) = (0u64, 0.0);
    let (mut way_m, mut way_time_s, mut n_way) = (0.0, 0.0, 0u64);
    for run in
        counted.chunk_by(|a, b| b.contact == a.contact + 1 && contacts[a.contact].walk == contacts[b.contact].walk)
    {
        let (first, last) = (run[0].contact - 1, run[run.len() - 1].contact);
        n_steps += run.len() as u64;
        time_s += contacts[last].contact_s - contacts[first].contact_s;
        if let Some([way, time]) = way_of_run(&contacts[first..=last]) {
            way_m += way;
            way_time_s += time;
            n_way += run.len() as u64;
        }
    }
    let measure = |name: &str, value: Option<f64>, n: u64, definition: Option<String>| PerformanceMeasure {
        name: name.to_owned(),
        side: None,
        value,
        standard_error: None,
        error_sd: None,
        n_observations: Some(n),
        definition,
        reason: if value.is_some() { String::new() } else { "too few steps count".to_owned() },
    };
    let cadence = (n_steps > 0 && time_s > 0.0).then(|| 60.0 * n_steps as f64 / time_s);
    let mut found = vec![measure("cadence_spm", cadence, n_steps, None)];
    if id.is_some() {
        let speed = (way_time_s > 0.0).then(|| way_m / way_time_s);
        let mut speed = measure("usual_speed_mps", speed, n_way, id.clone());
        speed.standard_error = speed.value.and_then(|_| speed_error(counted));
        found.push(speed);
    }
    found
}

/// Standard error of a speed from the speeds of single strides, SD / √n; none with fewer than two.
fn speed_error(counted: &[&StepValues]) -> Option<f64> {
    let of_stride =
        |s: &&StepValues| observation(s, s.stride_length_m.zip(s.stride_time_s).map(|(way, time)| way / time));
    Spread::of(counted.iter().filter_map(of_stride).collect(), None).standard_error()
}

/// Way of a run and its time, between the first and the last contact that have places.
fn way_of_run(run: &[GaitContact]) -> Option<[f64; 2]> {
    let placed: Vec<(usize, Vector2<f64>)> =
        run.iter().enumerate().filter_map(|(i, c)| Some((i, Vector2::from(c.place_m?)))).collect();
    let span = |from: usize, to: usize| {
        let ((a, from_place), (b, to_place)) = (placed[from], placed[to]);
        ((to_place - from_place).norm(), run[b].contact_s - run[a].contact_s)
    };
    let last = placed.len().checked_sub(1).filter(|last| *last > 0)?;
    let spans = match run[placed[0].0].side == run[placed[last].0].side {
        true => vec![span(0, last)],
        false if last >= 3 => vec![span(0, last - 1), span(1, last)],
        // A single step has no two places of one foot.
        false => vec![span(0, last)],
    };
    let count = spans.len() as f64;
    Some([spans.iter().map(|s| s.0).sum::<f64>() / count, spans.iter().map(|s| s.1).sum::<f64>() / count])
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::gait::contact::{GaitContact, mark_excluded};

    const HEELS: PlaceDefinition =
        PlaceDefinition { id: Some(HEEL_TO_OPPOSITE_LINE), error_sd_m: None, offset_sd_m: None };

    fn walk(n: usize) -> Vec<GaitContact> {
        let at = |i: usize| {
            let (side, z) = if i.is_multiple_of(2) { (Side::Right, 0.05) } else { (Side::Left, -0.05) };
            GaitContact::new(side, 0.55 * i as f64, [0.6 * i as f64, z])
        };
        (0..n).map(at).collect()
    }

    fn value(measures: &[PerformanceMeasure], name: &str) -> Option<f64> {
        measures.iter().find(|m| m.name == name && m.side.is_none()).and_then(|m| m.value)
    }

    fn near(found: Option<f64>, expected: f64, within: f64) {
        assert!(found.is_some_and(|found| (found - expected).abs() < within), "{found:?} instead of {expected}");
    }

    #[test]
    fn cadence_and_speed_test_of_section_6_regular_walk() {
        let found = measures(&walk(4), &HEELS, StepSelection::All);
        near(value(&found, "step_length_m"), 0.60, 1e-9);
        near(value(&found, "stride_length_m"), 1.20, 1e-9);
        near(value(&found, "step_width_m"), 0.10, 1e-9);
        near(value(&found, "cadence_spm"), 109.09, 5e-3);
        near(value(&found, "usual_speed_mps"), 1.0909, 5e-5);
        near(value(&found, "step_length_symmetry_ratio"), 1.0, 1e-9);
        let width = found.iter().find(|m| m.name == "step_width_m").unwrap();
        assert_eq!(width.definition.as_deref(), Some("heel_to_opposite_line"));
    }

    #[test]
    fn the_measures_rest_on_the_steps_that_count_and_say_how_many() {
        let mut contacts = walk(10);
        mark_excluded(&mut contacts);
        let found = measures(&contacts, &HEELS, StepSelection::Counted);
        let n = |name: &str| found.iter().find(|m| m.name == name && m.side.is_none()).unwrap().n_observations;
        assert_eq!((n("step_length_m"), n("cadence_spm"), n("stride_length_m")), (Some(5), Some(5), Some(4)));
        near(value(&found, "cadence_spm"), 60.0 / 0.55, 1e-9);
        near(value(&found, "usual_speed_mps"), 0.6 / 0.55, 1e-9);
    }

    #[test]
    fn a_foot_that_is_seen_ahead_of_where_it_is_changes_neither_speed_nor_mean_length() {
        for n in [4, 5, 6, 7] {
            let mut contacts = walk(n);
            for contact in contacts.iter_mut().filter(|contact| contact.side == Side::Left) {
                contact.place_m = contact.place_m.map(|[x, z]| [x + 0.05, z]);
            }
            let found = measures(&contacts, &HEELS, StepSelection::All);
            near(value(&found, "usual_speed_mps"), 0.6 / 0.55, 1e-9);
            near(value(&found, "step_length_m"), 0.60, 1e-4);
        }
    }

    #[test]
    fn contacts_without_places_have_times_only() {
        let mut contacts = walk(6);
        contacts.iter_mut().for_each(|contact| contact.place_m = None);
        let found = measures(&contacts, &PlaceDefinition::default(), StepSelection::All);
        near(value(&found, "cadence_spm"), 60.0 / 0.55, 1e-9);
        assert!(found.iter().all(|m| !m.name.ends_with("_m") && !m.name.ends_with("_mps")), "{found:?}");
    }
}
