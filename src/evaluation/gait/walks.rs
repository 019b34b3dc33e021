//! The walks that footfalls are judged on.

use super::disturbed::{add_kinect_error, simulated_skeleton, thinned, turned};
use super::truth::{TrueContact, captured_contacts, planned_contacts};
use super::{GaitErrors, baseline, compare};
use crate::assessment::JointTrack;
use crate::gait::measures_of_track;
use crate::recording::SkeletonRecording;
use crate::synthetic::SettingOutOfRange;
use crate::synthetic::walker::trousers::trousers;
use crate::synthetic::walker::{Course, WalkerSettings, WalkerSimulation};
use serde::Serialize;
use std::f64::consts::FRAC_PI_2;

/// Frames of a captured motion for one of a camera: 120 Hz for 30 Hz.
const CAPTURED_STRIDE: usize = 4;
/// Directions of walking before the camera: away, across, towards, across.
const DIRECTIONS: usize = 4;

/// A walk as a camera sees it, with its truth.
#[derive(Debug, Clone, PartialEq)]
pub struct GaitWalk {
    /// What it is, for example `captured` or `simulated straight`.
    pub set: String,
    /// `clean`, or `kinect` with the error of a Kinect v2.
    pub sensor: &'static str,
    /// What the camera gave.
    pub skeleton: SkeletonRecording,
    /// Contacts by time.
    pub truth: Vec<TrueContact>,
}

/// A captured motion at 30 Hz: clean with every phase of the frames, and with the error of a Kinect v2 for each seed in four
/// directions before the camera.
pub fn captured(motion: &SkeletonRecording, seeds: u64) -> Vec<GaitWalk> {
    let truth = captured_contacts(motion);
    let start_ns = motion.time_ns.first().copied().unwrap_or(0);
    let of = |skeleton: SkeletonRecording, angle: f64, sensor| {
        // Times count from the first frame that is left.
        let shift_s = skeleton.time_ns.first().map_or(0.0, |time| (time - start_ns) as f64 * 1e-9);
        let truth = truth.iter().map(|contact| moved(contact, shift_s, angle)).collect();
        GaitWalk { set: "captured".to_owned(), sensor, skeleton: turned(skeleton, angle), truth }
    };
    let mut walks: Vec<GaitWalk> =
        (0..CAPTURED_STRIDE).map(|first| of(thinned(motion, CAPTURED_STRIDE, first), 0.0, "clean")).collect();
    for seed in 1..=seeds {
        for direction in 0..DIRECTIONS {
            let first = (seed as usize + direction) % CAPTURED_STRIDE;
            let mut walk = of(thinned(motion, CAPTURED_STRIDE, first), direction as f64 * FRAC_PI_2, "kinect");
            add_kinect_error(&mut walk.skeleton, seed);
            walks.push(walk);
        }
    }
    walks
}

/// A contact later by `−shift_s`, its place turned about the vertical.
fn moved(contact: &TrueContact, shift_s: f64, angle: f64) -> TrueContact {
    let (sin, cos) = angle.sin_cos();
    TrueContact {
        side: contact.side,
        contact_s: contact.contact_s - shift_s,
        release_s: contact.release_s.map(|time| time - shift_s),
        place_m: contact.place_m.map(|[x, z]| [cos * x + sin * z, cos * z - sin * x]),
    }
}

/// Simulated walks of 20 s, each seed with its own person, speed and scatter of steps; clean and with the error of a Kinect
/// v2. Speeds are 0.3 to 1.0 m/s.
///
/// # Errors
/// Those of the simulation.
pub fn simulated(course: Course, seeds: u64) -> Result<Vec<GaitWalk>, SettingOutOfRange> {
    let mut walks = Vec::new();
    for seed in 1..=seeds {
        let simulation = WalkerSimulation::new(&WalkerSettings::of_seed(course, seed), trousers())?;
        let truth = planned_contacts(&simulation);
        let set = format!("simulated {}", course.name());
        let clean = turned(simulated_skeleton(&simulation), 0.0);
        let mut noisy = clean.clone();
        add_kinect_error(&mut noisy, seed);
        walks.push(GaitWalk { set: set.clone(), sensor: "clean", skeleton: clean, truth: truth.clone() });
        walks.push(GaitWalk { set, sensor: "kinect", skeleton: noisy, truth });
    }
    Ok(walks)
}

/// Errors of one method on walks of one set and sensor; means of absolute values unless said otherwise.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct GaitRow {
    /// What the walks are.
    pub set: String,
    /// `clean` or `kinect`.
    pub sensor: String,
    /// `footfalls`, or `baseline`: frames in which the feet are farthest apart.
    pub method: &'static str,
    /// Walks, and those of them in which fewer than two contacts were found.
    pub n_walks: [usize; 2],
    /// True contacts, those found, and contacts found that are none.
    pub n_contacts: [usize; 3],
    /// Mean of found − true initial contact, seconds, signed.
    pub contact_bias_s: f64,
    /// Mean step time of a walk: mean absolute and worst error, seconds.
    pub step_time_s: [f64; 2],
    /// Single step times: the worst error, seconds.
    pub worst_step_time_s: f64,
    /// Mean step length of a walk: mean absolute and worst error, metres.
    pub step_length_m: [f64; 2],
    /// Single step lengths: mean absolute error, metres.
    pub single_step_length_m: f64,
    /// Walking speed: mean absolute and worst error, as a share.
    pub speed: [f64; 2],
    /// Mean step width of a walk: mean absolute and worst error, metres.
    pub step_width_m: [f64; 2],
    /// Double support: mean absolute and worst error, percent of a stride; none of a method without terminal contacts.
    pub double_support_pct: Option<[f64; 2]>,
    /// Standard deviation of the errors of single lengths and widths about each side's mean, metres.
    pub scatter_m: [f64; 2],
}

/// Both methods on walks, by set and sensor in the order in which they come.
pub fn rows(walks: &[GaitWalk]) -> Vec<GaitRow> {
    let mut rows = Vec::new();
    let mut kinds: Vec<(&str, &str)> = Vec::new();
    for walk in walks {
        if !kinds.contains(&(walk.set.as_str(), walk.sensor)) {
            kinds.push((&walk.set, walk.sensor));
        }
    }
    for (set, sensor) in kinds {
        for method in ["footfalls", "baseline"] {
            let of_kind = walks.iter().filter(|walk| walk.set == set && walk.sensor == sensor);
            let errors: Vec<Option<GaitErrors>> = of_kind
                .map(|walk| {
                    let track = JointTrack::of_skeleton(&walk.skeleton);
                    let contacts = match method {
                        "footfalls" => measures_of_track(&track).contacts,
                        _ => baseline::contacts(&track),
                    };
                    compare(&contacts, &walk.truth)
                })
                .collect();
            rows.push(row(set, sensor, method, &errors));
        }
    }
    rows
}

fn row(set: &str, sensor: &str, method: &'static str, outcomes: &[Option<GaitErrors>]) -> GaitRow {
    let found: Vec<&GaitErrors> = outcomes.iter().flatten().collect();
    let mean = |values: &[f64]| values.iter().sum::<f64>() / values.len().max(1) as f64;
    let worst = |values: &[f64]| values.iter().copied().fold(0.0, f64::max);
    let both = |value: &dyn Fn(&GaitErrors) -> Option<f64>| {
        let values: Vec<f64> = found.iter().filter_map(|errors| value(errors)).map(f64::abs).collect();
        [mean(&values), worst(&values)]
    };
    let each = |value: &dyn Fn(&GaitErrors) -> f64| found.iter().map(|errors| value(errors)).collect::<Vec<f64>>();
    let has_support = found.iter().any(|errors| errors.error("double_support_pct").is_some());
    let rms = |k: usize| mean(&each(&|errors| errors.scatter_m[k].powi(2))).sqrt();
    GaitRow {
        set: set.to_owned(),
        sensor: sensor.to_owned(),
        method,
        n_walks: [outcomes.len(), outcomes.len() - found.len()],
        n_contacts: [
            found.iter().map(|errors| errors.n_contacts[0]).sum(),
            found.iter().map(|errors| errors.n_contacts[1]).sum(),
            found.iter().map(|errors| errors.n_extra).sum(),
        ],
        contact_bias_s: mean(&each(&|errors| errors.contact_bias_s)),
        step_time_s: both(&|errors| errors.error("step_time_s")),
        worst_step_time_s: worst(&each(&|errors| errors.worst_step_time_s)),
        step_length_m: both(&|errors| errors.error("step_length_m")),
        single_step_length_m: mean(&each(&|errors| errors.step_length_m)),
        speed: both(&|errors| errors.relative("usual_speed_mps")),
        step_width_m: both(&|errors| errors.error("step_width_m")),
        double_support_pct: has_support.then(|| both(&|errors| errors.error("double_support_pct"))),
        scatter_m: [rms(0), rms(1)],
    }
}
