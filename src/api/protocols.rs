//! The catalogue of exercises and tests that a recording can hold.

use super::auth::Caller;
use super::error::ApiError;
use super::request::ApiPath;
use super::state::AppState;
use crate::fall_risk::rules_of_measure;
use crate::protocol::{self, PROTOCOLS, ProtocolInfo};
use axum::Json;
use serde::{Deserialize, Serialize};
use utoipa::{IntoParams, ToSchema};
use utoipa_axum::router::OpenApiRouter;
use utoipa_axum::routes;

/// Routes of this file.
pub fn router() -> OpenApiRouter<AppState> {
    OpenApiRouter::new().routes(routes!(list_protocols)).routes(routes!(read_protocol))
}

/// The catalogue.
#[derive(Debug, Clone, Serialize, ToSchema)]
pub struct ProtocolsResponse {
    /// Every exercise and test.
    pub items: Vec<ProtocolInfo>,
}

/// Address of one protocol.
#[derive(Debug, Clone, Deserialize, IntoParams)]
#[into_params(parameter_in = Path)]
pub struct ProtocolPath {
    /// Id of the protocol, or another name of it.
    #[param(example = "five_times_sit_to_stand")]
    pub id: String,
}

/// List the protocols
///
/// Exercises and tests that a recording can hold: how they are done and recorded, what is measured of them and how. A recording
/// that names one in its header, or whose session does, is measured by it.
#[utoipa::path(get, path = "/v1/protocols", tag = "protocols", operation_id = "list_protocols",
    security(("api_key" = ["device"])),
    responses((status = 200, description = "The catalogue", body = ProtocolsResponse)))]
async fn list_protocols(_: Caller) -> Json<ProtocolsResponse> {
    let items = PROTOCOLS.iter().map(|protocol| protocol.info(rules_of_measure)).collect();
    Json(ProtocolsResponse { items })
}

/// Read a protocol
#[utoipa::path(get, path = "/v1/protocols/{id}", tag = "protocols", operation_id = "read_protocol",
    security(("api_key" = ["device"])),
    params(ProtocolPath),
    responses((status = 200, description = "The protocol", body = ProtocolInfo)))]
async fn read_protocol(_: Caller, ApiPath(path): ApiPath<ProtocolPath>) -> Result<Json<ProtocolInfo>, ApiError> {
    let found = protocol::find(&path.id).ok_or(ApiError::NotFound("protocol"))?;
    Ok(Json(found.info(rules_of_measure)))
}
