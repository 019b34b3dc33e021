//! Identities: one newtype per kind of row, so that a patient's id can never be passed for a session's.

use super::database::{Bind, Value};
use serde::{Deserialize, Serialize};
use std::fmt;
use std::str::FromStr;
use utoipa::ToSchema;
use uuid::Uuid;

macro_rules! ids {
    ($($(#[$doc:meta])* $name:ident;)+) => {$(
        $(#[$doc])*
        ///
        /// A UUID of version 7: ids made later sort later.
        #[derive(
            Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord, Serialize, Deserialize, ToSchema, sqlx::Type,
        )]
        #[serde(transparent)]
        #[sqlx(transparent)]
        #[schema(value_type = String, format = Uuid)]
        pub struct $name(pub Uuid);

        impl $name {
            /// A new id, later than every other that this process has made.
            pub(crate) fn new() -> Self {
                Self(Uuid::now_v7())
            }
        }

        impl fmt::Display for $name {
            fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                self.0.fmt(f)
            }
        }

        impl<'q> Bind<'q> for $name {
            const ABSENT: Value<'static> = Value::Id(None);

            fn value(self) -> Value<'q> {
                Value::Id(Some(self.0))
            }
        }

        impl From<$name> for Uuid {
            fn from(id: $name) -> Self {
                id.0
            }
        }

        impl FromStr for $name {
            type Err = uuid::Error;

            fn from_str(text: &str) -> Result<Self, Self::Err> {
                text.parse().map(Self)
            }
        }
    )+};
}

ids! {
    /// Identity of an organisation: nothing is shared between two of them.
    OrganisationId;
    /// Identity of an API client, the holder of a key.
    ClientId;
    /// Identity of a pseudonymous patient.
    PatientId;
    /// Identity of a consent of a patient.
    ConsentId;
    /// Identity of an erasure: the record that a patient was removed.
    ErasureId;
    /// Identity of a session: one sitting of a patient.
    SessionId;
    /// Identity of a recording: one upload in a session.
    RecordingId;
    /// Identity of an upload that may go on where it broke off.
    ResumableUploadId;
    /// Identity of a job: the work on one recording.
    JobId;
    /// Identity of an assessment: one pipeline's result on one recording.
    AssessmentId;
    /// Identity of a noise model: one version of one name.
    NoiseModelId;
    /// Identity of a questionnaire: one set of answers of a patient.
    QuestionnaireId;
    /// Identity of a measurement: results of tests of a patient on one occasion.
    MeasurementId;
    /// Identity of a measure: one value, by an assessment or of a measurement.
    MeasureId;
    /// Identity of a share: one patient, one clinician, one time.
    ShareId;
    /// Identity of a training plan: what a patient is to train at home.
    TrainingPlanId;
}

/// Ids as one parameter: a list in JSON, of hexadecimal digits alone, since JSON cannot carry what a column may hold as bytes.
pub(super) fn list_of_ids(ids: impl Iterator<Item = Uuid>) -> String {
    serde_json::Value::from_iter(ids.map(|id| id.simple().to_string())).to_string()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ids_made_later_sort_later_and_survive_text_and_json() {
        let ids: Vec<PatientId> = (0..1000).map(|_| PatientId::new()).collect();
        assert!(ids.is_sorted());
        let id = ids[0];
        assert_eq!(id.to_string().parse::<PatientId>().unwrap(), id);
        assert_eq!(serde_json::from_str::<PatientId>(&format!("\"{id}\"")).unwrap(), id);
    }
}
