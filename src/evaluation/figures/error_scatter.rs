//! Errors of the default beside those of the middleware, frame by frame (\[angles\] Figure 2).

use super::canvas::{Mark, WIDTH, label, px, sheet};
use super::{Drawn, Exercises, colour};
use crate::body::Side;
use crate::evaluation::contender::Contender;
use crate::evaluation::error_analysis::FrameErrors;
use crate::evaluation::joint_angles::MEASURE_NAMES;
use plotters::prelude::*;

/// Limits of both axes, degrees.
const AXIS: (f64, f64) = (0.08, 200.0);

/// Errors outside are drawn here, degrees.
const LOW: f64 = 0.1;
const HIGH: f64 = 180.0;

/// Most points of one side in one chart: more only darken the same cloud and make the file large.
const MOST_POINTS: usize = 500;

/// Width and height of one chart, pixels: two columns.
const CHART: u32 = WIDTH / 2;

/// Draws every angle that both have errors of; nothing when there is none.
pub(super) fn draw(dataset: &str, exercises: &Exercises<'_>, contenders: &[Contender]) -> Drawn<Option<String>> {
    let place = |wanted: fn(&Contender) -> bool| contenders.iter().position(wanted);
    let (Some(default), Some(middleware)) = (place(|c| c.is_default()), place(|c| *c == Contender::MIDDLEWARE)) else {
        return Ok(None);
    };
    let mut charts = Vec::new();
    for (i, (_, name)) in MEASURE_NAMES.iter().enumerate() {
        let sides = Side::BOTH.map(|side| pairs(exercises, (middleware, default), side, i));
        if sides.iter().any(|pairs| !pairs.is_empty()) {
            charts.push((*name, sides));
        }
    }
    if charts.is_empty() {
        return Ok(None);
    }
    let default = contenders[default];
    let colours = [colour::GREEN, colour::PURPLE];
    let mut legend: Vec<(String, Mark)> =
        Side::BOTH.iter().zip(colours).map(|(side, dot)| (format!("{} leg", side.name()), Mark::Dot(dot))).collect();
    legend.push((format!("below this line {default} is nearer to the reference than nite"), Mark::Line(colour::INK)));
    let title = format!("{dataset}: absolute errors of {default} and of nite, all exercises");
    let height = CHART * charts.len().div_ceil(2) as u32;
    sheet(&title, &legend, height, |area| {
        for (i, (name, sides)) in charts.iter().enumerate() {
            let corner = (px(f64::from(CHART * (i as u32 % 2))), px(f64::from(CHART * (i as u32 / 2))));
            let own = area.clone().shrink(corner, (px(f64::from(CHART)) as u32, px(f64::from(CHART)) as u32));
            let mut chart = ChartBuilder::on(&own)
                .margin(px(10.0))
                .margin_right(px(16.0))
                .x_label_area_size(px(36.0))
                .y_label_area_size(px(52.0))
                .build_cartesian_2d((AXIS.0..AXIS.1).log_scale(), (AXIS.0..AXIS.1).log_scale())?;
            let number = |v: &f64| format!("{v}");
            let mut mesh = chart.configure_mesh();
            mesh.label_style(label()).axis_desc_style(label()).axis_style(colour::INK.mix(0.6)).x_labels(5).y_labels(5);
            mesh.bold_line_style(colour::GRID.stroke_width(px(0.5) as u32)).light_line_style(TRANSPARENT);
            mesh.x_label_formatter(&number).y_label_formatter(&number);
            mesh.x_desc(format!("{name}: error of nite (°)")).y_desc(format!("error of {default} (°)")).draw()?;
            for (pairs, dot) in sides.iter().zip(colours) {
                let stride = pairs.len().div_ceil(MOST_POINTS).max(1);
                let shown = pairs.iter().step_by(stride);
                chart.draw_series(shown.map(|pair| Circle::new(*pair, px(1.5), dot.mix(0.5).filled())))?;
            }
            let diagonal = vec![(AXIS.0, AXIS.0), (AXIS.1, AXIS.1)];
            chart.draw_series([PathElement::new(diagonal, colour::INK.stroke_width(px(1.0) as u32))])?;
        }
        Ok(())
    })
    .map(Some)
}

/// Errors of the middleware and of the default in the frames in which both have one, within the limits.
fn pairs(
    exercises: &Exercises<'_>,
    (middleware, default): (usize, usize),
    side: Side,
    measure: usize,
) -> Vec<(f64, f64)> {
    let values = |errors: &FrameErrors| -> Vec<f64> {
        if measure < 3 { errors.hip_angles.iter().map(|angles| angles[measure]).collect() } else { errors.knee.clone() }
    };
    let mut found = Vec::new();
    for trial in exercises.values().flatten() {
        let errors = |i: usize| trial.results[i].as_ref().ok()?.errors.iter().find(|errors| errors.side == side);
        let (Some(a), Some(b)) = (errors(middleware), errors(default)) else { continue };
        let both = values(a).into_iter().zip(values(b)).filter(|(a, b)| a.is_finite() && b.is_finite());
        found.extend(both.map(|(a, b)| (a.clamp(LOW, HIGH), b.clamp(LOW, HIGH))));
    }
    found
}
