//! Backward pass over the tracked frames, in blocks, so that memory does not grow with the recording.
//!
//! The tracker keeps what each frame said as information about the pose. A linear Kalman filter runs over that again, and
//! a Rauch–Tung–Striebel pass goes back from a look-ahead beyond the block: what lies farther ahead no longer matters.

use super::leg_model::{POSE, PoseVector};
use super::tracker::{Belief, FrameFit, PoseMatrix, inverse};

/// Frames that are given out together.
const BLOCK: usize = 200;
/// Frames beyond a block that its estimates rest on; velocities forget within half a second.
const LOOK_AHEAD: usize = 40;

/// A frame after the backward pass.
#[derive(Debug, Clone)]
pub struct SmoothedFrame {
    /// What the tracker made of the frame.
    pub fit: FrameFit,
    /// Mode of the pose given all frames, in `floor`, metres.
    pub pose: PoseVector,
    /// Rates of its coordinates, m/s.
    pub velocity: PoseVector,
    /// Standard deviations of its coordinates, metres.
    pub deviation: PoseVector,
}

struct Pending {
    fit: FrameFit,
    predicted: Option<Belief>,
    filtered: Belief,
}

/// The smoother; frames go in in order and come out in order, later.
#[derive(Default)]
pub struct Smoother {
    pending: Vec<Pending>,
}

impl Smoother {
    /// Takes a frame; gives out those that are ready.
    pub fn push(&mut self, fit: FrameFit, out: &mut Vec<SmoothedFrame>) {
        if fit.restarted {
            self.finish(out);
        }
        let predicted =
            self.pending.last().map(|before| before.filtered.predict(seconds_between(before.fit.time_ns, fit.time_ns)));
        let filtered = match &predicted {
            Some(predicted) => {
                let information = inverse(&predicted.pose_covariance());
                let covariance = inverse(&(information + fit.information));
                let pose = covariance * (information * predicted.pose() + fit.information_vector);
                predicted.updated(&pose, &covariance)
            }
            None => (*fit.belief).clone(),
        };
        self.pending.push(Pending { fit, predicted, filtered });
        if self.pending.len() >= BLOCK + LOOK_AHEAD {
            self.give_out(BLOCK, out);
        }
    }

    /// Gives out the rest.
    pub fn finish(&mut self, out: &mut Vec<SmoothedFrame>) {
        self.give_out(self.pending.len(), out);
    }

    fn give_out(&mut self, count: usize, out: &mut Vec<SmoothedFrame>) {
        let Some(last) = self.pending.last() else { return };
        let mut smoothed = vec![last.filtered.clone()];
        for k in (0..self.pending.len() - 1).rev() {
            let here = &self.pending[k];
            let after = &self.pending[k + 1];
            let next = &smoothed[smoothed.len() - 1];
            let belief = match &after.predicted {
                Some(predicted) => {
                    here.filtered.smoothed(predicted, next, seconds_between(here.fit.time_ns, after.fit.time_ns))
                }
                None => here.filtered.clone(),
            };
            smoothed.push(belief);
        }
        for (pending, belief) in self.pending.drain(..count).zip(smoothed.into_iter().rev()) {
            let covariance: PoseMatrix = belief.pose_covariance();
            let deviation = PoseVector::from_fn(|k, _| covariance[(k, k)].max(0.0).sqrt());
            let velocity = belief.mean.fixed_rows::<POSE>(POSE).into_owned();
            out.push(SmoothedFrame { fit: pending.fit, pose: belief.pose(), velocity, deviation });
        }
    }
}

fn seconds_between(before_ns: i64, after_ns: i64) -> f64 {
    (after_ns - before_ns) as f64 * 1e-9
}
