//! `surefoot simulate`: recordings with known truth.

use crate::recording::{Format, Recording, encode};
use crate::synthetic::{Exercise, Preset, SimulationSettings, simulate};
use anyhow::{Context, bail};
use std::fs;
use std::path::{Path, PathBuf};

/// Write a synthetic exercise recording whose true joint angles are known.
///
/// The recording starts with two seconds in the T-posture; the truth comes along on its reference channels, so that
/// `evaluate` or any MCAP reader can compare. The same arguments always give the same bytes.
#[derive(Debug, clap::Args)]
#[command(after_help = "Examples:\n  surefoot simulate back_knee --out knee.mcap\n  \
    surefoot simulate step --noise kinect-v2 --jitter --seed 7 --out step.json\n  \
    surefoot simulate all --noise failures --out recordings/")]
pub struct Args {
    /// back_knee, sit_front_knee, side_hip, step, near_tandem, or all for one file of each
    exercise: String,
    /// File to write, .mcap or .json; for `all` a directory, made when absent
    #[arg(long, value_name = "PATH")]
    out: PathBuf,
    /// Sensor errors: clean, table1 (the paper's white noise), kinect-v2 (posture-dependent offset), failures (table1
    /// with lost joints, hand jumps, exchanged limbs and missing frames)
    #[arg(long, default_value = "table1", value_name = "PRESET")]
    noise: Preset,
    /// Length of the recording in seconds
    #[arg(long, default_value_t = 20.0)]
    seconds: f64,
    /// Nominal frames per second
    #[arg(long, default_value_t = 30.0)]
    rate: f64,
    /// Vary the time between frames as real sensors do (25 to 35 Hz around 30)
    #[arg(long)]
    jitter: bool,
    /// Seed of the subject (amplitude, tempo, asymmetry) and of the sensor's errors
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// Height of the subject in metres
    #[arg(long, default_value_t = 1.7)]
    stature: f64,
    /// Turn of the subject to the left of the sensor's direction in degrees
    #[arg(long, default_value_t = 0.0, allow_negative_numbers = true)]
    yaw_deg: f64,
}

/// Runs the command.
///
/// # Errors
/// Unknown exercise, setting out of range, or a file that cannot be written.
pub fn run(args: &Args) -> anyhow::Result<()> {
    if args.exercise == "all" {
        fs::create_dir_all(&args.out).with_context(|| format!("cannot make the directory {}", args.out.display()))?;
        for exercise in Exercise::ALL {
            write(args, exercise, &args.out.join(format!("{exercise}.mcap")))?;
        }
        return Ok(());
    }
    write(args, args.exercise.parse()?, &args.out)
}

fn write(args: &Args, exercise: Exercise, path: &Path) -> anyhow::Result<()> {
    let format = format_of(path)?;
    let settings = SimulationSettings {
        exercise,
        sensor: args.noise,
        duration_s: args.seconds,
        rate_hz: args.rate,
        jitter: args.jitter,
        stature_m: args.stature,
        yaw_deg: args.yaw_deg,
        seed: args.seed,
    };
    let recording = simulate(&settings)?.recording;
    let bytes = encoded(&recording, format)?;
    fs::write(path, &bytes).with_context(|| format!("cannot write {}", path.display()))?;
    let frames = recording.skeleton.as_ref().map_or(0, |skeleton| skeleton.len());
    println!("{}: {exercise}, {frames} frames, noise {}, {} bytes", path.display(), args.noise, bytes.len());
    Ok(())
}

/// The format that a file's name asks for.
fn format_of(path: &Path) -> anyhow::Result<Format> {
    match path.extension().and_then(|extension| extension.to_str()) {
        Some("mcap") => Ok(Format::Mcap),
        Some("json") => Ok(Format::Json),
        _ => bail!("{} must end in .mcap or .json", path.display()),
    }
}

fn encoded(recording: &Recording, format: Format) -> anyhow::Result<Vec<u8>> {
    Ok(match format {
        Format::Mcap => encode::mcap(recording)?,
        Format::Json => encode::json(recording)?,
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::recording::{Limits, decode};
    use clap::Parser;

    #[derive(Parser)]
    struct Command {
        #[command(flatten)]
        args: Args,
    }

    fn simulate_to(path: &Path, words: &[&str]) -> anyhow::Result<()> {
        let out = path.to_str().unwrap();
        let fixed = ["simulate", "--out", out, "--seconds", "8"];
        run(&Command::try_parse_from(fixed.iter().chain(words))?.args)
    }

    #[test]
    fn both_formats_decode_to_the_same_recording() {
        let folder = tempfile::tempdir().unwrap();
        let read = |name: &str, format: Format| {
            let path = folder.path().join(name);
            simulate_to(&path, &["step", "--noise", "failures"]).unwrap();
            decode(fs::File::open(path).unwrap(), format, &Limits::default()).unwrap()
        };
        let (mcap, json) = (read("a.mcap", Format::Mcap), read("a.json", Format::Json));
        assert_eq!(mcap.header, json.header);
        assert_eq!(mcap.header.protocol.as_deref(), Some("step"));
        let times = |recording: &Recording| recording.skeleton.as_ref().unwrap().time_ns.clone();
        assert_eq!(times(&mcap), times(&json));
        assert_eq!((mcap.references.len(), json.references.len()), (34, 34));
    }

    #[test]
    fn all_writes_one_file_of_each_exercise() {
        let folder = tempfile::tempdir().unwrap();
        simulate_to(&folder.path().join("new"), &["all"]).unwrap();
        for exercise in Exercise::ALL {
            assert!(folder.path().join("new").join(format!("{exercise}.mcap")).is_file(), "{exercise}");
        }
    }

    #[test]
    fn an_unknown_exercise_preset_or_file_name_is_refused_and_says_what_there_is() {
        let folder = tempfile::tempdir().unwrap();
        let refusal =
            |name: &str, words: &[&str]| simulate_to(&folder.path().join(name), words).unwrap_err().to_string();
        assert!(refusal("a.mcap", &["jump"]).contains("near_tandem"));
        assert!(refusal("a.mcap", &["step", "--noise", "loud"]).contains("kinect-v2"));
        assert!(refusal("a.csv", &["step"]).contains(".mcap or .json"));
        assert!(refusal("a.mcap", &["step", "--stature", "9"]).contains("between 0.5 and 2.5"));
    }
}
