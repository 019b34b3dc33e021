//! Importers of inertial data sets on the shared data, when it is there.

use super::*;
use crate::recording::inertial_quality::GRAVITY_M_S2;
use crate::recording::{InertialSensor, Limits, ReferenceSeries, Segment, decode, encode};
use nalgebra::{Quaternion, UnitQuaternion, Vector3};

/// Folder of the shared data, or nothing with a printed reason.
fn shared_data() -> Option<PathBuf> {
    let folder = std::env::var_os("SUREFOOT_DATA").map_or_else(|| "../shared/data".into(), PathBuf::from);
    let is_there = folder.join("imu").is_dir();
    if !is_there {
        println!("skipped: no shared inertial data at {}; set SUREFOOT_DATA", folder.display());
    }
    is_there.then_some(folder)
}

fn all_trials(dataset: Dataset, data: &Path) -> Vec<Trial> {
    let sources = list(dataset, data).expect("the data set is there");
    sources.iter().map(|source| source.read().unwrap_or_else(|error| panic!("{error}"))).collect()
}

fn sensors(trial: &Trial) -> &[InertialSensor] {
    &trial.recording.inertial.as_ref().expect("units").sensors
}

/// Orientations of a unit's reference, in the order of its times.
fn orientations(trial: &Trial, segment: Segment) -> (Vec<Option<UnitQuaternion<f64>>>, &ReferenceSeries) {
    let series = |part: &str| {
        let name = format!("{segment}_orientation_{part}");
        trial.recording.references.iter().find(|series| series.channel == name).expect("a reference")
    };
    let parts = ["w", "x", "y", "z"].map(series);
    let of = |i: usize| {
        let [w, x, y, z] = parts.map(|series| series.values[i]);
        w.is_finite().then(|| UnitQuaternion::new_normalize(Quaternion::new(w, x, y, z)))
    };
    ((0..parts[0].values.len()).map(of).collect(), parts[0])
}

/// Mean direction of the acceleration in the reference's frame, over instants at which it is close to gravity, and the
/// median angle between the turn that the reference and the gyroscope show over a sample, degrees.
fn agreement(trial: &Trial, unit: &InertialSensor) -> (Vector3<f64>, f64) {
    let (orientations, series) = orientations(trial, unit.segment);
    let (mut up, mut errors) = (Vector3::zeros(), Vec::new());
    let mut t = 0;
    for i in 1..unit.len() {
        let time_ns = unit.time_ns[i] - series.clock_offset_ns;
        while t + 1 < series.time_ns.len() && series.time_ns[t + 1] <= time_ns {
            t += 1;
        }
        let (Some(now), true) = (orientations[t], (unit.acceleration[i].norm() - GRAVITY_M_S2).abs() < 0.5) else {
            continue;
        };
        up += now * unit.acceleration[i].normalize();
        let Some(next) = orientations.get(t + 1).copied().flatten() else { continue };
        let dt = (series.time_ns[t + 1] - series.time_ns[t]) as f64 * 1e-9;
        let rate = (now.inverse() * next).scaled_axis() / dt;
        if rate.norm() > 0.5 {
            errors.push(rate.angle(&unit.angular_rate[i]).to_degrees());
        }
    }
    errors.sort_by(f64::total_cmp);
    (up.normalize(), errors[errors.len() / 2])
}

#[test]
fn every_inertial_trial_imports_in_si_without_a_unit_that_is_refused() {
    let Some(data) = shared_data() else { return };
    for (dataset, n_trials, n_units, rate_hz) in [
        (Dataset::Broad, 2, 1, 285.7),
        (Dataset::Repoimu, 3, 1, 100.0),
        (Dataset::RingChain, 2, 5, 40.0),
        (Dataset::KneeSts, 1, 2, 40.0),
        (Dataset::KneeDropCut, 1, 2, 100.0),
        (Dataset::QmtFullbody, 1, 9, 100.0),
        (Dataset::XimuGait, 1, 1, 256.0),
    ] {
        let trials = all_trials(dataset, &data);
        assert_eq!(trials.len(), n_trials, "{}", dataset.name());
        for trial in &trials {
            assert!(trial.recording.skeleton.is_none());
            assert_eq!(sensors(trial).len(), n_units, "{}", trial.notes.name);
            for (unit, notes) in sensors(trial).iter().zip(&trial.notes.inertial) {
                println!("{} {} {:?}", trial.notes.name, unit.segment, notes.warnings);
                let is_turned = notes.warnings.iter().any(|warning| warning.contains("wrong way"));
                assert!(!is_turned, "{} {}: a sound unit is doubted", trial.notes.name, unit.segment);
                assert!((notes.rate_hz / rate_hz - 1.0).abs() < 1e-3, "{}: {}", trial.notes.name, notes.rate_hz);
                let mut magnitudes: Vec<f64> = unit.acceleration.iter().map(Vector3::norm).collect();
                magnitudes.sort_by(f64::total_cmp);
                let median = magnitudes[magnitudes.len() / 2];
                assert!((8.8..12.5).contains(&median), "{}: {median} m/s²", trial.notes.name);
            }
        }
    }
}

#[test]
fn every_imported_inertial_trial_survives_the_format_and_the_upload() {
    let Some(data) = shared_data() else { return };
    for dataset in Dataset::ALL.into_iter().filter(|dataset| !Dataset::WITH_SKELETON.contains(dataset)) {
        let source = list(dataset, &data).expect("there").remove(0);
        let recording = source.read().expect("reads").recording;
        let bytes = encode::mcap(&recording).expect("mcap");
        let back = decode(&bytes[..], crate::recording::Format::Mcap, &Limits::default()).expect("decodes");
        assert_eq!(format!("{back:?}"), format!("{recording:?}"), "{}", source.name);
    }
}

#[test]
fn orientation_references_turn_gravity_up_and_agree_with_the_gyroscope() {
    let Some(data) = shared_data() else { return };
    for dataset in [Dataset::Broad, Dataset::Repoimu, Dataset::RingChain] {
        for trial in all_trials(dataset, &data) {
            for unit in sensors(&trial) {
                let (up, error) = agreement(&trial, unit);
                let tilt = up.angle(&Vector3::y()).to_degrees();
                println!("{} {}: tilt {tilt:.1}, rates {error:.1} degrees", trial.notes.name, unit.segment);
                // Foam lets a unit tilt by up to 12 degrees, and its rates differ while the foam gives way.
                let bound = if unit.mounting.as_deref() == Some("on foam") { 15.0 } else { 8.0 };
                assert!(tilt < bound && error < 2.0 * bound, "{} {}", trial.notes.name, unit.segment);
            }
        }
    }
}

#[test]
fn knee_flexion_follows_the_rates_of_thigh_and_shank() {
    let Some(data) = shared_data() else { return };
    for dataset in [Dataset::KneeSts, Dataset::KneeDropCut] {
        for trial in all_trials(dataset, &data) {
            let [thigh, shank] = sensors(&trial) else { panic!("two units") };
            let reference = &trial.recording.references[0];
            assert_eq!(reference.channel, "left_knee_flexion_deg");
            let largest = reference.values.iter().copied().filter(|v| v.is_finite()).fold(f64::MIN, f64::max);
            assert!((60.0..150.0).contains(&largest), "{}: flexion up to {largest}", trial.notes.name);
            // The hinge's rate is the difference of magnitudes at least; correlate their absolute values.
            let at = |t: i64| reference.time_ns.binary_search(&t).ok();
            let pairs: Vec<(f64, f64)> = (1..thigh.len())
                .filter_map(|i| {
                    let (a, b) = (at(thigh.time_ns[i - 1])?, at(thigh.time_ns[i])?);
                    let flexion_rate = (reference.values[b] - reference.values[a]).to_radians()
                        / ((reference.time_ns[b] - reference.time_ns[a]) as f64 * 1e-9);
                    let apart = thigh.angular_rate[i].norm() + shank.angular_rate[i].norm();
                    flexion_rate.is_finite().then_some((flexion_rate.abs(), apart))
                })
                .collect();
            let n = pairs.len() as f64;
            let (ma, mb) = (pairs.iter().map(|p| p.0).sum::<f64>() / n, pairs.iter().map(|p| p.1).sum::<f64>() / n);
            let sums = pairs.iter().fold((0.0, 0.0, 0.0), |(ab, aa, bb), (a, b)| {
                (ab + (a - ma) * (b - mb), aa + (a - ma).powi(2), bb + (b - mb).powi(2))
            });
            let correlation = sums.0 / (sums.1 * sums.2).sqrt();
            println!("{}: {correlation:.2} over {n} samples", trial.notes.name);
            assert!(correlation > 0.8, "{}: rates and reference correlate by {correlation}", trial.notes.name);
        }
    }
}

#[test]
fn an_ximu_at_rest_reads_gravity_in_si_and_the_field_of_the_earth() {
    let Some(data) = shared_data() else { return };
    let trial = all_trials(Dataset::XimuGait, &data).remove(0);
    let unit = &sensors(&trial)[0];
    let mean = |vectors: &[Vector3<f64>]| vectors[..256].iter().map(Vector3::norm).sum::<f64>() / 256.0;
    assert!((mean(&unit.acceleration) - GRAVITY_M_S2).abs() < 0.4);
    assert!(mean(&unit.angular_rate) < 0.05);
    let field = mean(unit.magnetic_field.as_deref().expect("a magnetometer"));
    assert!((25.0..65.0).contains(&field), "the earth's field is 25 to 65 µT, found {field}");
    assert!(trial.notes.remarks[0].contains("gaps in the packet numbers"));
}

#[test]
fn utdmhad_has_the_thigh_unit_beside_the_skeleton() {
    let Some(data) = shared_data().filter(|data| data.join("skeleton").is_dir()) else { return };
    let trial = list(Dataset::Utdmhad, &data).expect("there").remove(0).read().expect("reads");
    let unit = trial.recording.inertial.as_ref().and_then(|inertial| inertial.sensor(Segment::RightThigh));
    let unit = unit.expect("the unit");
    assert_eq!(unit.clock_offset_ns, trial.recording.references[0].clock_offset_ns);
    let start = unit.acceleration[0].norm();
    assert!((start - GRAVITY_M_S2).abs() < 1.5, "{start} m/s² before the action");
    assert!(trial.recording.skeleton.is_some());
}
