//! The camera on the walker: where it is while the walker rolls ahead of its user.

use super::gait::{GRID_S, PelvisPose, smoothed};
use super::noise::smooth;
use nalgebra::{Isometry3, Matrix3, Rotation3, Translation3, UnitQuaternion, Vector3};

/// How the camera is fixed to the walker: it looks back at the user, and somewhat down.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct CameraMount {
    /// Height above the floor, metres.
    pub height_m: f64,
    /// Tilt downwards, radians.
    pub tilt: f64,
    /// Turn to the walker's left, radians: a camera that is not mounted straight.
    pub yaw: f64,
    /// Turn about the direction of view, radians; positive lowers the right side of the image's floor.
    pub roll: f64,
    /// Mean distance from the user's pelvis along the floor, metres.
    pub distance_m: f64,
}

/// Time over which the user's pushing is evened out by the walker, SD in seconds.
const INERTIA_S: f64 = 0.8;

/// Range of the distance's slow variation to each side, and of the walker's place to the left and right, metres.
const DISTANCE_RANGE_M: f64 = 0.04;
/// See [`DISTANCE_RANGE_M`].
const SIDE_RANGE_M: f64 = 0.025;

/// Time in which the slow variation changes, seconds.
const DRIFT_S: f64 = 2.5;

/// Streams of the two slow variations.
const DISTANCE_STREAM: u64 = 0x6469_7374;
/// See [`DISTANCE_STREAM`].
const SIDE_STREAM: u64 = 0x7369_6465;

/// The camera's path over the floor.
#[derive(Debug, Clone)]
pub struct CameraPath {
    mount: CameraMount,
    seed: u64,
    /// Smoothed x, z and heading of the user every [`GRID_S`].
    user: Vec<[f64; 3]>,
}

impl CameraPath {
    /// The path of a walker that is pushed by a pelvis.
    pub fn new(mount: CameraMount, pelvis: &[PelvisPose], seed: u64) -> Self {
        let smooth = |value: fn(&PelvisPose) -> f64| smoothed(&pelvis.iter().map(value).collect::<Vec<_>>(), INERTIA_S);
        let (x, z, heading) = (smooth(|p| p.place.x), smooth(|p| p.place.z), smooth(|p| p.heading));
        let user = x.into_iter().zip(z).zip(heading).map(|((x, z), heading)| [x, z, heading]).collect();
        Self { mount, seed, user }
    }

    /// Heading of the walker at a time, radians to the left of z.
    pub fn heading(&self, time: f64) -> f64 {
        self.user_at(time)[2]
    }

    /// `world_from_sensor` at a time, seconds.
    pub fn world_from_sensor(&self, time: f64) -> Isometry3<f64> {
        let [x, z, heading] = self.user_at(time);
        let drift =
            |stream: u64, range: f64| range * (2.0 * smooth(self.seed ^ stream, [time / DRIFT_S, 0.0, 0.0]) - 1.0);
        let turn = Rotation3::from_axis_angle(&Vector3::y_axis(), heading);
        let ahead = self.mount.distance_m + drift(DISTANCE_STREAM, DISTANCE_RANGE_M);
        let place =
            Vector3::new(x, self.mount.height_m, z) + turn * Vector3::new(drift(SIDE_STREAM, SIDE_RANGE_M), 0.0, ahead);
        let axes = turn * Rotation3::from_matrix_unchecked(walker_from_sensor(&self.mount));
        Isometry3::from_parts(Translation3::from(place), UnitQuaternion::from_rotation_matrix(&axes))
    }

    fn user_at(&self, time: f64) -> [f64; 3] {
        let place = (time / GRID_S).clamp(0.0, (self.user.len() - 2) as f64);
        let (k, part) = (place as usize, place.fract());
        std::array::from_fn(|axis| self.user[k][axis] + part * (self.user[k + 1][axis] - self.user[k][axis]))
    }
}

/// Axes of the sensor (x right in the image, y down, z away) in those of the walker (x left, y up, z ahead).
fn walker_from_sensor(mount: &CameraMount) -> Matrix3<f64> {
    let back = Rotation3::from_axis_angle(&Vector3::y_axis(), mount.yaw) * -Vector3::z();
    let z = back * mount.tilt.cos() - Vector3::y() * mount.tilt.sin();
    let level = (-Vector3::y()).cross(&back);
    let x = level * mount.roll.cos() + z.cross(&level) * mount.roll.sin();
    Matrix3::from_columns(&[x, z.cross(&x), z])
}

#[cfg(test)]
mod tests {
    use super::*;

    fn path(tilt: f64) -> CameraPath {
        let mount = CameraMount { height_m: 0.5, tilt, yaw: 0.0, roll: 0.0, distance_m: 1.1 };
        let walk = |k: i32| PelvisPose { place: Vector3::new(0.0, 0.0, 0.005 * f64::from(k)), heading: 0.0 };
        CameraPath::new(mount, &(0..1000).map(walk).collect::<Vec<_>>(), 4)
    }

    #[test]
    fn the_camera_looks_back_at_its_user_and_down_by_its_tilt() {
        let pose = path(0.2).world_from_sensor(5.0);
        let looks = pose * Vector3::z();
        assert!((looks.z + 0.2f64.cos()).abs() < 1e-9 && (looks.y + 0.2f64.sin()).abs() < 1e-9);
        // The user's left is on the right of the image.
        assert!(((pose * Vector3::x()) - Vector3::x()).norm() < 1e-9);
        assert!((pose.rotation.to_rotation_matrix().matrix().determinant() - 1.0).abs() < 1e-9);
    }

    #[test]
    fn the_walker_stays_about_an_arm_ahead() {
        let path = path(0.1);
        for k in 100..800 {
            let time = 0.01 * f64::from(k);
            let pose = path.world_from_sensor(time);
            assert!((pose.translation.z - 0.5 * time - 1.1).abs() < 0.06, "{time}");
            assert_eq!(pose.translation.y, 0.5);
        }
    }
}
