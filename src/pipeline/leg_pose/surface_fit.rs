//! How far a pose is from the points of a frame, and how to change it: normal equations of one Gauss–Newton step.
//!
//! ```text
//! residual of a point p    |p − c| − r(t),  c = a + t (b − a) the nearest point of the nearest segment's axis
//! weight                   Geman–McClure, so that a stray point counts nothing
//! residuals of the body    lengths, hips level and apart, knees bend forwards, feet above the floor, legs apart
//! ```
//!
//! Derivatives with respect to a, b and both radii are −(1−t) n, −t n, −(1−t), −t with n = (p − c)/|p − c|.

use super::foreground::{ForegroundPoint, REFERENCE_FOCAL};
use super::leg_model::{LegPoint, LegSegment, POSE, PoseVector, SHAPE, ShapeVector, point_of, size_of};
use crate::body::Side;
use nalgebra::{SMatrix, SVector, Vector3};

/// Unknowns of a step: pose, then shape.
pub const UNKNOWNS: usize = POSE + SHAPE;
/// Standard deviation of a point about the surface, metres: folds, muscles, edges of the sensor.
const SURFACE_SD: f64 = 0.008;
/// Residual at which a point has lost three quarters of its weight, metres.
const STRAY: f64 = 0.025;
/// A point farther from every surface is nobody's leg, metres.
const REACH: f64 = 0.09;
/// Neighbouring points err together: a segment counts as this many independent ones at most.
const INDEPENDENT_POINTS: f64 = 30.0;
/// How much thigh, shank and foot count beside each other. A shank is nearly a cone; a foot is nothing like one, and when
/// its points count as much it drags the ankle along the shank by 1 to 2 cm (step length on simulated walks: 1.0 cm against
/// 0.4 cm).
const SEGMENT_TRUST: [f64; 3] = [10.0, 20.0, 1.0];
/// Share of a segment of which less is a sliver beside something nearer: of it only an edge is seen, and edges are ragged
/// and do not tell how far the leg goes on behind.
pub const SLIVER_SHARE: f64 = 0.35;
/// How exactly thigh, shank and foot have their lengths, metres: joint centres move in a bent joint, and a foot bends at
/// the ball when its heel rises.
const LENGTH_SD: [f64; 3] = [0.008, 0.003, 0.050];
/// Trouser legs hang below the ankle, and the trunk goes on above the hip: so far surfaces go on straight, so that their
/// points do not pull the joint along the bone, metres.
const OPEN_BELOW_ANKLE: f64 = 0.08;
/// See [`OPEN_BELOW_ANKLE`].
const OPEN_ABOVE_HIP: f64 = 0.3;
/// The middle of a shoe's rear lies this much below the ankle, metres; were a foot's axis to begin at the ankle, the low
/// upper of the shoe would pull the ankle down.
const FOOT_DROP: f64 = 0.05;
/// Height of the ankle's centre above the floor of a standing adult, metres: 0.039 of stature (Winter) and a shoe's sole.
const ANKLE_HEIGHT: f64 = 0.095;
/// How much it differs from body to body, and while a foot rolls, metres.
const ANKLE_SD: f64 = 0.025;
/// An ankle is not lower than expected by more than this, metres.
const ANKLE_LOWER: f64 = 0.02;
/// An ankle that is higher than the other by this much is half as sure to stand, metres.
const STANDING_APART: f64 = 0.02;
/// Points higher than this below upright hips are trunk, arms and what hangs from them, metres.
const BELOW_HIPS: f64 = 0.05;
/// A foot is wider than high: half the width of its flat part at ankle and toes, metres.
const FLAT_HALF_WIDTH: [f64; 2] = [0.005, 0.018];
/// Number of segments of both legs.
pub const SEGMENTS: usize = 6;

/// A linear system of normal equations with its cost.
#[derive(Debug, Clone)]
pub struct NormalEquations {
    /// `Jᵀ W J`.
    pub matrix: SMatrix<f64, UNKNOWNS, UNKNOWNS>,
    /// `Jᵀ W r`.
    pub gradient: SVector<f64, UNKNOWNS>,
    /// Weighted points that each segment explains, in pixels: thigh, shank, foot of the left leg, then of the right.
    pub support: [f64; SEGMENTS],
    /// Share of the points that lie on some segment, 0 to 1.
    pub explained: f64,
    /// Robust mean of squared residuals in units of `STRAY`, 0 to 1.
    pub misfit: f64,
}

struct Cone {
    start: Vector3<f64>,
    axis: Vector3<f64>,
    inverse_squared_length: f64,
    /// Where the surface begins and ends, as shares of the axis.
    range: [f64; 2],
    radii: [f64; 2],
    /// Unit vector across a foot, level; zero for round segments.
    across: Vector3<f64>,
}

struct Touch {
    segment: usize,
    /// Place along the axis, 0 to 1, and beyond 1 on a trouser leg's end.
    t: f64,
    normal: Vector3<f64>,
    residual: f64,
}

impl Cone {
    fn covered_pixels(&self, camera: &Vector3<f64>) -> f64 {
        covered_pixels(camera, [&self.start, &(self.start + self.axis)], self.radii[0] + self.radii[1])
    }
}

fn cones(pose: &PoseVector, shape: &ShapeVector) -> [Cone; SEGMENTS] {
    let size = size_of(shape);
    std::array::from_fn(|s| {
        let (side, segment) = side_and_segment(s);
        let mut start = point_of(pose, side, segment.start());
        if segment == LegSegment::Foot {
            start.y -= FOOT_DROP * size;
        }
        let axis = point_of(pose, side, segment.end()) - start;
        let (_, [first, last]) = segment.shape_indices();
        let inverse_squared_length = 1.0 / axis.norm_squared().max(1e-6);
        let across = match segment {
            LegSegment::Foot => Vector3::new(axis.z, 0.0, -axis.x).try_normalize(1e-6).unwrap_or_else(Vector3::zeros),
            _ => Vector3::zeros(),
        };
        let range = match segment {
            LegSegment::Thigh => [-OPEN_ABOVE_HIP * inverse_squared_length.sqrt(), 1.0],
            LegSegment::Shank => [0.0, 1.0 + OPEN_BELOW_ANKLE * inverse_squared_length.sqrt()],
            LegSegment::Foot => [0.0, 1.0],
        };
        Cone { start, axis, inverse_squared_length, range, radii: [shape[first], shape[last]], across }
    })
}

/// Height of a standing ankle of a body of this size: soles do not grow with the body.
fn ankle_height(size: f64) -> f64 {
    ANKLE_HEIGHT * (0.6 + 0.4 * size)
}

/// Side and segment of a place among the six segments.
pub fn side_and_segment(s: usize) -> (Side, LegSegment) {
    (Side::BOTH[s / 3], LegSegment::ALL[s % 3])
}

/// The segment whose surface a point is on or nearest to.
fn touch(cones: &[Cone; SEGMENTS], point: &Vector3<f64>) -> Option<Touch> {
    let mut best: Option<Touch> = None;
    for (segment, cone) in cones.iter().enumerate() {
        let from_start = point - cone.start;
        let t = (from_start.dot(&cone.axis) * cone.inverse_squared_length).clamp(cone.range[0], cone.range[1]);
        let mut from_axis = from_start - cone.axis * t;
        let half_width = FLAT_HALF_WIDTH[0] + t.clamp(0.0, 1.0) * (FLAT_HALF_WIDTH[1] - FLAT_HALF_WIDTH[0]);
        from_axis -= cone.across * from_axis.dot(&cone.across).clamp(-half_width, half_width);
        let distance = from_axis.norm();
        let residual = distance - (cone.radii[0] + t.clamp(0.0, 1.0) * (cone.radii[1] - cone.radii[0]));
        if best.as_ref().is_none_or(|b| residual < b.residual) && distance > 1e-6 {
            best = Some(Touch { segment, t, normal: from_axis / distance, residual });
        }
    }
    best.filter(|touch| touch.residual.abs() < REACH)
}

fn robust_weight(residual: f64) -> f64 {
    let u = STRAY * STRAY / (STRAY * STRAY + residual * residual);
    u * u
}

/// Normal equations of a frame at a pose and shape.
pub fn linearise(
    points: &[ForegroundPoint],
    camera: &Vector3<f64>,
    pose: &PoseVector,
    shape: &ShapeVector,
) -> NormalEquations {
    let cones = cones(pose, shape);
    let mut blocks: [SMatrix<f64, 8, 8>; SEGMENTS] = [SMatrix::zeros(); SEGMENTS];
    let mut vectors: [SVector<f64, 8>; SEGMENTS] = [SVector::zeros(); SEGMENTS];
    let mut weights = [0.0; SEGMENTS];
    let mut support = [0.0; SEGMENTS];
    let (mut explained, mut misfit, mut total) = (0.0, 0.0, 0.0);
    let top = ankle_height(size_of(shape)) + shape[0] + shape[1] - BELOW_HIPS;
    for point in points.iter().filter(|point| point.position.y < top) {
        total += point.pixels;
        let Some(touch) = touch(&cones, &point.position) else {
            misfit += point.pixels;
            continue;
        };
        // A camera cannot see the back of a leg: the axis is on the wrong side of such a point.
        if touch.normal.dot(&(point.position - camera)) > 0.0 {
            misfit += point.pixels;
            continue;
        }
        let robust = robust_weight(touch.residual);
        misfit += point.pixels * (1.0 - robust.sqrt());
        explained += point.pixels * robust;
        let weight = robust * point.pixels;
        let n = &touch.normal;
        let (u, t) = (1.0 - touch.t, touch.t);
        let row = SVector::<f64, 8>::from([
            -u * n.x,
            -u * n.y,
            -u * n.z,
            -t * n.x,
            -t * n.y,
            -t * n.z,
            -u.clamp(0.0, 1.0),
            -t.clamp(0.0, 1.0),
        ]);
        blocks[touch.segment].syger(weight, &row, &row, 1.0);
        vectors[touch.segment].axpy(weight * touch.residual, &row, 1.0);
        weights[touch.segment] += weight;
        support[touch.segment] += weight;
    }
    let mut system = NormalEquations {
        matrix: SMatrix::zeros(),
        gradient: SVector::zeros(),
        support,
        explained: explained / f64::max(total, 1.0),
        misfit: misfit / f64::max(total, 1.0),
    };
    for (s, (block, vector)) in blocks.iter().zip(&vectors).enumerate() {
        // A thigh is cut off by the image's upper edge, which tells nothing of the part that is seen.
        let seen =
            if s % 3 == 0 { 1.0 } else { (weights[s] / (SLIVER_SHARE * cones[s].covered_pixels(camera))).min(1.0) };
        let scale = segment_scale(weights[s]) * SEGMENT_TRUST[s % 3] * seen;
        let places = places_of_segment(s);
        for r in 0..8 {
            system.gradient[places[r]] += scale * vector[r];
            for c in 0..8 {
                system.matrix[(places[r], places[c])] += scale * block[(r.max(c), r.min(c))];
            }
        }
    }
    system
}

/// What one unit of weight (a pixel) counts in a segment that has `weight` of them.
fn segment_scale(weight: f64) -> f64 {
    // A dense point stands for nine pixels: as many pixels err together.
    let independent = (weight / 30.0).min(INDEPENDENT_POINTS);
    independent / weight.max(1e-9) / (SURFACE_SD * SURFACE_SD)
}

/// Pixels of a Kinect v1 that a segment between two points would cover; `width` is the sum of its radii, metres.
pub fn covered_pixels(camera: &Vector3<f64>, ends: [&Vector3<f64>; 2], width: f64) -> f64 {
    let view = 0.5 * (ends[0] + ends[1]) - camera;
    let distance = view.norm().max(0.1);
    let across = (ends[1] - ends[0]).cross(&view).norm() / distance;
    ((across * width + 0.5 * width * width) * (REFERENCE_FOCAL / distance).powi(2)).max(1.0)
}

/// Places among the unknowns of a segment's start, end and two radii.
fn places_of_segment(s: usize) -> [usize; 8] {
    let (side, segment) = side_and_segment(s);
    let (start, end) = (3 * segment.start().index(side), 3 * segment.end().index(side));
    let (_, [first, last]) = segment.shape_indices();
    [start, start + 1, start + 2, end, end + 1, end + 2, POSE + first, POSE + last]
}

impl NormalEquations {
    /// Adds one residual of standard deviation `sd` with its non-zero derivatives.
    pub fn add(&mut self, residual: f64, sd: f64, derivatives: &[(usize, f64)]) {
        let weight = 1.0 / (sd * sd);
        for (r, dr) in derivatives {
            self.gradient[*r] += weight * residual * dr;
            for (c, dc) in derivatives {
                self.matrix[(*r, *c)] += weight * dr * dc;
            }
        }
    }

    /// Adds what is known of bodies and floors.
    pub fn add_body(&mut self, pose: &PoseVector, shape: &ShapeVector) {
        for s in 0..SEGMENTS {
            self.add_length(s, pose, shape);
        }
        for side in Side::BOTH {
            self.add_knee(side, pose);
            self.add_foot(side, pose, shape);
        }
        self.add_pelvis(pose, shape);
        self.add_clearance(pose, shape);
    }

    fn add_length(&mut self, s: usize, pose: &PoseVector, shape: &ShapeVector) {
        let (side, segment) = side_and_segment(s);
        let axis = point_of(pose, side, segment.end()) - point_of(pose, side, segment.start());
        let length = axis.norm().max(1e-3);
        let n = axis / length;
        let (start, end) = (3 * segment.start().index(side), 3 * segment.end().index(side));
        let place = POSE + segment.shape_indices().0;
        let residual = length - shape[place - POSE];
        self.add(
            residual,
            LENGTH_SD[segment as usize],
            &[
                (start, -n.x),
                (start + 1, -n.y),
                (start + 2, -n.z),
                (end, n.x),
                (end + 1, n.y),
                (end + 2, n.z),
                (place, -1.0),
            ],
        );
    }

    /// A knee is not behind the line from hip to ankle, as seen along the direction of walking.
    fn add_knee(&mut self, side: Side, pose: &PoseVector) {
        const BACKWARD_SD: f64 = 0.01;
        let [hip, knee, ankle] = [LegPoint::Hip, LegPoint::Knee, LegPoint::Ankle].map(|p| 3 * p.index(side));
        let forward = pose[knee + 2] - 0.5 * (pose[hip + 2] + pose[ankle + 2]);
        if forward < 0.0 {
            self.add(forward, BACKWARD_SD, &[(knee + 2, 1.0), (hip + 2, -0.5), (ankle + 2, -0.5)]);
        }
    }

    /// A foot points forwards more or less, and stays above the floor.
    fn add_foot(&mut self, side: Side, pose: &PoseVector, shape: &ShapeVector) {
        const FORWARD_SD: f64 = 0.05;
        const SIDEWAYS_SD: f64 = 0.06;
        const FLOOR_SD: f64 = 0.002;
        let [ankle, toe] = [LegPoint::Ankle, LegPoint::Toe].map(|p| 3 * p.index(side));
        let length = shape[2];
        self.add(pose[toe + 2] - pose[ankle + 2] - 0.9 * length, FORWARD_SD, &[(toe + 2, 1.0), (ankle + 2, -1.0)]);
        self.add(pose[toe] - pose[ankle], SIDEWAYS_SD, &[(toe, 1.0), (ankle, -1.0)]);
        self.add(pose[toe + 1] - pose[ankle + 1] + 0.04, FORWARD_SD, &[(toe + 1, 1.0), (ankle + 1, -1.0)]);
        let sole = pose[toe + 1] - shape[7];
        if sole < 0.0 {
            self.add(sole, FLOOR_SD, &[(toe + 1, 1.0), (POSE + 7, -1.0)]);
        }
        let lowest = pose[ankle + 1] - ankle_height(size_of(shape)) + ANKLE_LOWER;
        if lowest < 0.0 {
            self.add(lowest, FLOOR_SD, &[(ankle + 1, 1.0)]);
        }
        // One foot stands; the other one does so the more the less it is higher.
        let other = 3 * LegPoint::Ankle.index(side.opposite());
        let higher = (pose[ankle + 1] - pose[other + 1]).max(0.0);
        let share = 1.0 / (1.0 + (higher / STANDING_APART).powi(2));
        self.add(pose[ankle + 1] - ankle_height(size_of(shape)), ANKLE_SD / share, &[(ankle + 1, 1.0)]);
    }

    /// Hips are about level and a pelvis apart, above the feet and as high as legs that walk, and the user looks at the
    /// camera.
    ///
    /// Of a straight leg in wide trousers neither knee nor hip is seen, and a leg slides along itself by centimetres.
    fn add_pelvis(&mut self, pose: &PoseVector, shape: &ShapeVector) {
        const WIDTH: f64 = 0.17;
        const WIDTH_SD: f64 = 0.02;
        const LEVEL_SD: f64 = 0.06;
        const ROTATION_SD: f64 = 0.10;
        /// How far hips are before or behind the middle of the feet, metres.
        const AHEAD_SD: f64 = 0.08;
        /// Height of hips above ankles as a share of a leg's length in walking, and how much it differs, metres.
        const STRETCH: f64 = 0.955;
        const HEIGHT_SD: f64 = 0.025;
        let [left, right] = Side::BOTH.map(|side| 3 * LegPoint::Hip.index(side));
        let sds = [(WIDTH * size_of(shape), WIDTH_SD), (0.0, LEVEL_SD), (0.0, ROTATION_SD)];
        for (axis, (expected, sd)) in sds.into_iter().enumerate() {
            let residual = pose[left + axis] - pose[right + axis] - expected;
            self.add(residual, sd, &[(left + axis, 1.0), (right + axis, -1.0)]);
        }
        let [left_ankle, right_ankle] = Side::BOTH.map(|side| 3 * LegPoint::Ankle.index(side));
        let ahead = 0.5 * (pose[left + 2] + pose[right + 2] - pose[left_ankle + 2] - pose[right_ankle + 2]);
        let middle = [(left + 2, 0.5), (right + 2, 0.5), (left_ankle + 2, -0.5), (right_ankle + 2, -0.5)];
        self.add(ahead, AHEAD_SD, &middle);
        let upright = ankle_height(size_of(shape)) + STRETCH * (shape[0] + shape[1]);
        let height = 0.5 * (pose[left + 1] + pose[right + 1]);
        let derivatives = [(left + 1, 0.5), (right + 1, 0.5), (POSE, -STRETCH), (POSE + 1, -STRETCH)];
        self.add(height - upright, HEIGHT_SD, &derivatives);
    }

    /// Knees and ankles do not go through each other.
    fn add_clearance(&mut self, pose: &PoseVector, shape: &ShapeVector) {
        const CLEARANCE_SD: f64 = 0.005;
        /// Bones may come this near, as a share of the radii of what is around them: cloth gives way.
        const CLEARANCE: f64 = 0.5;
        for (point, radius) in [(LegPoint::Knee, shape[4]), (LegPoint::Ankle, shape[5])] {
            let between = point_of(pose, Side::Left, point) - point_of(pose, Side::Right, point);
            let distance = between.norm().max(1e-3);
            let residual = distance - 2.0 * CLEARANCE * radius;
            if residual < 0.0 {
                let n = between / distance;
                let [left, right] = Side::BOTH.map(|side| 3 * point.index(side));
                let derivatives: [(usize, f64); 6] =
                    std::array::from_fn(|k| if k < 3 { (left + k, n[k]) } else { (right + k - 3, -n[k - 3]) });
                self.add(residual, CLEARANCE_SD, &derivatives);
            }
        }
    }
}
