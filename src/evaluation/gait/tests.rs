//! Accuracy of footfalls on captured and simulated walks, and silence where nobody walks.

use super::walks::{captured, rows, simulated};
use crate::assessment::JointTrack;
use crate::gait::measures_of_track;
use crate::recording::import::{Dataset, list};
use crate::synthetic::walker::Course;
use std::path::PathBuf;

fn data() -> PathBuf {
    std::env::var_os("SUREFOOT_DATA").map_or(PathBuf::from("../shared/data"), PathBuf::from)
}

#[test]
fn a_captured_walk_is_measured_from_every_side_through_the_error_of_a_kinect() {
    let Ok(sources) = list(Dataset::Cmu, &data()) else {
        println!("skipped: no captured walk below {}", data().display());
        return;
    };
    let motion = sources[0].read().unwrap().recording.skeleton.unwrap();
    for row in rows(&captured(&motion, 5)).iter().filter(|row| row.method == "footfalls") {
        assert_eq!((row.n_walks[1], row.n_contacts[0], row.n_contacts[2]), (0, row.n_contacts[1], 0), "{row:?}");
        assert!(row.step_time_s[1] < 0.010 && row.worst_step_time_s < 0.030, "{row:?}");
        assert!(row.step_length_m[1] < 0.005 && row.speed[1] < 0.02, "{row:?}");
    }
}

#[test]
fn simulated_walks_are_measured_and_the_constant_error_between_the_feet_leaves_their_means_alone() {
    let walks = simulated(Course::Straight, 3).unwrap();
    for row in rows(&walks).iter().filter(|row| row.method == "footfalls") {
        assert_eq!((row.n_walks[1], row.n_contacts[2]), (0, 0), "{row:?}");
        assert!(row.step_time_s[1] < 0.010 && row.step_length_m[1] < 0.005 && row.speed[1] < 0.01, "{row:?}");
        if row.sensor == "kinect" {
            // Single steps are centimetres off, which is why only means over both feet are believed.
            assert!(row.single_step_length_m > 0.01, "{row:?}");
        }
    }
}

#[test]
fn exercises_have_no_footfalls_and_steps_on_the_spot_no_lengths() {
    for dataset in [Dataset::Uiprmd, Dataset::Utdmhad, Dataset::Keraal] {
        let Ok(sources) = list(dataset, &data()) else { continue };
        for source in sources {
            let Some(skeleton) = source.read().unwrap().recording.skeleton else { continue };
            let found = measures_of_track(&JointTrack::of_skeleton(&skeleton));
            let lengths =
                found.measures_of_all_steps.iter().filter(|m| m.name.ends_with("_m") || m.name.ends_with("_mps"));
            assert_eq!(lengths.count(), 0, "{}", source.name);
            let is_on_the_spot = source.exercise.contains("in_place");
            assert!(is_on_the_spot || found.contacts.is_empty(), "{} {}", source.name, source.exercise);
        }
    }
}
