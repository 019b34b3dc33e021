//! The OpenAPI document: what the handlers say of themselves, completed with what holds for all of them.

use super::error::{FieldError, PROBLEM_JSON, Problem};
use serde_json::{Value, json};
use utoipa::OpenApi as _;
use utoipa::openapi::OpenApi;
use utoipa::openapi::security::{HttpAuthScheme, HttpBuilder, SecurityRequirement, SecurityScheme};

const DESCRIPTION: &str = "\
Recordings of human movement go in, joint angles with their credible intervals come out: from a camera's skeleton, and \
from inertial units on the body together with it, which also give places of joints.

The way of one recording: make a patient known (`POST /v1/patients`), record the patient's consent (`POST \
/v1/patients/{id}/consents`), begin a session (`POST /v1/sessions`), upload \
(`POST /v1/sessions/{id}/recordings`), follow the job that the answer names (`GET /v1/jobs/{id}`, or its events), read \
the assessment that the finished job names.

**Keys.** Every address under `/v1` needs `Authorization: Bearer <key>`. A key belongs to one organisation and one \
role: `device` uploads and sees its own sessions, `clinician` sees the patients of the organisation, `admin` makes and \
revokes keys. Where the operator has an identity provider, its tokens are taken in place of a key. The role that an operation needs at least stands in its security requirement; a higher role may do what a \
lower one may, in the order device, clinician, admin. What belongs to another organisation does not exist: 404.

**Sharing.** A clinician may let one clinician of another organisation read one patient until a time (`POST \
/v1/patients/{id}/shares`); the receiver finds it under `GET /v1/shares`, reads what is of that patient, and changes nothing.

**Limits.** A key, a user, and an address without a valid key may send so many requests in a minute; what is more answers \
429 with `Retry-After`.

**Noise models** say how far a sensor is off. Settings name one that is shipped, or one that the organisation trained \
(`POST /v1/noise-models`); a session may name the one of its sensor.

**Fall risk.** A clinician adds answers (`POST /v1/patients/{id}/questionnaires`) and results of tests (`POST \
/v1/patients/{id}/measurements`); `GET /v1/patients/{id}/fall-risk` applies every rule of `GET /v1/fall-risk-rules` to \
what is known. Each finding stands alone, with its limit, interval, source and population; what is not known is \
`unknown`, never `negative`.

**Refusals** are problem documents (RFC 9457, `application/problem+json`) with a stable `code`, a sentence for a \
person, and the paths of the fields concerned.

**Lists** come newest first in pages; `next` is the address of the page that follows.

**Units** stand in the names: `_deg`, `_m`, `_s`, `_ns`.";

#[derive(utoipa::OpenApi)]
#[openapi(
    info(title = "Surefoot"),
    components(schemas(Problem, FieldError)),
    tags(
        (name = "patients", description = "Pseudonymous patients"),
        (name = "consents", description = "What a patient has agreed to"),
        (name = "sessions", description = "One sitting of a patient"),
        (name = "recordings", description = "Uploads and their bytes"),
        (name = "jobs", description = "The work on a recording"),
        (name = "assessments", description = "What was found in a recording"),
        (name = "protocols", description = "Exercises and tests that a recording can hold"),
        (name = "entries", description = "What people enter about a patient: answers, results of tests, training plans"),
        (name = "report", description = "What was measured, how it changed, and what published rules make of it"),
        (name = "fhir", description = "The same as FHIR R4 resources, read-only"),
        (name = "noise models", description = "Noise of sensors, shipped and trained"),
        (name = "clients", description = "Holders of keys"),
        (name = "shares", description = "Patients that another organisation may read"),
        (name = "users", description = "People who sign in"),
        (name = "audit", description = "Who did or read what"),
        (name = "health", description = "For the operator"),
    )
)]
struct Base;

/// The document before any route: title, tags, the shape of refusals.
pub(super) fn base() -> OpenApi {
    let mut document = Base::openapi();
    document.info.version = env!("CARGO_PKG_VERSION").to_owned();
    document.info.description = Some(DESCRIPTION.to_owned());
    let bearer = HttpBuilder::new().scheme(HttpAuthScheme::Bearer).bearer_format("surefoot_…").build();
    let components = document.components.get_or_insert_default();
    components.add_security_scheme("api_key", SecurityScheme::Http(bearer));
    document.security = Some(vec![SecurityRequirement::new("api_key", Vec::<String>::new())]);
    document
}

/// Adds to every operation the refusals that any handler of its kind can give, and mends what the derive macros cannot
/// say.
///
/// # Panics
/// Never: a document of maps with text keys is always JSON.
pub(super) fn complete(document: &OpenApi) -> Value {
    let mut document = serde_json::to_value(document).expect("a document of maps with text keys is always JSON");
    if let Some(paths) = document["paths"].as_object_mut() {
        for (path, item) in paths {
            for (method, operation) in item.as_object_mut().into_iter().flatten() {
                document_refusals(path, method, operation);
                let parameters = operation.get_mut("parameters").and_then(Value::as_array_mut);
                parameters.into_iter().flatten().for_each(absent_is_not_null);
            }
        }
    }
    add_links(&mut document);
    name_contents(&mut document);
    let upload = &mut document["paths"]["/v1/sessions/{id}/recordings"]["post"]["requestBody"]["content"];
    upload["application/json"]["example"] = example_recording();
    let schemas = document["components"]["schemas"].clone();
    if let Some(settled) = document["components"]["schemas"].as_object_mut() {
        for schema in settled.values_mut() {
            merge_tagged_variants(schema, &schemas);
            drop_null_defaults(schema);
        }
    }
    document
}

/// What any handler of this kind may answer, when the handler's own words do not say it already.
fn document_refusals(path: &str, method: &str, operation: &mut Value) {
    let keyed = is_keyed(operation);
    // What watches the service is never limited.
    let limited = !path.starts_with("/health") && path != "/metrics";
    let body = operation.get("requestBody").is_some();
    let parameters = operation.get("parameters").is_some();
    let refusals = [
        (400, "A parameter or the body cannot be understood", parameters || body),
        (401, "The key is missing, unknown, expired or revoked", keyed),
        (403, "The role of the key does not reach this far", keyed),
        (404, "There is no such thing that the key may see", path.contains('{') || path.starts_with("/fhir") && keyed),
        (408, "The request did not arrive in time", body),
        (413, "The body is too large", body),
        (415, "The content type is not accepted", body),
        (422, "The body was understood, but its content is refused", body),
        (429, "Too many requests; Retry-After says how many seconds to wait", limited),
        (500, "Our fault", true),
        (503, "The keys of the identity provider cannot be had", keyed),
        (507, "There is no room left on the disk (`out_of_space`)", keyed && !["get", "head"].contains(&method)),
    ];
    let problem = json!({PROBLEM_JSON: {"schema": {"$ref": "#/components/schemas/Problem"}}});
    for (status, description, _) in refusals.into_iter().filter(|(_, _, applies)| *applies) {
        let response = &mut operation["responses"][status.to_string()];
        if response.is_null() {
            *response = json!({"description": description, "content": problem});
        }
    }
    if limited {
        operation["responses"]["429"]["headers"]["Retry-After"] =
            json!({"description": "Seconds to wait", "schema": {"type": "integer", "minimum": 1}});
    }
}

/// True of an operation that asks for a key; one that is open says so by a requirement of nothing.
fn is_keyed(operation: &Value) -> bool {
    let requirements = operation.get("security").and_then(Value::as_array);
    requirements.is_none_or(|all| all.iter().all(|one| one.as_object().is_some_and(|one| !one.is_empty())))
}

/// A parameter that is not required may be absent; it cannot be null, which an address has no way to say.
fn absent_is_not_null(parameter: &mut Value) {
    let schema = &mut parameter["schema"];
    if let Some(types) = schema["type"].as_array() {
        let other: Vec<Value> = types.iter().filter(|name| **name != "null").cloned().collect();
        if let [only] = other.as_slice() {
            schema["type"] = only.clone();
        }
    }
    if let Some(options) = schema["oneOf"].as_array() {
        let other: Vec<Value> = options.iter().filter(|option| option["type"] != "null").cloned().collect();
        if let [only] = other.as_slice() {
            *schema = only.clone();
        }
    }
}

/// Makes one closed object of each variant of a tagged enum. As "all of" a closed object and its tag, no value would
/// do: the tag is not among the closed object's properties.
fn merge_tagged_variants(schema: &mut Value, schemas: &Value) {
    for variant in schema.get_mut("oneOf").and_then(Value::as_array_mut).into_iter().flatten() {
        let Some([content, tag]) = variant["allOf"].as_array().map(Vec::as_slice) else { continue };
        let Some(name) = content["$ref"].as_str().and_then(|name| name.rsplit('/').next()) else { continue };
        let mut merged = schemas[name].clone();
        if let (Some(properties), Some(tags)) = (merged["properties"].as_object_mut(), tag["properties"].as_object()) {
            properties.extend(tags.clone());
        }
        merged["required"] = tag["required"].clone();
        *variant = merged;
    }
}

/// A field that may be absent has no default to be told of, least of all one that its own type does not allow.
fn drop_null_defaults(schema: &mut Value) {
    for property in schema.get_mut("properties").and_then(Value::as_object_mut).into_iter().flat_map(|p| p.values_mut())
    {
        if property.get("default").is_some_and(Value::is_null)
            && let Some(property) = property.as_object_mut()
        {
            property.remove("default");
        }
    }
}

/// Says what no Rust type says: bytes are bytes and not a list of numbers, and an event has a name and data.
fn name_contents(document: &mut Value) {
    let bytes = json!({"type": "string", "format": "binary"});
    let event = json!({
        "type": "object",
        "properties": {
            "event": {"type": "string", "enum": ["job"]},
            "data": {
                "type": "string",
                "contentMediaType": "application/json",
                "contentSchema": {"$ref": "#/components/schemas/JobResponse"},
            },
        },
        "required": ["event", "data"],
    });
    let operations = document["paths"].as_object_mut().into_iter().flat_map(|paths| paths.values_mut());
    for operation in operations.flat_map(|item| item.as_object_mut()).flat_map(|item| item.values_mut()) {
        let mut messages: Vec<&mut Value> = Vec::new();
        if let Some(operation) = operation.as_object_mut() {
            for (name, part) in operation {
                match name.as_str() {
                    "requestBody" => messages.push(part),
                    "responses" => messages.extend(part.as_object_mut().into_iter().flat_map(|all| all.values_mut())),
                    _ => {}
                }
            }
        }
        for contents in messages.into_iter().filter_map(|message| message.get_mut("content")?.as_object_mut()) {
            for (kind, content) in contents {
                match kind.as_str() {
                    "application/mcap"
                    | "application/octet-stream"
                    | "application/offset+octet-stream"
                    | "application/zip" => content["schema"] = bytes.clone(),
                    "text/event-stream" => content["schema"] = event.clone(),
                    _ => {}
                }
            }
        }
    }
}

/// Where the ids of an answer lead: (operation, status, place of the id in the body, operations that take it as `id`).
const LINKS: [(&str, &str, &str, &[&str]); 14] = [
    ("create_patient", "201", "/id", &["read_patient", "update_patient", "record_consent"]),
    ("create_session", "201", "/id", &["read_session", "list_recordings", "upload_recording", "create_upload"]),
    ("create_client", "201", "/client/id", &["revoke_client", "rotate_client"]),
    ("create_share", "201", "/id", &["revoke_share"]),
    ("create_user", "201", "/user/id", &["reset_user", "disable_user"]),
    ("upload_recording", "202", "/recording/id", &["read_recording", "read_recording_content", "create_job"]),
    ("upload_recording", "202", "/job/id", &["read_job", "read_job_events", "cancel_job"]),
    ("create_upload", "201", "/id", &["read_upload", "read_upload_offset", "continue_upload", "terminate_upload"]),
    ("read_upload", "200", "/job_id", &["read_job"]),
    ("create_job", "202", "/id", &["read_job", "read_job_events", "cancel_job"]),
    ("create_noise_model", "202", "/id", &["read_job", "read_job_events", "cancel_job"]),
    ("read_job", "200", "/noise_model_id", &["read_noise_model"]),
    ("read_job", "200", "/assessment_id", &["read_assessment", "read_series"]),
    ("list_assessments", "200", "/items/0/id", &["read_assessment", "read_series"]),
];

/// Operations that take the id of an upload, as `upload_id`.
const UPLOADS: [&str; 4] = ["read_upload", "read_upload_offset", "continue_upload", "terminate_upload"];

/// Says where the ids of answers lead.
fn add_links(document: &mut Value) {
    let operations = document["paths"].as_object_mut().into_iter().flat_map(|paths| paths.values_mut());
    for operation in operations.flat_map(|item| item.as_object_mut()).flat_map(|item| item.values_mut()) {
        let name = operation["operationId"].as_str().unwrap_or_default().to_owned();
        for (_, status, pointer, targets) in LINKS.iter().filter(|(from, ..)| *from == name) {
            for target in *targets {
                let id = format!("$response.body#{pointer}");
                let parameter = if UPLOADS.contains(target) { "upload_id" } else { "id" };
                operation["responses"][status]["links"][target] =
                    json!({"operationId": target, "parameters": {parameter: id}});
            }
        }
        if name == "create_patient" {
            let body = json!({"patient_id": "$response.body#/id"});
            operation["responses"]["201"]["links"]["create_session"] =
                json!({"operationId": "create_session", "requestBody": body});
        }
    }
}

/// The shortest sound recording.
fn example_recording() -> Value {
    let frame = |time_ns: u64, y: f64| json!({"time_ns": time_ns, "positions": [[0.1, y, 2.0], [0.1, y - 0.4, 2.0]], "confidence": [1.0, 1.0]});
    json!({
        "format": "surefoot",
        "version": 1,
        "coordinates": {"handedness": "right", "up": "+y", "length_unit": "m"},
        "header": {"protocol": "standing"},
        "joints": ["left_hip", "left_knee"],
        "frames": [frame(0, 0.0), frame(33_333_333, 0.002)],
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::recording::decode::{Format, Limits, decode};

    #[test]
    fn the_example_of_an_upload_is_a_recording() {
        let bytes = example_recording().to_string();
        let recording = decode(bytes.as_bytes(), Format::Json, &Limits::default()).unwrap();
        assert_eq!(recording.skeleton.unwrap().len(), 2);
    }
}
