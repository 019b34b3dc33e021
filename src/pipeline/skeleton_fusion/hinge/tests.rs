use super::*;
use nalgebra::Rotation3;

const RATE_HZ: f64 = 100.0;
const GRAVITY: f64 = 9.81;
/// Time of quiet standing or sitting before the movement, s.
const QUIET: f64 = 5.0;

/// A leg that bends and stretches while it walks about, with a unit on each segment.
struct Leg {
    /// Thigh and shank unit in their segments (x forwards, y up, z to the right).
    segment_from_imu: [UnitQuaternion<f64>; 2],
    /// Angle of the thigh from upright while quiet, rad; with the knee bent by as much.
    seat: f64,
    /// Change of the distal unit's heading, rad/s.
    drift: f64,
    seconds: f64,
}

/// One unit's samples.
struct Motion {
    time_ns: Vec<i64>,
    acceleration: Vec<Vector3<f64>>,
    angular_rate: Vec<Vector3<f64>>,
    earth_from_imu: Vec<UnitQuaternion<f64>>,
}

impl Motion {
    fn unit(&self) -> UnitMotion<'_> {
        UnitMotion {
            time_ns: &self.time_ns,
            acceleration: &self.acceleration,
            angular_rate: &self.angular_rate,
            earth_from_imu: &self.earth_from_imu,
        }
    }
}

impl Leg {
    fn new() -> Self {
        let mount = |r: f64, p: f64, y: f64| UnitQuaternion::from_euler_angles(r, p, y);
        Self {
            segment_from_imu: [mount(0.7, -0.4, 2.0), mount(-2.0, 1.1, 0.3)],
            seat: 0.0,
            drift: 0.002,
            seconds: 60.0,
        }
    }

    /// Flexion of the knee, rad.
    fn flexion(&self, t: f64) -> f64 {
        let moving = (t - QUIET).max(0.0);
        self.seat + 0.6 * (1.0 - (2.5 * moving).cos())
    }

    fn earth_from_segment(&self, unit: usize, t: f64) -> Rotation3<f64> {
        let moving = (t - QUIET).max(0.0);
        let thigh = self.seat + 0.4 * (self.flexion(t) - self.seat);
        let pitch = if unit == 0 { thigh } else { thigh - self.flexion(t) };
        Rotation3::from_axis_angle(&Vector3::y_axis(), 0.4 * (0.3 * moving).sin())
            * Rotation3::from_axis_angle(&Vector3::x_axis(), 0.06 * (1.3 * moving).sin())
            * Rotation3::from_axis_angle(&Vector3::z_axis(), pitch)
    }

    /// Place of a unit in the world, m.
    fn place(&self, unit: usize, t: f64) -> Vector3<f64> {
        let moving = (t - QUIET).max(0.0);
        let joint = Vector3::new(0.3 * (1.7 * moving).sin(), 0.05 * (3.1 * moving).sin(), 0.1 * (1.1 * moving).sin());
        let from_joint = [Vector3::new(0.06, 0.2, 0.02), Vector3::new(0.05, -0.15, -0.03)][unit];
        joint + self.earth_from_segment(unit, t) * from_joint
    }

    fn motion(&self, unit: usize) -> Motion {
        let mut motion = Motion {
            time_ns: Vec::new(),
            acceleration: Vec::new(),
            angular_rate: Vec::new(),
            earth_from_imu: Vec::new(),
        };
        // Derivatives over a step that is short beside the movement and long beside rounding.
        let h = 1e-4;
        for i in 0..(self.seconds * RATE_HZ) as i64 {
            let t = i as f64 / RATE_HZ;
            let attitude =
                |t: f64| UnitQuaternion::from(self.earth_from_segment(unit, t)) * self.segment_from_imu[unit];
            let rate = (attitude(t - h).inverse() * attitude(t + h)).scaled_axis() / (2.0 * h);
            let acceleration =
                (self.place(unit, t + h) - self.place(unit, t) * 2.0 + self.place(unit, t - h)) / (h * h);
            let drift = UnitQuaternion::from_axis_angle(&Vector3::y_axis(), unit as f64 * (1.0 + self.drift * t));
            motion.time_ns.push((t * 1e9) as i64);
            motion.acceleration.push(attitude(t).inverse() * (acceleration + Vector3::y() * GRAVITY));
            motion.angular_rate.push(rate);
            motion.earth_from_imu.push(drift * attitude(t));
        }
        motion
    }

    fn motions(&self) -> [Motion; 2] {
        [self.motion(0), self.motion(1)]
    }
}

fn units(motions: &[Motion; 2]) -> [UnitMotion<'_>; 2] {
    [motions[0].unit(), motions[1].unit()]
}

/// Root mean square difference from the true flexion, degrees.
fn error_deg(leg: &Leg, angles: &HingeAngles, offset: f64) -> f64 {
    let square = |(time, angle): (&i64, &f64)| (angle - leg.flexion(*time as f64 * 1e-9) - offset).powi(2);
    let sum: f64 = angles.time_ns.iter().zip(&angles.flexion).map(square).sum();
    (sum / angles.flexion.len() as f64).sqrt().to_degrees()
}

#[test]
fn axes_sense_zero_and_flexion_of_a_knee_are_found_whatever_the_mounting_and_although_heading_drifts() {
    let mut leg = Leg::new();
    for turn in 0..3 {
        leg.segment_from_imu[1] *= UnitQuaternion::from_euler_angles(0.9 * f64::from(turn), 0.5, -0.7);
        let motions = leg.motions();
        let hinge = axes(&units(&motions)).unwrap();
        // Bending the knee turns the shank backwards, about the leftward axis.
        for (unit, axis) in [hinge.proximal_axis_in_imu, hinge.distal_axis_in_imu].iter().enumerate() {
            let truth = leg.segment_from_imu[unit].inverse() * -Vector3::z();
            assert!(axis.dot(&truth) > 1.0_f64.to_radians().cos(), "unit {unit}: {axis} is not {truth}");
        }
        assert!(hinge.is_flexion_sense_known && hinge.opposite_end_ratio > 2.0, "{hinge:?}");
        let shank = leg.segment_from_imu[1] * hinge.distal_from_joint_m;
        // Metres; along the axis the place moves nothing and is hardly seen.
        assert!((shank - Vector3::new(0.05, -0.15, -0.03)).norm() < 0.03, "the shank's unit at {shank}");
        let angles = flexion(&units(&motions), &hinge, HeadingModel::Tracked, Zero::Standing).unwrap();
        let error = error_deg(&leg, &angles, 0.0);
        assert!(error < 0.5, "{error} degrees");
        assert!(angles.standing.is_some_and(|standing| standing.stretches[0].start == 0));
    }
}

#[test]
fn who_only_sits_gives_no_zero() {
    let leg = Leg { seat: 80.0_f64.to_radians(), ..Leg::new() };
    let motions = leg.motions();
    let hinge = axes(&units(&motions)).unwrap();
    let angles = flexion(&units(&motions), &hinge, HeadingModel::Tracked, Zero::Standing).unwrap();
    assert_eq!(angles.standing, None);
}

#[test]
fn a_drifting_heading_costs_accuracy_when_it_is_taken_as_constant() {
    let leg = Leg { drift: 0.01, ..Leg::new() };
    let motions = leg.motions();
    let hinge = axes(&units(&motions)).unwrap();
    let heading_error = |model: HeadingModel| {
        let angles = flexion(&units(&motions), &hinge, model, Zero::Standing).unwrap();
        let third = angles.heading.len() / 3;
        (angles.heading[2 * third] - angles.heading[third] + 0.01 * leg.seconds / 3.0).abs()
    };
    assert!(heading_error(HeadingModel::Tracked) < 0.05, "{}", heading_error(HeadingModel::Tracked));
    assert!(heading_error(HeadingModel::Constant) > 0.15);
}

#[test]
fn a_leg_that_hardly_moves_has_no_axis() {
    let leg = Leg { seconds: QUIET + 1.0, ..Leg::new() };
    let motions = leg.motions();
    assert!(matches!(axes(&units(&motions)), Err(HingeError::TooLittleMovement { .. })));
}

#[test]
fn units_that_never_measured_together_are_refused() {
    let mut motions = Leg::new().motions();
    motions[1].time_ns.iter_mut().for_each(|time| *time += 100_000_000_000);
    assert_eq!(axes(&units(&motions)), Err(HingeError::NoOverlap { seconds: 0.0 }));
    motions[1].time_ns.pop();
    assert_eq!(axes(&units(&motions)), Err(HingeError::UnequalLengths));
}

#[test]
fn the_same_samples_give_the_same_bits() {
    let motions = Leg::new().motions();
    let run = || {
        let hinge = axes(&units(&motions)).unwrap();
        flexion(&units(&motions), &hinge, HeadingModel::Tracked, Zero::Standing).unwrap()
    };
    assert_eq!(run(), run());
}
