//! Tokens at the machine itself, beside a service that runs or without one: the
//! store is written directly, as whoever can write it need not be asked.

use std::path::Path;

use anyhow::{Context, Result, bail};

use crate::config::Config;
use crate::service::Clock;
use crate::service::access::{Deed, NewToken, mint, token_view};
use crate::store::{AccessWrite, LAST_ID, Store, Write, Writer};
use crate::wire::access::TokenView;

/// Who is said to have done it.
const ACTOR: &str = "command line";

/// Tokens read at a time.
const PAGE: u32 = 500;

/// The store of a configuration. It is not taken for this process: a service
/// that runs on it goes on, and finds what is written here.
async fn beside(config: &Config) -> Result<(Store, Writer)> {
    config.check()?;
    let place = config.place()?;
    if let Some(directory) = place.file().and_then(Path::parent) {
        std::fs::create_dir_all(directory)
            .with_context(|| format!("`data`: cannot make {}", directory.display()))?;
    }
    Store::open_beside(&place).await.with_context(|| format!("cannot open the store {place}"))
}

async fn write(mut writer: Writer, change: AccessWrite, act: &str, id: &str) -> Result<()> {
    let (act, target) = (act.to_owned(), format!("/api/v1/tokens/{id}"));
    let entry = Deed { act, target, address: None }.row((ACTOR, None), Clock.now());
    let changes = [change, AccessWrite::Audit(entry)];
    let mut set = changes.map(Write::Access).to_vec();
    writer.commit(&mut [&mut set]).await?;
    Ok(writer.close().await?)
}

/// Makes a token; returns its secret, which is nowhere else.
///
/// # Errors
/// If the token cannot be, its name is taken, or the store cannot be written.
pub async fn create_token(config: &Config, wanted: NewToken) -> Result<String> {
    let minted = mint(wanted, ACTOR, Clock.now())?;
    let (store, writer) = beside(config).await?;
    let name = &minted.row.name;
    if store.token_named(name).await?.is_some() {
        bail!("there is a token `{name}` in force; revoke it first, or take another name");
    }
    if let Some(asset) = &minted.row.asset
        && store.asset(asset).await?.is_none()
    {
        tracing::warn!(asset, "there is no such asset yet");
    }
    let id = minted.row.id.clone();
    write(writer, AccessWrite::CreateToken(minted.row), "create_token", &id).await?;
    Ok(minted.secret)
}

/// The tokens, the latest first.
///
/// # Errors
/// If the store cannot be read.
pub async fn tokens(config: &Config) -> Result<Vec<TokenView>> {
    let (store, writer) = beside(config).await?;
    let mut tokens: Vec<TokenView> = Vec::new();
    loop {
        let before = tokens.last().map_or(LAST_ID, |token| token.id.as_str());
        let page = store.tokens(before, PAGE).await?;
        if page.is_empty() {
            writer.close().await?;
            return Ok(tokens);
        }
        tokens.extend(page.into_iter().map(token_view));
    }
}

/// Revokes the token of this name or id.
///
/// # Errors
/// If there is none in force, or the store cannot be written.
pub async fn revoke_token(config: &Config, word: &str) -> Result<()> {
    let (store, writer) = beside(config).await?;
    let found = match store.token_named(word).await? {
        Some(row) => Some(row),
        None => store.token(word).await?.filter(|row| row.revoked_at.is_none()),
    };
    let Some(row) = found else { bail!("no token `{word}` is in force") };
    let change = AccessWrite::RevokeToken { id: row.id.clone(), at: Clock.now() };
    write(writer, change, "revoke_token", &row.id).await
}
