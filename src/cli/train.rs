//! `surefoot train`: recordings of a sensor become its noise model.

use super::assess::recording_of;
use crate::assessment::noise_model::{ADAPTIVE, find_shipped, is_model_name};
use crate::assessment::{NoiseModel, NoiseModelName};
use crate::body::Limb;
use crate::pipeline::PipelineError;
use crate::pipeline::joint_angles::training::{RecordingIdentity, Trainer};
use crate::progress::Monitor;
use crate::recording::Recording;
use anyhow::{Context, anyhow, bail};
use sha2::{Digest, Sha256};
use std::fs;
use std::io::Write;
use std::path::{Path, PathBuf};

/// Train a noise model of a sensor from recordings
///
/// A noise model says how far a sensor is off: white noise, which is new in every frame, and a slow offset, which stays as
/// long as the posture does; and how fast the joints turn in the movements that it is for. `assess` and `evaluate` take it
/// with --noise-model.
///
/// White noise comes from seconds in which the subject stands still: give two static recordings of ten seconds or more
/// (stretches of ten seconds without movement count, 20 s in all are needed). The subject should face the sensor. Slow offset and
/// turns come from the movement recordings, best with reference angles.
#[derive(Debug, Clone, clap::Args)]
#[command(after_help = "Examples:\n  surefoot train --name ward-3 --static still1.mcap still2.mcap \\\n      \
    --movement squat.mcap step.mcap --out ward-3.json\n  surefoot assess squat.mcap --noise-model ward-3.json\n\n\
    A service trains from its stored recordings: POST /v1/noise-models.")]
pub struct Args {
    /// Name of the model: lower-case letters, digits and hyphens
    #[arg(long, value_name = "NAME")]
    name: String,
    /// Recordings of a subject who stands still, .mcap or .json
    #[arg(long = "static", value_name = "FILE", num_args = 1.., required_unless_present = "white_from_movement")]
    still: Vec<PathBuf>,
    /// Recordings of movements; without any, joints turn as in nite-table1 and no slow offset is known
    #[arg(long, value_name = "FILE", num_args = 1..)]
    movement: Vec<PathBuf>,
    /// Take white noise from the movement recordings (their third differences), when there are no static ones; noise that
    /// the sensor's software has smoothed looks smaller so
    #[arg(long, conflicts_with = "still", requires = "movement")]
    white_from_movement: bool,
    /// What the model describes, for a person
    #[arg(long, value_name = "TEXT", default_value = "")]
    description: String,
    /// File to write, JSON
    #[arg(long, value_name = "FILE")]
    out: PathBuf,
}

/// Runs the command.
///
/// # Errors
/// When a file is no recording, or the recordings do not make a model; the sentence says what to record.
pub fn run(args: &Args) -> anyhow::Result<()> {
    let model = trained(args)?;
    let bytes = serde_json::to_vec(&model)?;
    fs::write(&args.out, &bytes).with_context(|| format!("cannot write {}", args.out.display()))?;
    summary(&model, &args.out, &mut std::io::stdout().lock())
}

/// True of names that settings understand without a file or a stored model.
fn is_reserved(name: &str) -> bool {
    name == ADAPTIVE || find_shipped(&NoiseModelName { name: name.to_owned(), version: None }).is_some()
}

fn trained(args: &Args) -> anyhow::Result<NoiseModel> {
    if !is_model_name(&args.name) {
        bail!("`{}` is no name of a model; use lower-case letters, digits and hyphens, a letter first", args.name);
    }
    if args.name == ADAPTIVE {
        bail!("`{ADAPTIVE}` is the name of noise estimated from a recording itself; choose another");
    }
    if is_reserved(&args.name) {
        eprintln!(
            "note: {} is also the name of a shipped model; --noise-model takes that one unless a file is given",
            args.name
        );
    }
    let monitor = Monitor::default();
    let mut trainer =
        if args.white_from_movement { Trainer::with_white_noise_from_movement() } else { Trainer::default() };
    for path in &args.still {
        let (identity, recording) = read(path)?;
        trainer.add_static(identity, &recording, &monitor).map_err(told)?;
    }
    for path in &args.movement {
        let (identity, recording) = read(path)?;
        trainer.add_movement(identity, &recording, &monitor).map_err(told)?;
    }
    trainer.finish(&args.name, &args.description).map_err(told)
}

/// The recording, under the name of its file without the folder: where it lay is nobody's concern.
fn read(path: &Path) -> anyhow::Result<(RecordingIdentity, Recording)> {
    let bytes = fs::read(path).with_context(|| format!("cannot read {}", path.display()))?;
    let recording = recording_of(&bytes).with_context(|| path.display().to_string())?;
    let name = path.file_name().map_or_else(String::new, |name| name.to_string_lossy().into_owned());
    Ok((RecordingIdentity { name, sha256: hex::encode(Sha256::digest(&bytes)) }, recording))
}

fn told(error: PipelineError) -> anyhow::Error {
    match &error {
        PipelineError::Unsuitable { code, place: Some(place), sentence } => anyhow!("{code} at {place}: {sentence}"),
        PipelineError::Unsuitable { code, place: None, sentence } => anyhow!("{code}: {sentence}"),
        PipelineError::Cancelled | PipelineError::Defect(_) => anyhow!("{error}"),
    }
}

fn summary(model: &NoiseModel, path: &Path, out: &mut dyn Write) -> anyhow::Result<()> {
    let document = model.document();
    writeln!(out, "{}: noise model {}, sha256 {}", path.display(), model.name(), model.sha256())?;
    if let Some(training) = &document.training {
        writeln!(
            out,
            "white noise from {:.0} s ({}), correlations shrunk by {:.0} %; turns from {}; slow offset of arms from {}, of \
             legs from {}",
            training.white_s,
            training.white_source,
            100.0 * training.shrinkage,
            training.transition_source,
            training.arm_offset_source,
            training.leg_offset_source,
        )?;
    }
    writeln!(out, "\n{:<10}{:>32}{:>20}", "point", "white SD, mm (right, up, depth)", "slow offset SD, mm")?;
    for limb in [Limb::LeftArm, Limb::LeftLeg] {
        for level in 0..3 {
            let Some(noise) = document.point(limb, level) else { continue };
            let [x, y, z] = noise.white_sd_mm;
            let name = noise.point.name().trim_start_matches("left_");
            writeln!(out, "{name:<10}{:>32}{:>20.1}", format!("{x:.2}  {y:.2}  {z:.2}"), noise.slow_offset_sd_mm)?;
        }
    }
    let turns = &document.transition_sd_deg;
    writeln!(
        out,
        "\nturns in 1/30 s, SD in degrees: trunk {:.2?}, shoulder {:.2?}, elbow {:.2}, hip {:.2?}, knee {:.2}",
        turns.trunk, turns.shoulder, turns.elbow, turns.hip, turns.knee
    )?;
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::recording::encode;
    use crate::synthetic::{Exercise, Preset, SimulationSettings, simulate};
    use clap::Parser;

    #[derive(Debug, Parser)]
    struct Command {
        #[command(flatten)]
        args: Args,
    }

    fn train(words: &[&str]) -> anyhow::Result<()> {
        run(&Command::try_parse_from([&["train"], words].concat())?.args)
    }

    /// A file of a simulated exercise; its first two seconds are at rest.
    fn exercise(folder: &Path, name: &str, seconds: f64) -> String {
        let settings = SimulationSettings {
            duration_s: seconds,
            ..SimulationSettings::new(Exercise::BackKnee, Preset::Table1, 1)
        };
        let path = folder.join(name);
        fs::write(&path, encode::mcap(&simulate(&settings).unwrap().recording).unwrap()).unwrap();
        path.to_str().unwrap().to_owned()
    }

    #[test]
    fn too_few_too_short_and_moving_recordings_are_refused_and_nothing_is_written() {
        let folder = tempfile::tempdir().unwrap();
        let out = folder.path().join("model.json");
        let (short, long) = (exercise(folder.path(), "a.mcap", 8.0), exercise(folder.path(), "b.mcap", 30.0));
        let refusal = |still: &[&str]| {
            let words = [&["--name", "mine", "--out", out.to_str().unwrap(), "--static"], still].concat();
            train(&words).unwrap_err().to_string()
        };
        assert!(refusal(&[&long]).starts_with("too_few_static_recordings: "));
        assert!(refusal(&[&short, &short]).starts_with("static_too_short: the static recordings last 16.0 s"));
        let moving = refusal(&[&long, &long]);
        assert!(moving.starts_with("not_static: ") && moving.contains("b.mcap: "), "{moving}");
        assert!(!out.exists());
    }

    #[test]
    fn names_that_no_model_can_have_are_refused() {
        for name in ["Ward 3", "adaptive"] {
            let error = train(&["--name", name, "--static", "a.mcap", "--out", "b.json"]).unwrap_err().to_string();
            assert!(error.contains(name), "{error}");
        }
    }
}
