//! On real recordings.

use super::*;
use crate::recording::import::{Dataset, list};
use std::path::PathBuf;

/// Trials of a data set; none, said aloud, when the data are not there.
fn trials(dataset: Dataset) -> Vec<(String, String, Recording)> {
    let data = std::env::var_os("SUREFOOT_DATA").map_or(PathBuf::from("../shared/data"), PathBuf::from);
    if !data.join("skeleton").join(dataset.name()).is_dir() {
        println!("skipped: no {} below {}", dataset.name(), data.display());
        return Vec::new();
    }
    let sources = list(dataset, &data).expect("listed");
    sources.into_iter().map(|s| (s.name.clone(), s.exercise.clone(), s.read().expect("read").recording)).collect()
}

#[test]
fn each_segmented_sit_to_stand_is_one_repetition_whose_times_are_those_of_the_reference() {
    let mut errors = Vec::new();
    for (name, exercise, recording) in trials(Dataset::Uiprmd) {
        if !exercise.starts_with("m05") {
            continue;
        }
        let row = evaluate(&name, &exercise, &recording);
        assert_eq!(row.n_repetitions, 1, "{name}: {row:?}");
        assert_eq!(row.time_errors_s.len(), 1, "{name}: {row:?}");
        errors.extend(row.time_errors_s.iter().flatten().map(|error| error.abs()));
    }
    // Nine in ten within 0.2 s and none beyond 0.3 s; a grid step is 0.02 s.
    let n_within = errors.iter().filter(|error| **error <= 0.2 + 1e-9).count();
    assert!(10 * n_within >= 9 * errors.len(), "{errors:?}");
    assert!(errors.iter().all(|error| *error <= 0.3), "{errors:?}");
}

#[test]
fn real_movements_are_measured_as_nothing_that_they_are_not() {
    // Movements that a camera in front cannot tell apart: a seat that takes no weight, a knee that bends as the leg rises.
    let alike = [
        ("five_times_sit_to_stand", "squat"),
        ("squat", "five_times_sit_to_stand"),
        ("squat", "chair_stand_30_s"),
        ("five_times_sit_to_stand", "chair_stand_30_s"),
        ("leg_raise", "knee_lift"),
    ];
    let (mut n, mut n_wrong) = (0, 0);
    for dataset in [Dataset::Uiprmd, Dataset::Utdmhad] {
        for (name, exercise, recording) in trials(dataset) {
            let row = evaluate(&name, &exercise, &recording);
            let expected = row.expected.unwrap_or("nothing");
            let wrong = row.measured_as.iter().filter(|id| **id != expected && !alike.contains(&(expected, **id)));
            n += 1;
            n_wrong += usize::from(wrong.count() > 0);
        }
    }
    assert!(n_wrong * 25 <= n, "{n_wrong} of {n} recordings would get numbers of a movement that they are not");
}
