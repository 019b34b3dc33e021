//! The OpenAPI document: the committed copy is the served one, and it says what a client needs.

use serde_json::Value;
use std::collections::HashSet;
use std::path::Path;

fn document() -> Value {
    serde_json::from_str(&surefoot::api::openapi_document()).expect("JSON")
}

/// `(path, method, operation)` of everything that the service does.
fn operations(document: &Value) -> Vec<(String, String, Value)> {
    let paths = document["paths"].as_object().expect("paths");
    let of_path = |(path, item): (&String, &Value)| {
        let item = item.as_object().expect("a path item").clone();
        let path = path.clone();
        item.into_iter().map(move |(method, operation)| (path.clone(), method, operation)).collect::<Vec<_>>()
    };
    paths.iter().flat_map(of_path).collect()
}

#[test]
fn the_committed_document_is_the_served_one() {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("openapi/openapi.json");
    let committed = std::fs::read_to_string(path).unwrap_or_default();
    assert!(
        committed == surefoot::api::openapi_document(),
        "openapi/openapi.json is not what the service serves; look at the difference after \
         `cargo run -- openapi > openapi/openapi.json` and commit it when it is meant"
    );
}

#[test]
fn every_operation_has_a_name_a_summary_a_tag_and_documented_refusals() {
    let document = document();
    let mut names = HashSet::new();
    for (path, method, operation) in operations(&document) {
        let what = format!("{method} {path}");
        assert!(names.insert(operation["operationId"].as_str().expect("a name").to_owned()), "{what}: name used twice");
        assert!(operation["summary"].is_string() && operation["tags"].is_array(), "{what}");
        let statuses: Vec<&String> = operation["responses"].as_object().expect("responses").keys().collect();
        assert!(statuses.iter().any(|status| status.starts_with('2')), "{what}: no success");
        let is_open = operation["security"] == serde_json::json!([{}]);
        if path.starts_with("/v1") && !is_open {
            assert!(statuses.iter().any(|status| *status == "401"), "{what}: needs a key and does not say so");
        }
        for (status, response) in operation["responses"].as_object().expect("responses") {
            // An answer to HEAD has no body.
            if status.starts_with(['4', '5']) && method != "head" {
                assert!(response["content"]["application/problem+json"].is_object(), "{what} {status}");
            }
        }
    }
    assert!(names.len() >= 20, "only {} operations found", names.len());
}

#[test]
fn every_reference_leads_somewhere() {
    fn check(document: &Value, value: &Value) {
        match value {
            Value::Object(fields) => {
                if let Some(Value::String(reference)) = fields.get("$ref") {
                    let pointer = reference.strip_prefix('#').expect("a local reference");
                    assert!(document.pointer(pointer).is_some(), "{reference} leads nowhere");
                }
                fields.values().for_each(|field| check(document, field));
            }
            Value::Array(items) => items.iter().for_each(|item| check(document, item)),
            _ => {}
        }
    }
    let document = document();
    check(&document, &document);
}

#[test]
fn every_link_leads_to_an_operation_and_comes_from_a_documented_answer() {
    let document = document();
    let operations = operations(&document);
    let names: HashSet<&str> = operations.iter().filter_map(|(_, _, o)| o["operationId"].as_str()).collect();
    let mut links = 0;
    for (path, method, operation) in &operations {
        for (status, response) in operation["responses"].as_object().expect("responses") {
            for link in response["links"].as_object().into_iter().flat_map(|links| links.values()) {
                links += 1;
                assert!(names.contains(link["operationId"].as_str().expect("a name")), "{method} {path}: {link}");
                assert!(response["description"].is_string(), "{method} {path} {status} is not documented");
            }
        }
    }
    assert!(links >= 20, "only {links} links found");
}

#[test]
fn closed_objects_of_the_request_bodies_say_so() {
    let document = document();
    for name in ["PatientRequest", "PatientPatch", "SessionRequest", "ClientRequest"] {
        assert_eq!(document["components"]["schemas"][name]["additionalProperties"], false, "{name}");
    }
}
