//! `surefoot key`: API keys, made and revoked at the machine itself.

use super::place::Place;
use crate::storage::{ApiKey, Client, ClientId, OrganisationId, Role, Rotation, StorageError, Store};
use anyhow::bail;
use time::{Duration, OffsetDateTime};
use uuid::Uuid;

/// Make, list, replace and revoke API keys
///
/// Works on the data directory itself, also while the service runs. The text of a key is shown once, when it is made;
/// only its digest is stored.
#[derive(Debug, Clone, clap::Args)]
pub struct Args {
    #[command(flatten)]
    place: Place,
    /// Print JSON, for programs.
    #[arg(long, global = true)]
    json: bool,
    #[command(subcommand)]
    action: Action,
}

#[derive(Debug, Clone, clap::Subcommand)]
enum Action {
    /// Make a key and print it, once
    Create {
        /// What the key may do: `device` uploads, `clinician` reads patients, `admin` also manages keys.
        #[arg(long, value_enum)]
        role: RoleName,
        /// Whose key it is, for people.
        #[arg(long)]
        label: String,
        /// Organisation by name; it is made when absent. Default: the only one there is, or `default`.
        #[arg(long, value_name = "NAME")]
        organisation: Option<String>,
        /// The key ends by itself after so many days; default: it does not.
        #[arg(long, value_name = "DAYS", value_parser = clap::value_parser!(u32).range(1..=MOST_DAYS))]
        expires_in_days: Option<u32>,
    },
    /// Replace a client's key and print the new one, once; the client keeps what it has made
    Rotate {
        /// The client's id, as `list` shows it.
        id: Uuid,
        /// The key before opens for so many more hours; default: it ends at once.
        #[arg(long, value_name = "HOURS", default_value_t = 0, value_parser = clap::value_parser!(u32).range(..=720))]
        overlap_hours: u32,
        /// The new key ends by itself after so many days; default: when the key before was to end.
        #[arg(long, value_name = "DAYS", value_parser = clap::value_parser!(u32).range(1..=MOST_DAYS))]
        expires_in_days: Option<u32>,
    },
    /// List keys, revoked ones too
    List,
    /// Take a key out of use; a service that runs follows within half a second
    Revoke {
        /// The client's id, as `list` shows it.
        id: Uuid,
    },
}

/// Longest life of a key that ends, days: ten years.
const MOST_DAYS: i64 = 3653;

#[derive(Debug, Clone, Copy, clap::ValueEnum)]
enum RoleName {
    Device,
    Clinician,
    Admin,
}

impl From<RoleName> for Role {
    fn from(name: RoleName) -> Self {
        match name {
            RoleName::Device => Role::Device,
            RoleName::Clinician => Role::Clinician,
            RoleName::Admin => Role::Admin,
        }
    }
}

/// Runs the command.
///
/// # Errors
/// When the data directory cannot be opened or the request contradicts what is stored.
pub async fn run(args: &Args) -> anyhow::Result<()> {
    let store = args.place.open().await?;
    let result = match &args.action {
        Action::Create { role, label, organisation, expires_in_days } => {
            let expires_at = end_after(&store, *expires_in_days);
            create(&store, (*role).into(), label, organisation.as_deref(), expires_at, args.json).await
        }
        Action::Rotate { id, overlap_hours, expires_in_days } => {
            let overlap = Duration::hours((*overlap_hours).into());
            let rotation = Rotation { overlap, expires_at: end_after(&store, *expires_in_days) };
            rotate(&store, ClientId(*id), rotation, args.json).await
        }
        Action::List => list(&store, args.json).await,
        Action::Revoke { id } => revoke(&store, ClientId(*id), args.json).await,
    };
    store.close().await;
    result
}

fn end_after(store: &Store, days: Option<u32>) -> Option<OffsetDateTime> {
    days.map(|days| store.now() + Duration::days(days.into()))
}

async fn create(
    store: &Store,
    role: Role,
    label: &str,
    organisation: Option<&str>,
    expires_at: Option<OffsetDateTime>,
    json: bool,
) -> anyhow::Result<()> {
    if label.is_empty() || label.chars().count() > 64 || label.chars().any(char::is_control) {
        bail!("the label must be one line of 1 to 64 characters");
    }
    let organisation = organisation_for(store, organisation).await?;
    let (client, key) = store.create_client_until(organisation, role, label, expires_at).await?;
    show(&client, &key, json);
    Ok(())
}

fn show(client: &Client, key: &ApiKey, json: bool) {
    if json {
        println!("{}", serde_json::json!({"client": described(client), "key": key.reveal()}));
        return;
    }
    println!("{}", key.reveal());
    eprintln!("client {} ({}, {}); the key is shown this once", client.id, client.role.name(), client.label);
}

async fn rotate(store: &Store, id: ClientId, rotation: Rotation, json: bool) -> anyhow::Result<()> {
    for organisation in store.organisations().await? {
        match store.rotate_client(organisation.id, id, rotation).await {
            Ok((client, key)) => {
                show(&client, &key, json);
                return Ok(());
            }
            Err(StorageError::NotFound { .. }) => {}
            Err(error) => return Err(error.into()),
        }
    }
    bail!("there is no client {id}; `surefoot key list` shows those there are")
}

pub(super) async fn organisation_for(store: &Store, name: Option<&str>) -> anyhow::Result<OrganisationId> {
    let Some(name) = name else {
        let all = store.organisations().await?;
        return match all.as_slice() {
            [] => Ok(store.create_organisation("default").await?.id),
            [only] => Ok(only.id),
            several => {
                let names: Vec<&str> = several.iter().map(|organisation| organisation.name.as_str()).collect();
                bail!("there are several organisations; name one with --organisation: {}", names.join(", "))
            }
        };
    };
    match store.organisation_named(name).await {
        Ok(organisation) => Ok(organisation.id),
        Err(StorageError::NotFound { .. }) => Ok(store.create_organisation(name).await?.id),
        Err(error) => Err(error.into()),
    }
}

async fn list(store: &Store, json: bool) -> anyhow::Result<()> {
    let mut rows = Vec::new();
    for organisation in store.organisations().await? {
        for client in store.clients(organisation.id).await? {
            if json {
                let mut row = described(&client);
                row["organisation"] = organisation.name.clone().into();
                rows.push(row);
            } else {
                let state = match () {
                    () if client.revoked_at.is_some() => "revoked",
                    () if client.expires_at.is_some_and(|end| end <= store.now()) => "expired",
                    () => "valid",
                };
                println!("{}  {:9}  {state:7}  {}  {}", client.id, client.role.name(), organisation.name, client.label);
            }
        }
    }
    if json {
        println!("{}", serde_json::json!({ "clients": rows }));
    }
    Ok(())
}

async fn revoke(store: &Store, id: ClientId, json: bool) -> anyhow::Result<()> {
    for organisation in store.organisations().await? {
        match store.revoke_client(organisation.id, id).await {
            Ok(client) if json => {
                println!("{}", described(&client));
                return Ok(());
            }
            Ok(client) => {
                println!("revoked {} ({}, {})", client.id, client.role.name(), client.label);
                return Ok(());
            }
            Err(StorageError::NotFound { .. }) => {}
            Err(error) => return Err(error.into()),
        }
    }
    bail!("there is no client {id}; `surefoot key list` shows those there are")
}

fn described(client: &Client) -> serde_json::Value {
    let rfc3339 = |time: time::OffsetDateTime| time.format(&time::format_description::well_known::Rfc3339).ok();
    serde_json::json!({
        "id": client.id,
        "role": client.role,
        "label": client.label,
        "created_at": rfc3339(client.created_at),
        "expires_at": client.expires_at.and_then(rfc3339),
        "previous_key_until": client.previous_key_until.and_then(rfc3339),
        "revoked_at": client.revoked_at.and_then(rfc3339),
        "last_used_at": client.last_used_at.and_then(rfc3339),
    })
}
