//! Gait measures from the steps of the depth pipeline, whose camera moves with the walker.
//!
//! There are no places on a floor that stays, so:
//!
//! ```text
//! stride length  sum of two step lengths of one definition that follow each other
//! speed          stride length / stride time
//! ```

use super::contact::{GaitContact, StepExclusion};
use super::spread::{Observation, Spread};
use crate::assessment::PerformanceMeasure;
use crate::assessment::gait::{ANKLES_AT_MID_DOUBLE_SUPPORT, FLAT_FOOTPRINTS, Gait, Step, StepMeasure};

/// Half a 95 % interval in standard deviations.
const NORMAL_975: f64 = 1.96;

/// The contacts of steps; they have no places.
pub(super) fn contacts(gait: &Gait) -> Vec<GaitContact> {
    let mut walk = 0;
    let mut found: Vec<GaitContact> = Vec::new();
    for (i, step) in gait.steps.iter().enumerate() {
        // The first step of a walk has no time since the contact before. After a contact that was missed the same walk
        // goes on, with two contacts of one foot.
        let is_first = step.step_time_s.is_none() && !has_missed(step);
        if i > 0 && is_first {
            walk += 1;
        }
        found.push(GaitContact {
            place_m: None,
            toe_off_s: Some(step.toe_off_s),
            walk,
            coverage: step.coverage,
            is_turning: step.excluded_because.iter().any(|reason| reason == "turning"),
            excluded_because: step.excluded_because.iter().filter_map(|name| StepExclusion::of_name(name)).collect(),
            ..GaitContact::new(step.side, step.heel_strike_s, [0.0; 2])
        });
    }
    found
}

fn has_missed(step: &Step) -> bool {
    step.excluded_because.iter().any(|reason| reason == "missed_contact")
}

/// Lengths, widths and speed by definition, footprints first.
pub(super) fn lengths(gait: &Gait, is_all: bool) -> Vec<PerformanceMeasure> {
    let mut found = Vec::new();
    for definition in [FLAT_FOOTPRINTS, ANKLES_AT_MID_DOUBLE_SUPPORT] {
        let counted: Vec<(&Step, &StepMeasure)> = gait
            .steps
            .iter()
            .filter(|step| is_all || step.excluded_because.is_empty())
            .filter_map(|step| Some((step, measure_of(step, definition)?)))
            .collect();
        if counted.is_empty() {
            continue;
        }
        let id = Some(definition.to_owned());
        let values = |value: fn(&StepMeasure) -> f64| {
            counted.iter().map(|(step, m)| Observation { side: step.side, value: value(m) }).collect::<Vec<_>>()
        };
        let error = |interval: fn(&StepMeasure) -> [f64; 2]| {
            let squares = counted.iter().map(|(_, m)| half_width(interval(m)).powi(2)).sum::<f64>();
            Some((squares / counted.len() as f64).sqrt() / NORMAL_975)
        };
        let length = Spread::of(values(|m| m.length_m), error(|m| m.length_interval_m));
        found.extend(length.all("step_length_m", &id));
        let width = Spread::of(values(|m| m.width_m), error(|m| m.width_interval_m));
        found.extend(width.variability("step_width_m", &id));
        let (strides, speeds) = strides(&gait.steps, definition, is_all);
        found.extend(Spread::of(strides, None).all("stride_length_m", &id));
        found.extend(Spread::of(speeds, None).means("usual_speed_mps", &id).into_iter().take(1));
    }
    found
}

fn half_width([low, high]: [f64; 2]) -> f64 {
    0.5 * (high - low)
}

fn measure_of<'a>(step: &'a Step, definition: &str) -> Option<&'a StepMeasure> {
    step.measures.iter().find(|measure| measure.definition == definition)
}

/// Stride lengths and their speeds, of pairs of steps that both count.
fn strides(steps: &[Step], definition: &str, is_all: bool) -> (Vec<Observation>, Vec<Observation>) {
    let (mut lengths, mut speeds) = (Vec::new(), Vec::new());
    for pair in steps.windows(2) {
        let [before, step] = pair else { continue };
        let counts = is_all || pair.iter().all(|step| step.excluded_because.is_empty());
        let times = before.step_time_s.zip(step.step_time_s);
        let measures = measure_of(before, definition).zip(measure_of(step, definition));
        if let (true, true, Some((t0, t1)), Some((m0, m1))) = (counts, before.side != step.side, times, measures) {
            let length = m0.length_m + m1.length_m;
            lengths.push(Observation { side: step.side, value: length });
            if t0 + t1 > 0.0 {
                speeds.push(Observation { side: step.side, value: length / (t0 + t1) });
            }
        }
    }
    (lengths, speeds)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::body::Side;
    use crate::gait::measures_of_steps;

    fn gait(n: usize) -> Gait {
        let step = |i: usize| {
            let time = 0.8 * i as f64;
            let measure = |definition: &str, length: f64| StepMeasure {
                definition: definition.into(),
                length_m: length,
                length_interval_m: [length - 0.0196, length + 0.0196],
                width_m: 0.12,
                width_interval_m: [0.12 - 0.0098, 0.12 + 0.0098],
            };
            let long = if i.is_multiple_of(2) { 0.42 } else { 0.38 };
            let is_end = i < 2 || i + 2 >= n;
            Step {
                side: if i.is_multiple_of(2) { Side::Left } else { Side::Right },
                toe_off_s: time - 0.5,
                heel_strike_s: time,
                opposite_toe_off_s: Some(time + 0.3),
                step_time_s: (i > 0).then_some(0.8),
                measures: vec![measure(ANKLES_AT_MID_DOUBLE_SUPPORT, long - 0.05), measure(FLAT_FOOTPRINTS, long)],
                coverage: 1.0,
                backward: false,
                excluded_because: if is_end { vec!["first_or_last".into()] } else { Vec::new() },
            }
        };
        Gait { steps: (0..n).map(step).collect(), ..Gait::default() }
    }

    #[test]
    fn strides_and_speed_are_sums_of_steps_of_one_definition() {
        let found = measures_of_steps(&gait(12));
        let value = |name: &str, definition: &str| {
            let of = |m: &&PerformanceMeasure| m.name == name && m.definition.as_deref() == Some(definition);
            found.measures.iter().find(of).cloned().unwrap()
        };
        let near = |a: Option<f64>, b: f64| assert!(a.is_some_and(|a| (a - b).abs() < 1e-9), "{a:?} instead of {b}");
        near(value("stride_length_m", FLAT_FOOTPRINTS).value, 0.8);
        near(value("stride_length_m", ANKLES_AT_MID_DOUBLE_SUPPORT).value, 0.7);
        near(value("usual_speed_mps", FLAT_FOOTPRINTS).value, 0.5);
        near(value("step_length_m", FLAT_FOOTPRINTS).value, 0.4);
        near(value("step_length_sd_m", FLAT_FOOTPRINTS).error_sd, 0.01);
        near(value("step_width_sd_m", FLAT_FOOTPRINTS).error_sd, 0.005);
        assert_eq!(value("step_length_m", FLAT_FOOTPRINTS).n_observations, Some(8));
        assert_eq!(found.exclusions[0].n_steps, 4);
        assert!(found.contacts.iter().all(|contact| contact.place_m.is_none()));
    }

    #[test]
    fn phases_come_from_the_feet_that_leave_the_floor() {
        let found = measures_of_steps(&gait(12));
        let value = |name: &str| found.measures.iter().find(|m| m.name == name).and_then(|m| m.value).unwrap();
        // Swing 0.5 s of a stride of 1.6 s; each foot leaves 0.3 s after the other landed.
        assert!((value("swing_pct") - 31.25).abs() < 1e-9 && (value("double_support_pct") - 37.5).abs() < 1e-9);
        assert!((value("cadence_spm") - 75.0).abs() < 1e-9);
    }

    #[test]
    fn a_recording_without_steps_says_so() {
        let found = measures_of_steps(&Gait::default());
        assert!(found.measures.is_empty() && found.contacts.is_empty() && !found.reason.is_empty());
    }
}
