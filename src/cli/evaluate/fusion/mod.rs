//! `surefoot evaluate fusion`: camera skeleton and inertial units fused, beside a known truth and beside a real unit.

mod simulated;
mod subsets;
mod thigh;

use super::watch::Watch;
use crate::evaluation::fusion::Contender;
use crate::evaluation::fusion::simulated::{OCCLUSION_S, Outcome, Plan, run as run_simulated};
use crate::evaluation::fusion::summary::{totals, unit_totals};
use crate::recording::Segment;
use crate::synthetic::Movement;
use anyhow::bail;
use clap::builder::{PossibleValuesParser, TypedValueParser};
use serde_json::json;
use std::io::Write;
use std::path::PathBuf;

/// Elbows and knees: the joints of \[fusion\] Table 1.
const HINGES: [&str; 2] = ["elbow_flexion", "knee_flexion"];

/// The other angles.
const OTHERS: [&str; 6] = [
    "hip_flexion",
    "hip_abduction",
    "hip_axial_rotation",
    "trunk_flexion",
    "trunk_lateral_bending",
    "trunk_axial_rotation",
];

/// Compare the fusion of a camera skeleton and inertial units with the camera alone, the units alone and the paper's hierarchy.
///
/// Simulated: persons kick or bend their elbows for 30 s after plank and five jumps, with nine units that sit 5 to 10 degrees
/// off the scheme, clocks that are up to 2 s and 100 ppm off, soft tissue, and a Kinect with slow offsets that does not see a
/// limb, several or the whole body for 20 s. Prints the paper's Table 1 (elbows and knees: root mean square error, the same
/// without the constant offset, correlation, and error of the angular velocity), hips and trunk, and the errors of the
/// clocks. Angles count from the T-posture on. `raw` is the three-point angle of the camera's joints, where it saw them.
///
/// Real: the right thigh of UTD-MHAD, a Kinect v1 and one unit; the reference is that unit's own tilt against gravity, and
/// the price is how far the knee moves from where the camera saw it.
#[derive(Debug, clap::Args)]
#[command(after_help = "Examples:\n  surefoot evaluate fusion --simulated\n  \
    surefoot evaluate fusion --simulated --movements kick --units right_thigh,right_shank --no-plank\n  \
    surefoot evaluate fusion --simulated --subsets\n  \
    surefoot evaluate fusion --data ../shared/data --trials\n  \
    surefoot evaluate fusion --json > fusion.json")]
pub(super) struct FusionArgs {
    /// Evaluate simulated recordings only
    #[arg(long)]
    simulated: bool,
    /// Evaluate real recordings only: directory of the data sets, or utdmhad itself [default: both kinds, with $SUREFOOT_DATA,
    /// else ../shared/data]
    #[arg(long, value_name = "DIR", conflicts_with = "simulated")]
    data: Option<PathBuf>,
    /// Movements of simulated recordings, comma separated: kick, kick_left, elbow, or an exercise of `surefoot simulate`
    /// [default: the first three]
    #[arg(long, value_delimiter = ',', value_name = "LIST")]
    movements: Vec<Movement>,
    /// Simulated persons for each movement
    #[arg(long, value_name = "N", default_value_t = 6, value_parser = clap::value_parser!(u64).range(1..=10_000))]
    seeds: u64,
    /// Length of simulated movements, seconds
    #[arg(long, value_name = "S", default_value_t = 30.0)]
    seconds: f64,
    /// Time in which the camera does not see parts of the body in simulated recordings, seconds
    #[arg(long, value_name = "S", default_value_t = OCCLUSION_S)]
    occlusion: f64,
    /// Segments whose units simulated recordings keep, comma separated, for example right_thigh,right_shank [default: all
    /// nine]
    #[arg(long, value_delimiter = ',', value_name = "LIST")]
    units: Vec<Segment>,
    /// Simulated units are put on without lying on a common plank before
    #[arg(long)]
    no_plank: bool,
    /// Methods, comma separated [default: all]
    #[arg(long, value_delimiter = ',', value_name = "LIST", value_parser = contender_parser())]
    methods: Vec<Contender>,
    /// Compare the default with fewer units instead: one leg, one arm, one segment, the chest
    #[arg(long, conflicts_with_all = ["units", "methods", "data"])]
    subsets: bool,
    /// Print every trial too
    #[arg(long)]
    trials: bool,
    /// Print one JSON object with every trial
    #[arg(long)]
    json: bool,
}

fn contender_parser() -> impl TypedValueParser<Value = Contender> {
    PossibleValuesParser::new(Contender::ALL.map(Contender::name)).try_map(|name| name.parse::<Contender>())
}

pub(super) fn run(args: &FusionArgs, out: &mut dyn Write) -> anyhow::Result<()> {
    if args.subsets {
        return subsets::run(args, out);
    }
    let contenders = if args.methods.is_empty() { Contender::ALL.to_vec() } else { args.methods.clone() };
    let outcomes = if args.data.is_none() { outcomes(&plan(args, contenders.clone())?) } else { Vec::new() };
    let thighs = if args.simulated { Vec::new() } else { thigh::trials(args.data.as_deref(), &contenders)? };
    if args.json {
        let joints = [&HINGES[..], &OTHERS[..]].concat();
        let document = json!({
            "simulated": {
                "totals": totals(&outcomes, &joints),
                "units": unit_totals(&outcomes),
                "trials": outcomes,
            },
            "utdmhad": thighs,
            "version": env!("CARGO_PKG_VERSION"),
        });
        writeln!(out, "{}", serde_json::to_string_pretty(&document)?)?;
        return Ok(());
    }
    if !outcomes.is_empty() {
        simulated::write(&outcomes, args.trials, out)?;
    }
    if !thighs.is_empty() {
        thigh::write(&thighs, args.trials, out)?;
    }
    Ok(())
}

fn plan(args: &FusionArgs, contenders: Vec<Contender>) -> anyhow::Result<Plan> {
    if let Some(segment) = args.units.iter().find(|segment| segment.bone().is_none()) {
        bail!("no simulated unit is worn on {segment}");
    }
    let usual = Plan::new((1..=args.seeds).collect(), contenders);
    Ok(Plan {
        movements: if args.movements.is_empty() { usual.movements } else { args.movements.clone() },
        units: (!args.units.is_empty()).then(|| args.units.clone()),
        plank: !args.no_plank,
        movement_s: args.seconds,
        occlusion_s: args.occlusion,
        ..usual
    })
}

/// Runs a plan, saying how far it is.
fn outcomes(plan: &Plan) -> Vec<Outcome> {
    let watch = Watch::new((plan.movements.len() * plan.seeds.len()) as u64);
    let outcomes = run_simulated(plan, || watch.one_more());
    watch.finish();
    outcomes
}

fn number(value: Option<f64>, decimals: usize) -> String {
    value.map_or("-".to_owned(), |value| format!("{value:.decimals$}"))
}

fn percent(share: Option<f64>) -> String {
    share.map_or("-".to_owned(), |share| format!("{:.0}%", 100.0 * share))
}

#[cfg(test)]
mod tests;
