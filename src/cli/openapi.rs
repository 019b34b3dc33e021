//! `surefoot openapi`: the document of the REST API.

/// Print the OpenAPI document
///
/// It is the same as `/openapi.json` of a running service. The committed copy is made by
/// `surefoot openapi > openapi/openapi.json`.
#[derive(Debug, Clone, clap::Args)]
pub struct Args {}

/// Prints the document.
///
/// # Errors
/// When standard output is closed.
pub fn run(_: &Args) -> anyhow::Result<()> {
    use std::io::Write;
    std::io::stdout().write_all(crate::api::openapi_document().as_bytes())?;
    Ok(())
}
