//! Management of tokens on the machine of the store, by direct access to the store,
//! whether a service is running or not. No token is needed: whoever can write the store
//! has every right.

use std::path::Path;

use anyhow::{Context, Result, bail};

use crate::config::Config;
use offbd_service::Clock;
use offbd_service::access::{AuditEntry, NewToken, mint, token_view};
use offbd_store::{AccessWrite, ChangeSet, LAST_ID, Store, Write, Writer};
use offbd_wire::access::TokenView;

/// The actor in the audit log.
const ACTOR: &str = "command line";

/// Tokens per query.
const PAGE_SIZE: u32 = 500;

/// Opens the store with an auxiliary writer. It is not locked: a running service
/// continues, and sees what is written here.
/// Opens the store that a service has used before.
async fn open_existing_store(config: &Config) -> Result<(Store, Writer)> {
    config.check()?;
    if let Some(file) = config.location()?.file().filter(|file| !file.exists()) {
        bail!("there is no store {}: `--data` names the directory of the service", file.display());
    }
    open_store(config).await
}

/// Opens the store; a missing one is created.
async fn open_store(config: &Config) -> Result<(Store, Writer)> {
    config.check()?;
    let location = config.location()?;
    if let Some(directory) = location.file().and_then(Path::parent) {
        std::fs::create_dir_all(directory)
            .with_context(|| format!("`data`: cannot create {}", directory.display()))?;
    }
    Store::open_auxiliary(&location)
        .await
        .with_context(|| format!("cannot open the store {location}"))
}

async fn write(mut writer: Writer, change: AccessWrite, act: &str, id: &str) -> Result<()> {
    let (act, target) = (act.to_owned(), format!("/api/v1/tokens/{id}"));
    let entry = AuditEntry { action: act, target, address: None, by: None }
        .row((ACTOR, None), Clock::System.now());
    let changes = [change, AccessWrite::Audit(entry)];
    let mut set = changes.map(Write::Access).to_vec();
    writer.commit(&mut [ChangeSet { partition: None, writes: &mut set }]).await?;
    Ok(writer.close().await?)
}

/// Creates a token. Returns its secret, which is not stored anywhere.
///
/// # Errors
/// If the token is invalid, its name is taken, or the store cannot be written.
pub async fn create_token(config: &Config, wanted: NewToken) -> Result<String> {
    let minted = mint(wanted, ACTOR, Clock::System.now())?;
    let (store, writer) = open_store(config).await?;
    let name = &minted.row.name;
    if store.token_named(name).await?.is_some() {
        bail!("a token `{name}` exists already; revoke it first, or choose another name");
    }
    if let Some(asset) = &minted.row.asset
        && store.existing_assets(std::slice::from_ref(asset)).await?.is_empty()
    {
        tracing::warn!(asset, "there is no such asset yet");
    }
    let id = minted.row.id.clone();
    write(writer, AccessWrite::CreateToken(minted.row), "create_token", &id).await?;
    Ok(minted.secret)
}

/// Lists all tokens, the latest first.
///
/// # Errors
/// If the store cannot be read.
pub async fn tokens(config: &Config) -> Result<Vec<TokenView>> {
    let (store, writer) = open_existing_store(config).await?;
    let mut tokens: Vec<TokenView> = Vec::new();
    loop {
        let before = tokens.last().map_or(LAST_ID, |token| token.id.as_str());
        let page = store.tokens(before, PAGE_SIZE).await?;
        if page.is_empty() {
            writer.close().await?;
            return Ok(tokens);
        }
        for row in page {
            tokens.push(token_view(row)?);
        }
    }
}

/// Revokes the token with this name or id.
///
/// # Errors
/// If there is none that is not revoked, or the store cannot be written.
pub async fn revoke_token(config: &Config, name_or_id: &str) -> Result<()> {
    let (store, writer) = open_existing_store(config).await?;
    let found = match store.token_named(name_or_id).await? {
        Some(row) => Some(row),
        None => store.token(name_or_id).await?.filter(|row| row.revoked_at.is_none()),
    };
    let Some(row) = found else { bail!("no valid token `{name_or_id}`") };
    let change = AccessWrite::RevokeToken { id: row.id.clone(), at: Clock::System.now() };
    write(writer, change, "revoke_token", &row.id).await
}
