//! Tables of the real thigh.

use super::number;
use crate::assessment::FusionMethod;
use crate::cli::evaluate::watch::Watch;
use crate::evaluation::agreement::median;
use crate::evaluation::fusion::Contender;
use crate::evaluation::fusion::thigh::{ThighErrors, evaluate};
use crate::recording::import::{Dataset, ImportError, list};
use anyhow::bail;
use rayon::prelude::*;
use serde::Serialize;
use std::io::{self, Write};
use std::path::{Path, PathBuf};

/// One recording.
#[derive(Debug, Serialize)]
pub(super) struct Trial {
    pub(super) name: String,
    pub(super) exercise: String,
    pub(super) errors: Vec<ThighErrors>,
}

/// Every contender on every recording at or below a directory, or below the usual one, which need not be there.
pub(super) fn trials(directory: Option<&Path>, contenders: &[Contender]) -> anyhow::Result<Vec<Trial>> {
    let usual = || std::env::var_os("SUREFOOT_DATA").map_or(PathBuf::from("../shared/data"), PathBuf::from);
    let is_asked_for = directory.is_some();
    let directory = directory.map_or_else(usual, Path::to_owned);
    let sources = match list(Dataset::Utdmhad, &directory) {
        Ok(sources) => sources,
        Err(ImportError::NotFound { .. }) if is_asked_for => {
            bail!("no trials of utdmhad below {}; give their directory with --data", directory.display())
        }
        Err(ImportError::NotFound { .. }) => {
            eprintln!("no real recordings below {}; give the data sets' directory with --data", directory.display());
            return Ok(Vec::new());
        }
        Err(error) => return Err(error.into()),
    };
    let watch = Watch::new(sources.len() as u64);
    let trials: Result<Vec<Trial>, ImportError> = sources
        .par_iter()
        .with_max_len(1)
        .map(|source| {
            let errors = evaluate(&source.read()?.recording, contenders);
            watch.one_more();
            Ok(Trial { name: source.name.clone(), exercise: source.exercise.clone(), errors })
        })
        .collect();
    watch.finish();
    Ok(trials?)
}

pub(super) fn write(trials: &[Trial], has_trials: bool, out: &mut dyn Write) -> io::Result<()> {
    let mut exercises: Vec<&str> = trials.iter().map(|trial| trial.exercise.as_str()).collect();
    exercises.sort_unstable();
    exercises.dedup();
    writeln!(
        out,
        "\n{:<20} {:<9} {:>6} {:>6} {:>7} {:>8} {:>15} {:>6}",
        "utdmhad", "method", "trials", "turn", "closer", "tilt", "knee, mm", "failed"
    )?;
    for exercise in exercises.into_iter().map(Some).chain([None]) {
        let of_exercise: Vec<&Trial> =
            trials.iter().filter(|trial| exercise.is_none_or(|exercise| trial.exercise == exercise)).collect();
        lines(exercise.unwrap_or("all"), &of_exercise, out)?;
        for trial in of_exercise.iter().filter(|_| has_trials && exercise.is_some()) {
            for errors in &trial.errors {
                let line = Line::of(&[errors]);
                writeln!(out, "  {:<18} {:<9} {:>6} {}", trial.name, errors.contender.name(), "", line.cells(None))?;
            }
        }
    }
    writeln!(
        out,
        "\nMedians over trials: root mean square error of how far the thigh has turned against the vertical, degrees; how much \
         less that is than of the camera alone; error of the change of the bone's angle to the camera's vertical; distance of the right knee from the camera's, \
         median and 95 % of the frames. In the line of raw the last is the camera's own scatter: its knee's distance from \
         its course averaged over 0.3 s, and the change of the thigh's length, root of the squares."
    )
}

fn lines(exercise: &str, trials: &[&Trial], out: &mut dyn Write) -> io::Result<()> {
    let names: Vec<Contender> = trials
        .iter()
        .find_map(|t| (!t.errors.is_empty()).then(|| t.errors.iter().map(|e| e.contender).collect()))
        .unwrap_or_default();
    let of = |contender: Contender| {
        let errors: Vec<&ThighErrors> =
            trials.iter().flat_map(|trial| &trial.errors).filter(|errors| errors.contender == contender).collect();
        Line::of(&errors)
    };
    let camera = Contender::Method(FusionMethod::Camera);
    let alone = names.contains(&camera).then(|| of(camera).turn).flatten();
    for contender in names {
        let line = of(contender);
        writeln!(out, "{exercise:<20} {:<9} {:>6} {}", contender.name(), line.n, line.cells(alone))?;
    }
    Ok(())
}

/// Medians over trials.
struct Line {
    n: usize,
    turn: Option<f64>,
    tilt: Option<f64>,
    knee: Option<[f64; 2]>,
    n_failed: usize,
}

impl Line {
    fn of(errors: &[&ThighErrors]) -> Self {
        let over = |value: &dyn Fn(&ThighErrors) -> Option<f64>| {
            median(&errors.iter().filter_map(|errors| value(errors)).collect::<Vec<f64>>())
        };
        let knee = |which: usize| over(&|errors| errors.knee_mm.map(|mm| mm[which]));
        Self {
            n: errors.len(),
            turn: over(&|errors| errors.turn_rmse_deg),
            tilt: over(&|errors| errors.tilt_rmse_deg),
            knee: knee(0).zip(knee(1)).map(|(median, most)| [median, most]),
            n_failed: errors.iter().filter(|errors| errors.failure.is_some()).count(),
        }
    }

    fn cells(&self, alone: Option<f64>) -> String {
        let closer = self.turn.zip(alone).map(|(turn, alone)| format!("{:.0}%", 100.0 * (1.0 - turn / alone)));
        let knee = self.knee.map(|[median, most]| format!("{median:.0} / {most:.0}"));
        let text = |text: Option<String>| text.unwrap_or("-".to_owned());
        let (turn, tilt) = (number(self.turn, 2), number(self.tilt, 2));
        format!("{turn:>6} {:>7} {tilt:>8} {:>15} {:>6}", text(closer), text(knee), self.n_failed)
    }
}
