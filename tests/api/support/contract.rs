//! The OpenAPI document, held against every answer.

use super::Answer;
use axum::http::Method;
use jsonschema::Validator;
use serde_json::{Value, json};
use std::collections::HashMap;
use std::sync::{Arc, Mutex, OnceLock};

pub struct Contract {
    document: Value,
    validators: Mutex<HashMap<String, Arc<Validator>>>,
}

/// The document of the service under test.
pub fn contract() -> &'static Contract {
    static CONTRACT: OnceLock<Contract> = OnceLock::new();
    CONTRACT.get_or_init(|| Contract {
        document: serde_json::from_str(&surefoot::api::openapi_document()).unwrap(),
        validators: Mutex::default(),
    })
}

impl Contract {
    /// Panics unless the document allows this answer to this request.
    pub fn check(&self, method: &Method, address: &str, answer: &Answer) {
        let path = address.split('?').next().unwrap();
        let status = answer.status.as_u16();
        let what = format!("{method} {path} -> {status}");
        let refusal = json!({"$ref": "#/components/schemas/Problem"});
        if status >= 400 {
            assert_eq!(answer.header("content-type"), "application/problem+json", "{what}");
            // An answer to HEAD names a body and has none.
            if method != Method::HEAD {
                self.validate(&what, &refusal, &answer.json());
            }
        }
        assert!(!answer.header("x-request-id").is_empty(), "{what}: no request id");
        let Some(operation) = self.operation(method, path) else {
            let expected = [404, 405].contains(&status) || !path.starts_with("/v1");
            assert!(expected, "{what}: the document knows no such operation");
            return;
        };
        let response = &operation["responses"][status.to_string()];
        assert!(response.is_object(), "{what}: the document does not know this status");
        let kinds = response.get("content").and_then(Value::as_object);
        let kind = answer.header("content-type").split(';').next().unwrap().trim();
        match kinds {
            None => assert!(answer.body.is_empty(), "{what}: a body that the document does not know"),
            Some(kinds) => {
                let content = kinds.get(kind).unwrap_or_else(|| panic!("{what}: undocumented content type `{kind}`"));
                if kind.ends_with("json") && method != Method::HEAD {
                    self.validate(&what, &content["schema"], &answer.json());
                }
            }
        }
    }

    /// The operation whose template matches the path.
    fn operation(&self, method: &Method, path: &str) -> Option<&Value> {
        let given: Vec<&str> = path.split('/').collect();
        let paths = self.document["paths"].as_object().unwrap();
        let matching = paths.iter().find(|(template, _)| {
            let parts: Vec<&str> = template.split('/').collect();
            parts.len() == given.len()
                && parts.iter().zip(&given).all(|(part, given)| part == given || part.starts_with('{'))
        });
        matching.and_then(|(_, item)| item.get(method.as_str().to_lowercase()))
    }

    fn validate(&self, what: &str, schema: &Value, body: &Value) {
        let validator = self.validator(schema);
        let errors: Vec<String> =
            validator.iter_errors(body).map(|error| format!("{}: {error}", error.instance_path())).collect();
        assert!(errors.is_empty(), "{what}: not as documented: {}\n{body:#}", errors.join("; "));
    }

    fn validator(&self, schema: &Value) -> Arc<Validator> {
        let mut validators = self.validators.lock().unwrap();
        let made = validators.entry(schema.to_string()).or_insert_with(|| {
            let mut root = schema.clone();
            root["components"] = self.document["components"].clone();
            let options = jsonschema::options().with_draft(jsonschema::Draft::Draft202012);
            Arc::new(options.should_validate_formats(true).build(&root).expect("a schema of the document"))
        });
        made.clone()
    }
}
