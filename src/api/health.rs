//! Whether the service lives and can do its work.

use super::error::ApiError;
use super::state::AppState;
use axum::Json;
use axum::extract::State;
use serde::Serialize;
use utoipa::ToSchema;
use utoipa_axum::router::OpenApiRouter;
use utoipa_axum::routes;

/// Routes of this file.
pub fn router() -> OpenApiRouter<AppState> {
    OpenApiRouter::new().routes(routes!(read_liveness)).routes(routes!(read_readiness))
}

/// The service answers.
#[derive(Debug, Clone, Serialize, ToSchema)]
pub struct HealthResponse {
    /// `ok`.
    pub status: &'static str,
    /// Version of Surefoot.
    pub version: &'static str,
}

const OK: HealthResponse = HealthResponse { status: "ok", version: env!("CARGO_PKG_VERSION") };

/// Does the process live?
#[utoipa::path(get, path = "/health/live", tag = "health", security(()), operation_id = "read_liveness",
    responses((status = 200, description = "It does", body = HealthResponse)))]
async fn read_liveness() -> Json<HealthResponse> {
    Json(OK)
}

/// Can the service do its work?
///
/// Looks whether the database and the folder of blobs can be written.
#[utoipa::path(get, path = "/health/ready", tag = "health", security(()), operation_id = "read_readiness",
    responses((status = 200, description = "It can", body = HealthResponse),
              (status = 503, description = "It cannot", body = super::error::Problem,
               content_type = "application/problem+json")))]
async fn read_readiness(State(state): State<AppState>) -> Result<Json<HealthResponse>, ApiError> {
    if let Err(error) = state.store.check_ready().await {
        tracing::error!(error = format!("{error:#}"), "not ready: the database");
        return Err(ApiError::Unavailable("The database cannot be written. The operator finds the reason in the log."));
    }
    if let Err(error) = state.store.blobs().check_ready().await {
        tracing::error!(error = format!("{error:#}"), "not ready: the blobs");
        return Err(ApiError::Unavailable("The folder of recordings cannot be written. See the log."));
    }
    Ok(Json(OK))
}
