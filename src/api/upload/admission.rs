//! What an upload is asked before its bytes, and what its assessment is to be. Direct and resumable uploads ask the same.

use crate::api::error::{ApiError, Problem};
use crate::api::noise_models::pinned;
use crate::api::state::AppState;
use crate::assessment::{JointAngleSettings, LegPoseSettings, Settings};
use crate::recording::decode::Inspection;
use crate::storage::{Access, Session, SessionId};

/// What an upload may be answered, beside what every request may be, as the OpenAPI document tells it.
#[derive(Debug, utoipa::IntoResponses)]
#[expect(dead_code, reason = "read by the macro that documents an operation")]
pub enum Refused {
    /// Too many recordings of the organisation wait to be assessed (`too_many_waiting_jobs`), or too many requests; Retry-After
    /// says how many seconds to wait
    #[response(status = 429, content_type = "application/problem+json")]
    TooManyOfOrganisation(#[to_schema] Problem),
    /// Too many recordings wait to be assessed (`queue_full`), or the keys of the identity provider cannot be had
    #[response(status = 503, content_type = "application/problem+json")]
    QueueFull(#[to_schema] Problem),
}

/// The session, if a recording may be added to it: one of the caller's own organisation, whose patient has consented.
///
/// Asked when an upload begins and, of one that took its time, when it ends.
pub(super) async fn permitted(state: &AppState, access: &Access, session: SessionId) -> Result<Session, ApiError> {
    let session = state.store.session(&access.own(), session).await?;
    if state.config.require_consent {
        state.store.require_consent(session.patient_id).await?;
    }
    Ok(session)
}

/// The session, if a recording may be added to it and there is room for one more.
pub(super) async fn admit(state: &AppState, access: &Access, session: SessionId) -> Result<Session, ApiError> {
    let session = permitted(state, access, session).await?;
    state.queue.room(access).await?.map_err(ApiError::Crowded)?;
    Ok(session)
}

/// The settings that suit a recording of this session.
pub(super) async fn suited_settings(
    state: &AppState,
    access: &Access,
    session: &Session,
    inspection: &Inspection,
) -> Result<Settings, ApiError> {
    let units = inspection.inertial_units.iter().map(|unit| unit.segment);
    let suited = match inspection.depth {
        Some(_) => Settings::LegPose(LegPoseSettings::default()),
        None => Settings::suited_to(units),
    };
    Ok(match suited {
        Settings::JointAngles(settings) => {
            let settings = JointAngleSettings { noise_model: session.noise_model.clone(), ..settings };
            Settings::JointAngles(pinned(state, access, settings).await?)
        }
        other => other,
    })
}
