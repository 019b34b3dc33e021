//! `surefoot simulate`: recordings with known truth.

mod fusion;

use crate::recording::{Format, Recording, encode};
use crate::synthetic::{Exercise, Movement, Preset, SimulationSettings, simulate, simulate_fusion};
use anyhow::{Context, bail};
use fusion::FusionArgs;
use std::fs;
use std::path::{Path, PathBuf};

/// Length of a recording, or with inertial units of its movement, when none is asked for, seconds.
const DEFAULT_S: f64 = 20.0;

/// The sensor of a recording without inertial units, when none is asked for.
const DEFAULT_NOISE: Preset = Preset::Table1;

/// Write a synthetic recording whose true joint angles are known.
///
/// The recording starts with two seconds in the T-posture, with --imu after the units were put on; the truth comes along
/// on its reference channels, so that `evaluate` or any MCAP reader can compare. The same arguments always give the same
/// bytes.
#[derive(Debug, clap::Args)]
#[command(after_help = "Examples:\n  surefoot simulate back_knee --out knee.mcap\n  \
    surefoot simulate step --noise kinect-v2 --jitter --seed 7 --out step.json\n  \
    surefoot simulate all --noise failures --out recordings/\n  \
    surefoot simulate kick --imu --occlusion 20 --seconds 40 --out kick.mcap\n  \
    surefoot simulate elbow --imu --units left_upper_arm,left_forearm --no-plank --out elbow.mcap\n  \
    surefoot simulate --motion cmu/02_01.mcap --imu --mounting arbitrary --out walk.mcap")]
pub struct Args {
    /// back_knee, sit_front_knee, side_hip, step, near_tandem, kick, kick_left, elbow, or all for one file of each of the
    /// first five (with --imu of all eight)
    #[arg(required_unless_present = "motion")]
    exercise: Option<String>,
    /// Recording whose motion the subject does instead of an exercise, forth and back, .mcap or .json
    #[arg(long, value_name = "FILE", conflicts_with = "exercise")]
    motion: Option<PathBuf>,
    /// File to write, .mcap or .json; for `all` a directory, made when absent
    // Optional only for the parser: `simulate walker` has arguments of its own.
    #[arg(long, value_name = "PATH", required = true)]
    out: Option<PathBuf>,
    /// Sensor errors: clean, table1 (the paper's white noise), kinect-v2 (posture-dependent offset), kinect-offset (larger
    /// offsets, of every joint), failures (table1 with lost joints, hand jumps, exchanged limbs and missing frames)
    /// [default: table1, with --imu kinect-offset]
    #[arg(long, value_name = "PRESET")]
    noise: Option<Preset>,
    /// Length of the recording, with --imu, kick and elbow of the movement, in seconds [default: 20, or that of a
    /// longer motion]
    #[arg(long)]
    seconds: Option<f64>,
    /// Nominal frames per second
    #[arg(long, default_value_t = 30.0)]
    rate: f64,
    /// Vary the time between frames as real sensors do (25 to 35 Hz around 30)
    #[arg(long)]
    jitter: bool,
    /// Seconds of the movement during which the camera does not see a limb, several, or the whole body
    #[arg(long, default_value_t = 0.0, value_name = "SECONDS")]
    occlusion: f64,
    /// Seed of the subject (amplitude, tempo, asymmetry) and of the sensors' errors
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// Height of the subject in metres
    #[arg(long, default_value_t = 1.7)]
    stature: f64,
    /// Turn of the subject to the left of the sensor's direction in degrees
    #[arg(long, default_value_t = 0.0, allow_negative_numbers = true)]
    yaw_deg: f64,
    #[command(flatten)]
    fusion: FusionArgs,
}

/// Runs the command.
///
/// # Errors
/// Unknown exercise, setting out of range, a motion that cannot be read, or a file that cannot be written.
pub fn run(args: &Args) -> anyhow::Result<()> {
    let Some(out) = &args.out else { bail!("say with --out what to write") };
    match (&args.motion, args.exercise.as_deref().unwrap_or_default()) {
        (Some(path), _) => write(args, fusion::motion_of(path)?, out),
        (None, "all") => {
            let folder = out;
            fs::create_dir_all(folder).with_context(|| format!("cannot make the directory {}", folder.display()))?;
            let of_fusion = if args.fusion.imu { &Movement::OF_FUSION[..] } else { &[] };
            for movement in Exercise::ALL.map(Movement::Exercise).iter().chain(of_fusion) {
                write(args, movement.clone(), &folder.join(format!("{movement}.mcap")))?;
            }
            Ok(())
        }
        (None, name) => write(args, name.parse()?, out),
    }
}

fn write(args: &Args, movement: Movement, path: &Path) -> anyhow::Result<()> {
    let format = format_of(path)?;
    let name = movement.name();
    let recording = match movement {
        Movement::Exercise(exercise) if !args.fusion.imu && args.occlusion == 0.0 => {
            simulate(&exercise_settings(args, exercise))?.recording
        }
        movement => simulate_fusion(&args.fusion.simulation(args, movement))?.recording,
    };
    let bytes = encoded(&recording, format)?;
    fs::write(path, &bytes).with_context(|| format!("cannot write {}", path.display()))?;
    let frames = recording.skeleton.as_ref().map_or(0, |skeleton| skeleton.len());
    let units = recording.inertial.as_ref().map_or(0, |inertial| inertial.sensors.len());
    let noise = recording.header.device.model.unwrap_or_default();
    println!("{}: {name}, {frames} frames, {units} units, noise {noise}, {} bytes", path.display(), bytes.len());
    Ok(())
}

fn exercise_settings(args: &Args, exercise: Exercise) -> SimulationSettings {
    SimulationSettings {
        exercise,
        sensor: args.noise.unwrap_or(DEFAULT_NOISE),
        duration_s: args.seconds.unwrap_or(DEFAULT_S),
        rate_hz: args.rate,
        jitter: args.jitter,
        stature_m: args.stature,
        yaw_deg: args.yaw_deg,
        seed: args.seed,
    }
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
    fn inertial_units_come_with_their_truth_and_a_recorded_motion_can_carry_them() {
        let folder = tempfile::tempdir().unwrap();
        let read = |name: &str, words: &[&str]| {
            let path = folder.path().join(name);
            simulate_to(&path, words).unwrap();
            decode(fs::File::open(path).unwrap(), Format::Mcap, &Limits::default()).unwrap()
        };
        let units = ["--imu", "--units", "left_thigh,left_shank", "--no-plank", "--no-jumps"];
        let kick = read("kick.mcap", &[&["kick", "--occlusion", "3"], &units[..]].concat());
        assert_eq!(kick.header.protocol.as_deref(), Some("kick"));
        assert_eq!(kick.header.device.model.as_deref(), Some("kinect-offset"));
        assert_eq!(kick.inertial.as_ref().map(|inertial| inertial.sensors.len()), Some(2));
        assert!(kick.references.iter().any(|series| series.channel == "left_shank_clock_offset_s"));
        assert!(kick.skeleton.unwrap().confidence.contains(&0.0));
        let motion = folder.path().join("kick.mcap");
        let walk = read("again.mcap", &[&["--motion", motion.to_str().unwrap()], &units[..]].concat());
        assert_eq!(walk.header.protocol.as_deref(), Some("recorded_motion"));
        let refused = simulate_to(&folder.path().join("a.mcap"), &["kick", "--no-plank"]).unwrap_err().to_string();
        assert!(refused.contains("--imu"), "{refused}");
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
