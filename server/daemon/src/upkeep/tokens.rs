//! `lightpathd token …`: creating, listing and revoking tokens, also while a server is running.

use super::commands::{DataDir, exit, runtime};
use anyhow::{Context as _, ensure};
use clap::builder::{PossibleValue, PossibleValuesParser, TypedValueParser as _};
use lightpath_artifacts::FolderLock;
use lightpath_domain::access::{Caller, Role, Secret};
use lightpath_store::{Store, TokenRecord};
use serde::Serialize;
use std::io::Write as _;
use std::process::ExitCode;

/// Commands about tokens.
#[derive(Debug, clap::Subcommand)]
pub enum TokenCommand {
    /// Create a token and print it. It cannot be printed again, because only its hash is stored
    Create(Create),
    /// List tokens, without their secrets
    List(List),
    /// Revoke a token permanently
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
    /// Name of the token in the audit log: a-z, A-Z, 0-9, '.', '_' and '-'; each name can be used only once
    name: String,
    /// Role of the token, which decides what it permits
    #[arg(long, value_parser = roles())]
    role: Role,
    /// Display for which the token is valid; repeat the option for several displays [default: all displays]
    #[arg(long, value_name = "ID")]
    display: Vec<String>,
    /// Days until the token expires; 0: never
    #[arg(long, value_name = "DAYS", default_value_t = 365)]
    expires_days: u32,
    #[command(flatten)]
    folder: DataDir,
}

/// Arguments of `lightpathd token list`.
#[derive(Debug, clap::Args)]
pub struct List {
    #[command(flatten)]
    folder: DataDir,
}

/// Arguments of `lightpathd token revoke`.
#[derive(Debug, clap::Args)]
pub struct Revoke {
    /// Name of the token
    name: String,
    #[command(flatten)]
    folder: DataDir,
}

/// A token as it is printed.
#[derive(Serialize)]
struct PrintedToken {
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
/// What a new token does not do by itself. Only the server knows its own flags and address.
const PROTECTION: &str = "note: the token protects nothing on a server that asks for none: one on 127.0.0.1 without --require-tokens \
                          (require_tokens), or one with --insecure. There everyone who reaches the server is an admin. This \
                          command cannot see how your server was started.";

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
        let is_allowed = |byte: u8| byte.is_ascii_alphanumeric() || b"._-".contains(&byte);
        ensure!(
            (1..=NAME_BYTES_MAX).contains(&self.name.len()) && self.name.bytes().all(is_allowed),
            "name is {:?}, but must be 1 to {NAME_BYTES_MAX} characters of a-z, A-Z, 0-9, '.', '_' and '-'",
            self.name
        );
        ensure!(
            !matches!(self.role, Role::Firmware | Role::Rig) || !self.display.is_empty(),
            "a {} token must name its displays; add --display ID",
            self.role.as_str()
        );
        let (data_dir, database) = self.folder.places()?;
        // The first token is created before the first start of the server. The lock prevents that this command creates
        // a database while a restore is about to put another one into the folder.
        let is_used = runtime()?.block_on(database.require()).is_ok();
        let _lock = if is_used { None } else { Some(FolderLock::take(&data_dir)?) };
        let secret = Secret::generate().context("the system provided no random numbers")?;
        let caller = Caller { name: self.name, role: self.role, displays: self.display };
        runtime()?.block_on(async {
            let store = database.open_shared().await?;
            let now_ms = store.now_ms();
            let expire_time_ms = (self.expires_days > 0).then(|| now_ms + i64::from(self.expires_days) * DAY_MS);
            for display in &caller.displays {
                store.display(display).await.context("a token can name only displays that exist")?;
            }
            store.create_token(&caller, &secret.hash(), expire_time_ms, now_ms).await?;
            store.close().await;
            Ok::<(), anyhow::Error>(())
        })?;
        writeln!(std::io::stdout().lock(), "{}", secret.reveal())?;
        // The token alone goes to stdout, so that it can be written into a file.
        writeln!(std::io::stderr().lock(), "{PROTECTION}")?;
        Ok(true)
    }
}

impl List {
    fn run(self) -> anyhow::Result<bool> {
        let (tokens, now_ms) = with_store(&self.folder, async |store| Ok((store.tokens().await?, store.now_ms())))?;
        let tokens: Vec<PrintedToken> = tokens.into_iter().map(|token| to_printed(token, now_ms)).collect();
        self.folder.print(&tokens, |tokens| {
            let line = |token: &PrintedToken| {
                let displays =
                    if token.displays.is_empty() { "all displays".to_owned() } else { token.displays.join(", ") };
                let state = match (token.valid, token.revoke_time_ms) {
                    (true, _) => "valid",
                    (false, Some(_)) => "revoked",
                    (false, None) => "expired",
                };
                format!("{:<24}{:<11}{:<9}{displays}", token.name, token.role.as_str(), state)
            };
            if tokens.is_empty() {
                "no tokens".to_owned()
            } else {
                tokens.iter().map(line).collect::<Vec<_>>().join("\n")
            }
        })?;
        Ok(true)
    }
}

impl Revoke {
    fn run(self) -> anyhow::Result<bool> {
        let name = self.name;
        let (token, now_ms) = with_store(&self.folder, async move |store| {
            let now_ms = store.now_ms();
            Ok((store.revoke_token(&name, now_ms).await?, now_ms))
        })?;
        self.folder.print(&to_printed(token, now_ms), |token| format!("{} is revoked", token.name))?;
        Ok(true)
    }
}

/// Runs `work` with the store of a data folder that a server may be using.
pub(super) fn with_store<T>(
    folder: &DataDir,
    work: impl AsyncFnOnce(&Store) -> anyhow::Result<T>,
) -> anyhow::Result<T> {
    let (_, database) = folder.places()?;
    runtime()?.block_on(async {
        database.require().await?;
        let store = database.open_shared().await?;
        let done = work(&store).await;
        store.close().await;
        done
    })
}

fn to_printed(token: TokenRecord, now_ms: i64) -> PrintedToken {
    let valid = token.is_valid(now_ms);
    let TokenRecord { caller: Caller { name, role, displays }, create_time_ms, expire_time_ms, revoke_time_ms } = token;
    PrintedToken { name, role, displays, create_time_ms, expire_time_ms, revoke_time_ms, valid }
}
