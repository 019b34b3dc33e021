//! The verdict for people: every row, the score against each other method, and every loss.

use super::table::number;
use crate::evaluation::rows::ALL_EXERCISES;
use crate::evaluation::verdict::{Outcome, Statistic, Verdict, VerdictRow};
use std::io::{self, Write};

/// Width of the rule's lines, characters.
const WIDTH: usize = 118;

/// Prints the verdict, or why there is none.
pub(super) fn print(verdict: Option<&Verdict>, out: &mut dyn Write) -> io::Result<()> {
    let Some(verdict) = verdict else {
        return writeln!(out, "\nNo verdict: that takes the default and another method.");
    };
    matrix(verdict, out)?;
    writeln!(out, "\nRows of single exercises that {} beats, ties and loses", verdict.default)?;
    writeln!(out, "  {:<14} {:>5} {:>7} {:>7} {:>7}", "against", "error", "beats", "ties", "loses")?;
    for score in &verdict.scores {
        let name = score.statistic.name();
        writeln!(out, "  {:<14} {name:>5} {:>7} {:>7} {:>7}", score.against, score.beats, score.ties, score.loses)?;
    }
    writeln!(out, "{}", wrapped(verdict.rule, WIDTH))?;
    losses(verdict, out)
}

/// A line for each data set, exercise and angle, a column for each other method.
fn matrix(verdict: &Verdict, out: &mut dyn Write) -> io::Result<()> {
    let default = &verdict.default;
    writeln!(out, "\nVerdict: does {default} beat (+), tie (=) or lose (-) against the others? By MAE, then by RMSE")?;
    let mut others: Vec<&str> = verdict.scores.iter().map(|score| score.against.as_str()).collect();
    others.dedup();
    write!(out, "  {:<20} {:<32} {:<19}", "data set", "exercise", "angle")?;
    for other in &others {
        write!(out, " {other:>13}")?;
    }
    writeln!(out)?;
    let same =
        |a: &VerdictRow, b: &VerdictRow| (&a.dataset, &a.exercise, a.measure) == (&b.dataset, &b.exercise, b.measure);
    for rows in verdict.rows.chunk_by(same) {
        write!(out, "  {:<20} {:<32} {:<19}", rows[0].dataset, rows[0].exercise, rows[0].measure)?;
        for other in &others {
            let signs = Statistic::ALL.map(|statistic| {
                let row = rows.iter().find(|row| row.against == *other && row.statistic == statistic);
                row.map_or(' ', |row| match row.judgement.outcome {
                    Outcome::Beats => '+',
                    Outcome::Ties => '=',
                    Outcome::Loses => '-',
                })
            });
            write!(out, " {:>13}", signs.iter().collect::<String>())?;
        }
        writeln!(out)?;
    }
    Ok(())
}

fn losses(verdict: &Verdict, out: &mut dyn Write) -> io::Result<()> {
    let default = &verdict.default;
    if verdict.default_beats_or_ties_everywhere {
        return writeln!(out, "\n{default} beats or ties every other method on every row.");
    }
    let lost: Vec<&VerdictRow> = verdict.losses().collect();
    let single = |row: &&&VerdictRow| row.exercise != ALL_EXERCISES;
    let (n, all) = (lost.iter().filter(single).count(), verdict.rows.iter().collect::<Vec<_>>());
    writeln!(
        out,
        "\n{default} does NOT beat or tie every other method on every row: it loses {n} of {} comparisons in single \
         exercises,\nand {} of {} over all exercises of a data set. Degrees; the loss is the median of paired differences.",
        all.iter().filter(single).count(),
        lost.len() - n,
        all.len() - all.iter().filter(single).count(),
    )?;
    writeln!(
        out,
        "  {:<20} {:<32} {:<19} {:>5} {:<14} {:>7} {:>7} {:>7} {:>6} {:>7}  ground",
        "data set", "exercise", "angle", "error", "against", "default", "other", "loss", "trials", "p"
    )?;
    for row in lost {
        let judgement = &row.judgement;
        writeln!(
            out,
            "  {:<20} {:<32} {:<19} {:>5} {:<14} {:>7} {:>7} {:>7} {:>6} {:>7}  {}",
            row.dataset,
            row.exercise,
            row.measure,
            row.statistic.name(),
            row.against,
            number(judgement.default_deg, 2),
            number(judgement.against_deg, 2),
            number(judgement.difference_deg, 2),
            judgement.n_trials,
            number(judgement.p, 4),
            judgement.ground.name(),
        )?;
    }
    Ok(())
}

/// Words broken into lines of at most `width` characters.
fn wrapped(text: &str, width: usize) -> String {
    let mut lines = vec![String::new()];
    for word in text.split_whitespace() {
        let last = lines.len() - 1;
        if lines[last].is_empty() {
            lines[last].push_str(word);
        } else if lines[last].len() + 1 + word.len() > width {
            lines.push(word.to_owned());
        } else {
            lines[last] += &format!(" {word}");
        }
    }
    lines.join("\n")
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::evaluation::verdict::{RULE, Score, judge};

    fn row(exercise: &str, against: &str, statistic: Statistic, default: f64, other: f64) -> VerdictRow {
        VerdictRow {
            dataset: "lab".into(),
            exercise: exercise.into(),
            measure: "knee_flexion",
            statistic,
            against: against.into(),
            judgement: judge(&[Some(default)], &[Some(other)]).unwrap(),
        }
    }

    fn printed(rows: Vec<VerdictRow>) -> String {
        let scores = Statistic::ALL
            .map(|statistic| Score { against: "raw".into(), statistic, beats: 1, ties: 0, loses: 0 })
            .to_vec();
        let wins = rows.iter().all(|row| row.judgement.outcome != Outcome::Loses);
        let default_beats_or_ties_everywhere = wins;
        let verdict = Verdict { default: "iekf".into(), rule: RULE, default_beats_or_ties_everywhere, scores, rows };
        let mut out = Vec::new();
        print(Some(&verdict), &mut out).unwrap();
        String::from_utf8(out).unwrap()
    }

    #[test]
    fn the_claim_is_printed_only_when_there_is_no_loss() {
        let won = vec![row("squat", "raw", Statistic::Mae, 1.0, 2.0), row("squat", "raw", Statistic::Rmse, 1.0, 1.02)];
        let text = printed(won.clone());
        assert!(text.contains("iekf beats or ties every other method on every row."), "{text}");
        assert!(text.lines().any(|line| line.contains("squat") && line.ends_with(" +=")), "{text}");

        let mut lost = won;
        lost.push(row("lunge", "raw", Statistic::Mae, 3.0, 2.0));
        let text = printed(lost);
        assert!(text.contains("does NOT beat or tie") && text.contains("loses 1 of 3 comparisons"), "{text}");
        let listed = text.lines().last().unwrap();
        assert!(listed.contains("lunge") && listed.contains("1.00") && listed.ends_with("untested"), "{listed}");
    }

    #[test]
    fn the_rule_is_printed_whole_in_lines_that_fit() {
        let text = wrapped(RULE, WIDTH);
        assert!(text.lines().all(|line| line.len() <= WIDTH) && text.lines().count() > 2);
        assert_eq!(text.split_whitespace().collect::<Vec<_>>(), RULE.split_whitespace().collect::<Vec<_>>());
    }
}
