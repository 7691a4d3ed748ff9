//! `lightpathd restore` and `restored`.

use super::commands::{DataDir, exit, runtime, text};
use super::keys::raise_after_restore;
use super::{Report, RestoredTokens, UpkeepError, check_with, open_artifacts, restore};
use crate::config::BucketFlags;
use crate::database::Database;
use lightpath_store::Store;
use serde::Serialize;
use std::path::PathBuf;
use std::process::ExitCode;

/// Create a data folder from a backup. The data folder must be empty or not exist, or hold what a restore left that did
/// not end. The backup does not change. Damaged files are listed, and everything else is restored.
///
/// The backup does not know which tokens were revoked after it. If it accepts any, say what becomes of them: --keep-tokens,
/// --revoke-token or --revoke-tokens. Without one of these, nothing is restored, and the tokens are named.
///
/// Exit code 0: no problems. 1: problems were found. 2: nothing was restored.
#[derive(Debug, clap::Args)]
#[command(after_help = "\
Examples:
  lightpathd restore /mnt/backup/2026-11-21 --data-dir /srv/lightpath \\
      --keep-tokens
  lightpathd restore /mnt/backup/2026-11-21 --revoke-token ada \\
      --revoke-token bench-7")]
pub struct RestoreArgs {
    /// Folder that `lightpathd backup` created
    #[arg(value_name = "BACKUP")]
    backup: PathBuf,
    #[command(flatten)]
    tokens: TokenFlags,
    #[command(flatten)]
    folder: DataDir,
}

/// Tell a database that it was restored by other means than `lightpathd restore`, then check it. Devices refuse older
/// kernels and keys than they have seen: this raises the generation of each display and the version of the keyring above
/// all of them, and halts rollouts. The server must not be running.
///
/// The database does not know which tokens were revoked after the backup. If it accepts any, say what becomes of them:
/// --keep-tokens, --revoke-token or --revoke-tokens. Without one of these, nothing is done, and the tokens are named.
///
/// Exit code 0: no problems. 1: problems were found. 2: nothing was done.
#[derive(Debug, clap::Args)]
#[command(after_help = "\
Examples:
  pg_restore --dbname lightpath lightpath.dump
  lightpathd restored --database-url postgres:///lightpath \\
      --data-dir /srv/lightpath --revoke-token ada")]
pub struct RestoredArgs {
    #[command(flatten)]
    tokens: TokenFlags,
    #[command(flatten)]
    folder: DataDir,
    #[command(flatten)]
    bucket: BucketFlags,
}

/// What becomes of the tokens that the backup accepts.
#[derive(Debug, clap::Args)]
#[group(multiple = false)]
struct TokenFlags {
    /// Keep all tokens as they were: none was revoked after the backup
    #[arg(long)]
    keep_tokens: bool,
    /// Revoke this token, and keep the others; repeat the option for each token that was revoked after the backup
    #[arg(long, value_name = "NAME")]
    revoke_token: Vec<String>,
    /// Revoke all tokens: everybody needs a new one
    #[arg(long)]
    revoke_tokens: bool,
}

impl RestoreArgs {
    /// Restores a backup, checks it and prints the report.
    #[must_use]
    pub fn run(self) -> ExitCode {
        exit(self.copy())
    }

    fn copy(&self) -> anyhow::Result<bool> {
        let data_dir = self.folder.whole()?;
        let restored = runtime()?.block_on(async {
            let report = restore(&self.backup, &data_dir, &self.tokens.meaning()).await?;
            let store = Database::InFolder(data_dir).open_shared().await?;
            Restored::of(report, &store).await
        })?;
        self.folder.print(&restored, Restored::text)?;
        Ok(restored.report.problems.is_empty())
    }
}

impl RestoredArgs {
    /// Raises what devices compare, checks everything and prints the report.
    #[must_use]
    pub fn run(self) -> ExitCode {
        exit(self.raise())
    }

    fn raise(&self) -> anyhow::Result<bool> {
        let config = self.folder.config(&self.bucket)?;
        let database = config.database()?;
        let restored = runtime()?.block_on(async {
            database.require().await?;
            // This fails while a server uses the folder.
            let artifacts = open_artifacts(&config)?;
            let store = database.open(&artifacts).await?;
            self.tokens.meaning().settle(&store, store.now_ms()).await?;
            raise_after_restore(&store, store.now_ms()).await?;
            let report = check_with(&config.data_dir, &database, config.bucket()?.as_ref()).await?;
            Restored::of(report, &store).await
        })?;
        self.folder.print(&restored, Restored::text)?;
        Ok(restored.report.problems.is_empty())
    }
}

impl TokenFlags {
    fn meaning(&self) -> RestoredTokens {
        match self {
            Self { keep_tokens: true, .. } => RestoredTokens::Keep,
            Self { revoke_tokens: true, .. } => RestoredTokens::RevokeAll,
            Self { revoke_token, .. } if revoke_token.is_empty() => RestoredTokens::Undecided,
            Self { revoke_token, .. } => RestoredTokens::Revoke(revoke_token.clone()),
        }
    }
}

/// What a restore made.
#[derive(Debug, Serialize)]
struct Restored {
    #[serde(flatten)]
    report: Report,
    /// Names of the tokens that are accepted.
    accepted_tokens: Vec<String>,
}

impl Restored {
    /// Closes the store.
    async fn of(report: Report, store: &Store) -> Result<Self, UpkeepError> {
        let now_ms = store.now_ms();
        let tokens = store.tokens().await?.into_iter().filter(|token| token.is_valid(now_ms));
        let accepted_tokens = tokens.map(|token| token.caller.name).collect();
        store.close().await;
        Ok(Self { report, accepted_tokens })
    }

    fn text(&self) -> String {
        let names = if self.accepted_tokens.is_empty() { "none".to_owned() } else { self.accepted_tokens.join(", ") };
        format!("{}\n{:<22}{names}", text(&self.report), "accepted tokens")
    }
}
