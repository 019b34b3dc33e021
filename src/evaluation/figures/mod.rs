//! Figures of an evaluation as SVG, in the manner of \[angles\] Figures 2 and 3.
//!
//! | figure | what it shows | of |
//! |---|---|---|
//! | `series-…` | estimate with its 95 % band, reference, middleware and raw angle over time | one trial of each exercise |
//! | `scatter-…` | error of the default beside the middleware's, frame by frame (Figure 2) | each data set |
//! | `boxes-…` | distribution of the errors of each method in each exercise | each data set |
//! | `gain-…` | gain over the middleware by the number of particles (Figure 3) | each data set |
//!
//! The same evaluation gives the same bytes.

mod canvas;
mod error_boxes;
mod error_scatter;
mod gain_by_particles;
#[cfg(test)]
mod tests;
mod time_series;

use super::contender::Contender;
use super::joint_angles::{Outcomes, TrialOutcome};
use super::rows::Evaluation;
use plotters::style::RGBColor;
use std::collections::BTreeMap;

/// One figure.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Figure {
    /// Name for a file, without ending.
    pub name: String,
    /// The picture.
    pub svg: String,
}

/// A figure that could not be drawn.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("cannot draw {figure}: {reason}")]
pub struct FigureError {
    /// The figure.
    pub figure: String,
    /// What the drawing library says.
    pub reason: String,
}

/// What drawing on a canvas may answer.
type Drawn<T = ()> = Result<T, Box<dyn std::error::Error>>;

/// Every figure for which the outcomes have data.
///
/// # Errors
/// [`FigureError`] when the drawing library gives up.
pub fn draw(outcomes: &Outcomes, evaluation: &Evaluation) -> Result<Vec<Figure>, FigureError> {
    let mut figures = Vec::new();
    let mut add = |name: String, drawn: Drawn<Option<String>>| match drawn {
        Ok(None) => Ok(()),
        Ok(Some(svg)) => {
            figures.push(Figure { name, svg });
            Ok(())
        }
        Err(error) => Err(FigureError { figure: name, reason: error.to_string() }),
    };
    let sets = by_dataset(outcomes);
    for (dataset, exercises) in &sets {
        for (exercise, trials) in exercises {
            let name = format!("series-{dataset}-{exercise}");
            add(name, time_series::draw(exercise, trials[0], &outcomes.contenders))?;
        }
        add(format!("scatter-{dataset}"), error_scatter::draw(dataset, exercises, &outcomes.contenders))?;
        add(format!("boxes-{dataset}"), error_boxes::draw(dataset, exercises, &outcomes.contenders))?;
        add(format!("gain-{dataset}"), gain_by_particles::draw(dataset, &evaluation.errors))?;
    }
    Ok(figures)
}

/// Trials with results, by exercise.
type Exercises<'a> = BTreeMap<&'a str, Vec<&'a TrialOutcome>>;

fn by_dataset(outcomes: &Outcomes) -> BTreeMap<&str, Exercises<'_>> {
    let mut sets: BTreeMap<&str, Exercises<'_>> = BTreeMap::new();
    for trial in outcomes.trials.iter().filter(|trial| !trial.results.is_empty()) {
        if let Ok((dataset, exercise)) = &trial.place {
            sets.entry(dataset).or_default().entry(exercise).or_default().push(trial);
        }
    }
    sets
}

/// Colours that people with any colour vision tell apart (Okabe and Ito, 2008).
mod colour {
    use plotters::style::RGBColor;

    pub(super) const BLUE: RGBColor = RGBColor(0, 114, 178);
    pub(super) const ORANGE: RGBColor = RGBColor(230, 159, 0);
    pub(super) const GREEN: RGBColor = RGBColor(0, 158, 115);
    pub(super) const VERMILLION: RGBColor = RGBColor(213, 94, 0);
    pub(super) const PURPLE: RGBColor = RGBColor(204, 121, 167);
    pub(super) const SKY: RGBColor = RGBColor(86, 180, 233);
    pub(super) const YELLOW: RGBColor = RGBColor(240, 228, 66);
    pub(super) const GREY: RGBColor = RGBColor(150, 150, 150);
    pub(super) const INK: RGBColor = RGBColor(40, 40, 40);
    pub(super) const GRID: RGBColor = RGBColor(224, 224, 224);
}

/// Colour of a contender: raw, the default and the middleware have one of their own; the others take turns.
fn colour_of(contender: Contender, contenders: &[Contender]) -> RGBColor {
    const OTHERS: [RGBColor; 5] = [colour::VERMILLION, colour::GREEN, colour::PURPLE, colour::SKY, colour::YELLOW];
    let has_own = |c: &Contender| *c == Contender::Raw || *c == Contender::MIDDLEWARE || c.is_default();
    match contender {
        Contender::Raw => colour::GREY,
        Contender::MIDDLEWARE => colour::ORANGE,
        own if own.is_default() => colour::BLUE,
        other => {
            let place = contenders.iter().filter(|c| !has_own(c)).position(|c| *c == other);
            OTHERS[place.unwrap_or(0) % OTHERS.len()]
        }
    }
}
