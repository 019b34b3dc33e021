//! The models that come with the software.

use super::{NoiseModel, NoiseModelName, table1};
use std::sync::LazyLock;

/// Kinect v1, trained on part of UTD-MHAD; the document says which.
const KINECT_V1: &str = include_str!("kinect-v1.json");
/// Kinect v2, trained on part of UI-PRMD; the document says which.
const KINECT_V2: &str = include_str!("kinect-v2.json");

static SHIPPED: LazyLock<Vec<NoiseModel>> = LazyLock::new(|| {
    let embedded = [KINECT_V1, KINECT_V2].map(|text| serde_json::from_str(text).expect("embedded models are sound"));
    NoiseModel::try_from(table1::document()).into_iter().chain(embedded).collect()
});

/// Every shipped model: the paper's, then those of sensors.
///
/// # Panics
/// Never: the embedded documents do not depend on any input, and a test reads each.
pub fn shipped() -> &'static [NoiseModel] {
    &SHIPPED
}

/// The paper's model.
///
/// # Panics
/// Never, as [`shipped`].
pub fn nite_table1() -> &'static NoiseModel {
    &shipped()[0]
}

/// The shipped model of a name; `None` when there is none, or not of the version that is asked for.
pub fn find_shipped(name: &NoiseModelName) -> Option<&'static NoiseModel> {
    shipped().iter().find(|model| {
        let found = model.document();
        found.name == name.name && name.version.is_none_or(|version| version == found.version)
    })
}
