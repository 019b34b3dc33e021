//! Angles of one trial over time: the default with its 95 % band, the reference, the middleware and the raw angle.

use super::canvas::{Area, Mark, WIDTH, label, px, sheet, unbroken, vertical_name};
use super::{Drawn, colour, colour_of};
use crate::body::Side;
use crate::evaluation::contender::Contender;
use crate::evaluation::joint_angles::{Compared, Comparison, MEASURE_NAMES, TrialOutcome};
use plotters::prelude::*;

/// Height of one chart, pixels.
const HEIGHT: u32 = 165;

/// Height of the time axis below the last chart, pixels.
const TIME_AXIS: u32 = 36;

/// Strength of the band's colour.
const BAND: f64 = 0.25;

/// Draws the side of a trial that moved more; nothing when the default has no estimate in it.
pub(super) fn draw(exercise: &str, trial: &TrialOutcome, contenders: &[Contender]) -> Drawn<Option<String>> {
    let of = |wanted: fn(&Contender) -> bool| {
        let i = contenders.iter().position(wanted)?;
        trial.results[i].as_ref().ok().map(|compared| (contenders[i], compared))
    };
    let Some((default, estimate)) = of(|c| c.is_default()) else { return Ok(None) };
    let Some(side) = busier_side(estimate) else { return Ok(None) };
    let beside: Vec<(Contender, &Compared)> =
        [of(|c| *c == Contender::Raw), of(|c| *c == Contender::MIDDLEWARE)].into_iter().flatten().collect();

    let colour = colour_of(default, contenders);
    let mut legend = vec![
        ("reference".to_owned(), Mark::Line(colour::INK)),
        (format!("{default} (default)"), Mark::Line(colour)),
        (format!("95 % interval of {default}"), Mark::Band(colour.mix(BAND))),
    ];
    for (contender, _) in &beside {
        let what = if *contender == Contender::Raw { "raw joints (knee)" } else { "nite (middleware)" };
        legend.push((what.to_owned(), Mark::Line(colour_of(*contender, contenders))));
    }
    let measures: Vec<(&str, &str)> =
        MEASURE_NAMES.into_iter().filter(|(measure, _)| comparison(estimate, measure, side).is_some()).collect();
    let title = format!("{exercise}, {} leg ({})", side.name(), trial.name);
    let height = HEIGHT * measures.len() as u32 + TIME_AXIS;
    sheet(&title, &legend, height, |area| {
        for (i, (measure, name)) in measures.iter().enumerate() {
            let own = area.clone().shrink(
                (0, px(f64::from(HEIGHT * i as u32))),
                (px(f64::from(WIDTH)) as u32, px(f64::from(HEIGHT + TIME_AXIS)) as u32),
            );
            let Some(found) = comparison(estimate, measure, side) else { continue };
            let mut lines = Vec::new();
            for (contender, compared) in &beside {
                if let Some(other) = comparison(compared, measure, side) {
                    lines.push((colour_of(*contender, contenders), &compared.time_ns, &other.estimate));
                }
            }
            lines.push((colour::INK, &estimate.time_ns, &found.reference));
            lines.push((colour, &estimate.time_ns, &found.estimate));
            panel(&own, name, &estimate.time_ns, found, &lines, colour, i + 1 == measures.len())?;
        }
        Ok(())
    })
    .map(Some)
}

/// A coloured series with its times.
type Line<'a> = (RGBColor, &'a Vec<i64>, &'a Vec<f64>);

fn panel(
    area: &Area<'_>,
    name: &str,
    time_ns: &[i64],
    found: &Comparison,
    lines: &[Line<'_>],
    colour: RGBColor,
    has_time_axis: bool,
) -> Drawn {
    let first = time_ns.first().copied().unwrap_or(0);
    let seconds = |time: i64| (time - first) as f64 * 1e-9;
    let end = time_ns.last().map_or(1.0, |last| seconds(*last)).max(0.1);
    let (low, high) = range(found, lines);
    let mut chart = ChartBuilder::on(area)
        .margin_top(px(8.0))
        .margin_right(px(16.0))
        .margin_left(px(22.0))
        .x_label_area_size(px(f64::from(TIME_AXIS)))
        .y_label_area_size(px(40.0))
        .build_cartesian_2d(0.0..end, low..high)?;
    let mut mesh = chart.configure_mesh();
    mesh.label_style(label())
        .axis_style(colour::INK.mix(0.6))
        .bold_line_style(colour::GRID.stroke_width(px(0.5) as u32));
    mesh.light_line_style(TRANSPARENT).x_labels(11).y_labels(5).y_label_formatter(&|v| format!("{v:.0}"));
    // Ticks of short trials lie between whole seconds.
    let digits = usize::from(end < 10.0);
    let time_label = |v: &f64| if has_time_axis { format!("{v:.digits$}") } else { String::new() };
    mesh.x_label_formatter(&time_label);
    if has_time_axis {
        mesh.x_desc("time (s)").axis_desc_style(label());
    }
    mesh.draw()?;
    let middle = px(8.0) + px(f64::from(HEIGHT) - 8.0) / 2;
    vertical_name(area, &format!("{name} (°)"), middle)?;

    let with_interval: Vec<(f64, [f32; 2])> =
        time_ns.iter().map(|time| seconds(*time)).zip(found.intervals.iter().copied()).collect();
    for stretch in with_interval.split(|(_, ends)| !ends.iter().all(|end| end.is_finite())) {
        let end_of = |(x, ends): &(f64, [f32; 2]), i: usize| (*x, f64::from(ends[i]).clamp(low, high));
        let forth = stretch.iter().map(|sample| end_of(sample, 1));
        let back = stretch.iter().rev().map(|sample| end_of(sample, 0));
        if stretch.len() > 1 {
            chart.draw_series([Polygon::new(forth.chain(back).collect::<Vec<_>>(), colour.mix(BAND).filled())])?;
        }
    }
    for (i, (line_colour, times, values)) in lines.iter().enumerate() {
        let is_default = i + 1 == lines.len();
        let width = if is_default || *line_colour == colour::INK { 1.6 } else { 1.0 };
        // What leaves the chart is left out: a line along its edge would look like a value.
        let inside = |value: f64| if (low..=high).contains(&value) { value } else { f64::NAN };
        let points = times.iter().zip(values.iter()).map(|(time, value)| (seconds(*time), inside(*value)));
        for stretch in unbroken(points) {
            chart.draw_series([PathElement::new(stretch, line_colour.stroke_width(px(width) as u32))])?;
        }
    }
    Ok(())
}

/// Smallest span of angles from which the vertical axis is stretched, degrees.
const LEAST_SPAN: f64 = 20.0;

/// Limits of the vertical axis, degrees: all of reference and default, and of the rest what is not farther away than
/// their span, so that one flip of the middleware does not flatten everything else.
fn range(found: &Comparison, lines: &[Line<'_>]) -> (f64, f64) {
    let finite = |values: &[f64]| values.iter().copied().filter(|v| v.is_finite()).collect::<Vec<f64>>();
    let mut all = finite(&found.reference);
    all.extend(finite(&found.estimate));
    let bounds =
        |values: &[f64]| values.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), v| (a.min(*v), b.max(*v)));
    let (low, high) = bounds(&all);
    let span = (high - low).max(LEAST_SPAN);
    let mut rest: Vec<f64> = lines.iter().flat_map(|(_, _, values)| finite(values)).collect();
    rest.extend(found.intervals.iter().flatten().map(|end| f64::from(*end)).filter(|end| end.is_finite()));
    rest.retain(|v| (low - span..=high + span).contains(v));
    let (low, high) = bounds(&rest);
    if low > high { (0.0, 1.0) } else { (low - 0.05 * span, high + 0.05 * span) }
}

fn comparison<'a>(compared: &'a Compared, measure: &str, side: Side) -> Option<&'a Comparison> {
    compared.comparisons.iter().find(|c| c.measure == measure && c.side == side)
}

/// The side whose reference angles have the larger sum of ranges.
fn busier_side(compared: &Compared) -> Option<Side> {
    let motion = |side: Side| {
        let own = compared.comparisons.iter().filter(|c| c.side == side);
        let ranges = own.filter_map(|c| {
            let finite = || c.reference.iter().copied().filter(|v| v.is_finite());
            Some(finite().reduce(f64::max)? - finite().reduce(f64::min)?)
        });
        ranges.reduce(|a, b| a + b)
    };
    match (motion(Side::Left), motion(Side::Right)) {
        (Some(left), Some(right)) => Some(if left > right { Side::Left } else { Side::Right }),
        (left, right) => left.map(|_| Side::Left).or(right.map(|_| Side::Right)),
    }
}
