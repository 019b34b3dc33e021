//! `surefoot user`: people who sign in to the pages, made and disabled at the machine itself.

use super::key::organisation_for;
use super::place::Place;
use crate::storage::users::is_user_name;
use crate::storage::{ClientId, NewUser, OrganisationId, Password, Role, StorageError, Store, User};
use anyhow::bail;

/// Make, list, reset and disable users of the pages
///
/// Works on the data directory itself, also while the service runs. A password is shown once, when it is made; the user has to replace
/// it at the next sign-in.
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
    /// Make a user and print the first password, once
    Add {
        /// Name at the sign-in: lower-case letters, digits, `.`, `_`, `-`; unique in the installation.
        name: String,
        /// What the user may do: `clinician` reads patients, `admin` also manages keys and users.
        #[arg(long, value_enum)]
        role: UserRoleName,
        /// Who it is, for people; default: the name.
        #[arg(long)]
        label: Option<String>,
        /// Organisation by name; it is made when absent. Default: the only one there is, or `default`.
        #[arg(long, value_name = "NAME")]
        organisation: Option<String>,
    },
    /// List users, disabled ones too
    List,
    /// Print a new password, once; sessions end and failed sign-ins are forgotten
    Reset {
        /// Name at the sign-in.
        name: String,
    },
    /// Take a user out of use, at once
    Disable {
        /// Name at the sign-in, or the id of a user of the identity provider.
        name: String,
    },
}

#[derive(Debug, Clone, Copy, clap::ValueEnum)]
enum UserRoleName {
    Clinician,
    Admin,
}

/// Runs the command.
///
/// # Errors
/// When the data directory cannot be opened or the request contradicts what is stored.
pub async fn run(args: &Args) -> anyhow::Result<()> {
    let store = args.place.open().await?;
    let result = act(&store, args).await;
    store.close().await;
    result
}

async fn act(store: &Store, args: &Args) -> anyhow::Result<()> {
    match &args.action {
        Action::Add { name, role, label, organisation } => {
            if !is_user_name(name) {
                bail!("the name must be 3 to 64 lower-case letters, digits, `.`, `_` or `-`");
            }
            let label = label.as_ref().unwrap_or(name);
            if label.is_empty() || label.chars().count() > 64 || label.chars().any(char::is_control) {
                bail!("the label must be one line of 1 to 64 characters");
            }
            let role = match role {
                UserRoleName::Clinician => Role::Clinician,
                UserRoleName::Admin => Role::Admin,
            };
            let organisation = organisation_for(store, organisation.as_deref()).await?;
            let new = NewUser { name: name.clone(), role, label: label.clone() };
            let (user, password) = store.create_user(organisation, &new).await?;
            show(&user, &password, args.json);
        }
        Action::List => list(store, args.json).await?,
        Action::Reset { name } => {
            let (organisation, id) = found(store, name).await?;
            let (user, password) = store.reset_user(organisation, id).await?;
            show(&user, &password, args.json);
        }
        Action::Disable { name } => {
            let (organisation, id) = found(store, name).await?;
            let user = store.disable_user(organisation, id).await?;
            if args.json {
                println!("{}", described(&user));
            } else {
                println!("disabled {name} ({})", user.client.label);
            }
        }
    }
    Ok(())
}

async fn found(store: &Store, name: &str) -> Result<(OrganisationId, ClientId), StorageError> {
    for organisation in store.organisations().await? {
        let users = store.users(organisation.id).await?;
        if let Some(user) =
            users.iter().find(|user| user.name.as_deref() == Some(name) || user.client.id.to_string() == name)
        {
            return Ok((organisation.id, user.client.id));
        }
    }
    Err(StorageError::not_found("user"))
}

fn show(user: &User, password: &Password, json: bool) {
    if json {
        println!("{}", serde_json::json!({"user": described(user), "password": password.reveal()}));
        return;
    }
    println!("{}", password.reveal());
    let name = user.name.as_deref().unwrap_or_default();
    eprintln!("user {name} ({}); the password is shown this once and has to be changed", user.client.role.name());
}

async fn list(store: &Store, json: bool) -> anyhow::Result<()> {
    let mut rows = Vec::new();
    for organisation in store.organisations().await? {
        for user in store.users(organisation.id).await? {
            if json {
                let mut row = described(&user);
                row["organisation"] = organisation.name.clone().into();
                rows.push(row);
                continue;
            }
            let state = if user.client.revoked_at.is_some() { "disabled" } else { "enabled" };
            let name = user.name.as_deref().or(user.subject.as_deref()).unwrap_or_default();
            let (role, label) = (user.client.role.name(), &user.client.label);
            println!("{name:20}  {role:9}  {state:8}  {}  {label}", organisation.name);
        }
    }
    if json {
        println!("{}", serde_json::json!({ "users": rows }));
    }
    Ok(())
}

fn described(user: &User) -> serde_json::Value {
    let rfc3339 = |time: time::OffsetDateTime| time.format(&time::format_description::well_known::Rfc3339).ok();
    serde_json::json!({
        "id": user.client.id,
        "name": user.name,
        "role": user.client.role,
        "label": user.client.label,
        "issuer": user.issuer,
        "subject": user.subject,
        "created_at": rfc3339(user.client.created_at),
        "disabled_at": user.client.revoked_at.and_then(rfc3339),
    })
}
