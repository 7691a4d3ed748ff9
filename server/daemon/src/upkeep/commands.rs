//! `lightpathd check`, `backup` and `collect`, and what all commands share.

use super::{Collected, Finding, Report, Retention, UpkeepError, backup, check_with, open_artifacts};
use crate::config::{BucketFlags, Config, Effective, ServeFlags, Settings};
use crate::database::Database;
use anyhow::Context as _;
use serde::Serialize;
use std::io::Write as _;
use std::iter::once;
use std::path::PathBuf;
use std::process::ExitCode;

/// Arguments that select the data folder, in the same way as for the server.
#[derive(Debug, clap::Args)]
pub(super) struct DataDir {
    /// TOML file with the server's settings, which contains its data_dir
    #[arg(long, env = "LIGHTPATH_CONFIG", value_name = "FILE")]
    config: Option<PathBuf>,
    /// Data folder of the server [default: ./lightpath-data]
    #[arg(long, env = "LIGHTPATH_DATA_DIR", value_name = "DIR")]
    data_dir: Option<PathBuf>,
    /// URL of the server's PostgreSQL database, if it uses one
    #[arg(long, env = "LIGHTPATH_DATABASE_URL", value_name = "URL", hide_env_values = true)]
    database_url: Option<String>,
    /// Format of the output
    #[arg(long, value_name = "FORM", default_value = "table")]
    output: Form,
}

/// Form of a report.
#[derive(Clone, Copy, Debug, clap::ValueEnum)]
pub(super) enum Form {
    /// Text for people
    Table,
    /// JSON for programs
    Json,
}

/// Check a data folder: every constraint and reference of its database, and every stored file against its SHA-256. If the
/// artifacts are in a bucket, every object is read from there. The check changes nothing. The server may be running.
///
/// Exit code 0: no problems. 1: problems were found. 2: the folder could not be checked.
#[derive(Debug, clap::Args)]
#[command(after_help = "\
Examples:
  lightpathd check --data-dir /srv/lightpath
  lightpathd check --output json | jq .problems")]
pub struct CheckArgs {
    #[command(flatten)]
    folder: DataDir,
    #[command(flatten)]
    bucket: BucketFlags,
}

/// Copy a data folder to a folder that is empty or does not exist. The server may be running. The copy is checked and
/// shows the state of one moment. Damaged artifacts are listed, and everything else is copied.
///
/// Exit code 0: the copy is complete. 1: it lacks the listed artifacts. 2: there is no copy.
#[derive(Debug, clap::Args)]
#[command(after_help = "\
Examples:
  lightpathd backup --data-dir /srv/lightpath /mnt/backup/$(date +%F)")]
pub struct BackupArgs {
    /// Folder for the copy
    #[arg(value_name = "DESTINATION")]
    destination: PathBuf,
    #[command(flatten)]
    folder: DataDir,
}

/// Remove ended jobs, and artifacts without references, that have reached the ages in the settings. A running server
/// does this every hour. Use this command for a preview, or while the server is stopped.
#[derive(Debug, clap::Args)]
#[command(after_help = "\
Examples:
  lightpathd collect --data-dir /srv/lightpath --dry-run")]
pub struct CollectArgs {
    /// Print what would be removed, and remove nothing; the server may be running
    #[arg(long)]
    dry_run: bool,
    /// TOML file with the server's settings
    #[arg(long, env = "LIGHTPATH_CONFIG", value_name = "FILE")]
    config: Option<PathBuf>,
    /// Format of the output
    #[arg(long, value_name = "FORM", default_value = "table")]
    output: Form,
    #[command(flatten)]
    settings: ServeFlags,
}

/// Exit code if the command could not do its work.
const EXIT_NOT_DONE: u8 = 2;

impl DataDir {
    /// The data folder, and where its database is.
    pub(super) fn places(&self) -> anyhow::Result<(PathBuf, Database)> {
        let config = self.config(&BucketFlags::default())?;
        let database = config.database()?;
        Ok((config.data_dir, database))
    }

    /// The settings of the server, of which these arguments and those of the bucket override the file.
    pub(super) fn config(&self, bucket: &BucketFlags) -> anyhow::Result<Config> {
        let file = self.config.as_deref().map(Settings::read).transpose()?.unwrap_or_default();
        let mut given = bucket.0.clone();
        if let Some(data_dir) = &self.data_dir {
            given = given.with("data_dir", data_dir.to_str().context("data_dir must be valid Unicode")?);
        }
        if let Some(url) = &self.database_url {
            given = given.with("database_url", url);
        }
        Ok(Effective::merge(given, file)?.config)
    }

    /// The data folder with its database.
    pub(super) fn whole(&self) -> anyhow::Result<PathBuf> {
        match self.places()? {
            (folder, Database::InFolder(_)) => Ok(folder),
            (_, Database::OnServer(_)) => Err(UpkeepError::DatabaseOnServer.into()),
        }
    }

    pub(super) fn print<T: Serialize>(&self, value: &T, text: impl FnOnce(&T) -> String) -> anyhow::Result<()> {
        print(self.output, value, text)
    }
}

pub(super) fn print<T: Serialize>(output: Form, value: &T, text: impl FnOnce(&T) -> String) -> anyhow::Result<()> {
    let text = match output {
        Form::Table => text(value),
        Form::Json => serde_json::to_string_pretty(value)?,
    };
    Ok(writeln!(std::io::stdout().lock(), "{}", text.trim_end())?)
}

impl CheckArgs {
    /// Checks the data folder and prints the report.
    #[must_use]
    pub fn run(self) -> ExitCode {
        exit(self.report())
    }

    fn report(&self) -> anyhow::Result<bool> {
        let config = self.folder.config(&self.bucket)?;
        let bucket = config.bucket()?;
        let report = runtime()?.block_on(check_with(&config.data_dir, &config.database()?, bucket.as_ref()))?;
        self.folder.print(&report, text)?;
        Ok(report.problems.is_empty())
    }
}

impl BackupArgs {
    /// Backs up the data folder and prints the result.
    #[must_use]
    pub fn run(self) -> ExitCode {
        exit(self.copy())
    }

    fn copy(&self) -> anyhow::Result<bool> {
        let data_dir = self.folder.whole()?;
        let done = runtime()?.block_on(backup(&data_dir, &self.destination))?;
        self.folder.print(&done, |done| {
            let manifest = &done.manifest;
            let mib = manifest.artifact_bytes as f64 / f64::from(1 << 20);
            let jobs = manifest.jobs;
            let copied = format!(
                "{}: {jobs} jobs, {} artifacts, {mib:.1} MiB; {} jobs would start from the beginning",
                self.destination.display(),
                manifest.artifacts,
                done.restarting_jobs
            );
            let missing = format!("artifacts that could not be copied: {}", done.damaged.len());
            once(copied).chain(once(missing)).chain(done.damaged.iter().map(line)).collect::<Vec<_>>().join("\n")
        })?;
        Ok(done.damaged.is_empty())
    }
}

impl CollectArgs {
    /// Removes old jobs and artifacts, or prints what would be removed.
    #[must_use]
    pub fn run(self) -> ExitCode {
        exit(self.collect())
    }

    fn collect(self) -> anyhow::Result<bool> {
        let file = self.config.as_deref().map(Settings::read).transpose()?.unwrap_or_default();
        let config = Effective::merge(self.settings.0, file)?.config;
        let database = config.database()?;
        let retention = Retention::of(&config);
        let collected = runtime()?.block_on(async {
            database.require().await?;
            if self.dry_run {
                let store = database.open_shared().await?;
                return retention.preview(&store, store.now_ms()).await;
            }
            // This fails while a server uses the folder, because two processes would not know of each other's uploads.
            let artifacts = open_artifacts(&config)?;
            let store = database.open(&artifacts).await?;
            retention.collect(&store, &artifacts, store.now_ms()).await
        })?;
        let what = if self.dry_run { "would be removed" } else { "removed" };
        print(self.output, &collected, |Collected { jobs, artifacts, artifact_bytes }| {
            let mib = *artifact_bytes as f64 / f64::from(1 << 20);
            format!("{what}: {jobs} jobs, {artifacts} artifacts, {mib:.1} MiB")
        })?;
        Ok(true)
    }
}

pub(super) fn runtime() -> std::io::Result<tokio::runtime::Runtime> {
    tokio::runtime::Builder::new_current_thread().enable_all().build()
}

pub(super) fn exit(outcome: anyhow::Result<bool>) -> ExitCode {
    match outcome {
        Ok(true) => ExitCode::SUCCESS,
        Ok(false) => ExitCode::FAILURE,
        Err(error) => {
            let _ = writeln!(std::io::stderr().lock(), "lightpathd: {error:#}");
            ExitCode::from(EXIT_NOT_DONE)
        }
    }
}

pub(super) fn text(report: &Report) -> String {
    let mut lines = vec![
        format!("{:<22}{}", "data folder", report.data_dir.display()),
        format!("{:<22}{}", "bucket", report.bucket.as_deref().unwrap_or("none")),
        format!("{:<22}{}", "last migration", report.schema),
        format!("{:<22}{}", "jobs", report.jobs),
        format!("{:<22}{}", "kernel versions", report.kernel_versions),
        format!(
            "{:<22}{} ({:.1} MiB)",
            "artifacts",
            report.artifacts,
            report.artifact_bytes as f64 / f64::from(1 << 20)
        ),
        format!("{:<22}{}", "checkpoints", report.checkpoints),
        format!("{:<22}{}", "unreferenced files", report.unreferenced_files),
        format!("{:<22}{}", "problems", report.problems.len()),
    ];
    lines.extend(report.problems.iter().map(line));
    lines.join("\n")
}

pub(super) fn line(found: &Finding) -> String {
    format!("  {:<12}{} {}", found.kind.as_str(), found.what, found.problem)
}
