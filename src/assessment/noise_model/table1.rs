//! The noise of the paper (\[angles\] Table 1): exercises of older adults before a sensor with NITE middleware.

use super::NITE_TABLE1;
use super::document::{NoiseModelDocument, PointNoise, TransitionNoise, observed_joints};
use crate::body::OBSERVATION_DIMENSION;

/// Table 1, positions relative to the torso joint, millimetres: arm then leg, proximal point first.
const POSITION_SD_MM: [[[f64; 3]; 3]; 2] = [
    [[9.1, 6.7, 12.7], [29.8, 25.2, 20.3], [151.5, 181.7, 14.5]],
    [[6.0, 6.5, 10.1], [8.8, 16.8, 35.1], [19.8, 25.2, 38.1]],
];

/// Table 1's columns x, y, z are lateral, vertical and sagittal; here forward, up, rightward.
const TRANSITION_SD_DEG: TransitionNoise = TransitionNoise {
    trunk: [1.16, 2.44, 1.60],
    shoulder: [2.8, 5.64, 2.88],
    elbow: 2.44,
    hip: [3.36, 3.28, 2.76],
    knee: 1.31,
};

/// The paper's model.
///
/// Its correlations are not published. Those here have one source that is certain: every element of y has the torso
/// joint's own noise in it. The hip is the quietest point; taking the torso to be as noisy as the hip, half of the
/// hip's variance is common to all points. The slow offset is not published either, and is taken as none.
pub(super) fn document() -> NoiseModelDocument {
    let sd = |row: usize| {
        let point = row / 3;
        POSITION_SD_MM[point / 6][point % 3][row % 3]
    };
    let correlation = |row: usize, column: usize| {
        let common = 0.5 * POSITION_SD_MM[1][0][row % 3].powi(2);
        if row % 3 == column % 3 { common / (sd(row) * sd(column)) } else { 0.0 }
    };
    NoiseModelDocument {
        name: NITE_TABLE1.to_owned(),
        version: 1,
        description:
            "Kinect v1 with NITE middleware, home exercises, as in Table 1 of the method's paper. Published are \
                      the standard deviations only: correlations are those of the torso joint's own noise, the slow \
                      offset is unknown and taken as none."
                .to_owned(),
        points: observed_joints()
            .enumerate()
            .map(|(p, point)| PointNoise {
                point,
                white_sd_mm: std::array::from_fn(|axis| sd(3 * p + axis)),
                slow_offset_sd_mm: 0.0,
            })
            .collect(),
        correlations: (1..OBSERVATION_DIMENSION)
            .map(|row| (0..row).map(|column| correlation(row, column)).collect())
            .collect(),
        transition_sd_deg: TRANSITION_SD_DEG,
        training: None,
    }
}
