//! What operators do to a data folder: check it, back it up, restore it.
//!
//! A check and a backup work beside a server that runs: they read the database through connections of their own, and
//! take no part in the server's lock. What a server has removed or replaced between two looks is looked at again.
//!
//! # Layout
//!
//! - `check`: is everything there that should be? `backup`, `restore`. `collect`: what goes by itself. `tokens`: making
//!   and revoking them. `commands`: these on the command line.

mod backup;
mod check;
mod collect;
mod commands;
mod restore;
#[cfg(test)]
mod tests;
mod tokens;

pub use backup::{Backup, Manifest, backup};
pub use check::{Finding, FindingKind, Report, check};
pub use collect::{Collected, Retention};
pub use commands::{BackupArgs, CheckArgs, CollectArgs, RestoreArgs};
pub use restore::restore;
pub use tokens::TokenCommand;

use lightpath_artifacts::ArtifactError;
use lightpath_store::StoreError;
use std::io;
use std::path::PathBuf;

/// Name of the database in the data folder.
pub const DATABASE: &str = "lightpath.db";

/// Why a data folder could not be checked, backed up or restored.
#[derive(Debug, thiserror::Error)]
pub enum UpkeepError {
    /// No database.
    #[error("{} holds no {DATABASE}; name the folder that the server works in (--data-dir)", path.display())]
    NoData {
        /// The folder.
        path: PathBuf,
    },
    /// Something lies where the copy should go.
    #[error("{} is not empty; name a folder that is empty or does not exist", path.display())]
    NotEmpty {
        /// The folder.
        path: PathBuf,
    },
    /// Not a whole backup.
    #[error("{} is no complete backup: {problem}", path.display())]
    NoBackup {
        /// The folder.
        path: PathBuf,
        /// What is wrong.
        problem: String,
    },
    /// What was to be copied is damaged.
    #[error("{} is damaged and cannot be copied; `lightpathd check` tells everything", path.display())]
    Damaged {
        /// The folder.
        path: PathBuf,
        /// What was found.
        source: ArtifactError,
    },
    /// The file system refused.
    #[error("could not {action} {}", path.display())]
    Io {
        /// What was tried.
        action: &'static str,
        /// With which file.
        path: PathBuf,
        /// What the system said.
        source: io::Error,
    },
    /// The database failed.
    #[error(transparent)]
    Store(#[from] StoreError),
    /// The files failed.
    #[error(transparent)]
    Artifacts(#[from] ArtifactError),
}

impl UpkeepError {
    fn io(action: &'static str, path: impl Into<PathBuf>) -> impl FnOnce(io::Error) -> Self {
        let path = path.into();
        move |source| Self::Io { action, path, source }
    }
}
