//! The order of a session with inertial units, as \[fusion\] has it: plank, putting on, T-posture, jumps, movement.
//!
//! The camera runs through all of it. While the units lie on the plank and are put on, it sees the subject stand quietly
//! with hanging arms.

use super::jump::Jump;
use crate::synthetic::exercise::{ARMS_DOWN_S, ActiveTime, END_S, REST_S};
use crate::synthetic::motion::between;
use crate::synthetic::movement::Movement;
use crate::synthetic::posture::{Posture, Stance};
use crate::synthetic::sensor::{Stream, stream};
use crate::synthetic::subject::Subject;
use std::f64::consts::FRAC_PI_2;
use std::ops::Range;

/// Time on the plank, seconds.
pub const PLANK_S: f64 = 3.0;

/// Time in which the units are put on, seconds.
pub const PUTTING_ON_S: f64 = 9.0;

/// Time in which the arms come up into the T-posture, seconds.
const ARMS_UP_S: f64 = 1.4;

/// Which parts there are before the movement. The T-posture always is.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Protocol {
    /// The units lie on a common plank first and are then put on.
    pub plank: bool,
    /// Number of vertical jumps.
    pub jumps: usize,
}

impl Protocol {
    /// The paper's: plank and five jumps.
    pub const FULL: Protocol = Protocol { plank: true, jumps: 5 };

    /// T-posture and movement only.
    pub const NONE: Protocol = Protocol { plank: false, jumps: 0 };
}

/// When what happens, in true time of the camera's clock, seconds.
#[derive(Debug, Clone, PartialEq)]
pub struct Phases {
    /// The units lie on the plank.
    pub plank: Option<Range<f64>>,
    /// The units are put on; after it they stay where they are.
    pub putting_on: Option<Range<f64>>,
    /// The subject holds the T-posture.
    pub rest: Range<f64>,
    /// The jumps.
    pub jumps: Vec<Jump>,
    /// The movement.
    pub movement: Range<f64>,
    /// The recording ends.
    pub end_s: f64,
}

/// Codes of the phases on the truth's channel `protocol_phase_code`.
pub const PHASE_CODES: [(&str, f64); 5] =
    [("plank", 0.0), ("putting_on", 1.0), ("rest", 2.0), ("jumps", 3.0), ("movement", 4.0)];

impl Phases {
    /// The phases of a session with a movement of `movement_s` seconds; `seed` draws the jumps.
    pub fn of(protocol: Protocol, movement_s: f64, stature_m: f64, seed: u64) -> Self {
        let plank = protocol.plank.then_some(0.0..PLANK_S);
        let putting_on = protocol.plank.then_some(PLANK_S..PLANK_S + PUTTING_ON_S);
        let rest_s = putting_on.as_ref().map_or(0.0, |on| on.end + ARMS_UP_S);
        let ready_s = rest_s + REST_S + ARMS_DOWN_S;
        let jumps = Jump::series(protocol.jumps, ready_s, stature_m, &mut stream(seed, Stream::Jumps));
        let start_s = jumps.last().map_or(ready_s, |jump| jump.end_s + 0.5);
        let movement = start_s..start_s + movement_s;
        Self { plank, putting_on, rest: rest_s..rest_s + REST_S, jumps, end_s: movement.end + END_S, movement }
    }

    /// Start of each phase that there is, seconds, with its code of [`PHASE_CODES`].
    pub fn starts(&self) -> Vec<(f64, f64)> {
        let starts = [
            self.plank.as_ref().map(|plank| plank.start),
            self.putting_on.as_ref().map(|on| on.start),
            Some(self.rest.start),
            self.jumps.first().map(|jump| jump.start_s),
            Some(self.movement.start),
        ];
        starts.into_iter().zip(PHASE_CODES).filter_map(|(start, (_, code))| Some((start?, code))).collect()
    }

    /// The body at `t` seconds.
    pub fn stance(&self, subject: &Subject, movement: &Movement, t: f64) -> Stance {
        // Exercises begin with the rest, so theirs is the time since then.
        let origin_s = self.rest.start;
        let active = ActiveTime { start_s: self.movement.start - origin_s, end_s: self.movement.end - origin_s };
        movement.stance(subject, active, t - origin_s, |posture| {
            if self.plank.is_some() {
                let hanging = 1.0 - between(origin_s - ARMS_UP_S, origin_s, t);
                hang_arms(posture, subject, hanging);
            }
            if let Some(jump) = self.jumps.iter().find(|jump| (jump.start_s..jump.end_s).contains(&t)) {
                jump.shape(posture, t);
            }
        })
    }
}

/// Lowers the arms from the T-posture by a share of the way.
fn hang_arms(posture: &mut Posture, subject: &Subject, share: f64) {
    for arm in &mut posture.arms {
        arm.abduction += (subject.arm_hang - FRAC_PI_2) * share;
        arm.elbow += 10f64.to_radians() * share;
    }
}
