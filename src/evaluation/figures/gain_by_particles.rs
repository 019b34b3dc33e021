//! Gain over the middleware by the number of particles, mean and standard error (\[angles\] Figure 3).

use super::canvas::{Area, Mark, WIDTH, label, px, sheet, vertical_name, word_below};
use super::{Drawn, colour};
use crate::body::Side;
use crate::evaluation::contender::Contender;
use crate::evaluation::error_analysis::{ErrorRow, Gain};
use crate::evaluation::rows::ALL_EXERCISES;
use plotters::prelude::*;

/// Height of one chart, pixels.
const HEIGHT: u32 = 300;

/// Height of the numbers of particles below it, pixels.
const BELOW: f64 = 30.0;

/// Joint and side of a line: its name, its colour, its gain.
type Joint = (&'static str, Side, RGBColor, fn(&ErrorRow) -> Option<Gain>);

const JOINTS: [Joint; 4] = [
    ("left hip", Side::Left, colour::GREEN, |row| row.hip_gain),
    ("right hip", Side::Right, colour::BLUE, |row| row.hip_gain),
    ("left knee", Side::Left, colour::PURPLE, |row| row.knee_gain),
    ("right knee", Side::Right, colour::VERMILLION, |row| row.knee_gain),
];

/// Draws one chart for each method with particles; nothing when no gain is known.
pub(super) fn draw(dataset: &str, errors: &[ErrorRow]) -> Drawn<Option<String>> {
    let own: Vec<(&ErrorRow, Contender)> = errors
        .iter()
        .filter(|row| row.dataset == dataset && row.exercise == ALL_EXERCISES)
        .filter_map(|row| Some((row, row.method.parse().ok()?)))
        .collect();
    let mut charts: Vec<(String, Vec<u32>)> = Vec::new();
    for (row, contender) in &own {
        let Contender::Method { particles: Some(count), .. } = contender else { continue };
        if row.hip_gain.is_none() && row.knee_gain.is_none() {
            continue;
        }
        let name = family(*contender);
        match charts.iter_mut().find(|(known, _)| *known == name) {
            Some((_, counts)) if !counts.contains(count) => counts.push(*count),
            Some(_) => {}
            None => charts.push((name, vec![*count])),
        }
    }
    if charts.is_empty() {
        return Ok(None);
    }
    let value = |method: &str, joint: &Joint| {
        let row = own.iter().find(|(row, _)| row.method == method && row.side == joint.1)?;
        (joint.3)(row.0)
    };
    let default = own.iter().find(|(_, contender)| contender.is_default()).map(|(row, _)| row.method.clone());
    let has_gain = |joint: &&Joint| own.iter().any(|(row, _)| row.side == joint.1 && (joint.3)(row).is_some());
    let legend: Vec<(String, Mark)> =
        JOINTS.iter().filter(has_gain).map(|(name, _, line, _)| ((*name).to_owned(), Mark::Line(*line))).collect();
    let title = format!("{dataset}: error of nite less error of the method, mean and standard error over frames");
    sheet(&title, &legend, HEIGHT * charts.len() as u32, |area| {
        for (i, (name, counts)) in charts.iter().enumerate() {
            let top = px(f64::from(HEIGHT * i as u32));
            let own = area.clone().shrink((0, top), (px(f64::from(WIDTH)) as u32, px(f64::from(HEIGHT)) as u32));
            let mut columns: Vec<(String, String)> =
                counts.iter().map(|count| (format!("{count} particles"), format!("{name}/{count}"))).collect();
            columns.extend(default.iter().map(|default| (default.clone(), default.clone())));
            let gains: Vec<Vec<Option<Gain>>> =
                JOINTS.iter().map(|joint| columns.iter().map(|(_, method)| value(method, joint)).collect()).collect();
            panel(&own, name, &columns, counts.len(), &gains)?;
        }
        Ok(())
    })
    .map(Some)
}

/// Name of a contender without its number of particles.
fn family(contender: Contender) -> String {
    let name = contender.name();
    name.split_once('/').map_or(name.clone(), |(family, _)| family.to_owned())
}

fn panel(
    area: &Area<'_>,
    name: &str,
    columns: &[(String, String)],
    joined: usize,
    gains: &[Vec<Option<Gain>>],
) -> Drawn {
    let ends = gains.iter().flatten().flatten().flat_map(|gain| {
        let (mean, error) = (gain.difference.mean_deg, gain.standard_error_deg);
        [mean - error, mean + error]
    });
    let (low, high) = ends.fold((0.0f64, 0.0f64), |(low, high), end| (low.min(end), high.max(end)));
    let margin = 0.08 * (high - low).max(1.0);
    let mut chart = ChartBuilder::on(area)
        .margin_top(px(8.0))
        .margin_right(px(12.0))
        .margin_left(px(22.0))
        .x_label_area_size(px(BELOW))
        .y_label_area_size(px(40.0))
        .build_cartesian_2d(0.0..columns.len() as f64, low - margin..high + margin)?;
    let mut mesh = chart.configure_mesh();
    mesh.disable_x_mesh().label_style(label()).axis_style(colour::INK.mix(0.6)).x_labels(0).y_labels(7);
    mesh.bold_line_style(colour::GRID.stroke_width(px(0.5) as u32)).light_line_style(TRANSPARENT);
    mesh.y_label_formatter(&|v| format!("{v:.0}")).draw()?;
    vertical_name(area, &format!("gain of {name} over nite (°)"), px((f64::from(HEIGHT) - BELOW) / 2.0))?;
    let zero = vec![(0.0, 0.0), (columns.len() as f64, 0.0)];
    chart.draw_series([PathElement::new(zero, colour::INK.stroke_width(px(1.0) as u32))])?;
    for (i, ((_, _, line, _), of_joint)) in JOINTS.iter().zip(gains).enumerate() {
        // Side by side, so that standard errors do not hide each other.
        let x = |column: usize| column as f64 + 0.5 + 0.06 * (i as f64 - 1.5);
        let means = of_joint.iter().take(joined).enumerate();
        let path: Vec<(f64, f64)> =
            means.filter_map(|(c, gain)| Some((x(c), gain.as_ref()?.difference.mean_deg))).collect();
        chart.draw_series([PathElement::new(path, line.stroke_width(px(1.5) as u32))])?;
        for (column, gain) in of_joint.iter().enumerate() {
            let Some(gain) = gain else { continue };
            let (mean, error) = (gain.difference.mean_deg, gain.standard_error_deg);
            let bar = vec![(x(column), mean - error), (x(column), mean + error)];
            chart.draw_series([PathElement::new(bar, line.stroke_width(px(1.5) as u32))])?;
            chart.draw_series([Circle::new((x(column), mean), px(4.0), line.filled())])?;
        }
    }
    let origin = area.get_base_pixel();
    for (i, (word, _)) in columns.iter().enumerate() {
        let (x, y) = chart.backend_coord(&(i as f64 + 0.5, low - margin));
        word_below(area, word, (x - origin.0, y - origin.1 + px(6.0)))?;
    }
    Ok(())
}
