//! What all stands have in common: how long they were held, and how the trunk swayed.

use crate::assessment::PerformanceMeasure;
use crate::protocol::MeasureSpec;
use crate::protocol::measures::{EVENT_SD_S, measured, missing};
use crate::protocol::motion::Motion;
use crate::protocol::repetitions::Found;
use crate::protocol::stance::{Hold, sway};

/// What is measured of every stand beside its time.
pub(super) const SWAY: &[MeasureSpec] = &[PATH, AREA, SPEED];

const PATH: MeasureSpec =
    ("trunk_sway_path_m", "m", "way of the point between the shoulders over the floor during the hold");
const AREA: MeasureSpec = ("trunk_sway_area_m2", "m2", "ellipse that holds 95 % of that point's places");
const SPEED: MeasureSpec = ("trunk_sway_speed_mps", "m/s", "path divided by the time of the hold");

/// Time for which the tests ask a stand to be held, seconds. A recording that ends before does not tell whether it was.
const ASKED_S: f64 = 10.0;

/// Why sway has no standard error.
const SWAY_REASON: &str = "the camera's own trembling lengthens it by an amount that is not known";

/// Measures of the hold that was found.
pub(super) fn of_hold(motion: &Motion, found: &Found, spec: MeasureSpec, unseen: &str) -> Vec<PerformanceMeasure> {
    let Some(hold) = found.hold else {
        return vec![missing(spec, "no stand with the feet like this was seen; keep both feet in view")];
    };
    let mut measures = vec![time_of_hold(&hold, spec, unseen)];
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

fn time_of_hold(hold: &Hold, spec: MeasureSpec, unseen: &str) -> PerformanceMeasure {
    let seconds = hold.seconds();
    if hold.is_to_the_end && seconds < ASKED_S {
        let reason = format!(
            "the recording ends after {seconds:.1} s, while it is held; record at least {ASKED_S:.0} s of it, and until it ends"
        );
        return missing(spec, reason);
    }
    let end = if hold.is_to_the_end { "the recording ends while it is held: it may have been longer; " } else { "" };
    PerformanceMeasure {
        standard_error: Some(EVENT_SD_S * 2f64.sqrt()),
        n_observations: Some(1),
        reason: format!("{end}{unseen}"),
        ..measured(spec, seconds)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::protocol::motion::INTERVAL_S;

    fn time(seconds: f64, is_to_the_end: bool) -> PerformanceMeasure {
        let end = (seconds / INTERVAL_S).round() as usize;
        let hold = Hold { start: 0, end, apart_forward: 0.1, apart_sideways: 0.1, is_to_the_end };
        time_of_hold(&hold, ("near_tandem_hold_s", "s", ""), "closed eyes cannot be seen")
    }

    #[test]
    fn a_hold_that_the_recording_cuts_off_before_ten_seconds_has_no_time() {
        let cut_off = time(8.0, true);
        assert_eq!(cut_off.value, None);
        assert!(cut_off.reason.contains("record at least 10 s"), "{}", cut_off.reason);
        assert!(time(8.0, false).value.is_some_and(|seconds| (seconds - 8.0).abs() < 1e-9));
        let held = time(12.0, true);
        assert!(held.value.is_some() && held.reason.contains("may have been longer"), "{held:?}");
    }
}
