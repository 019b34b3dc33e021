//! `surefoot assess` on depth images: legs and steps, with memory that does not grow with the recording.

use crate::assessment::{Assessment, LegPoseSettings};
use crate::pipeline::leg_pose::{self, Track};
use crate::progress::Monitor;
use crate::protocol;
use crate::recording::decode::{DepthReader, Limits};
use anyhow::{Context, anyhow};
use sha2::{Digest, Sha256};
use std::fs::File;
use std::io::{BufReader, Read, Write};
use std::path::Path;

/// Bytes of the file that are read at a time.
const PIECE: usize = 64 * 1024;

/// The assessment of a recording that has depth images, with its track; none of one that has not. Settings are asked for
/// when there are such images.
///
/// # Errors
/// Code, place and sentence of the first defect, or why there is no assessment.
pub(super) fn assess(
    path: &Path,
    settings: impl FnOnce() -> anyhow::Result<LegPoseSettings>,
) -> anyhow::Result<Option<(Assessment, Track)>> {
    let open = || File::open(path).with_context(|| format!("cannot read {}", path.display()));
    let Ok(reader) = DepthReader::open(BufReader::new(open()?), &Limits::default()) else { return Ok(None) };
    let declared = reader.header().protocol.clone();
    let assessed = leg_pose::assess_watched(reader, &settings()?, &mut |_, _| {}, &Monitor::default());
    let (mut assessment, track) = assessed.map_err(|error| anyhow!("{error}"))?;
    assessment.performance = Some(protocol::perform(declared.as_deref(), &assessment));
    let mut digest = Sha256::new();
    let mut file = open()?;
    let mut piece = vec![0; PIECE];
    loop {
        let n = file.read(&mut piece)?;
        if n == 0 {
            break;
        }
        digest.update(&piece[..n]);
    }
    assessment.provenance.recording_sha256 = hex::encode(digest.finalize());
    Ok(Some((assessment, track)))
}

/// Writes the joints and step measures of every frame: metres, empty where there is no estimate.
///
/// # Errors
/// When the file cannot be written.
pub(super) fn write_frames(assessment: &Assessment, path: &Path) -> anyhow::Result<()> {
    let mut writer = csv::Writer::from_path(path)?;
    let names = assessment.series.iter().map(|series| series.channel.as_str());
    writer.write_record(std::iter::once("time_s").chain(names))?;
    for (t, time_ns) in assessment.time_ns.iter().enumerate() {
        let time = (*time_ns as f64 * 1e-9).to_string();
        let values = assessment.series.iter().map(|series| match series.value[t] {
            value if value.is_finite() => value.to_string(),
            _ => String::new(),
        });
        writer.write_record(std::iter::once(time).chain(values))?;
    }
    writer.flush()?;
    Ok(())
}

/// Prints the steps and what was left out.
///
/// # Errors
/// When `out` cannot be written.
pub(super) fn print_steps(assessment: &Assessment, out: &mut dyn Write) -> anyhow::Result<()> {
    let Some(gait) = &assessment.gait else { return Ok(()) };
    writeln!(out, "\n{} steps, {} used", gait.steps.len(), gait.n_steps_used)?;
    for excluded in &gait.excluded {
        writeln!(out, "  left out ({}): {}", excluded.reason, excluded.n_steps)?;
    }
    for summary in &gait.summary {
        writeln!(
            out,
            "  {}: length {:.3} m (SD {:.3}), width {:.3} m (SD {:.3}), {} steps",
            summary.definition,
            summary.length_mean_m,
            summary.length_sd_m,
            summary.width_mean_m,
            summary.width_sd_m,
            summary.n_steps
        )?;
    }
    for step in &gait.steps {
        write!(out, "  {:>7.2} s {:<5}", step.heel_strike_s, step.side.name())?;
        for measure in &step.measures {
            write!(out, "  {:.3} x {:.3} m ({})", measure.length_m, measure.width_m, measure.definition)?;
        }
        writeln!(out, "  {}", step.excluded_because.join(" "))?;
    }
    Ok(())
}
