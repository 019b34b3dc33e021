//! What is assumed of units, camera and bodies before the recording is looked at.
//!
//! These are standard deviations of errors, not thresholds of anything clinical. Where no source is named they are ours,
//! chosen once for all recordings and measured by `surefoot evaluate fusion`.

/// Standard deviations and times of the alignment.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct AlignmentTuning {
    /// Mounting about each axis around the scheme, radians: 5 to 10° in all, as units on straps are.
    pub scheme_sd: f64,
    /// Mounting about each axis when nothing is known of it, radians.
    pub free_sd: f64,
    /// Main axis of a thigh's or shank's turning against its hinge axis, radians: exercises of the legs are mostly in the
    /// sagittal plane. For units whose mounting is not known otherwise.
    pub main_axis_sd: f64,
    /// Tilt of the camera against gravity about each horizontal axis, radians.
    pub tilt_sd: f64,
    /// Attitude of a unit on the plank against its neighbours', radians.
    pub plank_sd: f64,
    /// Heading of the plank against the camera, radians.
    pub plank_heading_sd: f64,
    /// Mean drift of a heading, radians per second: what a filter leaves of a gyroscope's bias in a person who never rests.
    pub heading_drift: f64,
    /// How a heading wanders about its mean drift, radians per square root of a second.
    pub heading_walk: f64,
    /// Constant offset of a vector between two joints as the camera sees it, each axis, metres: joints are 30 to 45 mm
    /// off, and two of them make a vector.
    pub constant_offset: f64,
    /// Part of the offset that follows the posture, each axis of a vector, metres: 20 to 30 mm a joint.
    pub posture_offset: f64,
    /// Time after which the posture's offset is another one, seconds.
    pub offset_time: f64,
    /// Deviation of the bones of a leg that is stood on from the vertical, radians.
    pub upright_sd: f64,
    /// Deviation of a knee or elbow from a hinge, radians: other rotations of the joint, and soft tissue.
    pub hinge_sd: f64,
    /// Time after which that deviation is another one, seconds.
    pub hinge_time: f64,
    /// Rotation of a forearm about itself against the upper arm, radians: pronation.
    pub pronation_sd: f64,
    /// Degrees of freedom of the Student-t weight of a camera vector.
    pub student_t_dof: f64,
}

impl Default for AlignmentTuning {
    fn default() -> Self {
        Self {
            scheme_sd: 5f64.to_radians(),
            free_sd: 60f64.to_radians(),
            main_axis_sd: 10f64.to_radians(),
            tilt_sd: 4f64.to_radians(),
            plank_sd: 1.5f64.to_radians(),
            plank_heading_sd: 5f64.to_radians(),
            heading_drift: 0.3f64.to_radians(),
            heading_walk: 0.1f64.to_radians(),
            constant_offset: 0.040,
            posture_offset: 0.025,
            offset_time: 4.0,
            upright_sd: 5f64.to_radians(),
            hinge_sd: 4f64.to_radians(),
            hinge_time: 0.1,
            pronation_sd: 30f64.to_radians(),
            student_t_dof: 4.0,
        }
    }
}
