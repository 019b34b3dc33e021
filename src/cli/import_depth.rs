//! `surefoot import depth`: a raw stream of depth images becomes a recording.

use crate::recording::depth::DepthUnit;
use crate::recording::import::{CameraFile, import_depth};
use anyhow::Context;
use std::fs::File;
use std::io::{BufWriter, Read, Write};
use std::path::{Path, PathBuf};

/// Imports that have arguments of their own.
#[derive(Debug, clap::Subcommand)]
pub(super) enum Kind {
    Depth(Args),
}

/// Make a depth recording of a raw stream of images
///
/// The stream is little-endian u16, image after image, row by row, as it is or compressed by xz or zstd (told by its
/// first bytes). The camera is described by a JSON file: `fx`, `fy`, `cx`, `cy` in pixels, and where they differ from the
/// defaults or are known `width` (640), `height` (480), `unit` (`raw11` or `millimetres`), `rate_hz`, `camera_height_m`,
/// `camera_tilt_deg`, `device_model`. Memory does not grow with the stream.
#[derive(Debug, clap::Args)]
#[command(after_help = "Example: surefoot import depth frames.u16le.xz --calibration cam.json --unit raw11 --rate 30 \
    --background floor.u16le --out walk.mcap")]
pub struct Args {
    /// The stream of images
    stream: PathBuf,
    /// JSON file that describes the camera
    #[arg(long, value_name = "FILE")]
    calibration: PathBuf,
    /// Stream whose first image shows the scene without the person
    #[arg(long, value_name = "FILE")]
    background: Option<PathBuf>,
    /// What the values are, if the camera's file does not say it
    #[arg(long, value_enum)]
    unit: Option<Unit>,
    /// Images per second, if the camera's file does not say it
    #[arg(long)]
    rate: Option<f64>,
    /// File to write, .mcap
    #[arg(long, value_name = "FILE")]
    out: PathBuf,
}

#[derive(Debug, Clone, Copy, clap::ValueEnum)]
enum Unit {
    /// 11-bit codes of a Kinect v1, 2047 = missing
    Raw11,
    /// Millimetres, 0 = missing
    Millimetres,
}

/// Runs the command.
///
/// # Errors
/// When a file cannot be read or written, or the stream does not fit the camera.
pub fn run(args: &Args) -> anyhow::Result<()> {
    let open = |path: &Path| File::open(path).with_context(|| format!("cannot open {}", path.display()));
    let mut camera: CameraFile = serde_json::from_reader(open(&args.calibration)?)
        .with_context(|| format!("{} does not describe a camera", args.calibration.display()))?;
    camera.rate_hz = args.rate.or(camera.rate_hz);
    camera.unit = args.unit.map_or(camera.unit, |unit| {
        Some(match unit {
            Unit::Raw11 => DepthUnit::Raw11,
            Unit::Millimetres => DepthUnit::Millimetres,
        })
    });
    let background = args.background.as_deref().map(open).transpose()?;
    let background = background.map(|file| Box::new(file) as Box<dyn Read>);
    let stream = open(&args.stream)?;
    let out = File::create(&args.out).with_context(|| format!("cannot write {}", args.out.display()))?;
    let n = import_depth(stream, background, &camera, BufWriter::new(out))
        .with_context(|| format!("cannot import {}", args.stream.display()))?;
    writeln!(std::io::stdout(), "{}: {n} images of {} × {}", args.out.display(), camera.width, camera.height)?;
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::recording::Limits;
    use crate::recording::depth::DepthReader;
    use clap::Parser;

    #[derive(Debug, Parser)]
    struct Command {
        #[command(flatten)]
        args: Args,
    }

    #[test]
    fn a_stream_and_a_camera_become_a_recording() {
        let folder = tempfile::tempdir().unwrap();
        let path = |name: &str| folder.path().join(name).to_str().unwrap().to_owned();
        std::fs::write(path("cam.json"), r#"{"fx": 580, "fy": 580, "cx": 2, "cy": 2, "width": 4, "height": 4}"#)
            .unwrap();
        std::fs::write(path("frames.u16le"), [[0x10, 0x04]; 3 * 16].concat()).unwrap();
        let (stream, camera, out) = (path("frames.u16le"), path("cam.json"), path("walk.mcap"));
        let words = ["depth", &stream, "--calibration", &camera, "--out", &out, "--rate", "30"];
        let refusal = run(&Command::try_parse_from(words).unwrap().args).unwrap_err();
        assert!(format!("{refusal:#}").contains("does not say the `unit`"));
        run(&Command::try_parse_from([&words[..], &["--unit", "raw11"]].concat()).unwrap().args).unwrap();
        let reader = DepthReader::open(File::open(&out).unwrap(), &Limits::default()).unwrap();
        assert_eq!(reader.map(|image| image.unwrap().1.values[0]).collect::<Vec<_>>(), [0x410; 3]);
    }
}
