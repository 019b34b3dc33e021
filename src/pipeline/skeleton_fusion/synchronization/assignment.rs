//! Units whose names were exchanged.

use super::motion::{CameraGrid, Motion, smoothing_s};
use super::search::Coarse;
use super::{NEAR_S, Synchronization, declared_lag_s};
use crate::recording::{InertialSensor, Segment, SkeletonRecording};

/// Nats by which the exchange must explain the two units better than their names do: the movement of a few windows.
const MIN_GAIN: f64 = 20.0;

/// Factor by which it must do so.
const CLEARLY_BETTER: f64 = 1.5;

/// What an alignment by jumps leaves open when two units are compared, seconds.
const ALIGNED_S: f64 = 0.1;

/// Two units that move as if each were on the other's segment.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct AssignmentDoubt {
    /// The declared segments.
    pub segments: [Segment; 2],
    /// Correlation of each unit's angular rate with that of its declared segment's bone, 0 to 1; in windows of ten
    /// seconds, combined.
    pub as_declared: [f64; 2],
    /// Correlation of each unit's angular rate with that of the other's bone.
    pub exchanged: [f64; 2],
}

/// The pairs of units whose exchange explains the movement clearly better than their names do, most certain first; a
/// unit is in at most one.
pub fn assignment_doubts(
    skeleton: &SkeletonRecording,
    units: &[InertialSensor],
    synchronization: &Synchronization,
) -> Vec<AssignmentDoubt> {
    let smoothing_s = smoothing_s(&skeleton.time_ns);
    let Ok(camera) = CameraGrid::new(skeleton, smoothing_s) else { return Vec::new() };
    let rate = |motion: Motion| (Coarse::new(&motion).without_force(), motion);
    let bones: Vec<_> = units.iter().map(|unit| camera.motion(skeleton, unit.segment).map(rate)).collect();
    let felt: Vec<_> = units.iter().map(|unit| Motion::of_unit(unit, smoothing_s).ok().map(rate)).collect();
    // Every unit against every bone, each at its best lag: a wrong name may have led the alignment astray.
    let explained = |unit: usize, bone: usize| {
        let ((seen, camera), (coarse, motion)) = bones[bone].as_ref().zip(felt[unit].as_ref())?;
        let aligned = synchronization.units.get(unit)?.alignment.as_ref().ok().filter(|alignment| alignment.has_jumps);
        let (lag_s, reach_s) = match aligned {
            Some(alignment) => {
                let start_ns = motion.grid.start_ns;
                ((alignment.clock.camera_ns(start_ns) - camera.grid.start_ns) as f64 * 1e-9, ALIGNED_S)
            }
            None => (declared_lag_s(camera, motion, units[unit].clock_offset_ns), NEAR_S),
        };
        Some(seen.best_score(coarse, lag_s - reach_s..lag_s + reach_s))
    };
    let table: Vec<Vec<_>> = (0..units.len()).map(|u| (0..units.len()).map(|b| explained(u, b)).collect()).collect();
    let mut doubts: Vec<(f64, [usize; 2], AssignmentDoubt)> = Vec::new();
    for i in 0..units.len() {
        for j in i + 1..units.len() {
            let (Some(ii), Some(jj), Some(ij), Some(ji)) = (table[i][i], table[j][j], table[i][j], table[j][i]) else {
                continue;
            };
            let (declared, exchanged) = (ii.0 + jj.0, ij.0 + ji.0);
            // Each of the two must gain, or one of them is merely badly seen.
            let both_gain = ij.0 > ii.0 && ji.0 > jj.0;
            if both_gain && exchanged > CLEARLY_BETTER * declared && exchanged - declared > MIN_GAIN {
                let doubt = AssignmentDoubt {
                    segments: [units[i].segment, units[j].segment],
                    as_declared: [ii.1, jj.1],
                    exchanged: [ij.1, ji.1],
                };
                doubts.push((exchanged - declared, [i, j], doubt));
            }
        }
    }
    doubts.sort_by(|a, b| b.0.total_cmp(&a.0));
    let mut is_named = vec![false; units.len()];
    doubts.retain(|(_, pair, _)| {
        let is_new = pair.iter().all(|&unit| !is_named[unit]);
        pair.iter().for_each(|&unit| is_named[unit] |= is_new);
        is_new
    });
    doubts.into_iter().map(|(_, _, doubt)| doubt).collect()
}
