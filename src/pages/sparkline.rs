//! A measure over time as a small drawing (SVG) that needs no script.

use super::words;
use crate::report::Trend;
use std::fmt::Write;

/// Half the width of a 95 % interval in standard errors.
const Z95: f64 = 1.959_963_985;
/// Size of the drawing and the room around its points, in its own unit.
const WIDTH: f64 = 240.0;
const HEIGHT: f64 = 72.0;
const MARGIN: f64 = 8.0;
/// Room for the numbers of the axis.
const AXIS: f64 = 44.0;

/// The drawing of a trend: a point for each value, a bar for its 95 % interval where it is known, time to scale.
pub(super) fn sparkline(trend: &Trend) -> String {
    let half = |se: Option<f64>| se.map_or(0.0, |se| Z95 * se);
    let ends = trend.points.iter().flat_map(|p| [p.value - half(p.standard_error), p.value + half(p.standard_error)]);
    let (low, high) = ends.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), v| (low.min(v), high.max(v)));
    // Values that are all the same lie in the middle.
    let span = if high > low { high - low } else { 1.0 };
    let (bottom, y_span) = (HEIGHT - MARGIN, HEIGHT - 2.0 * MARGIN);
    let y = |value: f64| if high > low { bottom - (value - low) / span * y_span } else { HEIGHT / 2.0 };
    let seconds = |i: usize| trend.points[i].measured_at.unix_timestamp() as f64;
    let last = trend.points.len().saturating_sub(1);
    let time_span = if last > 0 { seconds(last) - seconds(0) } else { 0.0 };
    let x_span = WIDTH - AXIS - 2.0 * MARGIN;
    let x = |i: usize| {
        let share = if time_span > 0.0 { (seconds(i) - seconds(0)) / time_span } else { 0.5 };
        AXIS + MARGIN + share * x_span
    };

    let mut svg = format!(
        "<svg class=\"sparkline\" viewBox=\"0 0 {WIDTH} {HEIGHT}\" aria-hidden=\"true\" focusable=\"false\">\
         <line class=\"axis\" x1=\"{AXIS}\" y1=\"{MARGIN}\" x2=\"{AXIS}\" y2=\"{bottom}\"/>"
    );
    if high > low {
        for (value, at) in [(high, MARGIN), (low, bottom)] {
            let _ = write!(svg, "<text x=\"{}\" y=\"{}\">{}</text>", AXIS - 4.0, at + 3.5, words::number(value));
        }
    }
    let line: Vec<String> =
        trend.points.iter().enumerate().map(|(i, p)| format!("{:.1},{:.1}", x(i), y(p.value))).collect();
    let _ = write!(svg, "<polyline class=\"course\" points=\"{}\"/>", line.join(" "));
    for (i, point) in trend.points.iter().enumerate() {
        if point.standard_error.is_some() {
            let (a, b) = (y(point.value - half(point.standard_error)), y(point.value + half(point.standard_error)));
            let _ =
                write!(svg, "<line class=\"error\" x1=\"{0:.1}\" y1=\"{a:.1}\" x2=\"{0:.1}\" y2=\"{b:.1}\"/>", x(i));
        }
        let radius = if i == last { 3.5 } else { 2.5 };
        let _ = write!(svg, "<circle class=\"point\" cx=\"{:.1}\" cy=\"{:.1}\" r=\"{radius}\"/>", x(i), y(point.value));
    }
    svg.push_str("</svg>");
    svg
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::report::trend::TrendPoint;
    use time::{Duration, OffsetDateTime};
    use uuid::Uuid;

    fn trend(values: &[(i64, f64, Option<f64>)]) -> Trend {
        let point = |&(day, value, standard_error): &(i64, f64, Option<f64>)| TrendPoint {
            measure_id: Uuid::nil(),
            measured_at: OffsetDateTime::UNIX_EPOCH + Duration::days(day),
            value,
            standard_error,
        };
        Trend {
            name: "usual_speed_mps".into(),
            title: "Walking speed, usual".into(),
            side: None,
            unit: "m/s".into(),
            points: values.iter().map(point).collect(),
            n_other_definitions: 0,
            since_previous: None,
            since_first: None,
        }
    }

    #[test]
    fn every_value_is_a_point_and_every_known_error_a_bar() {
        let svg = sparkline(&trend(&[(0, 1.0, Some(0.1)), (1, 0.9, None), (10, 0.7, Some(0.1))]));
        assert_eq!((svg.matches("<circle").count(), svg.matches("\"error\"").count()), (3, 2));
        assert!(!svg.contains("NaN") && !svg.contains("style="), "{svg}");
        assert!(roxmltree::Document::parse(&svg).is_ok());
    }

    #[test]
    fn one_value_and_equal_values_are_drawn_too() {
        for values in [&[(0, 1.0, None)][..], &[(0, 1.0, None), (0, 1.0, None)], &[]] {
            let svg = sparkline(&trend(values));
            assert!(!svg.contains("NaN") && !svg.contains("inf"), "{svg}");
        }
    }
}
