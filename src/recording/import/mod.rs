//! Public data sets as recordings, with their gold standard on reference channels.
//!
//! Each data set has its own file and the same two calls: [`list`] finds the trials, [`Source::read`] makes one of
//! them a [`Trial`]. Defects that the data sets are known for are handled here, on purpose and counted in
//! [`ImportNotes`]: a joint or marker at exactly 0, 0, 0 was lost; four zeros are no rotation; a joint that moves more
//! than [`defects::MAX_JUMP_M`] between two frames was lost in the second.

mod acclaim;
mod broad;
mod cmu;
pub mod defects;
mod depth;
#[cfg(test)]
mod inertial_tests;
mod keraal;
mod knee_drop_cut;
mod knee_sts;
mod qmt_fullbody;
mod repoimu;
pub mod report;
mod ring_chain;
mod table;
#[cfg(test)]
mod tests;
mod uiprmd;
mod units;
mod utdmhad;
mod ximu_gait;

pub use depth::{CameraFile, DepthImportError, RawImages, import_depth};
pub use report::{Defects, ImportNotes, ImportReport, UnitNotes};

use super::Recording;
use std::path::{Path, PathBuf};

/// A data set that can be imported.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Dataset {
    /// UI-PRMD: rehabilitation exercises, Kinect v2 with Vicon knee angles.
    Uiprmd,
    /// UTD-MHAD: daily actions, Kinect v1 with one inertial sensor on the right thigh.
    Utdmhad,
    /// KERAAL: seated trunk exercises, Kinect v2 with orientations.
    Keraal,
    /// CMU motion capture, subject 02: walking, exact angles of a fitted model.
    Cmu,
    /// BROAD: one inertial unit in the hand, with its optical orientation.
    Broad,
    /// RepoIMU: one inertial unit on a rod, with the rod's optical orientation.
    Repoimu,
    /// A chain of five segments with hinges, a unit and the optical orientation of each.
    RingChain,
    /// Units on thigh and shank, sit to stand and sitting, with knee flexion from markers.
    KneeSts,
    /// Units on thigh and shank, drop landings and cutting, with knee flexion from Visual3D.
    KneeDropCut,
    /// Nine units on one person, without a reference.
    QmtFullbody,
    /// An x-IMU on a foot, without a reference.
    XimuGait,
}

impl Dataset {
    /// Every data set.
    pub const ALL: [Dataset; 11] = [
        Dataset::Uiprmd,
        Dataset::Utdmhad,
        Dataset::Keraal,
        Dataset::Cmu,
        Dataset::Broad,
        Dataset::Repoimu,
        Dataset::RingChain,
        Dataset::KneeSts,
        Dataset::KneeDropCut,
        Dataset::QmtFullbody,
        Dataset::XimuGait,
    ];

    /// The data sets with a skeleton.
    pub const WITH_SKELETON: [Dataset; 4] = [Dataset::Uiprmd, Dataset::Utdmhad, Dataset::Keraal, Dataset::Cmu];

    /// Name on the command line and of its folder.
    pub fn name(self) -> &'static str {
        match self {
            Dataset::Uiprmd => "uiprmd",
            Dataset::Utdmhad => "utdmhad",
            Dataset::Keraal => "keraal",
            Dataset::Cmu => "cmu",
            Dataset::Broad => "broad",
            Dataset::Repoimu => "repoimu",
            Dataset::RingChain => "ring_chain",
            Dataset::KneeSts => "knee_sts",
            Dataset::KneeDropCut => "knee_drop_cut",
            Dataset::QmtFullbody => "qmt_fullbody",
            Dataset::XimuGait => "ximu_gait",
        }
    }
}

/// Why a data set cannot be imported.
#[derive(Debug, thiserror::Error)]
pub enum ImportError {
    /// The directory holds nothing of this data set.
    #[error("no {dataset} trials below {}; {expected}", directory.display())]
    NotFound {
        /// Name of the data set.
        dataset: &'static str,
        /// Where it was looked for.
        directory: PathBuf,
        /// What should have been there.
        expected: &'static str,
    },
    /// A file cannot be read.
    #[error("{}: {error}", file.display())]
    Unreadable {
        /// The file.
        file: PathBuf,
        /// What the system says.
        error: std::io::Error,
    },
    /// A row of a file is not what the data set's description says.
    #[error("{}, row {row}: {reason}", file.display())]
    Malformed {
        /// The file.
        file: PathBuf,
        /// Row, from 1.
        row: usize,
        /// What was found and expected.
        reason: String,
    },
    /// Two files of one trial contradict each other.
    #[error("{}: {reason}", file.display())]
    Inconsistent {
        /// One of them.
        file: PathBuf,
        /// What does not fit.
        reason: String,
    },
}

/// One trial of a data set, not yet read.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Source {
    /// The data set.
    pub dataset: Dataset,
    /// Name of the trial in its data set, for example `m01_s02_e02`.
    pub name: String,
    /// What the subject did, for example `m01_deep_squat`.
    pub exercise: String,
    file: PathBuf,
}

/// One trial as a recording.
#[derive(Debug, Clone)]
pub struct Trial {
    /// The recording.
    pub recording: Recording,
    /// What was done to make it one.
    pub notes: ImportNotes,
}

/// Trials of a data set at or below `directory`, sorted by name.
///
/// `directory` may be the data set's own folder or one or two levels above (`uiprmd`, `skeleton/uiprmd`, `imu/broad`).
///
/// # Errors
/// [`ImportError::NotFound`] when there is none, [`ImportError::Unreadable`] when a folder cannot be listed.
pub fn list(dataset: Dataset, directory: &Path) -> Result<Vec<Source>, ImportError> {
    let name = dataset.name();
    for root in [
        directory.to_owned(),
        directory.join(name),
        directory.join("skeleton").join(name),
        directory.join("imu").join(name),
    ] {
        if !root.is_dir() {
            continue;
        }
        let mut sources = match dataset {
            Dataset::Uiprmd => uiprmd::list(&root)?,
            Dataset::Utdmhad => utdmhad::list(&root)?,
            Dataset::Keraal => keraal::list(&root)?,
            Dataset::Cmu => cmu::list(&root)?,
            Dataset::Broad => broad::list(&root)?,
            Dataset::Repoimu => repoimu::list(&root)?,
            Dataset::RingChain => ring_chain::list(&root)?,
            Dataset::KneeSts => knee_sts::list(&root)?,
            Dataset::KneeDropCut => knee_drop_cut::list(&root)?,
            Dataset::QmtFullbody => qmt_fullbody::list(&root)?,
            Dataset::XimuGait => ximu_gait::list(&root)?,
        };
        if !sources.is_empty() {
            sources.sort_by(|a, b| a.name.cmp(&b.name));
            return Ok(sources);
        }
    }
    let expected = match dataset {
        Dataset::Uiprmd => "expected segmented/kinect/positions/m01_s01_e02_positions.txt.gz and its siblings",
        Dataset::Utdmhad => "expected a22_s1_t1_skeleton.csv and a22_s1_t1_inertial.csv",
        Dataset::Keraal => "expected G3-Kinect-….txt.gz",
        Dataset::Cmu => "expected 02.asf and 02_….amc",
        Dataset::Broad => "expected 07_undisturbed_fast_rotation_B.csv.gz",
        Dataset::Repoimu => "expected TStick_Test04_Trial1.csv",
        Dataset::RingChain => "expected trial1_imu_rigid.csv and trial1_omc.csv",
        Dataset::KneeSts => "expected partA_imu_left_thigh.csv.gz and its siblings",
        Dataset::KneeDropCut => "expected Lknee_trial_271.txt and MT_…_left_thigh.txt",
        Dataset::QmtFullbody => "expected part1_9segments.csv.gz",
        Dataset::XimuGait => "expected straightLine_CalInertialAndMag.csv",
    };
    Err(ImportError::NotFound { dataset: name, directory: directory.to_owned(), expected })
}

impl Source {
    /// Reads the trial.
    ///
    /// # Errors
    /// See [`ImportError`]; the file and row are named.
    pub fn read(&self) -> Result<Trial, ImportError> {
        match self.dataset {
            Dataset::Uiprmd => uiprmd::read(self),
            Dataset::Utdmhad => utdmhad::read(self),
            Dataset::Keraal => keraal::read(self),
            Dataset::Cmu => cmu::read(self),
            Dataset::Broad => broad::read(self),
            Dataset::Repoimu => repoimu::read(self),
            Dataset::RingChain => ring_chain::read(self),
            Dataset::KneeSts => knee_sts::read(self),
            Dataset::KneeDropCut => knee_drop_cut::read(self),
            Dataset::QmtFullbody => qmt_fullbody::read(self),
            Dataset::XimuGait => ximu_gait::read(self),
        }
    }
}

/// Names of the plain files in a folder; none when the folder is absent.
fn file_names(folder: &Path) -> Result<Vec<String>, ImportError> {
    let unreadable = |error| ImportError::Unreadable { file: folder.to_owned(), error };
    if !folder.is_dir() {
        return Ok(Vec::new());
    }
    let mut names = Vec::new();
    for entry in std::fs::read_dir(folder).map_err(unreadable)? {
        let entry = entry.map_err(unreadable)?;
        if entry.path().is_file() {
            names.push(entry.file_name().to_string_lossy().into_owned());
        }
    }
    Ok(names)
}

/// The name without a final `.gz`.
fn without_gz(name: &str) -> &str {
    name.strip_suffix(".gz").unwrap_or(name)
}

/// Times of `n` samples at `rate` per second, nanoseconds from zero.
fn regular_times(n: usize, rate: f64) -> Vec<i64> {
    (0..n).map(|i| (i as f64 / rate * 1e9).round() as i64).collect()
}
