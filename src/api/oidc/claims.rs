//! From the claims of a token to a user of this service.

use super::super::error::ApiError;
use crate::config::OidcConfig;
use crate::storage::{Provided, Role};
use serde_json::{Map, Value};

/// Longest subject, bytes (OpenID Connect Core, section 2).
const LONGEST_SUBJECT: usize = 255;
/// Longest label, characters, as that of a key.
const LONGEST_LABEL: usize = 64;

/// Who it is, what they may do, and where.
pub(super) fn provided(config: &OidcConfig, claims: &Map<String, Value>) -> Result<Provided, ApiError> {
    const SUBJECT: &str = "The bearer token names no subject.";
    let subject = claims.get("sub").and_then(Value::as_str).filter(|subject| {
        !subject.is_empty() && subject.len() <= LONGEST_SUBJECT && !subject.chars().any(char::is_control)
    });
    let subject = subject.ok_or(ApiError::Unauthenticated(SUBJECT))?.to_owned();
    let roles = claim(claims, &config.roles_claim).map(words).unwrap_or_default();
    let has = |role: &String| !role.is_empty() && roles.contains(&role.as_str());
    let role = match () {
        () if has(&config.admin_role) => Role::Admin,
        () if has(&config.clinician_role) => Role::Clinician,
        () => return Err(ApiError::Forbidden("clinician or admin")),
    };
    let organisation = claim(claims, &config.organisation_claim).and_then(Value::as_str);
    let organisation = organisation.ok_or(ApiError::Forbidden("clinician or admin of an organisation"))?.to_owned();
    let label = claim(claims, &config.label_claim).and_then(Value::as_str).map(plain).filter(|label| !label.is_empty());
    let label = label.unwrap_or_else(|| plain(&subject));
    Ok(Provided { issuer: config.issuer.clone(), subject, organisation, role, label })
}

/// A claim by its name, or by the way to it through objects; names may have points of their own.
fn claim<'a>(claims: &'a Map<String, Value>, name: &str) -> Option<&'a Value> {
    if let Some(value) = claims.get(name) {
        return Some(value);
    }
    let mut parts = name.split('.');
    let first = claims.get(parts.next()?)?;
    parts.try_fold(first, |value, part| value.get(part))
}

fn words(value: &Value) -> Vec<&str> {
    match value {
        Value::String(text) => text.split_whitespace().collect(),
        Value::Array(items) => items.iter().filter_map(Value::as_str).collect(),
        _ => Vec::new(),
    }
}

/// One line of bearable length.
fn plain(text: &str) -> String {
    text.chars().filter(|letter| !letter.is_control()).take(LONGEST_LABEL).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    fn read(claims: Value) -> Result<Provided, ApiError> {
        let config = OidcConfig {
            issuer: "https://id.example".into(),
            roles_claim: "realm.roles".into(),
            ..OidcConfig::default()
        };
        provided(&config, claims.as_object().unwrap())
    }

    #[test]
    fn roles_are_a_list_or_words_at_the_end_of_a_way() {
        let list = json!({"sub": "42", "realm": {"roles": ["other", "clinician"]}, "organisation": "clinic"});
        let user = read(list).unwrap();
        assert_eq!((user.role, user.label.as_str(), user.organisation.as_str()), (Role::Clinician, "42", "clinic"));
        let words =
            json!({"sub": "42", "realm.roles": "clinician admin", "organisation": "clinic", "name": "Dr\n Kim"});
        let user = read(words).unwrap();
        assert_eq!((user.role, user.label.as_str()), (Role::Admin, "Dr Kim"));
    }

    #[test]
    fn what_is_not_said_is_not_given() {
        for (claims, forbidden) in [
            (json!({"realm": {"roles": ["admin"]}, "organisation": "clinic"}), false),
            (json!({"sub": "", "realm": {"roles": ["admin"]}, "organisation": "clinic"}), false),
            (json!({"sub": "42", "organisation": "clinic"}), true),
            (json!({"sub": "42", "realm": {"roles": ["administrator"]}, "organisation": "clinic"}), true),
            (json!({"sub": "42", "realm": {"roles": ["admin"]}}), true),
        ] {
            let answer = read(claims);
            assert_eq!(matches!(answer, Err(ApiError::Forbidden(_))), forbidden, "{answer:?}");
            assert!(answer.is_err());
        }
    }
}
