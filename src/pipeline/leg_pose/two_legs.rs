//! Two legs in the points of one frame, without a model or a filter.
//!
//! Seen from above, the lower legs are two compact heaps of points. Two means find them. This starts the tracker, and it
//! is the baseline that the tracker must beat: the lowest part of each heap is the foot.

use super::foreground::ForegroundPoint;
use crate::body::Side;
use nalgebra::Vector3;

/// Points of lower legs and feet are below this, metres.
const BELOW_KNEE: f64 = 0.45;
/// A point farther than this from both means belongs to neither leg, metres.
const REACH: f64 = 0.30;
/// Two heaps nearer than this are one leg, metres.
const MIN_SEPARATION: f64 = 0.07;
/// A leg has at least this many points.
const MIN_POINTS: usize = 12;
/// Rounds of reassignment.
const ROUNDS: usize = 12;
/// The lowest part of a heap: this much above its lowest points, metres.
const LOWEST_PART: f64 = 0.10;
/// Share of the points that may lie lower than the "lowest" ones.
const STRAY_SHARE: f64 = 0.02;

/// The points of two lower legs: left, then right.
#[derive(Debug, Clone, PartialEq)]
pub struct TwoLegs {
    /// Points of each leg, in the order of [`Side::BOTH`].
    pub points: [Vec<ForegroundPoint>; 2],
}

impl TwoLegs {
    /// Separates the points of a frame. `None` when there are not two legs.
    pub fn find(points: &[ForegroundPoint]) -> Option<Self> {
        let low: Vec<ForegroundPoint> = points.iter().copied().filter(|p| p.position.y < BELOW_KNEE).collect();
        if low.len() < 2 * MIN_POINTS {
            return None;
        }
        let starts = [Vector3::x(), Vector3::z(), Vector3::new(0.7, 0.0, 0.7), Vector3::new(0.7, 0.0, -0.7)];
        let tries = starts.iter().filter_map(|axis| two_means(&low, axis));
        let (means, _) = tries.min_by(|a, b| a.1.total_cmp(&b.1))?;
        if horizontal_distance(&means[0], &means[1]) < MIN_SEPARATION {
            return None;
        }
        let mut points: [Vec<ForegroundPoint>; 2] = Default::default();
        for point in &low {
            if let Some(leg) = nearest(&means, &point.position) {
                points[leg].push(*point);
            }
        }
        if points.iter().any(|leg| leg.len() < MIN_POINTS) {
            return None;
        }
        // The user looks at the camera, so the left leg is on the right in the image.
        if means[0].x < means[1].x {
            points.swap(0, 1);
        }
        Some(Self { points })
    }

    /// The foot of a leg: the middle of its lowest part, in `floor`, metres.
    pub fn foot(&self, side: Side) -> Vector3<f64> {
        let points = &self.points[side as usize];
        let mut heights: Vec<f64> = points.iter().map(|p| p.position.y).collect();
        heights.sort_by(f64::total_cmp);
        let lowest = heights[(STRAY_SHARE * heights.len() as f64) as usize];
        let part: Vec<&ForegroundPoint> = points.iter().filter(|p| p.position.y < lowest + LOWEST_PART).collect();
        weighted_mean(part.into_iter())
    }
}

/// Means of two heaps and the cost of the assignment, from a first cut across `axis`.
fn two_means(points: &[ForegroundPoint], axis: &Vector3<f64>) -> Option<([Vector3<f64>; 2], f64)> {
    let middle = median(points.iter().map(|p| p.position.dot(axis)).collect());
    let part = |above: bool| weighted_mean(points.iter().filter(move |p| (p.position.dot(axis) > middle) == above));
    let mut means = [part(true), part(false)];
    let mut cost = f64::INFINITY;
    for _ in 0..ROUNDS {
        let of_leg = |leg| {
            let means = &means;
            weighted_mean(points.iter().filter(move |p| nearest(means, &p.position) == Some(leg)))
        };
        means = [of_leg(0), of_leg(1)];
        cost = points
            .iter()
            .map(|p| {
                let distance = means.iter().map(|m| horizontal_distance(m, &p.position)).fold(REACH, f64::min);
                area(p) * distance * distance
            })
            .sum();
    }
    cost.is_finite().then_some((means, cost))
}

fn nearest(means: &[Vector3<f64>; 2], position: &Vector3<f64>) -> Option<usize> {
    let [a, b] = [horizontal_distance(&means[0], position), horizontal_distance(&means[1], position)];
    (a.min(b) < REACH).then_some(usize::from(b < a))
}

fn horizontal_distance(a: &Vector3<f64>, b: &Vector3<f64>) -> f64 {
    (a.x - b.x).hypot(a.z - b.z)
}

/// The surface that a point stands for: pixels are larger farther away.
fn area(point: &ForegroundPoint) -> f64 {
    point.pixels * point.position.z * point.position.z
}

fn weighted_mean<'a>(points: impl Iterator<Item = &'a ForegroundPoint>) -> Vector3<f64> {
    let (sum, total) =
        points.fold((Vector3::zeros(), 0.0), |(sum, total), p| (sum + p.position * area(p), total + area(p)));
    sum / total
}

fn median(mut values: Vec<f64>) -> f64 {
    values.sort_by(f64::total_cmp);
    values[values.len() / 2]
}
