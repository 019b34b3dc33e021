//! A figure that jumps, kicks and bends its elbows, closed form in time, with a camera and nine units.

use crate::body::{Bone, Joint, Limb, Side};
use crate::recording::{InertialSensor, Segment, SkeletonRecording};
use nalgebra::{Rotation3, UnitQuaternion, Vector3};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rand_distr::StandardNormal;
use std::f64::consts::PI;

/// What the figure does.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Moves {
    /// Five jumps from 3 s on, then standing.
    JumpsOnly,
    /// Five jumps, then kicks and elbow bends of varying size until the end.
    JumpsThenKicks,
    /// Kicks and elbow bends of varying size.
    Kicks,
    /// Kicks and elbow bends that are all alike, a second apart.
    EvenKicks,
    /// Standing without any sway.
    Still,
}

/// The true clock of a unit: camera = unit + offset + drift (unit − origin).
#[derive(Debug, Clone, Copy)]
pub(super) struct Clock {
    pub offset_s: f64,
    pub drift: f64,
    /// Time of the unit's clock at which the offset holds, seconds.
    pub origin_s: f64,
}

impl Clock {
    pub(super) fn camera_ns(&self, unit_ns: i64) -> i64 {
        let elapsed = unit_ns as f64 - self.origin_s * 1e9;
        unit_ns + (self.offset_s * 1e9 + self.drift * elapsed).round() as i64
    }

    pub(super) fn unit_s(&self, camera_s: f64) -> f64 {
        self.origin_s + (camera_s - self.offset_s - self.origin_s) / (1.0 + self.drift)
    }
}

pub(super) struct Figure {
    pub moves: Moves,
    pub duration_s: f64,
    pub seed: u64,
    pub clocks: Vec<(Segment, Clock)>,
    /// Standard deviation of a joint's jitter, metres.
    pub jitter_m: f64,
}

const JUMPS: usize = 5;
const FIRST_JUMP_S: f64 = 4.0;
const JUMP_EVERY_S: f64 = 1.9;
const FLIGHT_S: f64 = 0.4;
const PUSH_S: f64 = 0.5;
const G: f64 = 9.80665;

/// Attitude of a segment and the point where its unit sits.
struct Placed {
    world_from_segment: Rotation3<f64>,
    point: Vector3<f64>,
}

/// Joint positions and placed segments.
type Body = (Vec<(Joint, Vector3<f64>)>, Vec<(Segment, Placed)>);

fn bump(x: f64) -> f64 {
    if (0.0..1.0).contains(&x) { (PI * x).sin().powi(4) } else { 0.0 }
}

/// Height of a jump's push-off at `s` of [`PUSH_S`]: at rest at 0, at the end at 0 with the speed of take-off.
fn push_height(s: f64) -> f64 {
    let x = (s / PUSH_S).clamp(0.0, 1.0);
    let (v, a) = (0.5 * G * FLIGHT_S * PUSH_S, 12.0 * PUSH_S * PUSH_S);
    // Quintic with value, slope and curvature 0 at 0 and 0, v, a at 1.
    x.powi(3) * ((-4.0 * v + 0.5 * a) + x * ((7.0 * v - a) + x * (-3.0 * v + 0.5 * a)))
}

impl Figure {
    pub(super) fn new(moves: Moves, duration_s: f64, seed: u64) -> Self {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let clocks = Bone::ALL
            .into_iter()
            .map(|bone| {
                let clock = Clock {
                    offset_s: rng.random_range(-2.0..2.0),
                    drift: rng.random_range(-100e-6..100e-6),
                    origin_s: 0.0,
                };
                (Segment::of_bone(bone), clock)
            })
            .collect();
        Self { moves, duration_s, seed, clocks, jitter_m: 1e-3 }
    }

    pub(super) fn clock(&self, segment: Segment) -> Clock {
        self.clocks.iter().find(|(s, _)| *s == segment).expect("a clock").1
    }

    /// Height above standing, and how far legs are bent, 0 to 1.
    fn jump(&self, t: f64) -> (f64, f64) {
        if !matches!(self.moves, Moves::JumpsOnly | Moves::JumpsThenKicks) {
            return (0.0, 0.0);
        }
        for i in 0..JUMPS {
            let take_off = FIRST_JUMP_S + i as f64 * JUMP_EVERY_S + 0.07 * (i % 2) as f64;
            let s = t - take_off;
            if (-PUSH_S..=FLIGHT_S + PUSH_S).contains(&s) {
                let bend = bump((s + PUSH_S) / PUSH_S) + bump((s - FLIGHT_S) / PUSH_S);
                let height = if s < 0.0 {
                    push_height(s + PUSH_S)
                } else if s < FLIGHT_S {
                    0.5 * G * s * (FLIGHT_S - s)
                } else {
                    push_height(PUSH_S - (s - FLIGHT_S))
                };
                return (height, bend);
            }
        }
        (0.0, 0.0)
    }

    /// Time since the last landing, seconds.
    fn since_landing(&self, t: f64) -> Option<f64> {
        if !matches!(self.moves, Moves::JumpsOnly | Moves::JumpsThenKicks) {
            return None;
        }
        (0..JUMPS)
            .map(|i| t - (FIRST_JUMP_S + i as f64 * JUMP_EVERY_S + 0.07 * (i % 2) as f64 + FLIGHT_S))
            .filter(|s| (0.0..1.0).contains(s))
            .reduce(f64::min)
    }

    /// Swing of a limb, 0 to about 1: one kick or bend after another, limbs in turn.
    fn swing(&self, limb: usize, t: f64) -> f64 {
        let (from, size_varies, period) = match self.moves {
            Moves::JumpsThenKicks => (16.0, true, 2.3),
            Moves::Kicks => (2.0, true, 2.3),
            Moves::EvenKicks => (-10.0, false, 1.0),
            _ => return 0.0,
        };
        let s = t - from - 0.25 * limb as f64 * period;
        if s < 0.0 {
            return 0.0;
        }
        let k = (s / period).floor();
        let random = |salt: f64| ((k * 12.9898 + limb as f64 * 78.233 + salt).sin() * 43758.5453).fract().abs();
        let (size, lasts) = if size_varies { (0.5 + 0.6 * random(0.0), 0.9 + 0.9 * random(1.0)) } else { (1.0, 0.95) };
        size * bump((s - k * period) / lasts)
    }

    /// Joint positions and placed segments at a time of the camera, seconds.
    fn at(&self, t: f64) -> Body {
        let (height, bend) = self.jump(t);
        let sway = if self.moves == Moves::Still { 0.0 } else { 0.003 };
        let pelvis = Vector3::new(sway * (0.7 * t).sin(), 0.95 + height, -2.5 + sway * (1.1 * t).cos());
        let trunk = Rotation3::from_axis_angle(&Vector3::x_axis(), 0.25 * bend)
            * Rotation3::from_axis_angle(&Vector3::y_axis(), 0.08 * self.swing(0, t));
        let neck = pelvis + trunk * Vector3::new(0.0, 0.5, 0.0);
        let mut joints = vec![
            (Joint::Pelvis, pelvis),
            (Joint::Torso, pelvis + trunk * Vector3::new(0.0, 0.25, 0.0)),
            (Joint::SpineShoulder, neck),
            (Joint::Head, neck + trunk * Vector3::new(0.0, 0.2, 0.0)),
        ];
        let chest = pelvis + trunk * Vector3::new(0.0, 0.38, 0.08);
        let mut placed = vec![(Segment::Chest, Placed { world_from_segment: trunk, point: chest })];
        for limb in Limb::ALL {
            // The figure faces +z, where the camera is, so its left is at +x.
            let side = if limb.side() == Side::Left { 1.0 } else { -1.0 };
            let swing = self.swing(limb.index(), t);
            let (root, lengths, proximal, hinge) = if limb.is_arm() {
                let lift = 0.9 * bend + 0.35 * swing;
                (trunk * Vector3::new(0.18 * side, 0.48, 0.0), [0.3, 0.25], lift, 1.6 * swing)
            } else {
                let lift = 0.8 * bend + 0.9 * swing;
                (trunk * Vector3::new(0.1 * side, 0.0, 0.0), [0.42, 0.42], lift, -1.3 * bend - 0.5 * swing)
            };
            let start = pelvis + root;
            let upper = trunk
                * Rotation3::from_axis_angle(&Vector3::z_axis(), 0.1 * side * (1.0 + swing))
                * Rotation3::from_axis_angle(&Vector3::x_axis(), -proximal)
                // A turn about the bone that the camera cannot see.
                * Rotation3::from_axis_angle(&Vector3::y_axis(), 0.3 * swing);
            let lower = upper * Rotation3::from_axis_angle(&Vector3::x_axis(), -hinge);
            let middle = start + upper * Vector3::new(0.0, -lengths[0], 0.0);
            let end = middle + lower * Vector3::new(0.0, -lengths[1], 0.0);
            for ((joint, _), position) in limb.joints().into_iter().zip([start, middle, end]) {
                joints.push((joint, position));
            }
            let off = Vector3::new(0.05 * side, 0.0, 0.03);
            let upper_unit = start + upper * (Vector3::new(0.0, -0.6 * lengths[0], 0.0) + off);
            let lower_unit = middle + lower * (Vector3::new(0.0, -0.6 * lengths[1], 0.0) + off);
            placed.push((
                Segment::of_bone(Bone::Proximal(limb)),
                Placed { world_from_segment: upper, point: upper_unit },
            ));
            placed
                .push((Segment::of_bone(Bone::Distal(limb)), Placed { world_from_segment: lower, point: lower_unit }));
        }
        (joints, placed)
    }

    pub(super) fn skeleton(&self) -> SkeletonRecording {
        let mut rng = ChaCha8Rng::seed_from_u64(self.seed ^ 1);
        let mut noise = |sd: f64| sd * rng.sample::<f64, _>(StandardNormal);
        let joints: Vec<Joint> = self.at(0.0).0.into_iter().map(|(joint, _)| joint).collect();
        let constant: Vec<Vector3<f64>> = joints.iter().map(|_| Vector3::from_fn(|_, _| noise(0.03))).collect();
        let with_posture: Vec<Vector3<f64>> = joints.iter().map(|_| Vector3::from_fn(|_, _| noise(0.1))).collect();
        let rest = self.at(0.0).0;
        let mut skeleton = SkeletonRecording { joints, ..SkeletonRecording::default() };
        for i in 0..(self.duration_s * 30.0) as i64 {
            let t = i as f64 / 30.0 + noise(0.003).clamp(-0.01, 0.01);
            skeleton.time_ns.push((t * 1e9) as i64 + (noise(1e6) as i64).clamp(-3_000_000, 3_000_000));
            for (j, (_, p)) in self.at(t).0.into_iter().enumerate() {
                // The bias grows with the distance from the posture at the start: 10 % of it.
                let moved = (p - rest[j].1).norm();
                let jitter = Vector3::from_fn(|_, _| noise(self.jitter_m));
                skeleton.positions.push(p + constant[j] + with_posture[j] * moved + jitter);
                skeleton.confidence.push(1.0);
            }
        }
        skeleton
    }

    pub(super) fn unit(&self, segment: Segment) -> InertialSensor {
        const STEP: f64 = 1e-3;
        let clock = self.clock(segment);
        let mut rng = ChaCha8Rng::seed_from_u64(self.seed ^ (1000 + segment as u64));
        let mut noise = |sd: f64| sd * rng.sample::<f64, _>(StandardNormal);
        let mounting = Rotation3::new(Vector3::from_fn(|_, _| noise(1.0)));
        let bias = Vector3::from_fn(|_, _| noise(0.01));
        let place = |t: f64| self.at(t).1.into_iter().find(|(s, _)| *s == segment).expect("placed").1;
        let mut unit = InertialSensor { nominal_rate_hz: Some(256.0), ..InertialSensor::new(segment) };
        let (first, last) = (clock.unit_s(-1.0), clock.unit_s(self.duration_s + 1.0));
        for i in 0..((last - first) * 256.0) as i64 {
            let unit_ns = ((first + i as f64 / 256.0) * 1e9) as i64;
            let t = clock.camera_ns(unit_ns) as f64 * 1e-9;
            let [a, b, c] = [-STEP, 0.0, STEP].map(|d| place(t + d));
            let acceleration = (a.point - 2.0 * b.point + c.point) / (STEP * STEP);
            let turn = UnitQuaternion::from_rotation_matrix(&(a.world_from_segment.inverse() * c.world_from_segment));
            let turn = turn.scaled_axis() / (2.0 * STEP);
            let imu_from_world = mounting * b.world_from_segment.inverse();
            let is_leg = segment.name().ends_with("shank") || segment.name().ends_with("thigh");
            let wobble = self.since_landing(t).map_or(0.0, |s| {
                let size = if is_leg { 25.0 } else { 8.0 };
                size * (-s / 0.08).exp() * (2.0 * PI * 14.0 * s).sin()
            });
            let force = imu_from_world * (acceleration + Vector3::y() * (G + wobble));
            unit.time_ns.push(unit_ns);
            unit.acceleration.push(force.map(|v| (v + noise(0.05)).clamp(-80.0, 80.0)));
            unit.angular_rate.push(mounting * turn + bias + Vector3::from_fn(|_, _| noise(0.005)));
        }
        unit
    }

    /// The camera's recording and that of some units.
    pub(super) fn record(&self, segments: &[Segment]) -> (SkeletonRecording, Vec<InertialSensor>) {
        (self.skeleton(), segments.iter().map(|segment| self.unit(*segment)).collect())
    }
}
