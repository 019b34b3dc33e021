//! Trials to evaluate: data sets on disk, or simulated exercises.

use crate::evaluation::{Trial, TrialSource};
use crate::recording::import::{Dataset, ImportError, list};
use crate::synthetic::{Exercise, Preset, SimulationSettings, simulate};
use anyhow::bail;
use std::path::Path;

/// Every trial of every data set at or below a directory.
pub(super) fn imported(directory: &Path) -> anyhow::Result<Vec<TrialSource>> {
    if !directory.is_dir() {
        bail!(
            "there is no directory {}; give the data sets' directory with --data or SUREFOOT_DATA, or use --simulated",
            directory.display()
        );
    }
    let mut sources = Vec::new();
    for dataset in Dataset::WITH_SKELETON {
        let found = match list(dataset, directory) {
            Ok(found) => found,
            Err(ImportError::NotFound { .. }) => continue,
            Err(error) => return Err(error.into()),
        };
        for source in found {
            // Exercises done wrongly on purpose are kept apart from the same done well.
            let manner = if source.name.ends_with("_inc") { "_incorrect" } else { "" };
            let exercise = format!("{}{manner}", source.exercise);
            sources.push(TrialSource::new(format!("{} {}", dataset.name(), source.name), move || {
                let trial = source.read().map_err(|error| error.to_string())?;
                Ok(Trial { dataset: dataset.name().to_owned(), exercise: exercise.clone(), recording: trial.recording })
            }));
        }
    }
    if sources.is_empty() {
        let names = Dataset::WITH_SKELETON.map(Dataset::name).join(", ");
        bail!(
            "no trials of {names} below {}; give their directory with --data, or use --simulated",
            directory.display()
        );
    }
    Ok(sources)
}

/// The synthetic exercises with one sensor's errors, each by several subjects of different height and direction.
pub(super) fn simulated(noise: Preset, seeds: u64) -> Vec<TrialSource> {
    let mut sources = Vec::new();
    for exercise in Exercise::ALL {
        for seed in 1..=seeds {
            sources.push(TrialSource::new(format!("simulated-{noise} {exercise}, seed {seed}"), move || {
                let settings = SimulationSettings {
                    jitter: true,
                    // Steps that never repeat within a few subjects: heights 1.55 to 1.85 m, up to 10° to either side.
                    stature_m: 1.55 + 0.3 * (0.618 * seed as f64).fract(),
                    yaw_deg: -10.0 + 20.0 * (0.414 * seed as f64).fract(),
                    ..SimulationSettings::new(exercise, noise, seed)
                };
                let recording = simulate(&settings).map_err(|error| error.to_string())?.recording;
                Ok(Trial { dataset: format!("simulated-{noise}"), exercise: exercise.name().to_owned(), recording })
            }));
        }
    }
    sources
}
