//! How far a client reaches.

use super::{ClientId, OrganisationId};

/// Whose rows a question may touch. Every question of a client carries one, and every answer stays inside.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Access {
    /// The only organisation that exists for the client.
    pub organisation: OrganisationId,
    /// Who asks; new rows name it as their maker.
    pub client: ClientId,
    /// True for devices: only the client's own sessions, and what hangs on them, exist for it.
    pub own_sessions_only: bool,
}

impl Access {
    /// The client whose sessions alone are visible, when there is such a restriction; bound as `?2` in the questions.
    pub(crate) fn only_sessions_of(&self) -> Option<ClientId> {
        self.own_sessions_only.then_some(self.client)
    }
}
