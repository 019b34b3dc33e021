//! Names of the joint-angle channels.

use crate::body::Side;

/// One channel of a joint-angle assessment. Flexion, abduction and internal rotation are positive on both sides.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum AngleChannel {
    /// Trunk against the subject's initial facing direction, Z-X-Y: forward bending positive.
    TrunkFlexion,
    /// Trunk bending to the subject's right.
    TrunkLateralBending,
    /// Trunk turning to the subject's left.
    TrunkAxialRotation,
    /// Plane of elevation of the upper arm, Y-X-Y: 0 is abduction, 90 is forward flexion.
    ShoulderPlane(Side),
    /// Elevation of the upper arm from hanging, 0 to 180.
    ShoulderElevation(Side),
    /// Internal rotation of the upper arm.
    ShoulderAxialRotation(Side),
    /// Elbow flexion.
    ElbowFlexion(Side),
    /// Hip flexion, Z-X-Y.
    HipFlexion(Side),
    /// Hip abduction.
    HipAbduction(Side),
    /// Hip internal rotation.
    HipAxialRotation(Side),
    /// Knee flexion.
    KneeFlexion(Side),
    /// Attitude vector of the trunk in the subject frame; component 0 (X), 1 (Y) or 2 (Z).
    TrunkAttitude(usize),
    /// Attitude vector of the upper arm against the T-posture, in the trunk frame.
    ShoulderAttitude(Side, usize),
    /// Attitude vector of the thigh against standing, in the trunk frame.
    HipAttitude(Side, usize),
}

impl AngleChannel {
    /// Every channel, in the order in which an assessment lists them: 19 anatomical angles, then 15 attitudes.
    pub fn all() -> Vec<AngleChannel> {
        let mut all = vec![Self::TrunkFlexion, Self::TrunkLateralBending, Self::TrunkAxialRotation];
        for side in Side::BOTH {
            all.extend([
                Self::ShoulderPlane(side),
                Self::ShoulderElevation(side),
                Self::ShoulderAxialRotation(side),
                Self::ElbowFlexion(side),
            ]);
        }
        for side in Side::BOTH {
            all.extend([
                Self::HipFlexion(side),
                Self::HipAbduction(side),
                Self::HipAxialRotation(side),
                Self::KneeFlexion(side),
            ]);
        }
        all.extend((0..3).map(Self::TrunkAttitude));
        for side in Side::BOTH {
            all.extend((0..3).map(|axis| Self::ShoulderAttitude(side, axis)));
        }
        for side in Side::BOTH {
            all.extend((0..3).map(|axis| Self::HipAttitude(side, axis)));
        }
        all
    }

    /// Name at the API, for example `right_knee_flexion_deg`.
    pub fn name(self) -> String {
        const AXES: [&str; 3] = ["x", "y", "z"];
        let sided = |side: Side, what: &str| format!("{}_{what}_deg", side.name());
        match self {
            Self::TrunkFlexion => "trunk_flexion_deg".into(),
            Self::TrunkLateralBending => "trunk_lateral_bending_deg".into(),
            Self::TrunkAxialRotation => "trunk_axial_rotation_deg".into(),
            Self::ShoulderPlane(side) => sided(side, "shoulder_plane"),
            Self::ShoulderElevation(side) => sided(side, "shoulder_elevation"),
            Self::ShoulderAxialRotation(side) => sided(side, "shoulder_axial_rotation"),
            Self::ElbowFlexion(side) => sided(side, "elbow_flexion"),
            Self::HipFlexion(side) => sided(side, "hip_flexion"),
            Self::HipAbduction(side) => sided(side, "hip_abduction"),
            Self::HipAxialRotation(side) => sided(side, "hip_axial_rotation"),
            Self::KneeFlexion(side) => sided(side, "knee_flexion"),
            Self::TrunkAttitude(axis) => format!("trunk_attitude_{}_deg", AXES[axis]),
            Self::ShoulderAttitude(side, axis) => sided(side, &format!("shoulder_attitude_{}", AXES[axis])),
            Self::HipAttitude(side, axis) => sided(side, &format!("hip_attitude_{}", AXES[axis])),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::collections::HashSet;

    #[test]
    fn there_are_19_anatomical_channels_and_15_attitude_components_with_distinct_names() {
        let names: HashSet<String> = AngleChannel::all().into_iter().map(AngleChannel::name).collect();
        assert_eq!(names.len(), 34);
        assert!(names.contains("right_knee_flexion_deg") && names.contains("left_hip_attitude_y_deg"));
    }
}
