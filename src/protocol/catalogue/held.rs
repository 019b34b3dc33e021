//! What all stands have in common: how long they were held, and how the trunk swayed.

use crate::assessment::PerformanceMeasure;
use crate::protocol::MeasureSpec;
use crate::protocol::measures::{EVENT_SD_S, measured, missing};
use crate::protocol::motion::Motion;
use crate::protocol::repetitions::Found;
use crate::protocol::stance::sway;

/// What is measured of every stand beside its time.
pub(super) const SWAY: &[MeasureSpec] = &[PATH, AREA, SPEED];

const PATH: MeasureSpec =
    ("trunk_sway_path_m", "m", "way of the point between the shoulders over the floor during the hold");
const AREA: MeasureSpec = ("trunk_sway_area_m2", "m2", "ellipse that holds 95 % of that point's places");
const SPEED: MeasureSpec = ("trunk_sway_speed_mps", "m/s", "path divided by the time of the hold");

/// Why sway has no standard error.
const SWAY_REASON: &str = "the camera's own trembling lengthens it by an amount that is not known";

/// Measures of the hold that was found.
pub(super) fn of_hold(motion: &Motion, found: &Found, spec: MeasureSpec, unseen: &str) -> Vec<PerformanceMeasure> {
    let Some(hold) = found.hold else {
        return vec![missing(spec, "no stand with the feet like this was seen; keep both feet in view")];
    };
    let mut time = measured(spec, hold.seconds());
    time.standard_error = Some(EVENT_SD_S * 2f64.sqrt());
    time.n_observations = Some(1);
    let end = if hold.is_to_the_end { "the recording ends while it is held: it may have been longer; " } else { "" };
    time.reason = format!("{end}{unseen}");
    let mut measures = vec![time];
    let sway = sway(motion, &hold);
    let values =
        [(PATH, sway.map(|s| s.path_m)), (AREA, sway.map(|s| s.area_m2)), (SPEED, sway.map(|s| s.mean_speed_mps))];
    for (spec, value) in values {
        measures.push(match value {
            Some(value) => PerformanceMeasure { reason: SWAY_REASON.to_owned(), ..measured(spec, value) },
            None => missing(spec, "the shoulders were not seen throughout the hold"),
        });
    }
    measures
}
