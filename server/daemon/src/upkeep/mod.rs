//! Commands for operators on a data folder and its database: check them, back them up, restore them, and remove old data.
//!
//! A check and a backup may run while the server runs. They read the database through their own connections and do not
//! need the lock of the data folder. If the server removes or replaces an item during the check, the check examines it
//! again. Commands that write files hold the lock of the folder into which they write: a restore from before its first
//! file until after its check, a backup in its destination, a collection, and a command that creates the database.
//!
//! # Layout
//!
//! - `check`, `backup`, `restore`: these commands. `restored_tokens`: which tokens a restored database accepts. `blob_reader`: reads the blobs of a check. `collect`: automatic removal of
//!   old data; `removal`: from a bucket. `migrate`: a move to another database; `migrate_command`: its command.
//! - `tokens`: creating, listing and revoking tokens. `keys`: keys that sign manifests; `key_commands`: `lightpathd key`.
//!   `restore_command`: `restore` and `restored` on the command line; `commands`: the others.

mod backup;
mod blob_reader;
mod check;
mod collect;
mod commands;
mod key_commands;
mod keys;
mod migrate;
mod migrate_command;
#[cfg(test)]
mod migrate_tests;
mod removal;
mod restore;
mod restore_command;
#[cfg(test)]
mod restore_tests;
mod restored_tokens;
#[cfg(test)]
mod tests;
mod tokens;

pub use backup::{Backup, Manifest, backup};
pub use check::{Finding, FindingKind, Report, check, check_with};
pub use collect::Retention;
pub use commands::{BackupArgs, CheckArgs, CollectArgs};
pub use key_commands::KeyCommand;
pub use keys::{KeyChange, KeyLine, KeyState, KeysError, change_keyring, install, state, tend};
pub use migrate::{Migration, Moved, MovedBlobs};
pub use migrate_command::MigrateArgs;
pub use removal::Collected;
pub use restore::restore;
pub use restore_command::{RestoreArgs, RestoredArgs};
pub use restored_tokens::RestoredTokens;
pub use tokens::TokenCommand;

use crate::config::{Config, ConfigError};
use crate::database::DatabaseError;
use lightpath_artifacts::{ArtifactError, Artifacts};
use lightpath_store::{StoreError, TransferError};
use std::io;
use std::path::PathBuf;

/// A result with an [`UpkeepError`], if it names no other error.
pub type Result<T, E = UpkeepError> = std::result::Result<T, E>;

/// Why a data folder could not be checked, backed up or restored; the messages say what each means.
#[derive(Debug, thiserror::Error)]
#[allow(missing_docs)]
pub enum UpkeepError {
    #[error(transparent)]
    Database(#[from] DatabaseError),
    #[error(
        "the database is on a PostgreSQL server: copy it with pg_dump and then the artifacts; without database_url this \
         command copies a data folder with a database"
    )]
    DatabaseOnServer,
    #[error("{} is not empty; choose a folder that is empty or does not exist", path.display())]
    NotEmpty { path: PathBuf },
    /// The destination of a copy is inside the folder that is copied.
    #[error("{} is inside {}; choose a folder outside of it", path.display(), folder.display())]
    Inside { path: PathBuf, folder: PathBuf },
    #[error("{} is not a complete backup: {problem}", path.display())]
    NoBackup { path: PathBuf, problem: String },
    /// Nobody has said what becomes of the tokens.
    #[error(
        "the backup accepts the tokens {names}, and does not know which of them were revoked after it. Add --revoke-token \
         NAME for each that was, --keep-tokens if none was, or --revoke-tokens to revoke all"
    )]
    TokensUndecided { names: String },
    #[error(
        "the backup has no token {names}; it accepts {accepted}. A token that was created after the backup is not in it"
    )]
    UnknownTokens { names: String, accepted: String },
    #[error("could not {action} {}", path.display())]
    Io { action: &'static str, path: PathBuf, source: io::Error },
    #[error(transparent)]
    Keys(Box<KeysError>),
    #[error(transparent)]
    Artifacts(#[from] ArtifactError),
    #[error(transparent)]
    Transfer(#[from] TransferError),
    /// The settings of the bucket are wrong.
    #[error(transparent)]
    Config(#[from] ConfigError),
}

impl From<StoreError> for UpkeepError {
    fn from(error: StoreError) -> Self {
        Self::Database(error.into())
    }
}

impl UpkeepError {
    fn io(action: &'static str, path: impl Into<PathBuf>) -> impl FnOnce(io::Error) -> Self {
        let path = path.into();
        move |source| Self::Io { action, path, source }
    }
}

/// Opens the artifacts of a server: locks the data folder, and connects to the bucket if there is one. Blocks.
pub(crate) fn open_artifacts(config: &Config) -> Result<Artifacts> {
    Ok(Artifacts::open_with(&config.data_dir, config.space(), config.bucket()?.as_ref())?)
}
