use super::*;
use crate::body::Limb;
use crate::body::anatomical_angles::angles_of_pose;
use crate::body::kinematics::forward_kinematics;
use crate::body::pose::{PoseVector, hinge_offset};
use crate::body::range_of_motion::RangeOfMotion;
use crate::body::skeleton::point_index;
use crate::synthetic::posture::ANKLE_HEIGHT_SHARE;
use crate::synthetic::{Preset, SimulationSettings, simulate};

const ACTIVE: ActiveTime = ActiveTime { start_s: 4.0, end_s: 24.0 };
const STEP_S: f64 = 1.0 / 64.0;

fn stances(movement: &Movement, subject: &Subject) -> Vec<Stance> {
    (0..1600).map(|i| movement.stance(subject, ACTIVE, f64::from(i) * STEP_S, |_| {})).collect()
}

/// Range of a limb's hinge, degrees, during the movement.
fn hinge_range(stances: &[Stance], limb: Limb) -> f64 {
    let hinges = stances[400..].iter().map(|stance| stance.pose.hinges[limb.index()].to_degrees());
    let [low, high] = hinges.fold([f64::INFINITY, f64::NEG_INFINITY], |[l, h], v| [l.min(v), h.max(v)]);
    high - low
}

#[test]
fn a_kick_moves_one_knee_and_the_elbow_movement_both_elbows() {
    for seed in 0..4 {
        let subject = Subject::of_seed(seed, 1.7);
        let kick = stances(&Movement::Kick(Side::Right), &subject);
        assert!(hinge_range(&kick, Limb::RightLeg) > 55.0 && hinge_range(&kick, Limb::LeftLeg) < 15.0);
        let elbow = stances(&Movement::Elbow, &subject);
        assert!(hinge_range(&elbow, Limb::RightArm) > 80.0 && hinge_range(&elbow, Limb::LeftArm) > 80.0);
    }
}

#[test]
fn movements_stay_in_the_range_of_motion_above_the_floor_and_are_smooth() {
    let range = RangeOfMotion::healthy_adult();
    for movement in Movement::OF_FUSION {
        for seed in 0..4 {
            let subject = Subject::of_seed(seed, 1.7);
            let stances = stances(&movement, &subject);
            let mut theta = PoseVector::zeros();
            let mut angles = Vec::new();
            for stance in &stances {
                theta = stance.pose.to_vector(&theta);
                assert!(range.contains(&theta), "{movement}: {}", theta.map(f64::to_degrees));
                let points = forward_kinematics(&subject.skeleton, &stance.pose);
                for leg in [Limb::LeftLeg, Limb::RightLeg] {
                    let height = (stance.torso + points[point_index(leg, 2)]).y;
                    assert!(height > ANKLE_HEIGHT_SHARE * 1.7 - 0.01, "{movement}: {leg:?} at {height}");
                }
                angles.push(angles_of_pose(&stance.pose).0);
            }
            for w in angles.windows(3) {
                let acceleration = (w[2] - 2.0 * w[1] + w[0]).amax() / (STEP_S * STEP_S);
                assert!(acceleration < 8000f64.to_radians(), "{movement}: {} deg/s2", acceleration.to_degrees());
            }
        }
    }
}

#[test]
fn a_recorded_motion_is_followed_and_smooth() {
    let settings = SimulationSettings::new(Exercise::SideHip, Preset::Table1, 3);
    let source = simulate(&settings).unwrap();
    let motion = RecordedMotion::fit(&source.recording).unwrap();
    assert!((motion.stature_m() - 1.7).abs() < 0.1, "{}", motion.stature_m());
    assert!((motion.duration_s() - 20.0).abs() < 0.1);
    let frames = source.recording.skeleton.as_ref().unwrap().time_ns.iter().zip(&source.stances);
    let mut squares = 0.0;
    for (time, stance) in frames.clone() {
        let fitted = motion.stance(*time as f64 * 1e-9);
        squares += (fitted.pose.hinges[3] - stance.pose.hinges[3]).to_degrees().powi(2);
        assert!((fitted.torso - stance.torso).norm() < 0.2, "{}", fitted.torso - stance.torso);
    }
    let rms = (squares / frames.len() as f64).sqrt();
    assert!(rms < 5.0, "{rms}°");
    let theta = |t: f64| motion.forth_and_back(t).pose.to_vector(&PoseVector::zeros())[hinge_offset(3)];
    let pass_s = motion.pass_s();
    assert!((theta(pass_s - 3.0) - theta(pass_s + 3.0)).abs() < 1e-9, "the way back is the way there");
    assert!((theta(pass_s) - motion.stance(motion.duration_s()).pose.hinges[3]).abs() < 1e-9);
    for i in 10..4500 {
        let (t, h) = (f64::from(i) / 100.0, 0.01);
        let acceleration = (theta(t + h) - 2.0 * theta(t) + theta(t - h)) / (h * h);
        assert!(acceleration.abs() < 6000f64.to_radians(), "{t}: {}", acceleration.to_degrees());
    }
}

#[test]
fn going_over_into_a_recorded_motion_is_smooth_also_when_an_arm_is_far_away() {
    let standing = Subject::of_seed(1, 1.7);
    let (from, mut to) = {
        let stance = Movement::Elbow.stance(&standing, ACTIVE, 4.0, |_| {});
        (stance.clone(), stance)
    };
    to.pose.limbs[0] = nalgebra::Rotation3::new(nalgebra::Vector3::new(-1.9, 0.2, 0.1));
    let at = |share: f64| {
        let turned = nalgebra::Rotation3::new(nalgebra::Vector3::new(0.0, 0.3 * share, 0.0));
        let to = Stance { pose: Pose { trunk: to.pose.trunk * turned, ..to.pose.clone() }, ..to.clone() };
        blend(&from, &to, share).pose.limbs[0]
    };
    for i in 1..1000 {
        let turn = at(f64::from(i) / 1000.0).angle_to(&at(f64::from(i - 1) / 1000.0));
        assert!(turn < 0.02, "{i}: {turn}");
    }
}

#[test]
fn motions_of_the_data_sets_have_the_accelerations_of_a_body() {
    use crate::recording::import::{Dataset, list};
    let root = std::env::var("SUREFOOT_DATA").unwrap_or_else(|_| "../shared/data".into());
    for dataset in [Dataset::Cmu, Dataset::Uiprmd] {
        let Ok(sources) = list(dataset, std::path::Path::new(&format!("{root}/skeleton"))) else {
            println!("skipped: {} is not below {root}", dataset.name());
            continue;
        };
        for source in sources.iter().step_by(7) {
            let motion = RecordedMotion::fit(&source.read().unwrap().recording).unwrap();
            let torso = |t: f64| motion.forth_and_back(t).torso;
            let h = 0.02;
            let mut t = 2.0 * h;
            while t < 2.0 * motion.pass_s() {
                let acceleration = (torso(t + h) - 2.0 * torso(t) + torso(t - h)).norm() / (h * h);
                // Nobody in these recordings jumps: the trunk stays below one g.
                assert!(acceleration < 9.81, "{} at {t}: {acceleration} m/s²", source.name);
                t += h;
            }
        }
    }
}

#[test]
fn names_parse_back_and_unknown_ones_are_refused_with_what_there_is() {
    for movement in Movement::OF_FUSION.into_iter().chain(Exercise::ALL.map(Movement::Exercise)) {
        assert_eq!(movement.name().parse(), Ok(movement));
    }
    let refusal = "jump".parse::<Movement>().unwrap_err().to_string();
    assert!(refusal.contains("near_tandem") && refusal.contains("kick_left"));
}
