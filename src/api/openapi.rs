//! The OpenAPI document: what the handlers say of themselves, completed with what holds for all of them.

use super::error::{FieldError, PROBLEM_JSON, Problem};
use serde_json::{Value, json};
use utoipa::OpenApi as _;
use utoipa::openapi::OpenApi;
use utoipa::openapi::security::{HttpAuthScheme, HttpBuilder, SecurityRequirement, SecurityScheme};

const DESCRIPTION: &str = "\
Recordings of human movement go in, joint angles with their credible intervals come out.

The way of one recording: make a patient known (`POST /v1/patients`), begin a session (`POST /v1/sessions`), upload \
(`POST /v1/sessions/{id}/recordings`), follow the job that the answer names (`GET /v1/jobs/{id}`, or its events), read \
the assessment that the finished job names.

**Keys.** Every address under `/v1` needs `Authorization: Bearer <key>`. A key belongs to one organisation and one \
role: `device` uploads and sees its own sessions, `clinician` sees the patients of the organisation, `admin` makes and \
revokes keys. What belongs to another organisation does not exist: 404.

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
        (name = "sessions", description = "One sitting of a patient"),
        (name = "recordings", description = "Uploads and their bytes"),
        (name = "jobs", description = "The work on a recording"),
        (name = "assessments", description = "What was found in a recording"),
        (name = "clients", description = "Holders of keys"),
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
            for operation in item.as_object_mut().into_iter().flat_map(|item| item.values_mut()) {
                document_refusals(path, operation);
                let parameters = operation.get_mut("parameters").and_then(Value::as_array_mut);
                parameters.into_iter().flatten().for_each(absent_is_not_null);
            }
        }
    }
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
fn document_refusals(path: &str, operation: &mut Value) {
    let keyed = operation.get("security").is_none();
    let body = operation.get("requestBody").is_some();
    let parameters = operation.get("parameters").is_some();
    let refusals = [
        (400, "A parameter or the body cannot be understood", parameters || body),
        (401, "The key is missing, unknown or revoked", keyed),
        (403, "The role of the key does not reach this far", keyed),
        (404, "There is no such thing that the key may see", path.contains('{')),
        (408, "The request did not arrive in time", body),
        (413, "The body is too large", body),
        (415, "The content type is not accepted", body),
        (422, "The body was understood, but its content is refused", body),
        (500, "Our fault", true),
    ];
    let problem = json!({PROBLEM_JSON: {"schema": {"$ref": "#/components/schemas/Problem"}}});
    for (status, description, _) in refusals.into_iter().filter(|(_, _, applies)| *applies) {
        let response = &mut operation["responses"][status.to_string()];
        if response.is_null() {
            *response = json!({"description": description, "content": problem});
        }
    }
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
