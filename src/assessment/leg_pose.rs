//! Names of the leg-pose channels.

use crate::body::Side;

/// One channel of a leg-pose assessment: metres, positions in `sensor` (x right in the image, y down, z away).
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum LegChannel {
    /// Coordinate 0 (x), 1 (y) or 2 (z) of an ankle's centre.
    Ankle(Side, usize),
    /// Coordinate of a knee's centre.
    Knee(Side, usize),
    /// Coordinate of a hip's centre.
    Hip(Side, usize),
    /// Distance of the ankles along z of `sensor`.
    StepLengthSensor,
    /// Distance of the ankles along x of `sensor`.
    StepWidthSensor,
    /// Distance of the ankles along the floor in the camera's direction of view.
    StepLengthFloor,
    /// Distance of the ankles along the floor across the camera's direction of view.
    StepWidthFloor,
}

impl LegChannel {
    /// Every channel, in the order in which an assessment lists them.
    pub fn all() -> Vec<LegChannel> {
        let mut all = Vec::with_capacity(22);
        for of in [Self::Ankle, Self::Knee, Self::Hip] {
            for side in Side::BOTH {
                all.extend((0..3).map(|axis| of(side, axis)));
            }
        }
        all.extend([Self::StepLengthSensor, Self::StepWidthSensor, Self::StepLengthFloor, Self::StepWidthFloor]);
        all
    }

    /// Name at the API, for example `left_ankle_x_m`.
    pub fn name(self) -> String {
        const AXES: [&str; 3] = ["x", "y", "z"];
        match self {
            Self::Ankle(side, axis) => format!("{}_ankle_{}_m", side.name(), AXES[axis]),
            Self::Knee(side, axis) => format!("{}_knee_{}_m", side.name(), AXES[axis]),
            Self::Hip(side, axis) => format!("{}_hip_{}_m", side.name(), AXES[axis]),
            Self::StepLengthSensor => "step_length_sensor_m".into(),
            Self::StepWidthSensor => "step_width_sensor_m".into(),
            Self::StepLengthFloor => "step_length_floor_m".into(),
            Self::StepWidthFloor => "step_width_floor_m".into(),
        }
    }
}
