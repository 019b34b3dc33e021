//! FHIR resources held against the R4B models of the Python package `fhir.resources`, when it is there.

use serde_json::Value;
use std::io::Write;
use std::process::{Command, Stdio};

const SCRIPT: &str = "
import json, sys
from fhir.resources.R4B import get_fhir_model_class
text = sys.stdin.read()
get_fhir_model_class(json.loads(text)['resourceType']).model_validate_json(text)
";

/// Panics when a resource is not valid; says that it was not checked when Python lacks the package.
pub fn validate(resource: &Value) {
    let is_there = Command::new("python3").args(["-c", "import fhir.resources"]).output();
    if !is_there.is_ok_and(|output| output.status.success()) {
        println!("skipped: python3 with the package `fhir.resources` is not there");
        return;
    }
    let python = Command::new("python3").args(["-c", SCRIPT]).stdin(Stdio::piped()).stderr(Stdio::piped()).spawn();
    let mut python = python.unwrap();
    python.stdin.take().unwrap().write_all(resource.to_string().as_bytes()).unwrap();
    let output = python.wait_with_output().unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
}
