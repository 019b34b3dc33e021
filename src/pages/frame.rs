//! What is around every page: title, script, style, who is signed in.

use super::bundle::BUNDLE;
use crate::api::auth::Caller;
use crate::storage::User;
use askama::Template;
use axum::response::Html;

/// The frame of a page.
#[derive(Debug, Clone)]
pub(super) struct Frame {
    /// Title of the window.
    pub title: String,
    /// Label of the key that is signed in; none before the sign-in.
    pub signed_in_as: Option<String>,
    /// True of somebody who signs in with a password, which can be changed.
    pub has_password: bool,
    /// Address of the script.
    pub script: &'static str,
    /// Address of the style sheet.
    pub style: &'static str,
    /// Version of the software.
    pub version: &'static str,
}

impl Frame {
    /// The frame of a page that nobody has to be signed in for.
    pub(super) fn anonymous(title: &str) -> Self {
        Self {
            title: title.to_owned(),
            signed_in_as: None,
            has_password: false,
            script: &BUNDLE.script.address,
            style: &BUNDLE.style.address,
            version: env!("CARGO_PKG_VERSION"),
        }
    }

    /// The frame of a visitor's page.
    pub(super) fn of(caller: &Caller, title: impl Into<String>) -> Self {
        Self {
            title: title.into(),
            signed_in_as: Some(format!("{} ({})", caller.client.label, caller.client.role.name())),
            has_password: caller.client.is_user,
            ..Self::anonymous("")
        }
    }
}

impl Frame {
    /// The frame of a page for somebody who perhaps has to change the password first.
    pub(super) fn of_user(user: &User, title: &str) -> Self {
        let signed_in_as = Some(format!("{} ({})", user.client.label, user.client.role.name()));
        Self { signed_in_as, ..Self::anonymous(title) }
    }
}

/// The text of a page.
///
/// # Errors
/// When the template fails.
pub(super) fn page(template: &impl Template) -> Result<Html<String>, askama::Error> {
    template.render().map(Html)
}
