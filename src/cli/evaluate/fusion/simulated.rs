//! Tables of simulated recordings.

use super::{HINGES, OTHERS, number, percent};
use crate::evaluation::fusion::simulated::Outcome;
use crate::evaluation::fusion::summary::{Means, Total, contenders, totals, unit_totals};
use std::io::{self, Write};

/// Elbows and knees of the paper's Table 1, in its order.
const JOINTS: [(&str, &str); 4] = [
    ("left_elbow_flexion_deg", "left elbow"),
    ("right_elbow_flexion_deg", "right elbow"),
    ("left_knee_flexion_deg", "left knee"),
    ("right_knee_flexion_deg", "right knee"),
];

pub(super) fn write(outcomes: &[Outcome], has_trials: bool, out: &mut dyn Write) -> io::Result<()> {
    table_1(outcomes, out)?;
    if has_trials {
        trials(outcomes, out)?;
    }
    writeln!(
        out,
        "\nDegrees, means over persons: root mean square error, the same without the constant offset, zero-mean normalised \
         cross-correlation (Pearson's), root mean square error of the angular velocity (degrees per second, central \
         differences), share of 95 % intervals that hold the truth.\n"
    )?;
    overall(&totals(outcomes, &HINGES), out)?;
    writeln!(out)?;
    overall(&totals(outcomes, &OTHERS), out)?;
    writeln!(
        out,
        "\nlowest NCC and worst: of one angle in one recording; seen: share of the time with an estimate.\n"
    )?;
    units(outcomes, out)?;
    for outcome in outcomes {
        if let Some(failure) = &outcome.failure {
            writeln!(out, "failed: {} {} {}: {failure}", outcome.movement, outcome.seed, outcome.contender)?;
        }
    }
    Ok(())
}

/// The paper's Table 1: one block of columns for each movement.
fn table_1(outcomes: &[Outcome], out: &mut dyn Write) -> io::Result<()> {
    let mut movements: Vec<&str> = outcomes.iter().map(|outcome| outcome.movement.as_str()).collect();
    movements.dedup();
    write!(out, "{:<22}", "")?;
    for movement in &movements {
        write!(out, " | {movement:<31}")?;
    }
    write!(out, "\n{:<12} {:<9}", "joint", "method")?;
    for _ in &movements {
        write!(out, " | {:>6} {:>6} {:>6} {:>5} {:>4}", "RMSE", "free", "NCC", "deg/s", "held")?;
    }
    writeln!(out)?;
    for (channel, name) in JOINTS {
        for contender in contenders(outcomes) {
            write!(out, "{name:<12} {:<9}", contender.name())?;
            for movement in &movements {
                let own = outcomes.iter().filter(|o| o.contender == contender && o.movement == *movement);
                let means = Means::of(own.flat_map(|outcome| &outcome.angles).filter(|error| error.channel == channel));
                write!(
                    out,
                    " | {:>6} {:>6} {:>6} {:>5} {:>4}",
                    number(means.map(|m| m.rmse_deg), 2),
                    number(means.map(|m| m.offset_free_deg), 2),
                    number(means.and_then(|m| m.ncc), 3),
                    number(means.and_then(|m| m.speed_rmse_deg_s), 1),
                    percent(means.and_then(|m| m.held)),
                )?;
            }
            writeln!(out)?;
        }
    }
    Ok(())
}

/// Elbows and knees of every recording, root mean square error and correlation.
fn trials(outcomes: &[Outcome], out: &mut dyn Write) -> io::Result<()> {
    writeln!(
        out,
        "\n{:<12} {:>4} {:<9} {}",
        "movement",
        "seed",
        "method",
        JOINTS.map(|(_, name)| format!("{name:>14}")).concat()
    )?;
    for outcome in outcomes {
        let cells = JOINTS.map(|(channel, _)| {
            let error = outcome.angles.iter().find(|error| error.channel == channel);
            let rmse = number(error.map(|error| error.rmse_deg), 2);
            format!("{rmse:>8}/{:<5}", number(error.and_then(|error| error.ncc), 3))
        });
        let name = outcome.contender.name();
        writeln!(out, "{:<12} {:>4} {name:<9} {}", outcome.movement, outcome.seed, cells.concat())?;
    }
    Ok(())
}

fn overall(totals: &[Total], out: &mut dyn Write) -> io::Result<()> {
    writeln!(
        out,
        "{:<22} {:<9} {:>3} {:>6} {:>6} {:>6} {:>10} {:>6} {:>4} {:>4} {:>6}  worst",
        "all movements", "method", "n", "RMSE", "free", "NCC", "lowest NCC", "deg/s", "held", "seen", "failed"
    )?;
    for total in totals {
        let means = &total.means;
        writeln!(
            out,
            "{:<22} {:<9} {:>3} {:>6.2} {:>6.2} {:>6} {:>10} {:>6} {:>4} {:>4} {:>6}  {:.2} ({})",
            total.joint.replace('_', " "),
            total.contender.name(),
            means.n,
            means.rmse_deg,
            means.offset_free_deg,
            number(means.ncc, 3),
            number(means.lowest_ncc, 3),
            number(means.speed_rmse_deg_s, 1),
            percent(means.held),
            percent(Some(means.coverage)),
            total.n_failed,
            total.worst_deg,
            total.worst,
        )?;
    }
    Ok(())
}

fn units(outcomes: &[Outcome], out: &mut dyn Write) -> io::Result<()> {
    let totals = unit_totals(outcomes);
    if totals.is_empty() {
        return Ok(());
    }
    writeln!(
        out,
        "{:<10} {:>6} {:>9} {:>27} {:>32}",
        "method", "units", "by jumps", "clock, ms", "mounting, at least, degrees"
    )?;
    for total in totals {
        let three = |[median, most, largest]: [f64; 3]| format!("{median:.1} / {most:.1} / {largest:.1}");
        writeln!(
            out,
            "{:<10} {:>6} {:>9} {:>27} {:>32}",
            total.contender.name(),
            total.n,
            total.n_by_jumps,
            three(total.clock_ms),
            three(total.mounting_at_least_deg),
        )?;
    }
    writeln!(out, "\nLargest error of a unit's clock over its recording: median, 90 % and largest of the units.")
}
