//! Rules for words and times that clients send, in the form that the validation of a field takes. Each has its twin in
//! the document: a pattern that says the same.

use time::OffsetDateTime;

/// Letters, digits, `.`, `_` and `-`, at most 64, the first a letter or digit. Spaces are out on purpose: they invite
/// names.
pub fn pseudonym(text: &str, _: &()) -> garde::Result {
    let first = text.bytes().next().is_some_and(|b| b.is_ascii_alphanumeric());
    let rest = text.bytes().all(|b| b.is_ascii_alphanumeric() || b"._-".contains(&b));
    if first && rest && text.len() <= 64 {
        return Ok(());
    }
    Err(garde::Error::new("must be 1 to 64 letters, digits, `.`, `_` or `-`, beginning with a letter or digit"))
}

/// A pseudonym that may be absent.
pub fn optional_pseudonym(text: &Option<String>, context: &()) -> garde::Result {
    text.as_ref().map_or(Ok(()), |text| pseudonym(text, context))
}

/// One lower-case word that may be absent, such as the name of a pipeline.
pub fn optional_word(text: &Option<String>, _: &()) -> garde::Result {
    let fits = |text: &String| {
        (1..=64).contains(&text.len())
            && text.bytes().all(|b| b.is_ascii_lowercase() || b.is_ascii_digit() || b == b'_')
    };
    match text {
        Some(text) if !fits(text) => Err(garde::Error::new("must be 1 to 64 lower-case letters, digits or `_`")),
        _ => Ok(()),
    }
}

/// One line: no control characters.
pub fn line(text: &Option<String>, _: &()) -> garde::Result {
    match text {
        Some(text) if text.bytes().any(|b| b.is_ascii_control()) => {
            Err(garde::Error::new("must be one line without control characters"))
        }
        _ => Ok(()),
    }
}

/// One line that must be there.
pub fn required_line(text: &str, _: &()) -> garde::Result {
    line(&Some(text.to_owned()), &())
}

/// A time that every later computation can take: the years 0 to 9999 in UTC.
pub fn calendar_time(time: &Option<OffsetDateTime>, _: &()) -> garde::Result {
    let in_utc = time.and_then(|time| time.checked_to_offset(time::UtcOffset::UTC));
    match (time, in_utc) {
        (None, _) => Ok(()),
        (Some(_), Some(utc)) if (0..=9999).contains(&utc.year()) => Ok(()),
        _ => Err(garde::Error::new("must lie in the years 0 to 9999 in UTC")),
    }
}

/// A finite number; a query can spell `NaN`.
pub fn finite(number: &Option<f64>, _: &()) -> garde::Result {
    match number {
        Some(number) if !number.is_finite() => Err(garde::Error::new("must be a finite number")),
        _ => Ok(()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_pseudonym_is_a_code_and_not_a_name() {
        assert!(pseudonym("P-017.a", &()).is_ok());
        for bad in ["", "Jane Doe", "-x", "ä", "a\n", &"x".repeat(65)] {
            assert!(pseudonym(bad, &()).is_err(), "{bad:?}");
        }
    }

    #[test]
    fn a_line_has_no_control_characters() {
        assert!(line(&Some("Übung 3, sit to stand".into()), &()).is_ok());
        assert!(line(&Some("a\nb".into()), &()).is_err());
    }

    #[test]
    fn a_time_whose_utc_form_leaves_the_calendar_is_refused() {
        let format = &time::format_description::well_known::Rfc3339;
        let late = OffsetDateTime::parse("9999-12-31T23:59:59-10:00", format).unwrap();
        assert!(calendar_time(&Some(late), &()).is_err());
        assert!(calendar_time(&Some(OffsetDateTime::UNIX_EPOCH), &()).is_ok());
    }
}
