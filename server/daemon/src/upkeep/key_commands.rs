//! `lightpathd key`.

use super::commands::{DataDir, exit};
use super::keys::{self, KeyChange, KeyLine, KeyState, KeysError};
use super::tokens::with_store;
use anyhow::Context as _;
use clap::Subcommand;
use lightpath_manifest::PublicKey;
use std::io::Write as _;
use std::path::PathBuf;
use std::process::ExitCode;

/// Keys that sign manifests of kernels. Each command works beside a running server, which uses the result at once.
#[derive(Debug, Subcommand)]
#[command(after_help = "\
A device trusts the root key that was put into it (`lightpathd key list` shows it), the newest \
keyring that the root key signed, and the manifests of the keys that this keyring lists.

To keep the root key elsewhere, on a machine without a network (there), and not on this one (here):
  openssl genpkey -algorithm ed25519 -out root.pem         # there
  # here: the old root key signs
  lightpathd key draft --new-root PUBLIC > keyring.txt
  # there: the new root key signs, too
  lightpath keyring sign keyring.txt --key root.pem
  lightpathd key install keyring.txt                       # here
  lightpathd key forget OLD-ROOT")]
pub enum KeyCommand {
    /// List the keys, and which of them this server has
    List(List),
    /// Add a new key for manifests; the present one stays valid for the manifests that it signed
    Rotate(Rotate),
    /// Revoke a key that others may have. Devices refuse its manifests as soon as they have the new keyring
    Revoke(Revoke),
    /// Print the next keyring, signed with the root key if this server has it, for another root key to sign
    Draft(Draft),
    /// Install a keyring that was signed elsewhere
    Install(Install),
    /// Remove a private key from this server for ever, for example a root key that is kept elsewhere
    Forget(Forget),
}

/// Arguments of `lightpathd key list`.
#[derive(Debug, clap::Args)]
pub struct List {
    #[command(flatten)]
    folder: DataDir,
}

/// Arguments of `lightpathd key rotate`.
#[derive(Debug, clap::Args)]
pub struct Rotate {
    #[command(flatten)]
    folder: DataDir,
}

/// Arguments of `lightpathd key revoke`.
#[derive(Debug, clap::Args)]
pub struct Revoke {
    /// Id of the key, as `lightpathd key list` shows it
    #[arg(value_name = "ID")]
    id: String,
    #[command(flatten)]
    folder: DataDir,
}

/// Arguments of `lightpathd key draft`.
#[derive(Debug, clap::Args)]
pub struct Draft {
    /// Public key of a new root key, 64 hexadecimal digits, which replaces the present one
    #[arg(long, value_name = "PUBLIC")]
    new_root: Option<PublicKey>,
    /// List a new key for manifests
    #[arg(long, conflicts_with = "revoke")]
    rotate: bool,
    /// Revoke the key with this id, and list a new one
    #[arg(long, value_name = "ID")]
    revoke: Option<String>,
    /// Number of the keyring. After a restore it must be above all that devices have seen [default: the next one]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..))]
    version: Option<u32>,
    #[command(flatten)]
    folder: DataDir,
}

/// Arguments of `lightpathd key install`.
#[derive(Debug, clap::Args)]
pub struct Install {
    /// File with the signed keyring
    #[arg(value_name = "FILE")]
    file: PathBuf,
    #[command(flatten)]
    folder: DataDir,
}

/// Arguments of `lightpathd key forget`.
#[derive(Debug, clap::Args)]
pub struct Forget {
    /// Id of the key, as `lightpathd key list` shows it
    #[arg(value_name = "ID")]
    id: String,
    #[command(flatten)]
    folder: DataDir,
}

impl KeyCommand {
    /// Runs the command and prints its result.
    #[must_use]
    pub fn run(self) -> ExitCode {
        exit(match self {
            Self::List(list) => list.run(),
            Self::Rotate(rotate) => change(&rotate.folder, async |_| Ok(KeyChange::Rotate)),
            Self::Revoke(Revoke { id, folder }) => change(&folder, async |store| {
                let state = keys::state(store).await?;
                Ok(KeyChange::Revoke(find(&state, &id, "manifest")?))
            }),
            Self::Draft(draft) => draft.run(),
            Self::Install(install) => install.run(),
            Self::Forget(forget) => forget.run(),
        })
    }
}

impl List {
    fn run(self) -> anyhow::Result<bool> {
        let state = with_store(&self.folder, async |store| Ok(keys::state(store).await?))?;
        self.folder.print(&state, table)?;
        Ok(true)
    }
}

impl Draft {
    fn run(self) -> anyhow::Result<bool> {
        let Self { new_root, rotate, revoke, version, folder } = self;
        let text = with_store(&folder, async move |store| {
            let change = match (rotate, revoke) {
                (true, _) => KeyChange::Rotate,
                (false, Some(id)) => KeyChange::Revoke(find(&keys::state(store).await?, &id, "manifest")?),
                (false, None) => KeyChange::Renew,
            };
            Ok(keys::draft(store, change, new_root, version, store.now_ms()).await?)
        })?;
        write!(std::io::stdout().lock(), "{text}")?;
        Ok(true)
    }
}

impl Install {
    fn run(self) -> anyhow::Result<bool> {
        let document =
            std::fs::read_to_string(&self.file).with_context(|| format!("cannot read {}", self.file.display()))?;
        let version =
            with_store(&self.folder, async move |store| Ok(keys::install(store, &document, store.now_ms()).await?))?;
        self.folder.print(&version, |version| format!("keyring {version} is installed"))?;
        Ok(true)
    }
}

impl Forget {
    fn run(self) -> anyhow::Result<bool> {
        let id = self.id.clone();
        let is_done = with_store(&self.folder, async move |store| {
            let state = keys::state(store).await?;
            let line = state.keys.iter().find(|line| line.id == id).ok_or(KeysError::NoSuchKey { id })?;
            Ok(store.forget_private_key(&line.public).await?)
        })?;
        self.folder.print(&is_done, |is_done| match is_done {
            true => format!("this server has the private key {} no more", self.id),
            false => format!("this server did not have the private key {}", self.id),
        })?;
        Ok(true)
    }
}

/// Changes the keyring and prints the state after it.
fn change(
    folder: &DataDir,
    decide: impl AsyncFnOnce(&lightpath_store::Store) -> Result<KeyChange, KeysError>,
) -> anyhow::Result<bool> {
    let state = with_store(folder, async move |store| {
        let change = decide(store).await?;
        keys::change_keyring(store, change, store.now_ms()).await?;
        Ok(keys::state(store).await?)
    })?;
    folder.print(&state, table)?;
    Ok(true)
}

/// The public key with this id and use.
fn find(state: &KeyState, id: &str, use_: &str) -> Result<PublicKey, KeysError> {
    let line = state.keys.iter().find(|line| line.id == id && line.use_ == use_);
    line.and_then(|line| PublicKey::parse(&line.public)).ok_or_else(|| KeysError::NoSuchKey { id: id.to_owned() })
}

fn table(state: &KeyState) -> String {
    let line = |line: &KeyLine| {
        let times = match (&line.from, &line.until) {
            (Some(from), Some(until)) => format!("{from} to {until}"),
            _ => String::new(),
        };
        let place = if line.is_here { "here" } else { "elsewhere" };
        format!("{:<18}{:<10}{place:<11}{:<66}{times}", line.id, line.use_, line.public).trim_end().to_owned()
    };
    let lines: Vec<String> = state.keys.iter().map(line).collect();
    let head = format!("{:<18}{:<10}{:<11}{:<66}{}", "ID", "USE", "PRIVATE", "PUBLIC KEY", "COUNTS");
    format!("keyring {}, until {}\n\n{head}\n{}", state.keyring, state.keyring_expires, lines.join("\n"))
}
