//! `offbd token`: manages tokens on the machine of the store.

use std::io::Write as _;

use clap::{Args, Subcommand};

use super::serve::ConfigArgs;
use crate::server::tokens;
use offbd_service::access::{NewToken, Role};
use offbd_service::{Clock, ServiceError};
use offbd_store::Micros;
use offbd_terminal::errors::BadArgument;
use offbd_terminal::output::{self, OutputFormat};
use offbd_terminal::table;
use offbd_wire::access::TokenView;

/// Creates, lists and revokes tokens, directly in the store.
///
/// Needed for the first token. The service may be running or not; it refuses a
/// token that was revoked here within seconds.
#[derive(Clone, Debug, Args)]
#[command(after_help = "Examples:\n  \
    offbd token create --name ann --role admin\n  \
    offbd token create --name bench-1 --role device --asset bench-1 --days 365\n  \
    offbd token list\n  \
    offbd token revoke bench-1")]
pub(super) struct TokenArgs {
    #[command(subcommand)]
    command: TokenCommand,
}

#[derive(Clone, Debug, Subcommand)]
enum TokenCommand {
    Create(CreateArgs),
    List(ListArgs),
    Revoke(RevokeArgs),
    #[cfg(feature = "nats")]
    NatsIssuer(NatsIssuerArgs),
}

/// Creates a token and prints it. It is stored as a hash only, so it cannot be shown again.
#[derive(Clone, Debug, Args)]
struct CreateArgs {
    /// Name by which the audit log refers to the token
    #[arg(long)]
    name: String,
    /// device (one asset's own), viewer, operator or admin
    #[arg(long)]
    role: Role,
    /// The asset of a device
    #[arg(long, required_if_eq("role", "device"))]
    asset: Option<String>,
    /// Days until it expires [default: never]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=36500))]
    days: Option<u32>,
    #[command(flatten)]
    config: ConfigArgs,
}

/// Lists all tokens, the latest first, including revoked ones.
#[derive(Clone, Debug, Args)]
struct ListArgs {
    /// Output format
    #[arg(long, value_enum, default_value_t = OutputFormat::Table)]
    format: OutputFormat,
    #[command(flatten)]
    config: ConfigArgs,
}

/// Revokes a token, and ends the logins with it.
#[derive(Clone, Debug, Args)]
struct RevokeArgs {
    /// Name or id of the token
    token: String,
    #[command(flatten)]
    config: ConfigArgs,
}

/// Makes the key with which offbd tells a NATS server the rights of devices.
///
/// Writes the seed, for `nats.issuer_seed`, to a new file that only its owner may
/// read, and prints the public key, for `auth_callout` of the NATS server.
#[cfg(feature = "nats")]
#[derive(Clone, Debug, Args)]
struct NatsIssuerArgs {
    /// File for the seed
    #[arg(value_name = "FILE")]
    seed: std::path::PathBuf,
}

pub(super) fn run(args: &TokenArgs) -> anyhow::Result<()> {
    match &args.command {
        TokenCommand::Create(args) => offbd_terminal::block_on(create(args)),
        TokenCommand::List(args) => offbd_terminal::block_on(list(args)),
        TokenCommand::Revoke(args) => {
            offbd_terminal::block_on(tokens::revoke_token(&args.config.load()?, &args.token))
        }
        #[cfg(feature = "nats")]
        TokenCommand::NatsIssuer(args) => make_nats_issuer(&args.seed),
    }
}

#[cfg(feature = "nats")]
fn make_nats_issuer(path: &std::path::Path) -> anyhow::Result<()> {
    use anyhow::Context;
    let pair = nkeys::KeyPair::new_account();
    let mut options = std::fs::OpenOptions::new();
    options.write(true).create_new(true);
    #[cfg(unix)]
    std::os::unix::fs::OpenOptionsExt::mode(&mut options, 0o600);
    let file = options.open(path).with_context(|| format!("cannot create {}", path.display()));
    writeln!(file?, "{}", pair.seed()?)?;
    output::print_line(&pair.public_key())
}

async fn create(args: &CreateArgs) -> anyhow::Result<()> {
    const DAY: Micros = 86_400_000_000;
    let expires_at = args.days.map(|days| Clock::System.now() + Micros::from(days) * DAY);
    let CreateArgs { name, role, asset, .. } = args.clone();
    let wanted = NewToken { name, role, asset, expires_at };
    let created = tokens::create_token(&args.config.load()?, wanted).await;
    let secret = created.map_err(|error| match error.downcast::<ServiceError>() {
        Ok(error @ ServiceError::Invalid(_)) => BadArgument(error.to_string()).into(),
        Ok(error) => error.into(),
        Err(error) => error,
    })?;
    output::remark(format_args!("save this token now; it cannot be shown again"));
    output::print_line(&secret)
}

async fn list(args: &ListArgs) -> anyhow::Result<()> {
    let tokens = tokens::tokens(&args.config.load()?).await?;
    let mut out = output::stdout();
    match args.format {
        OutputFormat::Table => {
            let mut table = table::table(&["name", "role", "asset", "last used", "expires"], &[]);
            for token in &tokens {
                table.add_row(row(token));
            }
            table::lines(&table).try_for_each(|line| writeln!(out, "{line}"))?;
        }
        OutputFormat::Json => {
            for token in &tokens {
                writeln!(out, "{}", serde_json::to_string(token)?)?;
            }
        }
    }
    Ok(out.flush()?)
}

fn row(token: &TokenView) -> [String; 5] {
    // Without fractions of a second.
    let short = |moment: &str| moment.split('.').next().unwrap_or(moment).replace('T', " ");
    let or_dash = |moment: &Option<String>| moment.as_deref().map_or("-".to_owned(), short);
    let expires = match &token.revoked_at {
        Some(at) => format!("revoked {}", short(at)),
        None => or_dash(&token.expires_at),
    };
    let asset = token.asset.clone().unwrap_or_else(|| "-".to_owned());
    [token.name.clone(), token.role.to_string(), asset, or_dash(&token.last_used_at), expires]
}
