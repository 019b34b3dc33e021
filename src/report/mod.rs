//! What a clinician reads of a patient: findings of rules, measures with their errors, how they changed, what was trained,
//! and what is missing. Values only: who asks and where things are stored is not known here.
//!
//! Nothing is blended: each finding and each change stands by itself, with the rule and the source it rests on.

pub mod adherence;
pub mod export;
pub mod fhir;
pub mod measure;
pub mod needed;
pub mod patient_report;
pub mod trend;

pub use adherence::{Adherence, PlannedExercise, TrainedSession, TrainingPlan};
pub use measure::{MeasureKind, MeasureRecord, MeasureSource};
pub use needed::{Needed, needed};
pub use patient_report::{PatientReport, PatientSummary, RecentSession, StatusCounts};
pub use trend::{Change, ChangeVerdict, Trend};

/// What must be read with every report.
pub const CAUTION: &str = "Decision support for trained clinicians: not a diagnosis, not for emergency use, and valid only for the \
                           stated population and way of testing. Uncertainty and software version are as shown. Values and \
                           limits marked unconfirmed must not guide care.";
