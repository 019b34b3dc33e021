//! Events on simulated recordings whose disturbances are known, and on real ones.

use crate::support::{exercise, lose, series};
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use std::collections::BTreeMap;
use surefoot::assessment::series::{FLAG_BRIDGED, FLAG_OUTLIER, FLAG_SWAP_CORRECTED};
use surefoot::assessment::{Assessment, Event, JointAngleSettings, Method, Pass, Settings};
use surefoot::body::skeleton::point_index;
use surefoot::body::{Joint, Limb};
use surefoot::pipeline::joint_angles::events::{Inspection, inspect};
use surefoot::pipeline::joint_angles::observation::Observations;
use surefoot::pipeline::{PipelineError, assess};
use surefoot::progress::Monitor;
use surefoot::recording::SkeletonRecording;
use surefoot::synthetic::sensor::{dropout, hand_jump, limb_swap};
use surefoot::synthetic::{Exercise, Preset, SimulationSettings, simulate};

/// Subjects for each exercise.
const SEEDS: u64 = 4;

fn simulated(exercise: Exercise, sensor: Preset, seed: u64) -> SkeletonRecording {
    let settings = SimulationSettings {
        jitter: true,
        yaw_deg: -10.0 + 5.0 * seed as f64,
        ..SimulationSettings::new(exercise, sensor, seed)
    };
    simulate(&settings).expect("valid settings").recording.skeleton.expect("a skeleton")
}

fn inspection(skeleton: &SkeletonRecording) -> Inspection {
    let settings = JointAngleSettings::default();
    let observations = Observations::from_recording(skeleton, &settings).expect("the joints of the model");
    inspect(skeleton, &observations, &settings).expect("the joints of the model")
}

fn column(skeleton: &SkeletonRecording, limb: Limb, level: usize) -> usize {
    let (joint, stand_in) = limb.joints()[level];
    skeleton.column(joint).or_else(|| skeleton.column(stand_in)).expect("a joint of the sensor")
}

/// Points of each frame for which something holds.
fn points_where(skeleton: &SkeletonRecording, holds: impl Fn(usize, usize) -> bool) -> Vec<u16> {
    let mask = |t: usize| {
        let mut mask = 0;
        for limb in Limb::ALL {
            for level in (0..3).filter(|level| holds(t, column(skeleton, limb, *level))) {
                mask |= 1 << point_index(limb, level);
            }
        }
        mask
    };
    (0..skeleton.len()).map(mask).collect()
}

/// Points whose place differs between two recordings of the same movement.
fn moved(before: &SkeletonRecording, after: &SkeletonRecording) -> Vec<u16> {
    points_where(before, |t, column| before.frame(t)[column] != after.frame(t)[column])
}

/// A mask as it is when left and right hand have been exchanged back.
fn with_arms_back(mask: u16, exchanged: u16) -> u16 {
    const HANDS: u16 = 0b100_100;
    if exchanged & 0b100 == 0 {
        return mask;
    }
    mask & !HANDS | (mask >> 3 & 0b100) | (mask & 0b100) << 3
}

/// Points times frames that were disturbed, that were found, and both.
type Counts = [u64; 3];

/// What the failures of the simulator are against what is found, over all exercises and several subjects.
fn recall_and_precision(sensor: Preset) -> BTreeMap<&'static str, Counts> {
    let mut counts: BTreeMap<&'static str, Counts> = BTreeMap::new();
    for exercise in Exercise::ALL {
        for seed in 1..=SEEDS {
            let good = simulated(exercise, sensor, seed);
            let mut rng = ChaCha8Rng::seed_from_u64(100 * exercise as u64 + seed);
            let mut swapped = good.clone();
            limb_swap::apply(&mut swapped, limb_swap::USUAL, &mut rng);
            let mut jumped = swapped.clone();
            hand_jump::apply(&mut jumped, hand_jump::USUAL, &mut rng);
            let mut bad = jumped.clone();
            dropout::apply(&mut bad, dropout::usual, &mut rng);

            let (swaps, jumps) = (moved(&good, &swapped), moved(&swapped, &jumped));
            let seen = points_where(&bad, |t, column| bad.frame(t)[column].x.is_finite());
            let found = inspection(&bad);
            for t in 0..bad.len() {
                // Hands of an exchange that was not undone are somewhere else too: taking them out is no false alarm.
                let still_exchanged = swaps[t] & !found.repairs.exchanged[t];
                let rejected = found.repairs.rejected[t] & 0b111_111 & !still_exchanged;
                let mut add = |kind, truth: u16, found: u16| {
                    let counts = counts.entry(kind).or_default();
                    for (count, mask) in counts.iter_mut().zip([truth, found, truth & found]) {
                        *count += u64::from(mask.count_ones());
                    }
                };
                add("limb_swap", swaps[t], found.repairs.exchanged[t]);
                add("hand_jump", with_arms_back(jumps[t] & seen[t], swaps[t]), rejected);
            }
            let lost: u64 = seen.iter().map(|mask| u64::from(12 - mask.count_ones())).sum();
            let told = found.counts.iter().find(|c| c.kind == "lost_joint").expect("every kind is counted").n_frames;
            let total = counts.entry("lost_joint").or_default();
            *total = [total[0] + lost, total[1] + told, total[2] + lost.min(told)];
        }
    }
    counts
}

#[test]
fn most_failures_are_found_and_hardly_anything_else() {
    // Least recall and precision. A hand jump of 30 cm for one frame drowns in the 15 to 18 cm of Table 1.
    let limits = [
        (Preset::Table1, "limb_swap", 0.90, 0.99),
        (Preset::Table1, "hand_jump", 0.80, 0.80),
        (Preset::Table1, "lost_joint", 1.0, 1.0),
        (Preset::KinectV2, "limb_swap", 0.90, 0.99),
        (Preset::KinectV2, "hand_jump", 0.90, 0.97),
        (Preset::KinectV2, "lost_joint", 1.0, 1.0),
    ];
    for (sensor, kind, least_recall, least_precision) in limits {
        let [truth, found, both] = recall_and_precision(sensor)[kind].map(|n| n as f64);
        let (recall, precision) = (both / truth, both / found);
        println!("{sensor:<10} {kind:<10} of {truth:>5} recall {recall:.3} precision {precision:.3}");
        assert!(recall >= least_recall && precision >= least_precision, "{sensor} {kind}: {recall} {precision}");
    }
}

#[test]
fn missing_frames_are_found() {
    let (mut missing, mut told) = (0, 0);
    for seed in 1..=SEEDS {
        let bad = simulated(Exercise::Step, Preset::Failures, seed);
        let whole = simulated(Exercise::Step, Preset::Table1, seed);
        missing += (whole.len() - bad.len()) as u64;
        told += inspection(&bad).counts.iter().find(|c| c.kind == "frame_gap").unwrap().n_frames;
    }
    assert!(missing > 10);
    // Time stamps jitter by a sixth, so that the number of frames in a gap is a guess by one or so.
    assert!((told as f64 / missing as f64 - 1.0).abs() < 0.2, "{told} of {missing}");
}

#[test]
fn sensors_that_do_not_fail_have_no_events() {
    for sensor in [Preset::Clean, Preset::Table1, Preset::KinectV2] {
        for exercise in Exercise::ALL {
            for seed in 1..=SEEDS {
                let found = inspection(&simulated(exercise, sensor, seed));
                // The simulated Kinect's offsets of centimetres may well stretch a bone by a quarter.
                let false_alarms: Vec<&Event> = found.events.iter().filter(|e| e.kind != "occlusion").collect();
                assert!(false_alarms.is_empty(), "{sensor} {exercise} {seed}: {false_alarms:?}");
            }
        }
    }
}

fn assessed(skeleton: SkeletonRecording, settings: JointAngleSettings) -> Result<Assessment, PipelineError> {
    let recording = surefoot::recording::Recording { skeleton: Some(skeleton), ..Default::default() };
    assess(&recording, &Settings::JointAngles(settings), &Monitor::default())
}

#[test]
fn flags_agree_with_events() {
    let skeleton = simulated(Exercise::Step, Preset::Failures, 1);
    for method in [Method::Iekf, Method::Ik] {
        let settings = JointAngleSettings { method, ..JointAngleSettings::default() };
        let found = assessed(skeleton.clone(), settings).unwrap();
        let seconds = |t: usize| (found.time_ns[t] - found.time_ns[0]) as f64 * 1e-9;
        let inside = |t: usize, kind: &str, subject: &str| {
            let events = found.quality.events.iter().filter(|e| e.kind == kind && e.subject == subject);
            events.into_iter().any(|e| (e.start_s - 1e-9..=e.end_s + 1e-9).contains(&seconds(t)))
        };
        let (mut swapped, mut jumped) = (0, 0);
        for (side, hand) in [("left", "left_hand"), ("right", "right_hand")] {
            let (knee, elbow) = (format!("{side}_knee_flexion_deg"), format!("{side}_elbow_flexion_deg"));
            let (knee, elbow) = (series(&found, &knee), series(&found, &elbow));
            for t in 0..found.time_ns.len() {
                if knee.flags[t] & FLAG_SWAP_CORRECTED != 0 {
                    swapped += 1;
                    assert!(inside(t, "limb_swap", "legs"), "{method}: swap in frame {t}");
                }
                if inside(t, "lost_joint", &format!("{side}_elbow")) && !inside(t, "limb_swap", "arms") {
                    // Events bridge holes of a fifth of a second, in which the joint was seen.
                    let lost = skeleton.frame(t)[skeleton.column(elbow_of(side)).unwrap()].x.is_nan();
                    assert!(!lost || elbow.flags[t] & FLAG_BRIDGED != 0, "{method}: lost elbow in frame {t}");
                }
                if inside(t, "hand_jump", hand) && elbow.flags[t] & FLAG_OUTLIER != 0 {
                    jumped += 1;
                    assert!(elbow.flags[t] & FLAG_BRIDGED != 0, "{method}: a hand that jumped is bridged");
                }
            }
        }
        assert!(swapped > 5 && jumped > 5, "{method}: {swapped} {jumped}");
    }
}

fn elbow_of(side: &str) -> Joint {
    if side == "left" { Joint::LeftElbow } else { Joint::RightElbow }
}

#[test]
fn the_longer_a_joint_is_lost_the_wider_the_interval() {
    for (pass, deepest_s) in [(Pass::Filter, 6.95), (Pass::Smooth, 6.0)] {
        let settings = JointAngleSettings { pass: Some(pass), ..JointAngleSettings::default() };
        let width_with_loss = |until_s: f64, at_s: f64| {
            let recording = lose(exercise(Exercise::BackKnee, Preset::Table1, 12.0), Joint::RightFoot, 5.0, until_s);
            let found = assessed(recording.skeleton.unwrap(), settings.clone()).unwrap();
            let lost: Vec<_> = found.quality.events.iter().filter(|e| e.kind == "lost_joint").collect();
            assert_eq!((lost.len(), lost[0].subject.as_str()), (1, "right_foot"));
            assert!((lost[0].start_s - 5.0).abs() < 0.04 && (lost[0].end_s - until_s).abs() < 0.04);
            let knee = series(&found, "right_knee_flexion_deg");
            let t = found.time_ns.iter().position(|t| *t as f64 * 1e-9 >= at_s).unwrap();
            f64::from(knee.high[t] - knee.low[t])
        };
        let widths = [4.5, 5.1, 5.4, deepest_s].map(|at_s| width_with_loss(7.0, at_s));
        assert!(widths.is_sorted_by(|a, b| b > a), "{pass:?}: {widths:?}");
        assert!(width_with_loss(5.4, 5.2) < widths[3], "{pass:?}: a short loss costs less");
    }
}

#[test]
fn recordings_without_enough_to_see_are_refused_and_not_a_crash() {
    let refused = |change: &dyn Fn(&mut SkeletonRecording)| {
        let mut skeleton = simulated(Exercise::Step, Preset::Table1, 1);
        change(&mut skeleton);
        match assessed(skeleton, JointAngleSettings::default()) {
            Err(PipelineError::Unsuitable { code, .. }) => code,
            other => panic!("not refused: {:?}", other.map(|a| a.quality)),
        }
    };
    let lose_column = |skeleton: &mut SkeletonRecording, column: Option<usize>| {
        let n = skeleton.joints.len();
        for i in (0..skeleton.positions.len()).filter(|i| column.is_none_or(|c| i % n == c)) {
            skeleton.positions[i] = nalgebra::Vector3::repeat(f64::NAN);
            skeleton.confidence[i] = 0.0;
        }
    };
    assert_eq!(refused(&|s| lose_column(s, None)), "too_few_frames");
    assert_eq!(refused(&|s| lose_column(s, s.column(Joint::LeftKnee))), "too_few_frames");
    assert_eq!(refused(&|s| cut_to(s, 2)), "too_few_frames");
}

fn cut_to(skeleton: &mut SkeletonRecording, frames: usize) {
    let n = skeleton.joints.len();
    skeleton.time_ns.truncate(frames);
    skeleton.positions.truncate(frames * n);
    skeleton.confidence.truncate(frames * n);
    skeleton.orientations.clear();
}

#[test]
fn real_recordings_have_few_events() {
    use surefoot::recording::import::{Dataset, list};
    let data = std::env::var_os("SUREFOOT_DATA").map_or_else(|| "../shared/data".into(), std::path::PathBuf::from);
    let (mut frames, mut exchanged, mut jumped) = (0, 0, 0);
    for dataset in Dataset::WITH_SKELETON {
        let Ok(sources) = list(dataset, &data) else { continue };
        for source in sources {
            let skeleton = source.read().unwrap().recording.skeleton.unwrap();
            frames += skeleton.len();
            for count in inspection(&skeleton).counts {
                match count.kind.as_str() {
                    "limb_swap" => exchanged += count.n_frames,
                    "hand_jump" | "foot_jump" => jumped += count.n_frames,
                    _ => {}
                }
            }
        }
    }
    println!("{frames} frames: {exchanged} with exchanged limbs, {jumped} jumps");
    if frames == 0 {
        println!("skipped: no data at {}; set SUREFOOT_DATA", data.display());
        return;
    }
    // None of these data sets is known for exchanged limbs; a few hands and feet do flicker in them.
    assert_eq!(exchanged, 0);
    assert!((jumped as f64) < 0.005 * frames as f64, "{jumped} of {frames}");
}
