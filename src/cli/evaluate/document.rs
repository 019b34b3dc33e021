//! The result as JSON, with what is needed to get it again.

use super::Plan;
use crate::evaluation::Evaluation;
use crate::synthetic::Preset;
use serde_json::{Value, json};
use std::fs;

pub(super) fn document(plan: &Plan, evaluation: &Evaluation) -> Value {
    let mut document = json!(evaluation);
    let contenders = plan.contenders.iter().map(|contender| {
        let settings = contender.settings(&plan.settings);
        json!({ "name": contender, "settings": settings, "pass": settings.and_then(|s| s.chosen_pass().ok()) })
    });
    let about = json!({
        "data": data(plan),
        "settings": {
            "data": plan.data,
            "noise": plan.noise.iter().map(|preset| preset.name()).collect::<Vec<_>>(),
            "seeds": plan.seeds,
            "contenders": contenders.collect::<Vec<_>>(),
        },
        "particles": plan.settings.particles,
        "seed": plan.settings.seed,
        "machine": machine(),
        "version": env!("CARGO_PKG_VERSION"),
    });
    if let (Value::Object(document), Value::Object(about)) = (&mut document, about) {
        document.extend(about);
    }
    document
}

/// Where the trials come from, in words.
fn data(plan: &Plan) -> String {
    let mut words: Vec<String> = plan.data.iter().map(|directory| directory.display().to_string()).collect();
    if !plan.noise.is_empty() {
        let noise: Vec<&str> = plan.noise.iter().copied().map(Preset::name).collect();
        words.push(format!("simulated, noise {}, {} seeds", noise.join(" "), plan.seeds));
    }
    words.join("; ")
}

/// Name and number of the processors, as far as the system tells.
fn machine() -> Value {
    let information = fs::read_to_string("/proc/cpuinfo").unwrap_or_default();
    let model = information.lines().find(|line| line.starts_with("model name"));
    let cpu = model.and_then(|line| line.split_once(':')).map_or("unknown", |(_, name)| name.trim());
    let cores = std::thread::available_parallelism().map_or(1, usize::from);
    json!({ "cpu": cpu, "cores": cores })
}
