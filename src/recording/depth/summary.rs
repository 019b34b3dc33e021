//! What is known of a series of depth images that was read once, and what is doubtful about it.

use super::{DepthImage, DepthUnit};
use crate::recording::side_camera::SideCameraSummary;
use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

/// An image sees nothing when at least this share of it is missing.
const EMPTY_SHARE: f64 = 0.999;

/// Most of the images' pixels are missing beyond this share: a person and a floor fill about two thirds of an image.
const MOSTLY_MISSING: f64 = 0.8;

/// Neighbouring pixels whose depths differ by this share are a jump.
const JUMP_SHARE: f32 = 0.1;

/// Images with more jumps than this among neighbouring pixels are no surfaces: real and simulated images of a walker's
/// user have below 0.05, random numbers above 0.6.
const NOISE_SHARE: f64 = 0.25;

/// Every how many rows jumps are looked for.
const ROW_STEP: usize = 8;

/// A gap is longer than this many mean intervals.
const GAP: f64 = 2.5;

/// What a series of depth images raises doubts about.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
#[serde(rename_all = "snake_case")]
pub enum DepthWarningKind {
    /// There are no intrinsics.
    NoCalibration,
    /// There is no image of the floor without the person.
    NoBackground,
    /// Images in which nothing is seen.
    EmptyImages,
    /// Most pixels of the images are missing.
    MostlyMissing,
    /// Depths jump from pixel to pixel everywhere.
    Noise,
    /// An interval between images that is much longer than the others.
    DropOut,
    /// Colour images of cameras at the sides that cannot be used.
    SideCameras,
}

/// A doubt about the depth images; they are accepted all the same.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
pub struct DepthWarning {
    /// What it is.
    pub kind: DepthWarningKind,
    /// What was found, in one sentence.
    pub sentence: String,
}

/// What is known of a series of depth images.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct DepthSummary {
    /// Images.
    pub n_frames: u64,
    /// Pixels in a row.
    pub width: u32,
    /// Rows.
    pub height: u32,
    /// What the values are.
    pub unit: DepthUnit,
    /// Time of the first image, seconds.
    pub start_s: f64,
    /// Time between the first and the last image, seconds.
    pub duration_s: f64,
    /// Images per second on average.
    pub rate_hz: f64,
    /// Longest time between two images, seconds.
    pub longest_gap_s: f64,
    /// Share of the pixels without depth, 0 to 1.
    pub missing_share: f64,
    /// Images in which nothing is seen.
    pub n_empty_frames: u64,
    /// Whether there are intrinsics.
    pub has_calibration: bool,
    /// Whether there is an image without the person.
    pub has_background: bool,
    /// The colour images of cameras at the sides, when there are any.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub side_cameras: Option<SideCameraSummary>,
    /// Doubts about the images.
    pub warnings: Vec<DepthWarning>,
}

/// Sums over the images so far.
#[derive(Debug, Clone, Default)]
pub(crate) struct DepthStatistics {
    missing_shares: f64,
    n_empty: u64,
    n_neighbours: u64,
    n_jumps: u64,
    longest_gap_ns: i64,
    last_ns: Option<i64>,
}

impl DepthStatistics {
    /// Takes one image.
    pub(crate) fn add(&mut self, time_ns: i64, image: &DepthImage) {
        let missing = image.missing_share();
        self.missing_shares += missing;
        self.n_empty += u64::from(missing >= EMPTY_SHARE);
        for row in image.values.chunks(image.width).step_by(ROW_STEP) {
            for pair in row.windows(2) {
                let [a, b] = [image.unit.depth_m(pair[0]), image.unit.depth_m(pair[1])];
                if a > 0.0 && b > 0.0 {
                    self.n_neighbours += 1;
                    self.n_jumps += u64::from((a - b).abs() > JUMP_SHARE * a.min(b));
                }
            }
        }
        if let Some(last) = self.last_ns {
            self.longest_gap_ns = self.longest_gap_ns.max(time_ns.saturating_sub(last));
        }
        self.last_ns = Some(time_ns);
    }

    /// The summary of `n_frames` images of the kind of `image`, at least two.
    pub(crate) fn summary(
        &self,
        n_frames: u64,
        [first_ns, last_ns]: [i64; 2],
        image: &DepthImage,
        has_calibration: bool,
        has_background: bool,
    ) -> DepthSummary {
        let duration_s = last_ns.saturating_sub(first_ns) as f64 * 1e-9;
        let mut summary = DepthSummary {
            n_frames,
            width: image.width as u32,
            height: image.height as u32,
            unit: image.unit,
            start_s: first_ns as f64 * 1e-9,
            duration_s,
            rate_hz: (n_frames.saturating_sub(1)) as f64 / duration_s,
            longest_gap_s: self.longest_gap_ns as f64 * 1e-9,
            missing_share: self.missing_shares / n_frames as f64,
            n_empty_frames: self.n_empty,
            has_calibration,
            has_background,
            side_cameras: None,
            warnings: Vec::new(),
        };
        summary.warnings = self.warnings(&summary);
        summary
    }

    fn warnings(&self, summary: &DepthSummary) -> Vec<DepthWarning> {
        let DepthSummary { n_frames, n_empty_frames, missing_share, .. } = summary;
        let jumps = self.n_jumps as f64 / self.n_neighbours.max(1) as f64;
        let gap = summary.longest_gap_s;
        let found = [
            (
                !summary.has_calibration,
                DepthWarningKind::NoCalibration,
                "there is no `/depth/calibration`; without intrinsics nothing can be measured".to_owned(),
            ),
            (
                !summary.has_background,
                DepthWarningKind::NoBackground,
                "there is no `/depth/background`; the floor must be told from the person by its shape alone".to_owned(),
            ),
            (
                *n_empty_frames > 0,
                DepthWarningKind::EmptyImages,
                format!("{n_empty_frames} of {n_frames} images see nothing; was the camera covered?"),
            ),
            (
                *missing_share > MOSTLY_MISSING,
                DepthWarningKind::MostlyMissing,
                format!("{:.0} % of all pixels have no depth", 100.0 * missing_share),
            ),
            (
                jumps > NOISE_SHARE,
                DepthWarningKind::Noise,
                format!(
                    "{:.0} % of neighbouring pixels differ by more than a tenth of their depth: these are no surfaces; \
                     check the unit and the byte order",
                    100.0 * jumps
                ),
            ),
            (
                gap * summary.rate_hz > GAP,
                DepthWarningKind::DropOut,
                format!("no image came for {gap:.2} s, at {:.1} images a second on average", summary.rate_hz),
            ),
        ];
        found.into_iter().filter(|(is, ..)| *is).map(|(_, kind, sentence)| DepthWarning { kind, sentence }).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn kinds(images: &[(i64, DepthImage)]) -> Vec<DepthWarningKind> {
        let mut statistics = DepthStatistics::default();
        for (time, image) in images {
            statistics.add(*time, image);
        }
        let span = [images[0].0, images[images.len() - 1].0];
        let summary = statistics.summary(images.len() as u64, span, &images[0].1, true, true);
        summary.warnings.iter().map(|warning| warning.kind).collect()
    }

    fn image(value: impl Fn(usize) -> u16) -> DepthImage {
        DepthImage { width: 64, height: 48, unit: DepthUnit::Millimetres, values: (0..64 * 48).map(value).collect() }
    }

    fn at_rate(image: &DepthImage, n: i64) -> Vec<(i64, DepthImage)> {
        (0..n).map(|k| (k * 33_000_000, image.clone())).collect()
    }

    #[test]
    fn a_surface_raises_no_doubt() {
        assert_eq!(kinds(&at_rate(&image(|k| 900 + (k % 64) as u16), 10)), []);
    }

    #[test]
    fn covered_cameras_garbage_and_gaps_are_told() {
        let empty = image(|_| 0);
        assert_eq!(kinds(&at_rate(&empty, 3)), [DepthWarningKind::EmptyImages, DepthWarningKind::MostlyMissing]);
        let garbage = image(|k| (k as u32).wrapping_mul(2_654_435_761).to_le_bytes()[2].into());
        assert_eq!(kinds(&at_rate(&garbage, 3)), [DepthWarningKind::Noise]);
        let mut late = at_rate(&image(|_| 900), 10);
        late[9].0 += 300_000_000;
        assert_eq!(kinds(&late), [DepthWarningKind::DropOut]);
    }
}
