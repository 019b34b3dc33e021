//! `surefoot assess`: one recording, assessed on this machine without a service.

use super::assess_legs;
use super::method::AnyMethod;
use super::noise_model::NoiseModelChoice;
use super::overlay::{self, FrameRange};
use crate::assessment::{
    Assessment, JointAngleSettings, LegCues, LegPoseMode, LegPoseSettings, Method, Pass, Settings,
    SkeletonFusionSettings,
};
use crate::estimation::orientation_filter::OrientationMethod;
use crate::pipeline::{self, Inputs};
use crate::progress::{Monitor, Step};
use crate::protocol;
use crate::recording::decode::{Limits, decode};
use crate::recording::{Format, Recording};
use crate::report::export::{Samples, csv};
use anyhow::{Context, anyhow, bail};
use indicatif::{ProgressBar, ProgressStyle};
use sha2::{Digest, Sha256};
use std::fs;
use std::io::{BufWriter, IsTerminal, Write};
use std::ops::RangeInclusive;
use std::path::{Path, PathBuf};
use std::time::Duration;

/// Assess one recording on this machine, without a service
///
/// Reads a recording (MCAP or JSON, see docs/recording-format.md) and prints one line per series, joint angles and with
/// inertial units also places of joints: range, mean and interval. The same file and settings always give the same numbers
/// as an upload would.
#[derive(Debug, Clone, clap::Args)]
#[command(after_help = "Examples:\n  surefoot assess squat.mcap\n  surefoot assess squat.mcap --csv angles.csv\n  \
    surefoot assess squat.json --method particle --particles 2048 --json\n  \
    surefoot assess squat.mcap --noise-model kinect-v2\n  surefoot assess kick-with-units.mcap --method hierarchy\n  \
    surefoot assess walk.mcap --frames legs.csv --overlay pictures --frames-range 100..130\n  \
    surefoot assess walk.mcap --method paper --cues both --particles 5000")]
pub struct Args {
    /// Recording, .mcap or .json; the content decides
    recording: PathBuf,
    /// Of skeletons: iekf, ukf (unscented), guided (particles that look before they leap), particle (the paper's particle
    /// filter), ik (closed geometry), nite (middleware's rotations). With inertial units: fused, hierarchy (the paper's
    /// fusion), camera (alone), inertial (units alone). Of depth images: fitted, paper (its particle filter) [default: by
    /// the recording, fitted, fused or iekf]
    #[arg(long, value_name = "METHOD")]
    method: Option<AnyMethod>,
    /// Orientation filter of inertial units: smoother, vqf, madgwick, gyroscope; the method's own choice when absent
    #[arg(long, value_name = "FILTER")]
    orientation: Option<OrientationMethod>,
    /// Gain of the orientation filter madgwick, rad/s [default: 0.033]
    #[arg(long, value_name = "BETA")]
    gain: Option<f64>,
    /// Samples per second of a fused result [default: the units' own]
    #[arg(long, value_name = "HZ")]
    rate: Option<f64>,
    /// smooth (over the whole recording; the default of methods that can) or filter (from the frames up to each)
    #[arg(long, value_name = "PASS")]
    pass: Option<Pass>,
    /// Particles of particle (512 when not given), guided (96) and paper (5000)
    #[arg(long, value_parser = clap::value_parser!(u32).range(16..=65536), value_name = "N")]
    particles: Option<u32>,
    /// What weighs the particles of paper: distance (cue 1), projection (cue 2), both, or rgb (two cameras at the sides)
    /// [default: both]
    #[arg(long, value_name = "CUES")]
    cues: Option<LegCues>,
    /// Seed of the random streams
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// Noise of the sensor: adaptive (estimated from the recording itself), nite-table1, kinect-v1, kinect-v2, or the file
    /// of a model that `surefoot train` wrote; the method's own choice when absent
    #[arg(long, value_name = "NAME|FILE")]
    noise_model: Option<NoiseModelChoice>,
    /// Write all series as CSV: time_s, then value, low, high and flags of each channel
    #[arg(long, value_name = "FILE")]
    csv: Option<PathBuf>,
    /// Of depth images: write each frame's ankles, knees and hips (camera's axes, metres), step length and width as CSV
    #[arg(long, value_name = "FILE")]
    frames: Option<PathBuf>,
    /// Of depth images: draw the legs over them, as a picture that moves (legs.png, APNG) in this folder
    #[arg(long, value_name = "DIR")]
    overlay: Option<PathBuf>,
    /// Draw these frames only, from A to before B, and each of them also as a picture of its own
    #[arg(long, value_name = "A..B", requires = "overlay")]
    frames_range: Option<FrameRange>,
    /// Print summary, steps, performance, quality and provenance as JSON
    #[arg(long)]
    json: bool,
}

/// Runs the command.
///
/// # Errors
/// When the file is not a recording, or has no assessment; the sentence says where and what to do.
pub fn run(args: &Args) -> anyhow::Result<()> {
    if let None | Some(AnyMethod::LegPose(_)) = args.method
        && let Some((assessment, track)) = assess_legs::assess(&args.recording, || leg_settings(args))?
    {
        if let Some(folder) = &args.overlay {
            overlay::write(&args.recording, &track, folder, args.frames_range.as_ref())
                .with_context(|| format!("cannot draw into {}", folder.display()))?;
        }
        return write(args, &assessment);
    }
    let of_depth = [
        (args.frames.is_some(), "--frames"),
        (args.overlay.is_some(), "--overlay"),
        (args.cues.is_some(), "--cues"),
        (matches!(args.method, Some(AnyMethod::LegPose(_))), "this method"),
    ];
    if let Some((_, what)) = of_depth.iter().find(|(is_asked, _)| *is_asked) {
        bail!("{what} is of depth images, and {} has none", args.recording.display());
    }
    let bytes = fs::read(&args.recording).with_context(|| format!("cannot read {}", args.recording.display()))?;
    let recording = recording_of(&bytes).with_context(|| args.recording.display().to_string())?;
    let settings = settings(args, &recording)?;
    let inputs =
        Inputs { noise_model: args.noise_model.as_ref().and_then(NoiseModelChoice::model), ..Inputs::default() };
    let mut assessment = assess_with_progress(&recording, &settings, &inputs)?;
    assessment.provenance.recording_sha256 = hex::encode(Sha256::digest(&bytes));
    assessment.performance = Some(protocol::perform(recording.header.protocol.as_deref(), &assessment));
    write(args, &assessment)
}

/// Writes and prints what was asked for.
fn write(args: &Args, assessment: &Assessment) -> anyhow::Result<()> {
    if let Some(path) = &args.frames {
        assess_legs::write_frames(assessment, path).with_context(|| format!("cannot write {}", path.display()))?;
    }
    if let Some(path) = &args.csv {
        write_csv(assessment, path).with_context(|| format!("cannot write {}", path.display()))?;
    }
    let mut out = std::io::stdout().lock();
    if args.json {
        let document = serde_json::json!({
            "summary": assessment.summary,
            "gait": assessment.gait,
            "performance": assessment.performance,
            "quality": assessment.quality,
            "provenance": assessment.provenance,
        });
        writeln!(out, "{}", serde_json::to_string_pretty(&document)?)?;
    } else {
        print_summary(assessment, &mut out)?;
        assess_legs::print_steps(assessment, &mut out)?;
        print_performance(assessment, &mut out)?;
    }
    Ok(())
}

/// The settings of the leg-pose pipeline that the arguments ask for.
fn leg_settings(args: &Args) -> anyhow::Result<LegPoseSettings> {
    let mode = match args.method {
        Some(AnyMethod::LegPose(mode)) => mode,
        _ => LegPoseMode::default(),
    };
    if mode != LegPoseMode::Paper && (args.cues.is_some() || args.particles.is_some()) {
        bail!("--cues and --particles are of --method paper; add it, or leave them out");
    }
    let default = LegPoseSettings::default();
    let particles = args.particles.unwrap_or(default.particles);
    if !(64..=65_536).contains(&particles) {
        bail!("--particles is {particles}, but for depth images must lie between 64 and 65536");
    }
    Ok(LegPoseSettings { mode, cues: args.cues.unwrap_or_default(), particles, seed: args.seed, ..default })
}

/// The settings that the arguments ask for; what they leave open depends on the recording.
fn settings(args: &Args, recording: &Recording) -> anyhow::Result<Settings> {
    let units = recording.inertial.iter().flat_map(|inertial| &inertial.sensors).map(|sensor| sensor.segment);
    let method = args.method.unwrap_or(match Settings::suited_to(units) {
        Settings::SkeletonFusion(settings) => AnyMethod::Fusion(settings.method),
        _ => AnyMethod::JointAngles(Method::Iekf),
    });
    let of_angles = args.pass.is_some() || args.particles.is_some() || args.noise_model.is_some();
    let of_fusion = args.orientation.is_some() || args.gain.is_some() || args.rate.is_some();
    match method {
        AnyMethod::JointAngles(_) if of_fusion => {
            bail!("--orientation, --gain and --rate are of fusion; add --method fused, or leave them out")
        }
        AnyMethod::Fusion(_) if of_angles => {
            bail!("--pass, --particles and --noise-model are of skeletons alone; add --method iekf, or leave them out")
        }
        AnyMethod::LegPose(_) => Ok(Settings::LegPose(leg_settings(args)?)),
        AnyMethod::JointAngles(method) => Ok(Settings::JointAngles(JointAngleSettings {
            method,
            pass: args.pass,
            particles: args.particles,
            seed: args.seed,
            noise_model: args.noise_model.as_ref().map(NoiseModelChoice::name),
            ..JointAngleSettings::default()
        })),
        AnyMethod::Fusion(method) => {
            let settings = SkeletonFusionSettings {
                method,
                orientation: args.orientation,
                gain: in_range("--gain", args.gain, 0.0..=10.0)?,
                rate_hz: in_range("--rate", args.rate, 1.0..=1000.0)?,
                ..SkeletonFusionSettings::default()
            };
            match settings.unused() {
                Some((name, reason)) => bail!("{name} {reason}"),
                None => Ok(Settings::SkeletonFusion(settings)),
            }
        }
    }
}

fn in_range(name: &str, value: Option<f64>, range: RangeInclusive<f64>) -> anyhow::Result<Option<f64>> {
    if let Some(outside) = value.filter(|value| !range.contains(value)) {
        bail!("{name} is {outside}, but must lie between {} and {}", range.start(), range.end());
    }
    Ok(value)
}

/// The recording that a file holds, whatever its format.
///
/// # Errors
/// Code, place and sentence of the first defect.
pub(super) fn recording_of(bytes: &[u8]) -> anyhow::Result<Recording> {
    let format = Format::sniff(bytes).ok_or_else(|| anyhow!("neither an MCAP file nor a JSON document"))?;
    decode(bytes, format, &Limits::default()).map_err(|error| match &error.place {
        Some(place) => anyhow!("{} at {place}: {error}", error.code),
        None => anyhow!("{}: {error}", error.code),
    })
}

/// Runs the pipeline on a thread of its own while this one shows how far it is.
fn assess_with_progress(recording: &Recording, settings: &Settings, inputs: &Inputs) -> anyhow::Result<Assessment> {
    let monitor = Monitor::default();
    let bar = if std::io::stderr().is_terminal() { ProgressBar::new(0) } else { ProgressBar::hidden() };
    bar.set_style(ProgressStyle::with_template("{msg:12} {bar:40} {pos}/{len}")?);
    std::thread::scope(|scope| {
        let viewer = monitor.clone();
        let work = scope.spawn(|| pipeline::assess_with(recording, settings, inputs, &monitor));
        while !work.is_finished() {
            let progress = viewer.progress();
            bar.set_length(progress.total);
            bar.set_position(progress.done);
            bar.set_message(step_name(progress.step));
            std::thread::sleep(Duration::from_millis(20));
        }
        bar.finish_and_clear();
        let result = work.join().map_err(|_| anyhow!("the pipeline panicked; please report this recording"))?;
        result.map_err(|error| anyhow!("{error}"))
    })
}

fn step_name(step: Step) -> String {
    format!("{step:?}").to_lowercase()
}

fn print_summary(assessment: &Assessment, out: &mut dyn Write) -> anyhow::Result<()> {
    let quality = &assessment.quality;
    writeln!(
        out,
        "{} frames, {:.1} s, all joints seen in {:.0} % of them; method {}",
        quality.n_frames,
        quality.duration_s,
        100.0 * quality.coverage,
        assessment.provenance.method
    )?;
    for warning in &quality.warnings {
        writeln!(out, "note ({}): {}", warning.code, warning.message)?;
    }
    for count in quality.event_counts.iter().filter(|count| count.n_events > 0) {
        writeln!(
            out,
            "event {}: {} times, {} frames (--json has the times)",
            count.kind, count.n_events, count.n_frames
        )?;
    }
    writeln!(out, "\n{:<34}{:>9}{:>9}{:>9}{:>9}{:>12}", "channel", "min", "max", "mean", "covered", "95 % width")?;
    for line in &assessment.summary {
        // Degrees to the tenth, metres to the millimetre.
        let decimals = if line.channel.ends_with("_m") { 3 } else { 1 };
        let number = |value: Option<f64>| value.map_or_else(|| "-".to_owned(), |v| format!("{v:.decimals$}"));
        writeln!(
            out,
            "{:<34}{:>9}{:>9}{:>9}{:>8.0}%{:>12}",
            line.channel,
            number(line.min),
            number(line.max),
            number(line.mean),
            100.0 * line.coverage,
            number(line.interval_width)
        )?;
    }
    Ok(())
}

fn write_csv(assessment: &Assessment, path: &Path) -> anyhow::Result<()> {
    let mut file = BufWriter::new(fs::File::create(path)?);
    let samples = Samples { time_ns: assessment.time_ns.clone(), series: assessment.series.clone() };
    for piece in csv(samples).pieces() {
        file.write_all(piece.as_bytes())?;
    }
    file.flush()?;
    Ok(())
}

fn print_performance(assessment: &Assessment, out: &mut dyn Write) -> anyhow::Result<()> {
    let Some(performance) = &assessment.performance else { return Ok(()) };
    let protocol = performance.protocol.as_deref().unwrap_or("no protocol named");
    let status = serde_json::to_value(performance.status)?;
    writeln!(out, "\n{protocol}: {} {}", status.as_str().unwrap_or_default(), performance.reason)?;
    if !performance.repetitions.is_empty() {
        let complete = performance.repetitions.iter().filter(|repetition| repetition.is_complete).count();
        writeln!(out, "  {complete} repetitions")?;
    }
    for measure in performance.measures.iter().filter(|measure| measure.value.is_some()) {
        let side = measure.side.map_or("", |side| side.name());
        let error = measure.standard_error.map_or_else(String::new, |se| format!(" ± {:.2}", 1.96 * se));
        writeln!(out, "  {:<40} {side:<6}{:>10.3}{error}", measure.name, measure.value.unwrap_or_default())?;
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_file_that_is_no_recording_is_refused_with_the_reason() {
        assert!(recording_of(b"hello").unwrap_err().to_string().contains("neither"));
        let error = recording_of(br#"{"format": "surefoot", "version": 9}"#).unwrap_err().to_string();
        assert!(error.contains(": "), "{error}");
    }
}
