//! Distribution of the absolute errors of each method in each exercise: box from the first to the third quartile, line
//! at the median, whiskers from the 5th to the 95th percentile.

use super::canvas::{Area, Mark, WIDTH, label, px, sheet, vertical_name, word_below};
use super::{Drawn, Exercises, colour, colour_of};
use crate::evaluation::agreement::quantiles;
use crate::evaluation::contender::Contender;
use crate::evaluation::joint_angles::{MEASURE_NAMES, TrialOutcome};
use plotters::prelude::*;

/// Limits of the axis, degrees.
const AXIS: (f64, f64) = (0.08, 200.0);

/// Errors outside are drawn here, degrees.
const LOW: f64 = 0.1;
const HIGH: f64 = 180.0;

/// Height of one chart without the exercises' names, and of one line of the names, pixels.
const HEIGHT: u32 = 205;
const LINE: u32 = 14;

/// Mean width of a letter, pixels.
const LETTER: f64 = 6.6;

/// Whisker, box, median, box, whisker.
const SHARES: [f64; 5] = [0.05, 0.25, 0.5, 0.75, 0.95];

/// Draws every angle with errors; nothing when there is none.
pub(super) fn draw(dataset: &str, exercises: &Exercises<'_>, contenders: &[Contender]) -> Drawn<Option<String>> {
    let mut charts = Vec::new();
    for (measure, name) in MEASURE_NAMES {
        let boxes: Vec<Vec<Option<[f64; 5]>>> = exercises
            .values()
            .map(|trials| (0..contenders.len()).map(|i| quantiles(&errors(trials, i, measure), SHARES)).collect())
            .collect();
        if boxes.iter().flatten().any(Option::is_some) {
            charts.push((name, boxes));
        }
    }
    if charts.is_empty() {
        return Ok(None);
    }
    let legend: Vec<(String, Mark)> = contenders
        .iter()
        .map(|contender| (contender.name(), Mark::Band(colour_of(*contender, contenders).into())))
        .collect();
    let title = format!("{dataset}: absolute errors of each method (box: quartiles; whiskers: 5 to 95 %)");
    let most = (0.9 * f64::from(WIDTH - 74) / exercises.len() as f64 / LETTER) as usize;
    let names: Vec<Vec<String>> = exercises.keys().map(|exercise| broken(exercise, most)).collect();
    let height = HEIGHT + LINE * names.iter().map(Vec::len).max().unwrap_or(1) as u32;
    sheet(&title, &legend, height * charts.len() as u32, |area| {
        for (i, (name, boxes)) in charts.iter().enumerate() {
            let top = px(f64::from(height * i as u32));
            let own = area.clone().shrink((0, top), (px(f64::from(WIDTH)) as u32, px(f64::from(height)) as u32));
            panel(&own, name, &names, boxes, contenders)?;
        }
        Ok(())
    })
    .map(Some)
}

fn panel(
    area: &Area<'_>,
    name: &str,
    exercises: &[Vec<String>],
    boxes: &[Vec<Option<[f64; 5]>>],
    contenders: &[Contender],
) -> Drawn {
    let below = px(f64::from(LINE * exercises.iter().map(Vec::len).max().unwrap_or(1) as u32) + 8.0);
    let mut chart = ChartBuilder::on(area)
        .margin_top(px(8.0))
        .margin_right(px(12.0))
        .margin_left(px(22.0))
        .x_label_area_size(below)
        .y_label_area_size(px(40.0))
        .build_cartesian_2d(0.0..exercises.len() as f64, (AXIS.0..AXIS.1).log_scale())?;
    let mut mesh = chart.configure_mesh();
    mesh.disable_x_mesh().label_style(label()).axis_style(colour::INK.mix(0.6)).x_labels(0).y_labels(5);
    mesh.bold_line_style(colour::GRID.stroke_width(px(0.5) as u32)).light_line_style(TRANSPARENT);
    mesh.y_label_formatter(&|v| format!("{v}")).draw()?;
    vertical_name(area, &format!("{name}: error (°)"), px(f64::from(HEIGHT) / 2.0))?;

    // The methods of an exercise share four fifths of its width.
    let step = 0.8 / contenders.len() as f64;
    for (exercise, of_exercise) in boxes.iter().enumerate() {
        if exercise > 0 {
            let x = exercise as f64;
            chart.draw_series([PathElement::new(
                vec![(x, AXIS.0), (x, AXIS.1)],
                colour::GRID.stroke_width(px(1.0) as u32),
            )])?;
        }
        for (i, found) in of_exercise.iter().enumerate() {
            let Some(found) = found else { continue };
            let [low, first, median, third, high] = found.map(|error| error.clamp(LOW, HIGH));
            let left = exercise as f64 + 0.1 + i as f64 * step;
            let (right, middle) = (left + 0.8 * step, left + 0.4 * step);
            let fill = colour_of(contenders[i], contenders);
            let thin = colour::INK.stroke_width(px(0.75) as u32);
            chart.draw_series([PathElement::new(vec![(middle, low), (middle, high)], thin)])?;
            chart.draw_series([Rectangle::new([(left, first), (right, third)], fill.filled())])?;
            chart.draw_series([Rectangle::new([(left, first), (right, third)], thin)])?;
            let bold = colour::INK.stroke_width(px(1.75) as u32);
            chart.draw_series([PathElement::new(vec![(left, median), (right, median)], bold)])?;
        }
    }
    let origin = area.get_base_pixel();
    for (i, exercise) in exercises.iter().enumerate() {
        let (x, y) = chart.backend_coord(&(i as f64 + 0.5, AXIS.0));
        for (line, part) in exercise.iter().enumerate() {
            word_below(area, part, (x - origin.0, y - origin.1 + px(3.0 + f64::from(LINE) * line as f64)))?;
        }
    }
    Ok(())
}

/// A name in lines of at most `most` characters, broken at underscores where there are any.
fn broken(name: &str, most: usize) -> Vec<String> {
    let mut lines: Vec<String> = Vec::new();
    for part in name.split('_') {
        match lines.last_mut() {
            Some(line) if line.chars().count() + 1 + part.chars().count() <= most => {
                line.push('_');
                line.push_str(part);
            }
            _ => lines.push(part.to_owned()),
        }
    }
    lines
}

/// Absolute errors of a contender in an angle over all samples of an exercise's trials, both sides.
fn errors(trials: &[&TrialOutcome], contender: usize, measure: &str) -> Vec<f64> {
    let compared = trials.iter().filter_map(|trial| trial.results[contender].as_ref().ok());
    let comparisons = compared.flat_map(|compared| compared.comparisons.iter().filter(|c| c.measure == measure));
    comparisons.flat_map(|c| c.estimate.iter().zip(&c.reference).map(|(a, b)| (a - b).abs())).collect()
}
