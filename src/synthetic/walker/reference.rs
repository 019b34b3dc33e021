//! A simulated walk as a recording, with its truth on reference channels.

use super::bones::LegPoints;
use super::{StepTruth, WalkerFrame, WalkerSimulation};
use crate::recording::depth::{DepthCalibration, DepthWriter};
use crate::recording::encode::EncodeError;
use crate::recording::{Device, Header, ReferenceSeries};
use crate::synthetic::TRUTH_SOURCE;
use nalgebra::Point3;
use std::io::{Seek, Write};

/// Names of the sides in channels.
const SIDES: [&str; 2] = ["left", "right"];

/// The points of a leg that have channels `<side>_<point>_<axis>_m`, in `sensor`.
type Point = (&'static str, fn(&LegPoints) -> Point3<f64>);
const POINTS: [Point; 5] = [
    ("hip", |leg| leg.hip),
    ("knee", |leg| leg.knee),
    ("ankle", |leg| leg.ankle),
    ("heel", |leg| leg.heel),
    ("toe", |leg| leg.toe),
];

/// What a step's channel holds, one value for each step, at the middle of its double support.
type StepValue = (&'static str, fn(&StepTruth) -> f64);
const STEP_VALUES: [StepValue; 9] = [
    ("step_side", |step| step.side as f64),
    ("step_length_ankle_to_ankle_m", |step| step.ankle_length_m),
    ("step_width_ankle_to_ankle_m", |step| step.ankle_width_m),
    ("step_length_footprint_m", |step| step.footprint_length_m),
    ("step_width_footprint_m", |step| step.footprint_width_m),
    ("step_contact_s", |step| step.contact_s),
    ("step_place_in_bout", |step| step.place_in_bout as f64),
    ("step_steps_to_come", |step| step.steps_to_come as f64),
    ("step_is_turning", |step| f64::from(u8::from(step.is_turning))),
];

impl WalkerSimulation {
    /// Writes the walk as a recording: calibration, background, images, and the truth on reference channels.
    ///
    /// `<side>_<hip, knee, ankle, heel, toe>_<x, y, z>_m` are in `sensor`; `<side>_foot_contact` is 1 while a foot is
    /// down; `step_…` has one value for each step. Frames are made and written a few at a time; `progress` is told the
    /// number of those written.
    ///
    /// # Errors
    /// [`EncodeError`] when `out` fails.
    pub fn write<W: Write + Seek>(&self, out: W, progress: impl FnMut(usize)) -> Result<W, EncodeError> {
        self.write_channels(out, false, progress)
    }

    /// As [`WalkerSimulation::write`], with what the colour cameras at the sides see.
    ///
    /// # Errors
    /// [`EncodeError`] when `out` fails.
    pub fn write_with_sides<W: Write + Seek>(&self, out: W, progress: impl FnMut(usize)) -> Result<W, EncodeError> {
        self.write_channels(out, true, progress)
    }

    fn write_channels<W: Write + Seek>(
        &self,
        out: W,
        has_sides: bool,
        mut progress: impl FnMut(usize),
    ) -> Result<W, EncodeError> {
        let mount = &self.settings().mount;
        let mut calibration = DepthCalibration::of_intrinsics(self.intrinsics());
        calibration.camera_height_m = Some(mount.height_m);
        calibration.camera_tilt_deg = Some(mount.tilt.to_degrees());
        let mut writer = DepthWriter::new(out, &self.header(), &calibration, Some(&self.background()))?;
        if has_sides {
            writer.describe_sides(&self.side_cameras())?;
        }
        let mut truth = TruthSeries::default();
        for (k, frame) in self.frames().enumerate() {
            if has_sides {
                writer.write_sides(frame.truth.time_ns, &self.side_images(k))?;
            }
            writer.write(frame.truth.time_ns, &frame.image)?;
            truth.add(&frame);
            progress(k + 1);
        }
        let mut references = truth.references();
        references.extend(step_references(&self.steps()));
        writer.finish(&references)
    }

    fn header(&self) -> Header {
        Header {
            protocol: Some("walk_with_walker".to_owned()),
            device: Device { model: Some("kinect-v1".into()), middleware: Some("simulated".into()) },
            subject_height_m: Some(self.settings().stature_m),
            ..Header::default()
        }
    }
}

/// The truth of the frames so far.
#[derive(Default)]
struct TruthSeries {
    time_ns: Vec<i64>,
    /// Coordinates of each point of both legs.
    coordinates: [[[Vec<f64>; 3]; POINTS.len()]; 2],
    contacts: [Vec<f64>; 2],
}

impl TruthSeries {
    fn add(&mut self, frame: &WalkerFrame) {
        self.time_ns.push(frame.truth.time_ns);
        for (side, leg) in frame.truth.legs.iter().enumerate() {
            for ((_, point), series) in POINTS.iter().zip(&mut self.coordinates[side]) {
                for (axis, values) in series.iter_mut().enumerate() {
                    values.push(point(leg)[axis]);
                }
            }
            self.contacts[side].push(f64::from(u8::from(frame.truth.contacts[side])));
        }
    }

    fn references(self) -> Vec<ReferenceSeries> {
        let time_ns = self.time_ns;
        let mut references = Vec::new();
        for ((side, points), contacts) in SIDES.iter().zip(self.coordinates).zip(self.contacts) {
            for ((point, _), axes) in POINTS.iter().zip(points) {
                for (axis, values) in ["x", "y", "z"].iter().zip(axes) {
                    references.push(reference(format!("{side}_{point}_{axis}_m"), time_ns.clone(), values));
                }
            }
            references.push(reference(format!("{side}_foot_contact"), time_ns.clone(), contacts));
        }
        references
    }
}

fn step_references(steps: &[StepTruth]) -> Vec<ReferenceSeries> {
    let time_ns: Vec<i64> = steps.iter().map(|step| (step.mid_double_support_s * 1e9).round() as i64).collect();
    let series =
        |(name, value): &StepValue| reference((*name).to_owned(), time_ns.clone(), steps.iter().map(value).collect());
    STEP_VALUES.iter().map(series).collect()
}

fn reference(channel: String, time_ns: Vec<i64>, values: Vec<f64>) -> ReferenceSeries {
    ReferenceSeries { channel, source: TRUTH_SOURCE.to_owned(), clock_offset_ns: 0, time_ns, values }
}

#[cfg(test)]
mod tests {
    use super::super::trousers::trousers;
    use super::super::{Course, WalkerSettings};
    use super::*;
    use crate::recording::depth::DepthReader;
    use crate::recording::{Format, Inspector, Limits};
    use std::io::Cursor;

    #[test]
    fn a_walk_is_written_as_a_sound_recording_with_its_truth_beside_it() {
        let settings = WalkerSettings { duration_s: 3.0, rate_hz: 4.0, ..WalkerSettings::of_seed(Course::Straight, 6) };
        let simulation = WalkerSimulation::new(&settings, trousers()).unwrap();
        let mut told = 0;
        let bytes = simulation.write(Cursor::new(Vec::new()), |k| told = k).unwrap().into_inner();
        assert_eq!(told, 12);
        let mut inspector = Inspector::new(Format::Mcap, &Limits::default());
        inspector.push(&bytes).unwrap();
        let depth = inspector.finish().unwrap().depth.unwrap();
        assert_eq!((depth.n_frames, depth.warnings), (12, vec![]));

        let mut reader = DepthReader::open(&bytes[..], &Limits::default()).unwrap();
        assert_eq!(reader.background(), Some(&simulation.background()));
        assert_eq!(reader.calibration().unwrap().intrinsics(), *simulation.intrinsics());
        let (time, image) = reader.nth(7).unwrap().unwrap();
        assert_eq!((time, image), (1_750_000_000, simulation.frame(7).image));
        let rest = reader.finish().unwrap();
        let values = |channel: &str| &rest.references.iter().find(|r| r.channel == channel).unwrap().values;
        assert_eq!(values("right_ankle_z_m")[7], simulation.truth(7).legs[1].ankle.z);
        let steps = simulation.steps();
        assert_eq!(values("step_length_ankle_to_ankle_m")[0], steps[0].ankle_length_m);
        assert_eq!((rest.references.len(), values("step_side").len()), (2 * 16 + 9, steps.len()));
    }
}
