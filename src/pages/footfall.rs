//! A map of footfalls: the steps of a walk, one after the other along a straight line, as a drawing (SVG) from lengths and
//! widths. Turns are not in it, since a step says nothing of them.

use crate::assessment::Gait;
use crate::assessment::gait::{Step, StepMeasure};
use crate::body::Side;
use std::fmt::Write;

/// Scale of the drawing, its unit per metre.
const PER_M: f64 = 160.0;
/// Half length and half width of a footprint as it is drawn, metres; the foot's own size is not measured.
const PRINT_M: [f64; 2] = [0.12, 0.045];
/// Steps of one row.
const STEPS_OF_ROW: usize = 14;
/// Height of one row and room at its ends, in the drawing's unit.
const ROW: f64 = 96.0;
const MARGIN: f64 = 24.0;
/// Steps that are drawn at most; a map of more cannot be read.
const MOST_STEPS: usize = 140;

/// A map and what it shows.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct FootfallMap {
    /// The drawing.
    pub svg: String,
    /// The definition that its lengths and widths follow.
    pub definition: String,
    /// Steps in it.
    pub n_steps: usize,
    /// Steps that are not in it because there are too many.
    pub n_left_out: usize,
    /// Steps without length and width by that definition.
    pub n_without_measure: usize,
}

/// A footprint.
struct Print {
    side: Side,
    /// Along the walk and across it, metres; to the left of the walker is positive.
    at_m: [f64; 2],
    counts: bool,
}

impl FootfallMap {
    /// The map of a walk; none without a step that has a length and a width.
    pub(super) fn of(gait: &Gait) -> Option<Self> {
        let first_measure = || gait.steps.iter().find_map(|step| step.measures.first()).map(|m| &m.definition);
        let definition = gait.summary.first().map(|summary| &summary.definition).or_else(first_measure)?.clone();
        let measured = |step: &'_ Step| step.measures.iter().position(|m| m.definition == definition);
        let steps: Vec<(&Step, &StepMeasure)> =
            gait.steps.iter().filter_map(|step| measured(step).map(|i| (step, &step.measures[i]))).collect();
        let shown = &steps[..steps.len().min(MOST_STEPS)];
        (!shown.is_empty()).then(|| Self {
            svg: drawing(shown),
            n_steps: shown.len(),
            n_left_out: steps.len() - shown.len(),
            n_without_measure: gait.steps.len() - steps.len(),
            definition,
        })
    }
}

/// Rows of at most [`STEPS_OF_ROW`]; where a foot landed twice a contact was missed, and a new row begins.
fn rows_of<'a>(steps: &'a [(&'a Step, &'a StepMeasure)]) -> Vec<&'a [(&'a Step, &'a StepMeasure)]> {
    let walks = steps.chunk_by(|(before, _), (after, _)| before.side != after.side);
    walks.flat_map(|walk| walk.chunks(STEPS_OF_ROW)).collect()
}

/// Places of the prints of one row: the foot that stood, then one for each step.
fn prints(steps: &[(&Step, &StepMeasure)]) -> Vec<Print> {
    let across = |side: Side, width: f64| if side == Side::Left { width / 2.0 } else { -width / 2.0 };
    let Some((first, measure)) = steps.first() else { return Vec::new() };
    let standing = first.side.opposite();
    let mut prints = vec![Print { side: standing, at_m: [0.0, across(standing, measure.width_m)], counts: true }];
    for (step, measure) in steps {
        let [along, side_of_last] = prints.last().map_or([0.0; 2], |last| last.at_m);
        let to = if step.side == Side::Left { side_of_last + measure.width_m } else { side_of_last - measure.width_m };
        let at_m = [along + measure.length_m, to];
        prints.push(Print { side: step.side, at_m, counts: step.excluded_because.is_empty() });
    }
    prints
}

fn drawing(steps: &[(&Step, &StepMeasure)]) -> String {
    let rows: Vec<Vec<Print>> = rows_of(steps).into_iter().map(prints).collect();
    let along = rows.iter().flatten().map(|print| print.at_m[0]);
    let (back, front) = along.fold((0.0_f64, 1.0_f64), |(back, front), x| (back.min(x), front.max(x)));
    let width = 2.0 * MARGIN + (front - back) * PER_M;
    let height = rows.len() as f64 * ROW + 22.0;
    let mut svg = format!(
        "<svg class=\"footfalls\" viewBox=\"0 0 {width:.0} {height:.0}\" width=\"{width:.0}\" height=\"{height:.0}\" \
         aria-hidden=\"true\" focusable=\"false\">"
    );
    for (r, row) in rows.iter().enumerate() {
        let middle = (r as f64 + 0.5) * ROW;
        // The line of walking runs through the middle of the row's prints.
        let mean = row.iter().map(|print| print.at_m[1]).sum::<f64>() / row.len().max(1) as f64;
        let _ = write!(svg, "<line class=\"way\" x1=\"0\" y1=\"{middle:.1}\" x2=\"{width:.0}\" y2=\"{middle:.1}\"/>");
        for print in row {
            let x = MARGIN + (print.at_m[0] - back) * PER_M;
            let y = middle - (print.at_m[1] - mean) * PER_M;
            let (class, letter) = if print.side == Side::Left { ("left", "L") } else { ("right", "R") };
            let used = if print.counts { "" } else { " unused" };
            let _ = write!(
                svg,
                "<ellipse class=\"{class}{used}\" cx=\"{x:.1}\" cy=\"{y:.1}\" rx=\"{:.1}\" ry=\"{:.1}\"/>\
                 <text x=\"{x:.1}\" y=\"{:.1}\">{letter}</text>",
                PRINT_M[0] * PER_M,
                PRINT_M[1] * PER_M * 1.6,
                y + 3.5
            );
        }
    }
    let foot = height - 6.0;
    let _ = write!(
        svg,
        "<path class=\"scale\" d=\"M{MARGIN} {0} v6 h{PER_M} v-6\"/><text class=\"scale\" x=\"{1}\" y=\"{2}\">1 m</text></svg>",
        foot - 6.0,
        MARGIN + PER_M + 18.0,
        foot + 2.0
    );
    svg
}

#[cfg(test)]
mod tests {
    use super::*;

    fn step(side: Side, length_m: f64, width_m: f64, excluded: &[&str]) -> Step {
        let measure = |definition: &str| StepMeasure {
            definition: definition.to_owned(),
            length_m,
            length_interval_m: [length_m - 0.02, length_m + 0.02],
            width_m,
            width_interval_m: [width_m - 0.02, width_m + 0.02],
        };
        Step {
            side,
            toe_off_s: 0.0,
            heel_strike_s: 0.5,
            opposite_toe_off_s: None,
            step_time_s: None,
            measures: vec![measure("a"), measure("b")],
            coverage: 1.0,
            backward: false,
            excluded_because: excluded.iter().map(|reason| (*reason).to_owned()).collect(),
        }
    }

    #[test]
    fn prints_follow_each_other_by_length_and_lie_apart_by_width() {
        let steps = [step(Side::Left, 0.5, 0.1, &[]), step(Side::Right, 0.6, 0.2, &["turning"])];
        let measured: Vec<_> = steps.iter().map(|step| (step, &step.measures[0])).collect();
        let prints = prints(&measured);
        let at: Vec<[f64; 2]> = prints.iter().map(|p| p.at_m).collect();
        assert!((at[0][1] + 0.05).abs() < 1e-9 && (at[1][1] - 0.05).abs() < 1e-9 && (at[2][1] + 0.15).abs() < 1e-9);
        assert!((at[2][0] - 1.1).abs() < 1e-9);
        assert!(prints[1].counts && !prints[2].counts);
    }

    #[test]
    fn a_foot_that_landed_twice_begins_a_new_row() {
        let steps = [Side::Left, Side::Right, Side::Right, Side::Left].map(|side| step(side, 0.5, 0.1, &[]));
        let measured: Vec<_> = steps.iter().map(|step| (step, &step.measures[0])).collect();
        assert_eq!(rows_of(&measured).iter().map(|row| row.len()).collect::<Vec<_>>(), [2, 2]);
    }

    #[test]
    fn a_map_names_its_definition_and_counts_what_it_leaves_out() {
        assert_eq!(FootfallMap::of(&Gait::default()), None);
        let side = |i: usize| Side::BOTH[i % 2];
        let mut steps: Vec<Step> = (0..MOST_STEPS + 3).map(|i| step(side(i), 0.5, 0.1, &[])).collect();
        steps[0].measures.clear();
        let map = FootfallMap::of(&Gait { steps, ..Gait::default() }).unwrap();
        assert_eq!((map.definition.as_str(), map.n_steps), ("a", MOST_STEPS));
        assert_eq!((map.n_left_out, map.n_without_measure), (2, 1));
        assert!(roxmltree::Document::parse(&map.svg).is_ok() && !map.svg.contains("style="));
    }
}
