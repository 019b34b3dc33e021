//! A sheet with a title and a legend, and the charts on it.

use super::{Drawn, colour};
use plotters::coord::Shift;
use plotters::prelude::*;
use plotters::style::FontTransform;
use plotters::style::text_anchor::{HPos, Pos, VPos};

/// Units of the drawing for each pixel of the picture: the library rounds to whole units, which would make steps of
/// gentle slopes.
const UNITS: u32 = 4;

/// Width of every figure, pixels.
pub(super) const WIDTH: u32 = 800;

/// Font of every text.
const FONT: &str = "sans-serif";

/// Size of labels and legends, pixels.
const TEXT: u32 = 12;

/// Size of the title, pixels.
const TITLE: u32 = 16;

/// Space above the charts: title and legend lines, pixels.
const TITLE_HEIGHT: u32 = 30;
const LEGEND_HEIGHT: u32 = 20;

/// A part of the sheet.
pub(super) type Area<'a> = DrawingArea<SVGBackend<'a>, Shift>;

/// Mark in front of a legend's word.
pub(super) enum Mark {
    Line(RGBColor),
    Band(RGBAColor),
    Dot(RGBColor),
}

/// Pixels as units of the drawing.
pub(super) fn px(pixels: f64) -> i32 {
    (pixels * f64::from(UNITS)).round() as i32
}

/// Draws a sheet of [`WIDTH`] with a title, a legend and, below them, `height` pixels of charts.
pub(super) fn sheet(
    title: &str,
    legend: &[(String, Mark)],
    height: u32,
    charts: impl FnOnce(&Area<'_>) -> Drawn,
) -> Drawn<String> {
    let rows = legend_rows(legend);
    let head = TITLE_HEIGHT + LEGEND_HEIGHT * rows.len() as u32;
    let size = (WIDTH, head + height);
    let mut svg = String::new();
    {
        let root = SVGBackend::with_string(&mut svg, (size.0 * UNITS, size.1 * UNITS)).into_drawing_area();
        root.fill(&WHITE)?;
        let place = Pos::new(HPos::Left, VPos::Center);
        root.draw(&Text::new(title.to_owned(), (px(12.0), px(18.0)), style(TITLE, colour::INK).pos(place)))?;
        for (i, row) in rows.iter().enumerate() {
            let y = px(f64::from(TITLE_HEIGHT + LEGEND_HEIGHT * i as u32) + 8.0);
            for (x, word, mark) in row {
                draw_mark(&root, (px(*x), y), mark)?;
                root.draw(&Text::new(word.to_owned(), (px(x + 26.0), y), style(TEXT, colour::INK).pos(place)))?;
            }
        }
        charts(&root.split_vertically(px(f64::from(head))).1)?;
        root.present()?;
    }
    Ok(in_pixels(&svg, size, title))
}

/// Places of the legend's entries in as many lines as they need, pixels from the left.
fn legend_rows(legend: &[(String, Mark)]) -> Vec<Vec<(f64, &str, &Mark)>> {
    let mut rows = vec![Vec::new()];
    let mut x = 12.0;
    for (word, mark) in legend {
        // Letters of a sans-serif font are a little more than half as wide as high.
        let width = 26.0 + 0.58 * f64::from(TEXT) * word.chars().count() as f64 + 16.0;
        if x + width > f64::from(WIDTH) && x > 12.0 {
            rows.push(Vec::new());
            x = 12.0;
        }
        if let Some(row) = rows.last_mut() {
            row.push((x, word.as_str(), mark));
        }
        x += width;
    }
    rows
}

fn draw_mark(root: &Area<'_>, (x, y): (i32, i32), mark: &Mark) -> Drawn {
    match mark {
        Mark::Line(line) => {
            root.draw(&PathElement::new(vec![(x, y), (x + px(20.0), y)], line.stroke_width(px(2.0) as u32)))?;
        }
        Mark::Band(fill) => {
            root.draw(&Rectangle::new([(x, y - px(5.0)), (x + px(20.0), y + px(5.0))], fill.filled()))?;
        }
        Mark::Dot(fill) => root.draw(&Circle::new((x + px(10.0), y), px(4.0), fill.filled()))?,
    }
    Ok(())
}

/// The drawing at its size in pixels, with a title for those who do not see it.
fn in_pixels(svg: &str, (width, height): (u32, u32), title: &str) -> String {
    let escaped = title.replace('&', "&amp;").replace('<', "&lt;");
    let body = svg.split_once('>').map_or("", |(_, body)| body);
    let (wide, high) = (width * UNITS, height * UNITS);
    format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"{width}\" height=\"{height}\" viewBox=\"0 0 {wide} {high}\" \
         role=\"img\"><title>{escaped}</title>{body}"
    )
}

/// Text of a size in pixels.
pub(super) fn style(size: u32, color: RGBColor) -> TextStyle<'static> {
    TextStyle { color: color.to_backend_color(), ..TextStyle::from((FONT, size * UNITS).into_font()) }
}

/// Labels of axes.
pub(super) fn label() -> TextStyle<'static> {
    style(TEXT, colour::INK)
}

/// Writes a word at a place of the sheet, centred below it.
pub(super) fn word_below(area: &Area<'_>, word: &str, place: (i32, i32)) -> Drawn {
    let anchored = label().pos(Pos::new(HPos::Center, VPos::Top));
    area.draw(&Text::new(word.to_owned(), place, anchored))?;
    Ok(())
}

/// Writes the name of a vertical axis, upwards and centred, at the left edge of an area.
pub(super) fn vertical_name(area: &Area<'_>, name: &str, middle: i32) -> Drawn {
    let turned = label().transform(FontTransform::Rotate270).pos(Pos::new(HPos::Center, VPos::Center));
    area.draw(&Text::new(name.to_owned(), (px(12.0), middle), turned))?;
    Ok(())
}

/// Stretches of finite points, each to be drawn as one line.
pub(super) fn unbroken(points: impl Iterator<Item = (f64, f64)>) -> Vec<Vec<(f64, f64)>> {
    let mut lines: Vec<Vec<(f64, f64)>> = vec![Vec::new()];
    for point in points {
        match lines.last_mut() {
            Some(line) if point.1.is_finite() => line.push(point),
            Some(line) if !line.is_empty() => lines.push(Vec::new()),
            _ => {}
        }
    }
    lines.retain(|line| line.len() > 1);
    lines
}
