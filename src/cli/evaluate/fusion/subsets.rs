//! The default with fewer units than nine.

use super::{FusionArgs, number, outcomes, percent, plan};
use crate::assessment::FusionMethod;
use crate::evaluation::fusion::Contender;
use crate::evaluation::fusion::simulated::Plan;
use crate::evaluation::fusion::summary::Means;
use crate::recording::Segment;
use crate::synthetic::Movement;
use serde::Serialize;
use serde_json::json;
use std::io::Write;

const FUSED: Contender = Contender::Method(FusionMethod::Fused);

/// Units that are kept, and the name of the set.
const SUBSETS: [(&str, &[Segment]); 7] = [
    (
        "both legs and chest",
        &[Segment::Chest, Segment::LeftThigh, Segment::LeftShank, Segment::RightThigh, Segment::RightShank],
    ),
    ("right thigh and shank", &[Segment::RightThigh, Segment::RightShank]),
    ("right thigh", &[Segment::RightThigh]),
    ("right shank", &[Segment::RightShank]),
    ("right upper arm and forearm", &[Segment::RightUpperArm, Segment::RightForearm]),
    ("right forearm", &[Segment::RightForearm]),
    ("chest", &[Segment::Chest]),
];

/// One set of units in one movement.
#[derive(Debug, Serialize)]
struct Row {
    units: String,
    movement: String,
    right_elbow: Option<Means>,
    right_knee: Option<Means>,
    n_failed: usize,
}

pub(super) fn run(args: &FusionArgs, out: &mut dyn Write) -> anyhow::Result<()> {
    let all = plan(args, vec![FUSED])?;
    let mut rows = Vec::new();
    let camera = Contender::Method(FusionMethod::Camera);
    rows.extend(of_plan("none: camera alone", &Plan { contenders: vec![camera], ..all.clone() }));
    rows.extend(of_plan("all nine", &all));
    for (name, units) in SUBSETS {
        rows.extend(of_plan(name, &Plan { units: Some(units.to_vec()), ..all.clone() }));
    }
    if args.json {
        let document = json!({ "subsets": rows, "version": env!("CARGO_PKG_VERSION") });
        writeln!(out, "{}", serde_json::to_string_pretty(&document)?)?;
        return Ok(());
    }
    let names = all.movements.iter().map(Movement::name);
    for movement in names {
        writeln!(out, "{movement:<28} {:^30} {:^30}", "right elbow", "right knee")?;
        let columns = format!("{:>7} {:>7} {:>7} {:>6}", "RMSE", "free", "NCC", "held");
        writeln!(out, "{:<28} {columns} {columns}", "units")?;
        for row in rows.iter().filter(|row| row.movement == movement) {
            let cells = |means: Option<Means>| {
                format!(
                    "{:>7} {:>7} {:>7} {:>6}",
                    number(means.map(|m| m.rmse_deg), 2),
                    number(means.map(|m| m.offset_free_deg), 2),
                    number(means.and_then(|m| m.ncc), 3),
                    percent(means.and_then(|m| m.held)),
                )
            };
            let failed = if row.n_failed > 0 { format!("  {} failed", row.n_failed) } else { String::new() };
            writeln!(out, "{:<28} {} {}{failed}", row.units, cells(row.right_elbow), cells(row.right_knee))?;
        }
        writeln!(out)?;
    }
    Ok(())
}

fn of_plan(name: &str, plan: &Plan) -> Vec<Row> {
    let found = outcomes(plan);
    let row = |movement: &Movement| {
        let own = || found.iter().filter(|outcome| outcome.movement == movement.name());
        let of = |channel: &str| Means::of(own().flat_map(|o| &o.angles).filter(|error| error.channel == channel));
        Row {
            units: name.to_owned(),
            movement: movement.name().to_owned(),
            right_elbow: of("right_elbow_flexion_deg"),
            right_knee: of("right_knee_flexion_deg"),
            n_failed: own().filter(|outcome| outcome.failure.is_some()).count(),
        }
    };
    plan.movements.iter().map(row).collect()
}
