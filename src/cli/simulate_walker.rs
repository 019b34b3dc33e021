//! `surefoot simulate walker`: depth recordings of a walker's user with known truth.

use crate::synthetic::walker::{Body, Course, WalkerSettings, WalkerSimulation, cesium, trousers};
use anyhow::Context;
use indicatif::{ProgressBar, ProgressStyle};
use std::fs;
use std::io::{BufWriter, IsTerminal, Write};
use std::path::PathBuf;

/// Simulations that have arguments of their own.
#[derive(Debug, clap::Subcommand)]
pub(super) enum Kind {
    Walker(Args),
}

/// Write a synthetic depth recording of somebody who walks behind a walker
///
/// The walker's camera looks back at the legs. Person, gait, clothes and the camera's mount are drawn from the seed; the
/// truth (hips, knees, ankles, heels and toes in sensor axes, contacts, steps) comes along on reference channels. The same
/// arguments always give the same bytes.
#[derive(Debug, clap::Args)]
#[command(after_help = "Examples:\n  surefoot simulate walker --out walk.mcap\n  \
    surefoot simulate walker --course turn --missing 0.3 --seed 7 --out turn.mcap\n  \
    surefoot simulate walker --body cesium --figure ../shared/data/depth/assets/CesiumMan.glb --out figure.mcap")]
pub struct Args {
    /// File to write, .mcap
    #[arg(long, value_name = "FILE")]
    out: PathBuf,
    /// Surface of the person
    #[arg(long, value_enum, default_value = "trousers")]
    body: BodyName,
    /// CesiumMan.glb, for `--body cesium`
    #[arg(long, value_name = "FILE", default_value = "../shared/data/depth/assets/CesiumMan.glb")]
    figure: PathBuf,
    /// Where the walk goes
    #[arg(long, value_enum, default_value = "straight")]
    course: CourseName,
    /// Length of the recording in seconds
    #[arg(long, default_value_t = 20.0)]
    seconds: f64,
    /// Frames per second
    #[arg(long, default_value_t = 30.0)]
    rate: f64,
    /// Seed of everything that is not said here
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// Height of the person in metres [default: 1.5 to 1.9 by the seed]
    #[arg(long)]
    stature: Option<f64>,
    /// Walking speed in metres a second [default: 0.3 to 1 by the seed]
    #[arg(long)]
    speed: Option<f64>,
    /// Step width in metres [default: 0.08 to 0.2 by the seed]
    #[arg(long)]
    step_width: Option<f64>,
    /// Share of the person's pixels that are missing in patches, 0 to 0.9
    #[arg(long, default_value_t = 0.0)]
    missing: f64,
    /// Tilt of the camera downwards in degrees; its height is chosen so that it sees the feet [default: 0 to 15 by the
    /// seed]
    #[arg(long, allow_negative_numbers = true)]
    tilt_deg: Option<f64>,
    /// Height of the camera in metres [default: by the tilt]
    #[arg(long)]
    camera_height: Option<f64>,
    /// Also write what two colour cameras at the sides see, for the cue `rgb`
    #[arg(long)]
    side_cameras: bool,
    /// Leave out all errors of the sensor but its whole codes
    #[arg(long)]
    clean: bool,
}

#[derive(Debug, Clone, Copy, clap::ValueEnum)]
enum BodyName {
    /// Made here: trousers and shoes
    Trousers,
    /// The figure of CesiumMan.glb
    Cesium,
}

#[derive(Debug, Clone, Copy, clap::ValueEnum)]
enum CourseName {
    Straight,
    Standing,
    StopAndGo,
    Turn,
}

impl From<CourseName> for Course {
    fn from(name: CourseName) -> Self {
        match name {
            CourseName::Straight => Course::Straight,
            CourseName::Standing => Course::Standing,
            CourseName::StopAndGo => Course::StopAndGo,
            CourseName::Turn => Course::Turn,
        }
    }
}

/// Runs the command.
///
/// # Errors
/// A setting out of range, a figure that cannot be read, or a file that cannot be written.
pub fn run(args: &Args) -> anyhow::Result<()> {
    let simulation = WalkerSimulation::new(&settings(args), body(args)?)?;
    let file = fs::File::create(&args.out).with_context(|| format!("cannot write {}", args.out.display()))?;
    let bar = progress_bar(simulation.len() as u64)?;
    let (file, progress) = (BufWriter::new(file), |k| bar.set_position(k as u64));
    let file = if args.side_cameras {
        simulation.write_with_sides(file, progress)?
    } else {
        simulation.write(file, progress)?
    };
    bar.finish_and_clear();
    let bytes = file.into_inner().map_err(|error| error.into_error())?.metadata()?.len();
    let (frames, steps) = (simulation.len(), simulation.steps().len());
    writeln!(
        std::io::stdout(),
        "{}: walker {}, {frames} frames, {steps} steps, {bytes} bytes",
        args.out.display(),
        Course::from(args.course).name()
    )?;
    Ok(())
}

fn settings(args: &Args) -> WalkerSettings {
    let mut settings = WalkerSettings::of_seed(args.course.into(), args.seed);
    (settings.duration_s, settings.rate_hz) = (args.seconds, args.rate);
    settings.stature_m = args.stature.unwrap_or(settings.stature_m);
    if let Some(speed) = args.speed {
        settings = settings.with_speed(speed);
    }
    settings.stride.width_m = args.step_width.unwrap_or(settings.stride.width_m);
    if let Some(tilt) = args.tilt_deg {
        settings = settings.with_tilt(tilt.to_radians());
    }
    settings.mount.height_m = args.camera_height.unwrap_or(settings.mount.height_m);
    settings.errors.missing_share = args.missing;
    settings.errors.is_noisy = !args.clean;
    settings
}

fn body(args: &Args) -> anyhow::Result<Body> {
    match args.body {
        BodyName::Trousers => Ok(trousers::trousers()),
        BodyName::Cesium => {
            let path = &args.figure;
            let bytes = fs::read(path).with_context(|| format!("cannot read the figure {}", path.display()))?;
            Ok(cesium::body_from_glb(&bytes)?)
        }
    }
}

/// A bar on a terminal, nothing elsewhere.
fn progress_bar(n: u64) -> anyhow::Result<ProgressBar> {
    if !std::io::stderr().is_terminal() {
        return Ok(ProgressBar::hidden());
    }
    Ok(ProgressBar::new(n).with_style(ProgressStyle::with_template("{bar:40} {pos}/{len} frames")?))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::recording::Limits;
    use crate::recording::depth::DepthReader;
    use clap::Parser;

    #[derive(Parser)]
    struct Command {
        #[command(flatten)]
        args: Args,
    }

    fn simulate(out: &std::path::Path, words: &[&str]) -> anyhow::Result<()> {
        let fixed = ["walker", "--seconds", "1", "--rate", "3", "--out", out.to_str().unwrap()];
        run(&Command::try_parse_from(fixed.iter().chain(words))?.args)
    }

    #[test]
    fn a_walk_is_written_and_the_same_arguments_give_the_same_bytes() {
        let folder = tempfile::tempdir().unwrap();
        let [a, b] = ["a.mcap", "b.mcap"].map(|name| folder.path().join(name));
        simulate(&a, &["--tilt-deg", "10", "--missing", "0.3"]).unwrap();
        simulate(&b, &["--tilt-deg", "10", "--missing", "0.3"]).unwrap();
        assert_eq!(fs::read(&a).unwrap(), fs::read(&b).unwrap());
        let reader = DepthReader::open(fs::File::open(&a).unwrap(), &Limits::default()).unwrap();
        assert!(reader.side_cameras().is_none());
        assert!((reader.calibration().unwrap().camera_tilt_deg.unwrap() - 10.0).abs() < 1e-9);
        assert_eq!(reader.count(), 3);
    }

    #[test]
    fn cameras_at_the_sides_see_every_image_when_they_are_asked_for() {
        let folder = tempfile::tempdir().unwrap();
        let out = folder.path().join("walk.mcap");
        simulate(&out, &["--side-cameras"]).unwrap();
        let mut reader = DepthReader::open(fs::File::open(&out).unwrap(), &Limits::default()).unwrap();
        assert!(reader.side_cameras().is_some_and(|[left, right]| left.first != right.first));
        while let Some(image) = reader.next() {
            image.unwrap();
            assert!(reader.side_images().unwrap().is_some());
        }
    }

    #[test]
    fn what_cannot_be_simulated_is_refused_and_says_why() {
        let folder = tempfile::tempdir().unwrap();
        let refusal = |words: &[&str]| simulate(&folder.path().join("a.mcap"), words).unwrap_err().to_string();
        assert!(refusal(&["--missing", "2"]).contains("between 0 and 0.9"));
        assert!(refusal(&["--course", "loop"]).contains("stop-and-go"));
        assert!(refusal(&["--body", "cesium", "--figure", "none.glb"]).contains("none.glb"));
    }
}
