//! `lost_joint`: a joint that the sensor does not see, or hardly.

use super::lost_user::is_lost;
use super::{Finding, Scene, stretches};
use crate::body::Joint;

/// Stretches in which a joint of the model was lost, or its confidence below the limit, while others were seen. A lost
/// torso joint counts too: without it no other point has a place.
pub(super) fn find(scene: &mut Scene) -> Vec<Finding> {
    let user_lost: Vec<bool> = (0..scene.len()).map(|t| is_lost(scene, t)).collect();
    let torso = scene.skeleton.column(Joint::Torso);
    let mut found = Vec::new();
    for column in scene.columns.into_iter().chain(torso) {
        let name = scene.skeleton.joints[column].name();
        let lost = stretches(scene.len(), |t| !user_lost[t] && !scene.gives(t, column));
        found.extend(lost.into_iter().map(|frames| Finding::of_frames(name, frames)));
    }
    found
}
