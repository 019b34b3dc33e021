//! `lost_user`: nobody to be seen, whether the sensor says so or sends nothing.

use super::frame_gap::between;
use super::{Finding, Scene, stretches};

/// Most points that may be seen of a user who counts as lost: two points fix no posture.
const MAX_POINTS: usize = 2;
/// Shortest time without frames after which the user counts as lost, seconds, and in median intervals. Sensors that
/// send skeletons send nothing while they see nobody.
const ABSENT_S: f64 = 1.0;
const ABSENT_INTERVALS: f64 = 10.0;

/// True of a gap so long that the tracker must have lost its user.
pub(super) fn is_absence(gap_s: f64, median_s: f64) -> bool {
    gap_s >= ABSENT_S && gap_s > ABSENT_INTERVALS * median_s
}

/// Frames with hardly a point, and long times without frames.
pub(super) fn find(scene: &mut Scene) -> Vec<Finding> {
    let mut found: Vec<Finding> = stretches(scene.len(), |t| is_lost(scene, t))
        .into_iter()
        .map(|frames| Finding::of_frames("user", frames))
        .collect();
    let median = scene.median_interval_s();
    let absent = |t: &usize| is_absence(scene.observations.interval_s(*t), median);
    let gaps = (1..scene.len()).filter(absent);
    found.extend(gaps.map(|t| between("user", t, scene.observations.interval_s(t), median)));
    found
}

/// True when a frame shows hardly a point.
pub(super) fn is_lost(scene: &Scene, t: usize) -> bool {
    scene.points_given(t) <= MAX_POINTS
}
