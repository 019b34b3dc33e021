//! How far a client reaches.

use super::{ClientId, OrganisationId};

/// Whose rows a question may touch. Every question of a client carries one, and every answer stays inside.
///
/// Reading questions about one patient also reach what another organisation has shared with the client: they say so by the condition
/// `shared_with`. A question without that condition, and so every one that writes, ends at the organisation's walls.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Access {
    /// The client's own organisation.
    pub organisation: OrganisationId,
    /// Who asks; new rows name it as their maker.
    pub client: ClientId,
    /// True for devices: only the client's own sessions, and what hangs on them, exist for it.
    pub own_sessions_only: bool,
    /// True when patients that are shared with the client can be read as well.
    pub reaches_shared: bool,
}

impl Access {
    /// The client whose sessions alone are visible, when there is such a restriction; bound as `?2` in the questions.
    pub(crate) fn only_sessions_of(&self) -> Option<ClientId> {
        self.own_sessions_only.then_some(self.client)
    }

    /// The same client within its own organisation: for what is read in order to change something.
    pub fn own(self) -> Self {
        Self { reaches_shared: false, ..self }
    }

    /// The client to whom patients may be shared, bound in the condition `shared_with` before the time; none reaches nothing.
    pub(crate) fn receiver(&self) -> Option<ClientId> {
        self.reaches_shared.then_some(self.client)
    }
}

/// The condition that the patient of a row is shared with a client now: the column that holds the patient, the place of the receiver
/// ([`Access::receiver`]) and that of the time.
macro_rules! shared_with {
    ($patient:literal, $receiver:literal, $now:literal) => {
        concat!(
            $patient,
            " IN (SELECT g.patient_id FROM shares g WHERE g.receiver_id = ",
            $receiver,
            " AND g.revoked_at IS NULL AND g.expires_at > ",
            $now,
            ")"
        )
    };
}
pub(crate) use shared_with;
