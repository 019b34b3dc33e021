//! `surefoot audit`: the audit log of a data directory checked and written out.

use super::place::Place;
use crate::api::audit::AuditEntryResponse;
use crate::storage::audit::{Hash, Verification};
use anyhow::{Context, bail};
use clap::Subcommand;
use futures::TryStreamExt;
use std::io::Write;
use std::str::FromStr;

/// Check the audit log, or write it out
///
/// Every request with a key and every command that touches patients leaves an entry, and each entry carries the hash of the
/// one before. Works also while the service runs.
#[derive(Debug, Clone, clap::Args)]
pub struct Args {
    #[command(subcommand)]
    command: AuditCommand,
}

#[derive(Debug, Clone, Subcommand)]
enum AuditCommand {
    /// Walk the chain; ends with status 1 and names the first entry that does not hold
    ///
    /// Prints the head: number and hash of the last entry. Keep it elsewhere, and give it to a later `verify --known`, so that a
    /// log that was written anew from some entry on is found too.
    Verify {
        #[command(flatten)]
        place: Place,
        /// A head that was printed earlier
        #[arg(long, value_name = "NUMBER:HASH")]
        known: Option<Head>,
        /// Print JSON, for programs
        #[arg(long)]
        json: bool,
    },
    /// Write entries to the standard output, one JSON object a line, oldest first
    Export {
        #[command(flatten)]
        place: Place,
        /// Number of the first entry wanted
        #[arg(long, value_name = "NUMBER", default_value_t = 1)]
        from: i64,
    },
}

/// Number and hash of an entry.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
struct Head(i64, Hash);

impl FromStr for Head {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let wrong = || format!("`{text}` is not NUMBER:HASH, as `surefoot audit verify` prints it");
        let (number, hash) = text.split_once(':').ok_or_else(wrong)?;
        let hash: [u8; 32] = hex::decode(hash).ok().and_then(|bytes| bytes.try_into().ok()).ok_or_else(wrong)?;
        Ok(Self(number.parse().map_err(|_| wrong())?, Hash(hash)))
    }
}

/// Runs the command.
///
/// # Errors
/// When the chain is broken, or the data directory cannot be opened.
pub async fn run(args: &Args) -> anyhow::Result<()> {
    match &args.command {
        AuditCommand::Verify { place, known, json } => {
            let store = place.open_existing().await?;
            let found = store.verify_audit(known.map(|Head(sequence, hash)| (sequence, hash))).await?;
            store.close().await;
            told(&found, *json)
        }
        AuditCommand::Export { place, from } => {
            let store = place.open_existing().await?;
            let mut out = std::io::BufWriter::new(std::io::stdout().lock());
            let mut entries = store.audit_from(*from);
            while let Some(entry) = entries.try_next().await? {
                let organisation = entry.organisation_id;
                let mut line = serde_json::to_value(AuditEntryResponse::from(entry))?;
                line["organisation_id"] = serde_json::to_value(organisation)?;
                writeln!(out, "{line}").context("the output cannot be written")?;
            }
            out.flush()?;
            drop(entries);
            store.close().await;
            Ok(())
        }
    }
}

fn told(found: &Verification, json: bool) -> anyhow::Result<()> {
    if json {
        println!("{}", serde_json::to_string_pretty(found)?);
    }
    if let Some(broken) = &found.broken {
        bail!("the audit log is broken at entry {}: {}", broken.sequence, broken.reason);
    }
    if !json {
        println!("the chain of {} entries holds, from entry {} on", found.n_entries, found.begins_after + 1);
        println!("head {}:{}", found.head_sequence, found.head_hash);
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_head_is_read_as_it_is_printed() {
        let text = format!("12:{}", "ab".repeat(32));
        assert_eq!(text.parse::<Head>().unwrap(), Head(12, Hash([0xab; 32])));
        for bad in ["12", "x:00", "12:00"] {
            assert!(bad.parse::<Head>().is_err(), "{bad}");
        }
    }
}
