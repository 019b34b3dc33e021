//! Importers on the shared data, when it is there, and on any bytes.

use super::table::{Table, text_of_bytes};
use super::*;
use crate::body::{Joint, Side};
use crate::recording::{Limits, SkeletonRecording, decode, encode};
use crate::signal::interpolation::interpolate;
use proptest::prelude::*;
use std::io::Write;

/// Folder of the shared data, or nothing with a printed reason.
fn shared_data() -> Option<PathBuf> {
    let folder = std::env::var_os("SUREFOOT_DATA").map_or_else(|| "../shared/data".into(), PathBuf::from);
    let is_there = folder.join("skeleton").is_dir();
    if !is_there {
        println!("skipped: no shared data at {}; set SUREFOOT_DATA", folder.display());
    }
    is_there.then_some(folder)
}

fn all_trials(dataset: Dataset, data: &Path) -> Vec<Trial> {
    let sources = list(dataset, data).expect("the data set is there");
    assert!(sources.windows(2).all(|pair| pair[0].name < pair[1].name), "sorted by name");
    sources.iter().map(|source| source.read().unwrap_or_else(|error| panic!("{error}"))).collect()
}

fn skeleton(trial: &Trial) -> &SkeletonRecording {
    trial.recording.skeleton.as_ref().expect("a skeleton")
}

/// Mean length of a bone over the frames that show it, metres.
fn bone_length(skeleton: &SkeletonRecording, from: Joint, to: Joint) -> f64 {
    let (from, to) = (skeleton.column(from).expect("joint"), skeleton.column(to).expect("joint"));
    let lengths: Vec<f64> = (0..skeleton.len())
        .map(|t| (skeleton.frame(t)[to] - skeleton.frame(t)[from]).norm())
        .filter(|length| length.is_finite())
        .collect();
    lengths.iter().sum::<f64>() / lengths.len() as f64
}

fn correlation(pairs: &[(f64, f64)]) -> f64 {
    let n = pairs.len() as f64;
    let (ma, mb) = (pairs.iter().map(|p| p.0).sum::<f64>() / n, pairs.iter().map(|p| p.1).sum::<f64>() / n);
    let sums = pairs.iter().fold((0.0, 0.0, 0.0), |(ab, aa, bb), (a, b)| {
        (ab + (a - ma) * (b - mb), aa + (a - ma).powi(2), bb + (b - mb).powi(2))
    });
    sums.0 / (sums.1 * sums.2).sqrt()
}

/// The series beside its reference on the common clock, where both have a value.
fn beside(time_ns: &[i64], values: &[f64], reference: &crate::recording::ReferenceSeries) -> Vec<(f64, f64)> {
    let on_reference = |t: i64| interpolate(&reference.time_ns, &reference.values, t - reference.clock_offset_ns);
    let pairs = time_ns.iter().zip(values).map(|(&t, &value)| (value, on_reference(t)));
    pairs.filter(|(a, b)| a.is_finite() && b.is_finite()).collect()
}

fn median(mut values: Vec<f64>) -> f64 {
    values.sort_by(f64::total_cmp);
    values[values.len() / 2]
}

#[test]
fn every_uiprmd_trial_imports_with_plausible_legs_and_a_knee_that_follows_vicon() {
    let Some(data) = shared_data() else { return };
    let trials = all_trials(Dataset::Uiprmd, &data);
    assert_eq!(trials.len(), 47);
    let (mut correlations, mut lags) = (Vec::new(), Vec::new());
    for trial in &trials {
        let (name, skeleton) = (&trial.notes.name, skeleton(trial));
        for side in Side::BOTH {
            let [hip, knee, ankle] = match side {
                Side::Left => [Joint::LeftHip, Joint::LeftKnee, Joint::LeftAnkle],
                Side::Right => [Joint::RightHip, Joint::RightKnee, Joint::RightAnkle],
            };
            let (thigh, shank) = (bone_length(skeleton, hip, knee), bone_length(skeleton, knee, ankle));
            assert!((0.25..0.55).contains(&thigh) && (0.25..0.55).contains(&shank), "{name}: {thigh} m, {shank} m");
        }
        // Upright in world: head above pelvis above ankles, subject's left at +x as the data set says.
        let at = |joint| skeleton.frame(0)[skeleton.column(joint).expect("joint")];
        assert!(
            at(Joint::Head).y > at(Joint::Pelvis).y + 0.3 && at(Joint::Pelvis).y > at(Joint::LeftAnkle).y,
            "{name}"
        );
        assert!(at(Joint::LeftHip).x > at(Joint::RightHip).x, "{name}");
        if let Some(clock) = trial.notes.clock_offset.as_ref().filter(|clock| clock.is_determined) {
            lags.push(clock.offset_s.abs());
            for (side, reference) in Side::BOTH.into_iter().zip(&trial.recording.references) {
                let pairs = beside(&skeleton.time_ns, &uiprmd::raw_knee_flexion_deg(skeleton, side), reference);
                let (low, high) = pairs.iter().fold((f64::MAX, f64::MIN), |(l, h), p| (l.min(p.1), h.max(p.1)));
                if high - low > 40.0 {
                    correlations.push(correlation(&pairs));
                }
            }
        }
    }
    let report = ImportReport::of("uiprmd", trials.iter().map(|trial| trial.notes.clone()).collect());
    assert_eq!(report.n_trials_with_reference, 46, "s03 has no Vicon file for m03");
    assert!(median(correlations) > 0.98, "knees that bend more than 40°");
    assert!(median(lags.clone()) < 0.12 && lags.iter().all(|lag| *lag < 0.65), "as the data set's description says");
}

#[test]
fn uiprmd_orientations_turn_the_bone_that_leaves_the_joint() {
    let Some(data) = shared_data() else { return };
    let source = list(Dataset::Uiprmd, &data).expect("there").remove(0);
    let trial = source.read().expect("reads");
    let skeleton = skeleton(&trial);
    let n = skeleton.joints.len();
    let bones = [
        (Joint::LeftHip, Joint::LeftKnee, -nalgebra::Vector3::y()),
        (Joint::RightKnee, Joint::RightAnkle, -nalgebra::Vector3::y()),
        (Joint::LeftShoulder, Joint::LeftElbow, nalgebra::Vector3::x()),
        (Joint::RightShoulder, Joint::RightElbow, -nalgebra::Vector3::x()),
        (Joint::Pelvis, Joint::Torso, nalgebra::Vector3::y()),
        (Joint::LeftAnkle, Joint::LeftFoot, nalgebra::Vector3::z()),
    ];
    for t in 0..skeleton.len() {
        for (from, to, axis) in bones {
            let (from, to) = (skeleton.column(from).expect("joint"), skeleton.column(to).expect("joint"));
            let bone = skeleton.frame(t)[to] - skeleton.frame(t)[from];
            let Some(orientation) = skeleton.orientations[t * n + from] else { continue };
            // Offsets are stored with six digits: 1e-3 rad is far above their rounding.
            assert!((orientation * axis).angle(&bone) < 1e-3, "frame {t}, {}", skeleton.joints[from]);
        }
    }
}

#[test]
fn every_keraal_trial_imports_with_orientations_along_the_bone_that_arrives() {
    let Some(data) = shared_data() else { return };
    let trials = all_trials(Dataset::Keraal, &data);
    assert_eq!(trials.len(), 2);
    for trial in &trials {
        let skeleton = skeleton(trial);
        let n = skeleton.joints.len();
        // Head, feet, hand tips and thumbs have none.
        assert_eq!(trial.notes.defects.zero_quaternions, 7 * skeleton.len() as u64);
        let bones = [
            (Joint::Pelvis, Joint::Torso),
            (Joint::LeftHip, Joint::LeftKnee),
            (Joint::LeftKnee, Joint::LeftAnkle),
            (Joint::RightKnee, Joint::RightAnkle),
            (Joint::RightShoulder, Joint::RightElbow),
            (Joint::LeftElbow, Joint::LeftWrist),
        ];
        for (from, to) in bones {
            let (from, to) = (skeleton.column(from).expect("joint"), skeleton.column(to).expect("joint"));
            for t in 0..skeleton.len() {
                let Some(orientation) = skeleton.orientations[t * n + to] else { continue };
                let bone = skeleton.frame(t)[to] - skeleton.frame(t)[from];
                let angle = (orientation * nalgebra::Vector3::y()).angle(&bone).to_degrees();
                // Six decimals of a quaternion and of metres on bones of 0.2 m.
                assert!(angle < 0.1, "{} frame {t}, {}: {angle} deg", trial.notes.name, skeleton.joints[to]);
            }
        }
        let y = |joint| skeleton.frame(0)[skeleton.column(joint).expect("joint")].y;
        assert!(y(Joint::Head) > y(Joint::Pelvis) && y(Joint::Pelvis) > y(Joint::LeftAnkle));
    }
}

#[test]
fn every_utdmhad_trial_imports_at_its_own_rate_with_a_thigh_that_follows_its_sensor() {
    let Some(data) = shared_data() else { return };
    let trials = all_trials(Dataset::Utdmhad, &data);
    assert_eq!(trials.len(), 48);
    let mut correlations = Vec::new();
    for trial in &trials {
        let skeleton = skeleton(trial);
        assert!(
            (14.0..21.0).contains(&trial.notes.frame_rate_hz),
            "{}: {}",
            trial.notes.name,
            trial.notes.frame_rate_hz
        );
        let raw = utdmhad::raw_thigh_tilt_change_deg(skeleton);
        let r = correlation(&beside(&skeleton.time_ns, &raw, &trial.recording.references[0]));
        // Jogging and walking in place are too fast for the smoothed skeleton, and a lunge with the left foot hardly
        // tilts the right thigh.
        if ["a24", "a25", "a27"].contains(&&trial.notes.name[..3]) {
            correlations.push(r);
        }
    }
    assert!(median(correlations) > 0.94, "sit to stand, stand to sit, squat");
}

#[test]
fn the_cmu_knee_angle_is_the_three_point_angle_to_a_thousandth_of_a_degree() {
    let Some(data) = shared_data() else { return };
    let trials = all_trials(Dataset::Cmu, &data);
    assert_eq!(trials.len(), 1);
    let skeleton = skeleton(&trials[0]);
    assert_eq!(skeleton.len(), 343);
    for (side, reference) in Side::BOTH.into_iter().zip(&trials[0].recording.references) {
        let raw = uiprmd::raw_knee_flexion_deg(skeleton, side);
        for (t, (raw, exact)) in raw.iter().zip(&reference.values).enumerate() {
            // An extended knee is negative in the model; three points cannot tell.
            assert!((raw - exact.abs()).abs() < 1e-3, "frame {t}: {raw} and {exact}");
        }
    }
    let at = |t: usize, joint| skeleton.frame(t)[skeleton.column(joint).expect("joint")];
    let distance = (at(342, Joint::Pelvis) - at(0, Joint::Pelvis)).norm();
    let speed = distance / skeleton.duration_s();
    assert!((speed - 1.18).abs() < 0.1, "walks at {speed} m/s, the description says 1.18");
    assert!(at(0, Joint::Head).y - at(0, Joint::LeftAnkle).y > 1.2);
}

#[test]
fn every_imported_trial_survives_the_format() {
    let Some(data) = shared_data() else { return };
    for dataset in Dataset::ALL {
        let source = list(dataset, &data).expect("there").remove(0);
        let recording = source.read().expect("reads").recording;
        for (format, bytes) in [
            (crate::recording::Format::Mcap, encode::mcap(&recording).expect("mcap")),
            (crate::recording::Format::Json, encode::json(&recording).expect("json")),
        ] {
            let back = decode(&bytes[..], format, &Limits::default()).expect("decodes");
            assert_eq!(format!("{back:?}"), format!("{recording:?}"), "{}", source.name);
        }
    }
}

#[test]
fn the_data_set_is_found_from_two_levels_above_and_not_elsewhere() {
    let Some(data) = shared_data() else { return };
    for directory in [data.clone(), data.join("skeleton"), data.join("skeleton").join("uiprmd")] {
        assert_eq!(list(Dataset::Uiprmd, &directory).expect("there").len(), 47);
    }
    let elsewhere = list(Dataset::Uiprmd, &data.join("imu")).expect_err("nothing there");
    assert!(elsewhere.to_string().contains("segmented/kinect/positions"), "{elsewhere}");
}

#[test]
fn a_gzip_file_that_is_cut_is_refused() {
    let mut encoder = flate2::write::GzEncoder::new(Vec::new(), flate2::Compression::default());
    encoder.write_all(rows(50, 66).as_bytes()).expect("written");
    let zipped = encoder.finish().expect("zipped");
    assert_eq!(text_of_bytes(zipped.clone()).expect("sound"), rows(50, 66));
    assert!(text_of_bytes(zipped[..zipped.len() - 9].to_vec()).is_err());
}

#[test]
fn of_utdmhad_only_the_actions_with_the_sensor_on_the_thigh_are_listed() {
    let folder = folder_with(&[("a01_s1_t1_skeleton.csv", b""), ("a22_s1_t1_skeleton.csv", b"")]);
    let sources = list(Dataset::Utdmhad, folder.path()).expect("one");
    assert_eq!(sources.iter().map(|source| source.name.as_str()).collect::<Vec<_>>(), ["a22_s1_t1"]);
}

#[test]
fn a_malformed_row_is_an_error_that_names_the_file_and_the_row() {
    let file = Path::new("some/file.txt");
    let error = |text: &str| Table::parse(text, 0, 2, file).expect_err("malformed").to_string();
    assert_eq!(error("1,2\n3\n"), "some/file.txt, row 2: 1 numbers, expected 2");
    assert_eq!(error("1,2\n\n3,x\n"), "some/file.txt, row 3: `x` is not a finite number");
    assert_eq!(error("1,NaN"), "some/file.txt, row 1: `NaN` is not a finite number");
    assert_eq!(Table::parse("a b\n1 2\n 3\t4 \n", 1, 2, file).expect("sound").column(1), [2.0, 4.0]);
}

/// A data set of one trial made of given texts, in a temporary folder.
fn folder_with(files: &[(&str, &[u8])]) -> tempfile::TempDir {
    let folder = tempfile::tempdir().expect("a folder");
    for (name, bytes) in files {
        let file = folder.path().join(name);
        std::fs::create_dir_all(file.parent().expect("a parent")).expect("made");
        std::fs::File::create(file).expect("created").write_all(bytes).expect("written");
    }
    folder
}

fn rows(n_rows: usize, n_columns: usize) -> String {
    (0..n_rows).map(|t| (0..n_columns).map(|c| format!("{}", c + t)).collect::<Vec<_>>().join(",") + "\n").collect()
}

#[test]
fn files_of_one_trial_that_contradict_each_other_are_refused() {
    let (five, four) = (rows(5, 66), rows(4, 66));
    let positions = "segmented/kinect/positions/m01_s01_e01_positions.txt";
    let angles = "segmented/kinect/angles/m01_s01_e01_angles.txt";
    let read = |files: &[(&str, &[u8])]| {
        let folder = folder_with(files);
        list(Dataset::Uiprmd, folder.path()).expect("a trial")[0].read()
    };
    assert!(read(&[(positions, five.as_bytes()), (angles, five.as_bytes())]).is_ok());
    let missing = read(&[(positions, five.as_bytes())]).expect_err("no angles").to_string();
    assert!(missing.contains("kinect/angles/m01_s01_e01_angles.txt is missing"), "{missing}");
    let shorter = read(&[(positions, five.as_bytes()), (angles, four.as_bytes())]).expect_err("rows").to_string();
    assert!(shorter.ends_with("4 rows, but 5 in the positions"), "{shorter}");
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(48))]

    #[test]
    fn any_bytes_in_any_file_are_refused_or_read_without_panic(bytes in prop::collection::vec(any::<u8>(), 0..600)) {
        let _ = text_of_bytes(bytes.clone());
        let mut zipped = vec![0x1f, 0x8b];
        zipped.extend(&bytes);
        let _ = text_of_bytes(zipped);
        let folder = folder_with(&[
            ("segmented/kinect/positions/m01_s01_e01_positions.txt", &bytes),
            ("segmented/kinect/angles/m01_s01_e01_angles.txt", &bytes),
            ("a22_s1_t1_skeleton.csv", &bytes),
            ("a22_s1_t1_inertial.csv", &bytes),
            ("G3-Kinect-CTK-P1.txt", &bytes),
            ("02.asf", &bytes),
            ("02_walk.amc", &bytes),
            ("07_fast.csv", &bytes),
            ("TStick_Test04_Trial1.csv", &bytes),
            ("trial1_imu_rigid.csv", &bytes),
            ("trial1_omc.csv", &bytes),
            ("partA_imu_left_thigh.csv", &bytes),
            ("partA_imu_left_shank.csv", &bytes),
            ("partA_mocap_knee.csv", &bytes),
            ("Lknee_trial_1.txt", &bytes),
            ("MT_left_thigh.txt", &bytes),
            ("MT_left_shank.txt", &bytes),
            ("part1_9segments.csv", &bytes),
            ("walk_CalInertialAndMag.csv", &bytes),
        ]);
        for dataset in Dataset::ALL {
            for source in list(dataset, folder.path()).expect("listed") {
                let _ = source.read();
            }
        }
    }

    #[test]
    fn any_words_of_the_acclaim_formats_are_refused_or_read_without_panic(
        words in prop::collection::vec(
            prop::sample::select(vec![
                ":units", ":bonedata", ":hierarchy", "begin", "end", "name", "root", "lfemur", "dof", "rx", "rz", "axis",
                "length", "direction", "1", "-2.5", "0", "\n", "\n", "\n",
            ]),
            0..80,
        )
    ) {
        let text = words.join(" ");
        let _ = cmu::recording_from(&text, "1\nroot 0 0 0 0 0 0\nlfemur 1 2 3\n", Path::new("a"), Path::new("b"));
        let asf = ":bonedata\nbegin\nname lfemur\nlength 1\ndirection 0 1 0\ndof rx ry rz\nend\n:hierarchy\nroot lfemur\n";
        let _ = cmu::recording_from(asf, &text, Path::new("a"), Path::new("b"));
    }

    #[test]
    fn a_trial_of_any_finite_numbers_imports_without_panic(seed in prop::collection::vec(-1e12..1e12f64, 66 * 3)) {
        let text: String = seed.chunks(66).map(|row| row.iter().map(f64::to_string).collect::<Vec<_>>().join(",") + "\n").collect();
        let folder = folder_with(&[
            ("segmented/kinect/positions/m01_s01_e01_positions.txt", text.as_bytes()),
            ("segmented/kinect/angles/m01_s01_e01_angles.txt", text.as_bytes()),
        ]);
        prop_assert!(list(Dataset::Uiprmd, folder.path()).expect("a trial")[0].read().is_ok());
    }
}

#[test]
fn in_every_data_set_bent_knees_lie_forward_and_the_right_foot_to_the_right() {
    let Some(data) = shared_data() else { return };
    for dataset in Dataset::WITH_SKELETON {
        let mut n_bent = 0;
        for trial in all_trials(dataset, &data) {
            let skeleton = skeleton(&trial);
            let at = |t: usize, joint| skeleton.frame(t)[skeleton.column(joint).expect("joint")];
            let right_at = |t| at(t, Joint::RightHip) - at(t, Joint::LeftHip);
            let apart = (0..skeleton.len())
                .map(|t| (at(t, Joint::RightAnkle) - at(t, Joint::LeftAnkle)).dot(&right_at(t)))
                .filter(|dot| dot.is_finite());
            assert!(median(apart.collect()) > 0.0, "{}: the right foot is on the left", trial.notes.name);
            let raw = uiprmd::raw_knee_flexion_deg(skeleton, Side::Right);
            let bent = (0..skeleton.len()).filter(|&t| raw[t] > 55.0);
            let forward: Vec<f64> = bent
                .map(|t| {
                    let middle = (at(t, Joint::RightHip) + at(t, Joint::RightAnkle)) / 2.0;
                    // Z to the subject's right, Y up: X = Y × Z points forward.
                    nalgebra::Vector3::y().cross(&right_at(t)).dot(&(at(t, Joint::RightKnee) - middle))
                })
                .collect();
            if forward.len() > 5 {
                n_bent += 1;
                assert!(median(forward) > 0.0, "{}: the right knee bends backwards", trial.notes.name);
            }
        }
        assert!(n_bent > 0, "{}: no trial bends the right knee", dataset.name());
    }
}
