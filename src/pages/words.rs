//! Numbers, times and states in the words of a page.

use crate::fall_risk::{Cutoff, Evidence, RiskSide, Status};
use time::OffsetDateTime;

/// Half the width of a 95 % interval in standard errors.
const Z95: f64 = 1.959_963_985;

/// A number with three digits that count, and not more than three decimals.
pub(super) fn number(value: f64) -> String {
    let size = value.abs();
    let text = if size >= 100.0 {
        format!("{value:.0}")
    } else if size >= 10.0 {
        format!("{value:.1}")
    } else if size >= 1.0 {
        format!("{value:.2}")
    } else {
        format!("{value:.3}")
    };
    // What rounds to zero has no sign.
    let text = if text.trim_start_matches(['-', '0', '.']).is_empty() { text.replace('-', "") } else { text };
    text.replace('-', "\u{2212}")
}

/// A whole number as it is, any other with three digits.
fn number_of(value: f64, unit: &str) -> String {
    let is_count = ["1", "{items}", "{points}"].contains(&unit) && value.fract() == 0.0;
    if is_count { format!("{value:.0}").replace('-', "\u{2212}") } else { number(value) }
}

/// A UCUM unit as people write it; empty for counts.
fn unit(ucum: &str) -> String {
    match ucum {
        "1" => String::new(),
        "deg" => "°".to_owned(),
        "deg/s" => "°/s".to_owned(),
        "m2" => "m²".to_owned(),
        other => other.replace(['{', '}'], ""),
    }
}

/// A value with its unit.
pub(super) fn quantity(value: f64, ucum: &str) -> String {
    with_unit(number_of(value, ucum), ucum)
}

/// A difference with its sign and unit.
pub(super) fn difference(value: f64, ucum: &str) -> String {
    let sign = if value > 0.0 { "+" } else { "" };
    with_unit(format!("{sign}{}", number_of(value, ucum)), ucum)
}

/// Two ends of an interval with their unit.
pub(super) fn range(low: f64, high: f64, ucum: &str) -> String {
    with_unit(format!("{} to {}", number(low), number(high)), ucum)
}

/// The 95 % interval of a value with a standard error.
pub(super) fn interval(value: f64, standard_error: Option<f64>, ucum: &str) -> Option<String> {
    standard_error.map(|se| range(value - Z95 * se, value + Z95 * se, ucum))
}

fn with_unit(text: String, ucum: &str) -> String {
    match unit(ucum).as_str() {
        "" => text,
        "°" => format!("{text}°"),
        // A space that no line breaks at.
        unit => format!("{text}\u{a0}{unit}"),
    }
}

/// A share of one in percent.
pub(super) fn percent(share: f64) -> String {
    let percent = 100.0 * share;
    // Nearly all is not all, and nearly nothing is not nothing.
    let text = match percent {
        p if (99.5..100.0).contains(&p) => "more than 99".to_owned(),
        p if p > 0.0 && p < 0.5 => "less than 1".to_owned(),
        p => format!("{p:.0}"),
    };
    format!("{text}\u{a0}%")
}

/// A day.
pub(super) fn day(time: OffsetDateTime) -> String {
    const MONTHS: [&str; 12] = ["Jan", "Feb", "Mar", "Apr", "May", "Jun", "Jul", "Aug", "Sep", "Oct", "Nov", "Dec"];
    let utc = time.to_offset(time::UtcOffset::UTC);
    let month = MONTHS[usize::from(u8::from(utc.month())) - 1];
    format!("{}\u{a0}{month}\u{a0}{}", utc.day(), utc.year())
}

/// A day and a time.
pub(super) fn moment(time: OffsetDateTime) -> String {
    let utc = time.to_offset(time::UtcOffset::UTC);
    format!("{}, {:02}:{:02}\u{a0}UTC", day(time), utc.hour(), utc.minute())
}

/// Seconds into a recording.
pub(super) fn seconds(value: f64) -> String {
    format!("{value:.2}\u{a0}s")
}

/// How often, in words up to twelve, as sentences begin with it.
pub(super) fn count(n: u64) -> String {
    const WORDS: [&str; 13] =
        ["no", "one", "two", "three", "four", "five", "six", "seven", "eight", "nine", "ten", "eleven", "twelve"];
    usize::try_from(n).ok().and_then(|n| WORDS.get(n)).map_or_else(|| n.to_string(), |word| (*word).to_owned())
}

/// The same text with a capital at its beginning.
pub(super) fn sentence(text: &str) -> String {
    let mut letters = text.chars();
    letters.next().map_or_else(String::new, |first| first.to_uppercase().chain(letters).collect())
}

/// A name such as `sit_to_stand` as people write it.
pub(super) fn spoken(name: &str) -> String {
    sentence(&name.replace('_', " "))
}

/// What a rule found, in one word.
pub(super) fn status(status: Option<Status>) -> &'static str {
    match status {
        Some(Status::Positive) => "Positive",
        Some(Status::Negative) => "Negative",
        Some(Status::Indeterminate) => "Indeterminate",
        Some(Status::Unknown) => "Unknown",
        Some(Status::NotAssessable) => "Not assessable",
        None => "Information",
    }
}

/// A limit in words.
pub(super) fn cutoff(cutoff: &Cutoff, ucum: &str) -> String {
    let limit = quantity(cutoff.value, ucum);
    match cutoff.side {
        RiskSide::AtLeast => format!("{limit} or more"),
        RiskSide::Above => format!("more than {limit}"),
        RiskSide::AtMost => format!("{limit} or less"),
        RiskSide::Below => format!("less than {limit}"),
    }
}

/// How well a number is confirmed, in words.
pub(super) fn evidence(evidence: Evidence) -> &'static str {
    match evidence {
        Evidence::Stated => "stated in the cited source",
        Evidence::Quoted => "quoted by another source",
        Evidence::Unconfirmed => "unconfirmed: must not guide care",
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use time::macros::datetime;

    #[test]
    fn numbers_show_the_digits_that_count_and_their_unit() {
        assert_eq!((number(0.7004), number(12.345), number(1234.5)), ("0.700".into(), "12.3".into(), "1234".into()));
        assert_eq!((number(-0.0001), number(-2.5)), ("0.000".to_owned(), "\u{2212}2.50".to_owned()));
        assert_eq!((quantity(0.7, "m/s"), quantity(11.0, "1")), ("0.700\u{a0}m/s".into(), "11".into()));
        assert_eq!(quantity(98.2, "{steps}/min"), "98.2\u{a0}steps/min");
        assert_eq!((quantity(61.0, "deg"), difference(0.1, "s")), ("61.0°".into(), "+0.100\u{a0}s".into()));
        assert_eq!(interval(1.0, Some(0.1), "s").unwrap(), "0.804 to 1.20\u{a0}s");
        assert_eq!(interval(1.0, None, "s"), None);
    }

    #[test]
    fn nearly_all_is_not_all() {
        assert_eq!((percent(0.9999), percent(1.0)), ("more than 99\u{a0}%".into(), "100\u{a0}%".into()));
        assert_eq!((percent(0.001), percent(0.0)), ("less than 1\u{a0}%".into(), "0\u{a0}%".into()));
    }

    #[test]
    fn a_limit_says_on_which_side_the_risk_is() {
        assert_eq!(cutoff(&Cutoff::above(15.0, Evidence::Stated), "s"), "more than 15.0\u{a0}s");
        assert_eq!(cutoff(&Cutoff::at_most(0.8, Evidence::Stated), "m/s"), "0.800\u{a0}m/s or less");
    }

    #[test]
    fn times_are_told_in_utc() {
        assert_eq!(moment(datetime!(2026-03-15 23:30 -2)), "16\u{a0}Mar\u{a0}2026, 01:30\u{a0}UTC");
        assert_eq!((count(3), count(13), spoken("sit_to_stand")), ("three".into(), "13".into(), "Sit to stand".into()));
    }
}
