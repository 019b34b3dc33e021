//! `surefoot assess --overlay`: pictures of the tracked legs over the depth images that they were found in.
//!
//! The recording is read a second time beside its track, image by image, so memory does not grow with it.

mod picture;

use crate::pipeline::leg_pose::Track;
use crate::recording::decode::{DepthReader, Limits};
use crate::recording::depth::{DepthImage, DepthUnit};
use anyhow::{Context, anyhow, bail};
use picture::Picture;
use std::fs::{self, File};
use std::io::{BufReader, BufWriter, Write};
use std::ops::Range;
use std::path::Path;
use std::str::FromStr;

/// Name of the animated picture.
const ANIMATION: &str = "legs.png";

/// Pictures a second of the animation, at most: movements stay visible, and the file a third as large.
const ANIMATION_HZ: f64 = 10.0;

/// Pixels of an image along each side that become one of the animation.
const ANIMATION_SHRINK: usize = 2;

/// Frames from one number to before another one, counted from 0.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct FrameRange(pub Range<usize>);

impl FromStr for FrameRange {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let sentence = || format!("`{text}` is no range of frames; write it as A..B, for example 100..130");
        let (from, to) = text.split_once("..").ok_or_else(sentence)?;
        let [from, to] = [from.parse().map_err(|_| sentence())?, to.parse().map_err(|_| sentence())?];
        if from < to { Ok(Self(from..to)) } else { Err(sentence()) }
    }
}

/// Draws a recording with its track into a folder: each frame of the range as `frame_000123.png`, and `legs.png`, a picture
/// that moves (APNG), of the range or, without one, of the whole recording.
///
/// # Errors
/// When the recording cannot be read again, or a file not be written.
pub(super) fn write(recording: &Path, track: &Track, folder: &Path, range: Option<&FrameRange>) -> anyhow::Result<()> {
    let frames = range.map_or(0..track.frames.len(), |range| range.0.clone());
    if frames.end > track.frames.len() {
        bail!("--frames-range ends at {}, but the recording has {} frames", frames.end, track.frames.len());
    }
    fs::create_dir_all(folder)?;
    let file = File::open(recording).with_context(|| format!("cannot read {}", recording.display()))?;
    let mut reader = DepthReader::open(BufReader::new(file), &Limits::default()).map_err(|error| anyhow!("{error}"))?;
    let shown = shown_in_animation(track, &frames);
    let mut animation = None;
    let mut image = DepthImage::missing(0, 0, DepthUnit::Raw11);
    for (k, frame) in track.frames.iter().enumerate().take(frames.end) {
        if reader.next_into(&mut image)?.is_none() {
            bail!("the recording ends before its track does");
        }
        let is_shown = shown.binary_search(&k).is_ok();
        if k < frames.start || !(is_shown || range.is_some()) {
            continue;
        }
        let mut picture = Picture::of_depth(&image.to_depth_map());
        picture.draw_legs(frame, track)?;
        if range.is_some() {
            let path = folder.join(format!("frame_{k:06}.png"));
            picture.write(BufWriter::new(File::create(path)?))?;
        }
        if !is_shown {
            continue;
        }
        let small = picture.shrunk(ANIMATION_SHRINK);
        let writer = match &mut animation {
            Some(writer) => writer,
            none => none.insert(begin_animation(&folder.join(ANIMATION), &small, track, &shown)?),
        };
        writer.write_image_data(&small.rgb)?;
    }
    if let Some(writer) = animation {
        writer.finish()?;
    }
    Ok(())
}

/// The frames that the animation shows: all, or every so many that [`ANIMATION_HZ`] is not exceeded.
fn shown_in_animation(track: &Track, frames: &Range<usize>) -> Vec<usize> {
    let step = (median_interval_s(track).recip() / ANIMATION_HZ).round().max(1.0);
    frames.clone().step_by(step as usize).collect()
}

/// Median time between frames, seconds; a thirtieth when there is none.
fn median_interval_s(track: &Track) -> f64 {
    let mut intervals: Vec<i64> = track.frames.windows(2).map(|pair| pair[1].time_ns - pair[0].time_ns).collect();
    intervals.sort_unstable();
    intervals.get(intervals.len() / 2).map_or(1.0 / 30.0, |ns| (*ns).max(1) as f64 * 1e-9)
}

fn begin_animation(
    path: &Path,
    first: &Picture,
    track: &Track,
    shown: &[usize],
) -> anyhow::Result<png::Writer<impl Write + use<>>> {
    let mut encoder = png::Encoder::new(BufWriter::new(File::create(path)?), first.width as u32, first.height as u32);
    encoder.set_color(png::ColorType::Rgb);
    encoder.set_depth(png::BitDepth::Eight);
    encoder.set_animated(u32::try_from(shown.len())?, 0)?;
    let frames_apart = shown.get(1).map_or(1, |second| second - shown[0]);
    let delay_ms = (median_interval_s(track) * frames_apart as f64 * 1000.0).round().clamp(1.0, 60_000.0);
    encoder.set_frame_delay(delay_ms as u16, 1000)?;
    Ok(encoder.write_header()?)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::assessment::LegPoseSettings;
    use crate::pipeline::leg_pose;
    use crate::progress::Monitor;
    use crate::synthetic::walker::trousers::trousers;
    use crate::synthetic::walker::{Course, WalkerSettings, WalkerSimulation};

    #[test]
    fn a_range_is_two_numbers_in_order() {
        assert_eq!("3..7".parse(), Ok(FrameRange(3..7)));
        for text in ["7..3", "3", "3..", "a..b", "3..3", "-1..2"] {
            assert!(text.parse::<FrameRange>().is_err(), "{text}");
        }
    }

    #[test]
    fn pictures_of_a_range_and_an_animation_of_it_are_written_and_show_legs_where_they_are() {
        let settings =
            WalkerSettings { duration_s: 1.2, rate_hz: 20.0, ..WalkerSettings::of_seed(Course::Straight, 2) };
        let simulation = WalkerSimulation::new(&settings, trousers()).unwrap();
        let folder = tempfile::tempdir().unwrap();
        let recording = folder.path().join("walk.mcap");
        simulation.write(File::create(&recording).unwrap(), |_| {}).unwrap();
        let reader = DepthReader::open(File::open(&recording).unwrap(), &Limits::default()).unwrap();
        let settings = LegPoseSettings::default();
        let track = leg_pose::track(reader, &settings, &mut |_, _| {}, &Monitor::default()).unwrap();

        let pictures = folder.path().join("pictures");
        write(&recording, &track, &pictures, Some(&FrameRange(8..14))).unwrap();
        let single = |k: usize| pictures.join(format!("frame_{k:06}.png"));
        assert!(!single(7).exists() && single(8).exists() && single(13).exists() && !single(14).exists());

        let decode = |path: &Path| png::Decoder::new(BufReader::new(File::open(path).unwrap())).read_info().unwrap();
        let mut drawn = decode(&single(10));
        let mut rgb = vec![0; drawn.output_buffer_size().unwrap()];
        drawn.next_frame(&mut rgb).unwrap();
        let plain = Picture::of_depth(&simulation.frame(10).image.to_depth_map());
        assert_eq!((plain.width, plain.height, plain.rgb.len()), (640, 480, rgb.len()));
        // At both true ankles something is drawn over the depth.
        for leg in &simulation.truth(10).legs {
            let [i, j] = simulation.intrinsics().pixel_of_point(&leg.ankle.coords).unwrap();
            let is_changed = |di: i32, dj: i32| {
                let at = 3 * ((j as i32 + dj) as usize * 640 + (i as i32 + di) as usize);
                rgb[at..at + 3] != plain.rgb[at..at + 3]
            };
            let n_changed =
                (-12..=12).flat_map(|di| (-12..=12).map(move |dj| (di, dj))).filter(|(a, b)| is_changed(*a, *b));
            assert!(n_changed.count() > 20, "at ({i}, {j})");
        }
        // Twenty frames a second: every second one.
        let animation = decode(&pictures.join(ANIMATION));
        assert_eq!(animation.info().animation_control().map(|control| control.num_frames), Some(3));
        assert_eq!(animation.info().size(), (320, 240));
        assert!(write(&recording, &track, &pictures, Some(&FrameRange(8..99))).is_err());
    }
}
