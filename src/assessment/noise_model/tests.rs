use super::*;
use crate::body::Limb;
use crate::body::pose::{attitude_offset, hinge_offset};
use crate::body::skeleton::point_index;

fn table1() -> NoiseModel {
    find_shipped(&NITE_TABLE1.parse().unwrap()).unwrap().clone()
}

fn refusal(change: impl FnOnce(&mut NoiseModelDocument)) -> String {
    let mut document = table1().document().clone();
    change(&mut document);
    NoiseModel::try_from(document).unwrap_err().to_string()
}

#[test]
fn every_shipped_model_is_sound_symmetric_and_survives_json_with_its_digest() {
    let names: Vec<String> = shipped().iter().map(|model| model.name().to_string()).collect();
    assert_eq!(names, ["nite-table1@1", "kinect-v1@1", "kinect-v2@1"]);
    for model in shipped() {
        assert!(model.observation.cholesky().is_some());
        assert_eq!(model.observation, model.observation.transpose());
        let text = serde_json::to_string(model).unwrap();
        let again: NoiseModel = serde_json::from_str(&text).unwrap();
        assert_eq!((again.sha256(), &again), (model.sha256(), model));
        for (left, right) in [(Limb::LeftArm, Limb::RightArm), (Limb::LeftLeg, Limb::RightLeg)] {
            for level in 0..3 {
                let white = |limb| model.document().point(limb, level).unwrap().white_sd_mm;
                assert_eq!(white(left), white(right), "{}", model.name());
            }
        }
    }
}

#[test]
fn shipped_models_of_sensors_say_what_they_were_trained_on() {
    for model in &shipped()[1..] {
        let training = model.document().training.as_ref().unwrap();
        assert!(training.white_s >= 20.0, "{}", model.name());
        assert!(!training.movement_recordings.is_empty(), "{}", model.name());
        assert!(model.document().description.contains("subject"), "{}", model.document().description);
    }
}

#[test]
fn table_1_stands_in_the_order_of_points_and_states() {
    let model = table1();
    let hand = 3 * point_index(Limb::LeftArm, 2);
    let sd: Vec<f64> = (0..3).map(|axis| model.observation[(hand + axis, hand + axis)].sqrt()).collect();
    for (found, expected) in sd.iter().zip([0.1515, 0.1817, 0.0145]) {
        assert!((found - expected).abs() < 1e-12, "{found}");
    }
    assert!((model.transition_sd[hinge_offset(3)].to_degrees() - 1.31).abs() < 1e-12);
    assert!((model.transition_sd[attitude_offset(2) + 2].to_degrees() - 2.76).abs() < 1e-12);
    // Half the variance of the hip is common: 0.5 · 6.0² mm².
    let knee = 3 * point_index(Limb::RightLeg, 1);
    assert!((model.observation[(hand, knee)] - 18e-6).abs() < 1e-12);
}

#[test]
fn a_version_of_a_shipped_model_that_does_not_exist_is_not_found() {
    assert!(find_shipped(&"kinect-v2@1".parse().unwrap()).is_some());
    assert!(find_shipped(&"kinect-v2@2".parse().unwrap()).is_none());
    assert!(find_shipped(&"kinect-v9".parse().unwrap()).is_none());
}

#[test]
fn documents_that_describe_no_model_are_refused_with_the_place() {
    assert!(refusal(|d| d.name = "Kinect".into()).starts_with("name: "));
    assert!(refusal(|d| d.version = 0).starts_with("version: "));
    assert!(refusal(|d| d.points.swap(0, 3)).contains("left_shoulder, left_elbow"));
    assert!(refusal(|d| d.points[3].white_sd_mm[1] = 0.0).starts_with("points[3].white_sd_mm: 0 millimetres"));
    assert!(refusal(|d| d.points[3].white_sd_mm[1] = f64::NAN).contains("NaN"));
    assert!(refusal(|d| d.points[0].slow_offset_sd_mm = -1.0).contains("slow_offset_sd_mm"));
    assert!(refusal(|d| d.transition_sd_deg.knee = 90.0).starts_with("transition_sd_deg.knee"));
    assert!(refusal(|d| d.correlations[4][4] = 1.5).starts_with("correlations[4][4]: 1.5"));
    assert!(refusal(|d| d.correlations.truncate(34)).contains("35 lists"));
    assert!(refusal(|d| d.correlations[7].truncate(7)).contains("8 numbers"));
}

#[test]
fn correlations_that_contradict_each_other_are_refused() {
    // a follows b and b follows c, yet a is the opposite of c.
    let sentence = refusal(|d| {
        d.correlations[0] = vec![0.9];
        d.correlations[1] = vec![-0.9, 0.9];
    });
    assert!(sentence.contains("not positive definite"), "{sentence}");
}
