//! `lightpathd token …`: creating, listing and revoking tokens. A server may be running meanwhile.

use super::commands::{DataDir, exit, runtime};
use super::{DATABASE, UpkeepError};
use anyhow::{Context as _, ensure};
use clap::builder::{PossibleValue, PossibleValuesParser, TypedValueParser as _};
use lightpath_domain::access::{Caller, Role, Secret};
use lightpath_store::{Store, TokenRecord};
use lightpath_worker::Clock;
use serde::Serialize;
use std::fs;
use std::io::Write as _;
use std::process::ExitCode;

/// Commands about tokens.
#[derive(Debug, clap::Subcommand)]
pub enum TokenCommand {
    /// Make a token and print it, once: the server keeps only its hash
    Create(Create),
    /// List tokens, without their secrets
    List(List),
    /// Refuse a token from now on, for good
    Revoke(Revoke),
}

/// Arguments of `lightpathd token create`.
#[derive(Debug, clap::Args)]
#[command(after_help = "\
Examples:
  lightpathd token create ada --role submitter > ada.token
  lightpathd token create bench-7 --role firmware --display pluto \\
      --expires-days 365 > bench-7.token

Then: lightpath --token-file ada.token job list")]
pub struct Create {
    /// Name of whoever gets it, for the audit log: a-z, A-Z, 0-9, '.', '_' and '-'; never given twice
    name: String,
    /// What its bearer may do
    #[arg(long, value_parser = roles())]
    role: Role,
    /// Only on this display; may be given several times [default: all displays]
    #[arg(long, value_name = "ID")]
    display: Vec<String>,
    /// Days after which it is not accepted any more; 0: never
    #[arg(long, value_name = "DAYS", default_value_t = 365)]
    expires_days: u32,
    #[command(flatten)]
    place: DataDir,
}

/// Arguments of `lightpathd token list`.
#[derive(Debug, clap::Args)]
pub struct List {
    #[command(flatten)]
    place: DataDir,
}

/// Arguments of `lightpathd token revoke`.
#[derive(Debug, clap::Args)]
pub struct Revoke {
    /// Its name
    name: String,
    #[command(flatten)]
    place: DataDir,
}

/// A token in the printed form.
#[derive(Serialize)]
struct Shown {
    name: String,
    role: Role,
    displays: Vec<String>,
    create_time_ms: i64,
    expire_time_ms: Option<i64>,
    revoke_time_ms: Option<i64>,
    valid: bool,
}

/// Parser of roles. The help lists every role with its purpose.
fn roles() -> impl clap::builder::TypedValueParser<Value = Role> {
    let possible = Role::ALL.map(|role| PossibleValue::new(role.as_str()).help(role.purpose()));
    PossibleValuesParser::new(possible)
        .try_map(|name| Role::ALL.into_iter().find(|role| role.as_str() == name).ok_or("no such role"))
}

const DAY_MS: i64 = 24 * 3600 * 1000;
const NAME_BYTES_MAX: usize = 63;

impl TokenCommand {
    /// Runs the command and prints its result.
    #[must_use]
    pub fn run(self) -> ExitCode {
        exit(match self {
            Self::Create(create) => create.run(),
            Self::List(list) => list.run(),
            Self::Revoke(revoke) => revoke.run(),
        })
    }
}

impl Create {
    fn run(self) -> anyhow::Result<bool> {
        let plain = |byte: u8| byte.is_ascii_alphanumeric() || b"._-".contains(&byte);
        ensure!(
            (1..=NAME_BYTES_MAX).contains(&self.name.len()) && self.name.bytes().all(plain),
            "name is {:?}, but must be 1 to {NAME_BYTES_MAX} characters of a-z, A-Z, 0-9, '.', '_' and '-'",
            self.name
        );
        ensure!(
            self.role != Role::Firmware || !self.display.is_empty(),
            "a firmware token is for named displays; add --display ID"
        );
        let data_dir = self.place.path()?;
        // The folder may not exist yet: the first token is created before the first start of the server.
        fs::create_dir_all(&data_dir).with_context(|| format!("cannot create {}", data_dir.display()))?;
        let secret = Secret::generate().context("the system has no random numbers")?;
        let caller = Caller { name: self.name, role: self.role, displays: self.display };
        let now_ms = Clock::default().now_ms();
        let expire_time_ms = (self.expires_days > 0).then(|| now_ms + i64::from(self.expires_days) * DAY_MS);
        runtime()?.block_on(async {
            let store = Store::open_beside(&data_dir.join(DATABASE)).await?;
            for display in &caller.displays {
                store.display(display).await.context("a token for a display that is not there would be a mistake")?;
            }
            store.create_token(&caller, &secret.hash(), expire_time_ms, now_ms).await?;
            store.close().await;
            Ok::<(), anyhow::Error>(())
        })?;
        writeln!(std::io::stdout().lock(), "{}", secret.reveal())?;
        Ok(true)
    }
}

impl List {
    fn run(self) -> anyhow::Result<bool> {
        let shown: Vec<Shown> =
            store_of(&self.place, async |store| store.tokens().await)?.into_iter().map(show).collect();
        self.place.print(&shown, |shown| {
            let line = |it: &Shown| {
                let displays = if it.displays.is_empty() { "all displays".to_owned() } else { it.displays.join(", ") };
                let state = match (it.valid, it.revoke_time_ms) {
                    (true, _) => "valid",
                    (false, Some(_)) => "revoked",
                    (false, None) => "expired",
                };
                format!("{:<24}{:<11}{:<9}{displays}", it.name, it.role.as_str(), state)
            };
            if shown.is_empty() {
                "no tokens".to_owned()
            } else {
                shown.iter().map(line).collect::<Vec<_>>().join("\n")
            }
        })?;
        Ok(true)
    }
}

impl Revoke {
    fn run(self) -> anyhow::Result<bool> {
        let now_ms = Clock::default().now_ms();
        let name = self.name;
        let token = store_of(&self.place, async move |store| store.revoke_token(&name, now_ms).await)?;
        self.place.print(&show(token), |it| format!("{} is revoked", it.name))?;
        Ok(true)
    }
}

fn store_of<T>(
    place: &DataDir,
    work: impl AsyncFnOnce(&Store) -> Result<T, lightpath_store::StoreError>,
) -> anyhow::Result<T> {
    let data_dir = place.path()?;
    let database = data_dir.join(DATABASE);
    if !database.is_file() {
        return Err(UpkeepError::NoData { path: data_dir }.into());
    }
    runtime()?.block_on(async {
        let store = Store::open_beside(&database).await?;
        let done = work(&store).await;
        store.close().await;
        Ok(done?)
    })
}

fn show(token: TokenRecord) -> Shown {
    let valid = token.is_valid(Clock::default().now_ms());
    let TokenRecord { caller: Caller { name, role, displays }, create_time_ms, expire_time_ms, revoke_time_ms } = token;
    Shown { name, role, displays, create_time_ms, expire_time_ms, revoke_time_ms, valid }
}
