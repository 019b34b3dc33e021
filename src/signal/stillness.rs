//! Where a set of points rests.

use nalgebra::Vector3;
use std::ops::Range;

/// A stretch of frames, and how fast the points drifted in it.
#[derive(Debug, Clone, PartialEq)]
pub struct StillWindow {
    /// Frames of the window.
    pub frames: Range<usize>,
    /// Mean drift of the points, m/s.
    pub drift: f64,
}

/// The window of at least `min_seconds` in the first `search_seconds` in which the points drift least.
///
/// The drift of a point is the distance between its mean over the first and over the second half of the window,
/// divided by the time between the halves: sensor noise averages out, so a noisy sensor does not hide a resting
/// subject. Missing points (NaN) do not count; a window in which a point is never seen in one half judges by the
/// others. `None` when no window is long enough or nothing was seen.
pub fn stillest_window<const N: usize>(
    time_ns: &[i64],
    points: &[[Vector3<f64>; N]],
    min_seconds: f64,
    search_seconds: f64,
) -> Option<StillWindow> {
    let first = *time_ns.first()?;
    let seconds = |t: usize| (time_ns[t] - first) as f64 * 1e-9;
    let mut best: Option<StillWindow> = None;
    let mut end = 0;
    for start in 0..time_ns.len() {
        while end < time_ns.len() && seconds(end) - seconds(start) < min_seconds {
            end += 1;
        }
        if end == time_ns.len() || seconds(end) > search_seconds {
            break;
        }
        let frames = start..end + 1;
        if let Some(drift) = drift(&points[frames.clone()], seconds(end) - seconds(start))
            && best.as_ref().is_none_or(|b| drift < b.drift)
        {
            best = Some(StillWindow { frames, drift });
        }
    }
    best
}

/// Mean drift of the points over a window of a given length in seconds, m/s.
fn drift<const N: usize>(points: &[[Vector3<f64>; N]], seconds: f64) -> Option<f64> {
    let (early, late) = points.split_at(points.len() / 2);
    let mut total = 0.0;
    let mut count = 0;
    for p in 0..N {
        if let (Some(a), Some(b)) = (mean_of_point(early, p), mean_of_point(late, p)) {
            total += (b - a).norm() / (seconds / 2.0);
            count += 1;
        }
    }
    (count > 0).then(|| total / f64::from(count))
}

fn mean_of_point<const N: usize>(points: &[[Vector3<f64>; N]], p: usize) -> Option<Vector3<f64>> {
    let mut sum = Vector3::zeros();
    let mut count = 0;
    for frame in points.iter().filter(|frame| frame[p].x.is_finite()) {
        sum += frame[p];
        count += 1;
    }
    (count > 0).then(|| sum / f64::from(count))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn times(n: i64) -> Vec<i64> {
        (0..n).map(|i| i * 33_333_333).collect()
    }

    #[test]
    fn the_rest_between_two_movements_is_found_although_the_sensor_trembles() {
        let tremble = |i: usize| if i.is_multiple_of(2) { 0.01 } else { -0.01 };
        let place = |i: usize| match i {
            0..30 => i as f64 * 0.02,
            30..75 => 0.6,
            _ => 0.6 + (i - 75) as f64 * 0.02,
        };
        let points: Vec<_> = (0..120).map(|i| [Vector3::new(place(i) + tremble(i), 0.0, 0.0)]).collect();
        let window = stillest_window(&times(120), &points, 1.0, 5.0).expect("a window");
        assert!(window.frames.start >= 29 && window.frames.end <= 77, "{window:?}");
        assert!(window.drift < 0.005, "{window:?}");
    }

    #[test]
    fn a_recording_shorter_than_the_window_has_none() {
        let points = vec![[Vector3::zeros()]; 20];
        assert_eq!(stillest_window(&times(20), &points, 1.0, 5.0), None);
    }

    #[test]
    fn points_that_were_never_seen_give_no_window() {
        let points = vec![[Vector3::repeat(f64::NAN)]; 60];
        assert_eq!(stillest_window(&times(60), &points, 1.0, 5.0), None);
    }
}
