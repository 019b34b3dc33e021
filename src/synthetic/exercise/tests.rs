use super::*;
use crate::body::Limb;
use crate::body::anatomical_angles::{Angles, angles_of_pose, leg_offset};
use crate::body::kinematics::forward_kinematics;
use crate::body::pose::PoseVector;
use crate::body::range_of_motion::RangeOfMotion;
use crate::body::skeleton::point_index;

const DURATION_S: f64 = 20.0;
const STEP_S: f64 = 1.0 / 60.0;

fn times() -> impl Iterator<Item = f64> {
    (0..).map(|i| f64::from(i) * STEP_S).take_while(|t| *t <= DURATION_S)
}

/// Smallest and largest value of an angle over an exercise, degrees.
fn extremes_deg(exercise: Exercise, subject: &Subject, angle: impl Fn(&Angles) -> f64) -> [f64; 2] {
    let values = times().map(|t| angle(&angles_of_pose(&exercise.stance(subject, DURATION_S, t).pose).0).to_degrees());
    values.fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], v| [low.min(v), high.max(v)])
}

fn people() -> impl Iterator<Item = Subject> {
    (0..6).map(|seed| Subject::of_seed(seed, 1.5 + 0.08 * seed as f64))
}

#[test]
fn each_exercise_moves_its_joint_on_both_sides_by_the_expected_amount_and_sign() {
    for subject in people() {
        for side in Side::BOTH {
            let leg = leg_offset(side);
            let [low, high] = extremes_deg(Exercise::BackKnee, &subject, |a| a[leg + 3]);
            assert!(low >= 0.0 && (60.0..115.0).contains(&high), "back_knee {side:?}: knee {low}..{high}");
            let [low, high] = extremes_deg(Exercise::SideHip, &subject, |a| a[leg + 1]);
            assert!(low > -15.0 && (20.0..45.0).contains(&high), "side_hip {side:?}: abduction {low}..{high}");
            let [_, high] = extremes_deg(Exercise::SitFrontKnee, &subject, |a| a[leg]);
            assert!((80.0..145.0).contains(&high), "sit_front_knee {side:?}: hip flexion up to {high}");
            let [_, high] = extremes_deg(Exercise::SitFrontKnee, &subject, |a| a[leg + 3]);
            assert!((80.0..125.0).contains(&high), "sit_front_knee {side:?}: knee up to {high}");
            let [_, high] = extremes_deg(Exercise::Step, &subject, |a| a[leg]);
            assert!((30.0..90.0).contains(&high), "step {side:?}: hip flexion up to {high}");
            let [_, high] = extremes_deg(Exercise::Step, &subject, |a| a[leg + 3]);
            assert!((35.0..100.0).contains(&high), "step {side:?}: knee up to {high}");
        }
    }
}

#[test]
fn a_seated_subject_straightens_each_knee_in_turn() {
    for subject in people() {
        for side in Side::BOTH {
            let seated = times().filter(|t| *t > 7.0);
            let knee = seated.map(|t| {
                let stance = Exercise::SitFrontKnee.stance(&subject, DURATION_S, t);
                stance.pose.hinges[limbs_of(side).1.index()].to_degrees()
            });
            let [low, high] = knee.fold([f64::INFINITY, 0.0], |[l, h]: [f64; 2], v| [l.min(v), h.max(v)]);
            assert!(low < 40.0 && high > 80.0, "{side:?}: {low}..{high}");
        }
    }
}

#[test]
fn in_near_tandem_the_feet_stand_one_before_the_other() {
    for subject in people() {
        let stance = Exercise::NearTandem.stance(&subject, DURATION_S, 12.0);
        let points = forward_kinematics(&subject.skeleton, &stance.pose);
        let [left, right] = [Limb::LeftLeg, Limb::RightLeg].map(|leg| points[point_index(leg, 2)]);
        assert!((right.x - left.x).abs() > 0.18, "{left} {right}");
        assert!((right.z - left.z).abs() < 0.09, "{left} {right}");
    }
}

#[test]
fn every_exercise_starts_at_rest_in_the_t_posture() {
    for subject in people() {
        for exercise in Exercise::ALL {
            let first = exercise.stance(&subject, DURATION_S, 0.0);
            for t in times().take_while(|t| *t < REST_S) {
                let stance = exercise.stance(&subject, DURATION_S, t);
                let theta = stance.pose.to_vector(&PoseVector::zeros());
                // Knees are not locked and toes point outwards by up to 4°; sway adds a fraction of a degree.
                assert!(theta.amax() < 6f64.to_radians(), "{exercise} at {t}: {theta}");
                let points = forward_kinematics(&subject.skeleton, &stance.pose);
                let start = forward_kinematics(&subject.skeleton, &first.pose);
                let moved = points.iter().zip(&start).map(|(a, b)| (a - b).norm()).fold(0.0, f64::max);
                assert!(moved < 0.012, "{exercise} moved by {moved} m within {t} s");
            }
        }
    }
}

#[test]
fn every_posture_is_within_the_range_of_motion() {
    let range = RangeOfMotion::healthy_adult();
    for subject in people() {
        for exercise in Exercise::ALL {
            let mut theta = PoseVector::zeros();
            for t in times() {
                theta = exercise.stance(&subject, DURATION_S, t).pose.to_vector(&theta);
                assert!(range.contains(&theta), "{exercise} at {t}: {}", theta.map(f64::to_degrees));
            }
        }
    }
}

#[test]
fn movements_are_smooth() {
    for subject in people() {
        for exercise in Exercise::ALL {
            let angles = |t: f64| angles_of_pose(&exercise.stance(&subject, DURATION_S, t).pose).0;
            for t in times().skip(1) {
                let (before, here, after) = (angles(t - STEP_S), angles(t), angles(t + STEP_S));
                let speed = (after - here).amax() / STEP_S;
                assert!(speed < 500f64.to_radians(), "{exercise} at {t}: {} deg/s", speed.to_degrees());
                let acceleration = (after - 2.0 * here + before).amax() / (STEP_S * STEP_S);
                // A step of 3° from one sample to the next would be 10 800 deg/s²; a foot that leaves the floor with a
                // nearly straight knee comes to 6 600.
                assert!(acceleration < 8000f64.to_radians(), "{exercise} at {t}: {} deg/s2", acceleration.to_degrees());
            }
        }
    }
}

#[test]
fn a_standing_foot_stays_on_its_place() {
    for subject in people() {
        for exercise in [Exercise::BackKnee, Exercise::SideHip, Exercise::Step] {
            for side in Side::BOTH {
                let (_, limb) = limbs_of(side);
                let home = standing(&subject, 1.0, 0.0).legs[side as usize].ankle;
                let moving = |t: f64| {
                    let active = ActiveTime { start_s: REST_S + ARMS_DOWN_S, end_s: DURATION_S - END_S };
                    let mut posture = standing(&subject, 1.0, t);
                    match exercise {
                        Exercise::BackKnee => back_knee::shape(&mut posture, &subject, active, t),
                        Exercise::SideHip => side_hip::shape(&mut posture, &subject, active, t),
                        _ => step::shape(&mut posture, &subject, active, t),
                    }
                    let leg = posture.legs[side as usize];
                    leg.lift > 0.0 || leg.ankle != home
                };
                for t in times().filter(|t| !moving(*t)) {
                    let stance = exercise.stance(&subject, DURATION_S, t);
                    let points = forward_kinematics(&subject.skeleton, &stance.pose);
                    let ankle = stance.torso + points[point_index(limb, 2)];
                    assert!((ankle - home).norm() < 0.004, "{exercise} {side:?} at {t}: {}", (ankle - home).norm());
                }
            }
        }
    }
}

#[test]
fn no_foot_goes_through_the_floor() {
    for subject in people() {
        let floor = ANKLE_HEIGHT_SHARE * subject.stature_m;
        for exercise in Exercise::ALL {
            for t in times() {
                let stance = exercise.stance(&subject, DURATION_S, t);
                let points = forward_kinematics(&subject.skeleton, &stance.pose);
                for leg in [Limb::LeftLeg, Limb::RightLeg] {
                    let height = (stance.torso + points[point_index(leg, 2)]).y - floor;
                    assert!(height > -0.01, "{exercise} at {t}: {leg:?} at {height} m");
                }
            }
        }
    }
}

#[test]
fn names_parse_back_and_unknown_ones_are_refused() {
    for exercise in Exercise::ALL {
        assert_eq!(exercise.name().parse(), Ok(exercise));
    }
    assert_eq!("jump".parse::<Exercise>(), Err(UnknownExercise("jump".into())));
}
