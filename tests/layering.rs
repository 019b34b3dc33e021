//! The direction of dependencies: a module uses only modules that stand above it in the house's list.

use std::fs;
use std::path::{Path, PathBuf};

/// The house, top to bottom, as in `src/lib.rs`.
const HOUSE: [&str; 19] = [
    "geometry",
    "estimation",
    "signal",
    "progress",
    "config",
    "body",
    "recording",
    "assessment",
    "pipeline",
    "synthetic",
    "evaluation",
    "fall_risk",
    "report",
    "storage",
    "queue",
    "worker",
    "api",
    "pages",
    "cli",
];

/// Pairs that must not meet although their order would allow it: (user, used).
const STRANGERS: [(&str, &str); 6] = [
    ("api", "pipeline"),
    ("api", "worker"),
    ("pages", "pipeline"),
    ("pages", "worker"),
    ("storage", "pipeline"),
    ("storage", "synthetic"),
];

/// Crates that domain code must not touch: no async, no SQL, no HTTP.
const EDGE_CRATES: [&str; 5] = ["tokio", "sqlx", "axum", "reqwest", "object_store"];

fn rust_files(folder: &Path, found: &mut Vec<PathBuf>) {
    for entry in fs::read_dir(folder).expect("readable folder") {
        let path = entry.expect("readable entry").path();
        if path.is_dir() {
            rust_files(&path, found);
        } else if path.extension().is_some_and(|e| e == "rs") {
            found.push(path);
        }
    }
}

/// Top-level modules named after `crate::` in a line, also inside braces: `use crate::{a::B, c::D}`.
fn modules_used(line: &str) -> Vec<String> {
    let mut used = Vec::new();
    for part in line.split("crate::").skip(1) {
        let names: Vec<&str> = match part.strip_prefix('{') {
            Some(list) => list.split(',').map(str::trim).collect(),
            None => vec![part],
        };
        for name in names {
            used.push(name.chars().take_while(|c| c.is_alphanumeric() || *c == '_').collect());
        }
    }
    used
}

/// `(module, file, line text)` of every line of code under `src`, comments left out.
fn lines_of_code() -> Vec<(String, PathBuf, String)> {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("src");
    let mut files = Vec::new();
    rust_files(&root, &mut files);
    let mut lines = Vec::new();
    for file in files {
        let relative = file.strip_prefix(&root).expect("under src").to_owned();
        let first = relative.iter().next().expect("a name").to_string_lossy().into_owned();
        let module = first.trim_end_matches(".rs").to_owned();
        let text = fs::read_to_string(&file).expect("readable file");
        for line in text.lines().filter(|l| !l.trim_start().starts_with("//")) {
            lines.push((module.clone(), relative.clone(), line.to_owned()));
        }
    }
    lines
}

#[test]
fn every_module_uses_only_what_stands_above_it() {
    let floor = |name: &str| HOUSE.iter().position(|m| *m == name);
    let mut checked = 0;
    for (module, file, line) in lines_of_code() {
        let Some(own) = floor(&module) else { continue };
        for used in modules_used(&line) {
            let Some(other) = floor(&used) else { continue };
            checked += 1;
            assert!(other <= own, "{} is above {used}: `{line}`", file.display());
            let strangers = STRANGERS.contains(&(module.as_str(), used.as_str()));
            assert!(!strangers, "{module} must not meet {used}: {} `{line}`", file.display());
        }
    }
    assert!(checked > 5, "only {checked} uses found: the test no longer reads the code");
}

#[test]
fn domain_code_touches_no_async_sql_or_http() {
    let edge = HOUSE.iter().position(|m| *m == "storage").expect("storage");
    for (module, file, line) in lines_of_code() {
        if HOUSE.iter().position(|m| *m == module).is_some_and(|own| own < edge) {
            for name in EDGE_CRATES {
                assert!(!line.contains(&format!("{name}::")), "{}: `{line}`", file.display());
            }
        }
    }
}

#[test]
fn every_module_of_the_crate_has_a_place_in_the_house() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("src");
    for entry in fs::read_dir(root).expect("src") {
        let name = entry.expect("entry").file_name().to_string_lossy().into_owned();
        let module = name.trim_end_matches(".rs");
        assert!(["lib", "main"].contains(&module) || HOUSE.contains(&module), "{module} is not in the list");
    }
}
