//! Tapered cylinders, whole or cut along the axis: the solids that a leg is made of.
//!
//! A solid is the convex hull of two discs, or of two half discs on the same side of a plane through the axis (its flat
//! side). Radii change linearly along the axis.

use nalgebra::{Unit, Vector3};

/// A tapered cylinder. Points in metres, one frame for all of them.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TaperedCylinder {
    /// Centre of the first disc.
    pub start: Vector3<f64>,
    /// Centre of the second disc.
    pub end: Vector3<f64>,
    /// Radii of the two discs, metres.
    pub radii: [f64; 2],
    /// Half cylinders: away from the flat side, at a right angle to the axis. `None` for whole ones.
    pub dome: Option<Unit<Vector3<f64>>>,
}

/// A ray's way through a solid: `z` at which it enters and leaves.
type Passage = [f64; 2];

impl TaperedCylinder {
    /// Length of the axis, metres.
    pub fn length(&self) -> f64 {
        (self.end - self.start).norm()
    }

    /// Direction of the axis from start to end; any direction when they coincide.
    pub fn axis(&self) -> Vector3<f64> {
        (self.end - self.start).try_normalize(0.0).unwrap_or(Vector3::y())
    }

    /// Radius at a share of the axis, metres.
    pub fn radius_at(&self, share: f64) -> f64 {
        self.radii[0] + share * (self.radii[1] - self.radii[0])
    }

    /// Depth at which the ray `z · (x, y, 1)` from the origin enters the solid; `None` when it misses it or starts in it.
    ///
    /// The solid is an intersection of convex sets (one nappe of a cone, two half spaces, for half cylinders a third): the
    /// ray is inside from its last entry to its first exit.
    pub fn depth_along(&self, x: f64, y: f64) -> Option<f64> {
        let ray = Vector3::new(x, y, 1.0);
        let axis = self.axis();
        let mut passage = self.passage_through_cone(&ray, &axis)?;
        for (inward, point) in [(axis, self.start), (-axis, self.end)] {
            clip(&mut passage, inward.dot(&ray), inward.dot(&point));
        }
        if let Some(dome) = self.dome {
            clip(&mut passage, dome.dot(&ray), dome.dot(&self.start));
        }
        (passage[0] > 0.0 && passage[0] <= passage[1]).then_some(passage[0])
    }

    /// Where the ray is inside the nappe that holds the solid: `|p − (p·u) u| ≤ r(p·u)`.
    fn passage_through_cone(&self, ray: &Vector3<f64>, axis: &Vector3<f64>) -> Option<Passage> {
        let slope = (self.radii[1] - self.radii[0]) / self.length();
        let (ray_along, start_along) = (ray.dot(axis), self.start.dot(axis));
        let radius = self.radii[0] - slope * start_along;
        let a = ray.norm_squared() - (1.0 + slope * slope) * ray_along * ray_along;
        let b = ray.dot(&self.start) - ray_along * (start_along - slope * radius);
        let c = self.start.norm_squared() - start_along * start_along - radius * radius;
        let discriminant = b * b - a * c;
        if a == 0.0 && b == 0.0 {
            // Along the axis of a cylinder: inside everywhere or nowhere.
            return (c <= 0.0).then_some([f64::NEG_INFINITY, f64::INFINITY]);
        }
        if a > 0.0 {
            // Both crossings are on one nappe; the radius there tells which.
            let root = (discriminant >= 0.0).then(|| discriminant.sqrt())?;
            let passage = [(b - root) / a, (b + root) / a];
            let radius_in_middle = radius + slope * ray_along * b / a;
            return (radius_in_middle >= 0.0).then_some(passage);
        }
        // Steeper than the cone: the ray crosses each nappe once, and stays in ours beyond the crossing or before it.
        let root = discriminant.max(0.0).sqrt();
        let crossings = [(b - root) / a, (b + root) / a];
        let [first, second] = if crossings[0] < crossings[1] { crossings } else { [crossings[1], crossings[0]] };
        if slope * ray_along > 0.0 { Some([second, f64::INFINITY]) } else { Some([f64::NEG_INFINITY, first]) }
    }
}

/// Keeps the part of a passage where `along · z ≥ offset`.
fn clip(passage: &mut Passage, along: f64, offset: f64) {
    if along > 0.0 {
        passage[0] = passage[0].max(offset / along);
    } else if along < 0.0 {
        passage[1] = passage[1].min(offset / along);
    } else if offset > 0.0 {
        *passage = [f64::INFINITY, f64::NEG_INFINITY];
    }
}

/// The closest points of two segments, as shares of their axes (C. Ericson, Real-Time Collision Detection, 2005,
/// section 5.1.9: the minimum of a quadratic over the unit square).
pub fn closest_shares(a: &TaperedCylinder, b: &TaperedCylinder) -> [f64; 2] {
    /// Shorter segments are points, metres squared.
    const SHORTEST: f64 = 1e-18;
    let (along_a, along_b, between) = (a.end - a.start, b.end - b.start, a.start - b.start);
    let (aa, bb, ab) = (along_a.norm_squared(), along_b.norm_squared(), along_a.dot(&along_b));
    if aa < SHORTEST || bb < SHORTEST {
        let share = |along: Vector3<f64>, squared: f64, to: Vector3<f64>| match squared < SHORTEST {
            true => 0.0,
            false => (along.dot(&to) / squared).clamp(0.0, 1.0),
        };
        return [share(along_a, aa, -between), share(along_b, bb, between)];
    }
    let (to_a, to_b) = (along_a.dot(&between), along_b.dot(&between));
    let determinant = aa * bb - ab * ab;
    // Parallel segments: any share of the first will do.
    let mut s = if determinant > SHORTEST { ((ab * to_b - to_a * bb) / determinant).clamp(0.0, 1.0) } else { 0.0 };
    let mut t = (ab * s + to_b) / bb;
    if !(0.0..=1.0).contains(&t) {
        t = t.clamp(0.0, 1.0);
        s = ((ab * t - to_a) / aa).clamp(0.0, 1.0);
    }
    [s, t]
}

#[cfg(test)]
mod tests {
    use super::*;

    fn upright(dome: Option<Unit<Vector3<f64>>>) -> TaperedCylinder {
        let (start, end) = (Vector3::new(0.1, -0.2, 1.0), Vector3::new(0.1, 0.3, 1.0));
        TaperedCylinder { start, end, radii: [0.1, 0.05], dome }
    }

    #[test]
    fn a_level_ray_meets_the_near_surface_at_the_radius_of_that_height() {
        // At y = 0 two fifths of the axis are passed: the radius is 0.08 m; the cone leans by 0.1.
        let depth = upright(None).depth_along(0.1 / 1.0, 0.0).expect("a hit");
        let point = Vector3::new(0.1, 0.0, 1.0) * depth;
        let radius = ((point.x - 0.1).powi(2) + (point.z - 1.0).powi(2)).sqrt();
        assert!((radius - 0.08).abs() < 1e-12, "{radius}");
        assert!(depth < 1.0);
    }

    #[test]
    fn rays_past_the_sides_and_the_ends_miss() {
        let solid = upright(None);
        for (x, y) in [(0.25, 0.0), (-0.05, 0.0), (0.1, 0.35), (0.1, -0.3)] {
            assert_eq!(solid.depth_along(x, y), None, "({x}, {y})");
        }
    }

    #[test]
    fn a_ray_along_the_axis_enters_through_the_disc() {
        let (start, end) = (Vector3::new(0.0, 0.0, 1.0), Vector3::new(0.0, 0.0, 1.5));
        for radii in [[0.05, 0.1], [0.1, 0.05], [0.1, 0.1]] {
            let solid = TaperedCylinder { start, end, radii, dome: None };
            assert!((solid.depth_along(0.0, 0.0).expect("a hit") - 1.0).abs() < 1e-12);
            let edge = 0.999 * radii[0];
            assert!((solid.depth_along(edge, 0.0).expect("a hit") - 1.0).abs() < 1e-12);
        }
    }

    #[test]
    fn a_half_cylinder_ends_at_its_flat_side() {
        let half = upright(Some(Unit::new_normalize(-Vector3::z())));
        let whole = upright(None).depth_along(0.1, 0.0);
        assert_eq!(half.depth_along(0.1, 0.0), whole);
        let behind = upright(Some(Unit::new_normalize(Vector3::z())));
        assert!((behind.depth_along(0.1, 0.0).expect("a hit") - 1.0).abs() < 1e-12, "through the flat side");
    }

    #[test]
    fn the_closest_points_of_crossing_segments_are_where_they_cross() {
        let segment = |start: [f64; 3], end: [f64; 3]| TaperedCylinder {
            start: start.into(),
            end: end.into(),
            radii: [0.1; 2],
            dome: None,
        };
        let a = segment([0.0, 0.0, 0.0], [1.0, 0.0, 0.0]);
        let b = segment([0.25, -1.0, 0.3], [0.25, 1.0, 0.3]);
        assert_eq!(closest_shares(&a, &b), [0.25, 0.5]);
        let parallel = segment([2.0, 1.0, 0.0], [3.0, 1.0, 0.0]);
        assert_eq!(closest_shares(&a, &parallel), [1.0, 0.0]);
    }
}
