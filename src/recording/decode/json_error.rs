//! From a parser's complaint to a defect with a code and a field path.

use crate::recording::DecodeError;
use serde_json::error::Category;
use std::fmt::Write;

/// The defect behind a JSON error in `text`; `root` is the path of the whole text, for example `frames[17]`.
pub(super) fn defect_in_json(text: &[u8], error: &serde_json::Error, root: &str) -> DecodeError {
    let offset = offset_of(text, error.line(), error.column());
    let place = place_of(text, offset, root);
    // The parser's own words end with the place, which is given apart.
    let full = error.to_string();
    let words = full.rsplit_once(" at line ").map_or(full.as_str(), |(words, _)| words);
    // A number that is cut after its sign or its point is called invalid, not unfinished.
    let is_cut = error.is_eof() || (words.contains("invalid number") && offset == text.len());
    let defect = match error.classify() {
        _ if is_cut => DecodeError::new(
            "truncated",
            format!("the JSON text ends in the middle ({words}); send the whole recording again"),
        ),
        Category::Syntax | Category::Io | Category::Eof
            if is_not_finite(text, offset) || words.contains("number out of range") =>
        {
            DecodeError::new(
                "not_finite",
                "found a number that is not finite (NaN, Infinity or beyond a 64-bit float); every number must be \
                 finite, a lost joint is written as null",
            )
        }
        Category::Syntax | Category::Io | Category::Eof => {
            DecodeError::new("invalid_json", format!("this is not valid JSON: {words}; write it with a JSON library"))
        }
        Category::Data if words.starts_with("missing field") => {
            DecodeError::new("missing_field", format!("{words}; see the page on the recording format"))
        }
        Category::Data if words.starts_with("unknown field") => {
            DecodeError::new("unknown_field", format!("{words}; check its spelling or leave it out"))
        }
        Category::Data => DecodeError::new("invalid_value", format!("{words}; see the page on the recording format")),
    };
    defect.at(place)
}

/// Byte at which a parser stopped, from its line and column, both from 1.
fn offset_of(text: &[u8], line: usize, column: usize) -> usize {
    let start = if line <= 1 {
        0
    } else {
        let ends = text.iter().enumerate().filter(|(_, byte)| **byte == b'\n');
        ends.map(|(i, _)| i + 1).nth(line - 2).unwrap_or(text.len())
    };
    (start + column).min(text.len())
}

/// True when the parser stopped at a token by which common writers spell a number that is not finite.
fn is_not_finite(text: &[u8], offset: usize) -> bool {
    // The parser stops on the first or the second letter of the token, after a sign or not.
    let around = &text[offset.saturating_sub(3)..(offset + 8).min(text.len())];
    let window = String::from_utf8_lossy(around).to_ascii_lowercase();
    window.contains("nan") || window.contains("inf")
}

/// Path of the value that holds byte `offset`, below `root`; the byte itself where there is no path.
fn place_of(text: &[u8], offset: usize, root: &str) -> String {
    let mut path = root.to_owned();
    for step in steps_to(&text[..offset]) {
        match step {
            Step::Element(i) => {
                // Writing to a string cannot fail.
                let _ = write!(path, "[{i}]");
            }
            Step::Field(name) if !name.is_empty() => {
                if !path.is_empty() {
                    path.push('.');
                }
                path.push_str(&name);
            }
            Step::Field(_) => {}
        }
    }
    if path.is_empty() { format!("byte {offset}") } else { path }
}

enum Step {
    Element(usize),
    Field(String),
}

/// Depth after which the path is no longer followed; the parser gives up at 128.
const MAX_DEPTH: usize = 160;

/// Open lists and objects at the end of a piece of JSON, outermost first. Tolerates anything.
fn steps_to(text: &[u8]) -> Vec<Step> {
    let mut steps: Vec<Step> = Vec::new();
    let mut last_string = None;
    let mut i = 0;
    while i < text.len() && steps.len() < MAX_DEPTH {
        match text[i] {
            b'"' => {
                let start = i + 1;
                i = start;
                while i < text.len() && text[i] != b'"' {
                    i += if text[i] == b'\\' { 2 } else { 1 };
                }
                last_string = Some(start..i.min(text.len()));
            }
            b':' => {
                if let (Some(Step::Field(name)), Some(range)) = (steps.last_mut(), last_string.take()) {
                    // A name is echoed back only as far as a person can use it.
                    let bytes = &text[range];
                    *name = String::from_utf8_lossy(&bytes[..bytes.len().min(64)]).into_owned();
                }
            }
            b',' => match steps.last_mut() {
                Some(Step::Element(index)) => *index += 1,
                Some(Step::Field(name)) => name.clear(),
                None => {}
            },
            b'[' => steps.push(Step::Element(0)),
            b'{' => steps.push(Step::Field(String::new())),
            b']' | b'}' => {
                steps.pop();
            }
            _ => {}
        }
        i += 1;
    }
    steps
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde::Deserialize;

    #[derive(Debug, Deserialize)]
    #[serde(deny_unknown_fields)]
    struct Example {
        #[serde(rename = "rows")]
        _rows: Vec<Vec<f64>>,
    }

    fn defect(text: &str) -> (&'static str, String) {
        let error = serde_json::from_str::<Example>(text).expect_err("a defect");
        let defect = defect_in_json(text.as_bytes(), &error, "root");
        (defect.code, defect.place.unwrap_or_default())
    }

    #[test]
    fn the_spellings_of_not_finite_are_told_from_bad_syntax_and_located() {
        for token in ["NaN", "Infinity", "-Infinity", "nan", "-inf", "1e999"] {
            assert_eq!(
                defect(&format!("{{\"rows\": [[1, 2],\n [3, {token}]]}}")),
                ("not_finite", "root.rows[1][1]".into()),
                "{token}"
            );
        }
        assert_eq!(defect("{\"rows\": [[1, 2], [3, oops]]}"), ("invalid_json", "root.rows[1][1]".into()));
    }

    #[test]
    fn data_errors_carry_the_path_and_their_own_code() {
        assert_eq!(defect("{\"rows\": [[1], [2, \"x\"]]}"), ("invalid_value", "root.rows[1][1]".into()));
        assert_eq!(defect("{}").0, "missing_field");
        assert_eq!(defect("{\"colour\": 1}").0, "unknown_field");
        assert_eq!(defect("{\"rows\": [[1, 2").0, "truncated");
    }
}
