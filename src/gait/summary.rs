//! Means, variability, symmetry and phases over the steps that count.

use super::contact::GaitContact;
use super::spread::{Observation, Spread};
use super::steps::{StepValues, StridePhases, steps};
use crate::assessment::PerformanceMeasure;
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
}

/// Which steps the measures are taken over.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum StepSelection {
    /// Those that no rule leaves out.
    Counted,
    /// Every step, also first and last ones and turns.
    All,
}

/// The measures of contacts in order of time, as their exclusions are marked.
pub fn measures(contacts: &[GaitContact], places: &PlaceDefinition, selection: StepSelection) -> Vec<PerformanceMeasure> {
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
        found.extend(length.all("step_length_m", &id));
        let width = Spread::of(counted.iter().filter_map(|s| observation(s, s.width_m)).collect(), width_error);
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
        let value = |s: &&&StepValues| observation(s, s.phases.zip(s.stride_time_s).map(|(p, stride)| value(&p, stride)));
        Spread::of(strides.iter().filter_map(|s| value(&s)).collect(), None)
    };
    let mut found = Vec::new();
    let stance = of(&|p, _| p.stance_s);
    if stance.is_empty() {
        return found;
    }
    found.extend(stance.variability("stance_time_s", &None));
    found.extend(of(&|p, _| p.swing_s).all("swing_time_s", &None));
    let shares: [(&str, fn(&StridePhases) -> f64); 4] = [
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
    for run in counted.chunk_by(|a, b| b.contact == a.contact + 1 && contacts[a.contact].walk == contacts[b.contact].walk) {
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
        speed.standard_error = speed.value.and_then(|value| speed_error(counted, value));
        found.push(speed);
    }
    found
}

/// Standard error of a speed from the speeds of single strides, SD / √n; none with fewer than two.
fn speed_error(counted: &[&StepValues], _speed: f64) -> Option<f64> {
    let of_stride = |s: &&StepValues| observation(s, s.stride_length_m.zip(s.stride_time_s).map(|(way, time)| way / time));
    Spread::of(counted.iter().filter_map(of_stride).collect(), None).standard_error()
}

/// Way along the direction of a run and its time.
fn way_of_run(run: &[GaitContact]) -> Option<[f64; 2]> {
    let places: Option<Vec<(Side, Vector2<f64>, f64)>> =
        run.iter().map(|c| c.place_m.map(|place| (c.side, Vector2::from(place), c.contact_s))).collect();
    let places = places?;
    let n = places.len();
    let span = |from: usize, to: usize| ((places[to].1 - places[from].1).norm(), places[to].2 - places[from].2);
    let spans = match places[0].0 == places[n - 1].0 {
        true => vec![span(0, n - 1)],
        false if n >= 4 => vec![span(0, n - 2), span(1, n - 1)],
        // A single step has no two places of one foot.
        false => vec![span(0, n - 1)],
    };
    let count = spans.len() as f64;
    Some([spans.iter().map(|s| s.0).sum::<f64>() / count, spans.iter().map(|s| s.1).sum::<f64>() / count])
}
