//! `lightpathd check`, `backup`, `restore` and `collect`.

use super::{Collected, DATABASE, Report, UpkeepError, backup, check, restore};
use crate::config::{Effective, Settings};
use lightpath_artifacts::Artifacts;
use lightpath_store::Store;
use lightpath_worker::Clock;
use serde::Serialize;
use std::io::Write as _;
use std::path::PathBuf;
use std::process::ExitCode;

/// Arguments that select the data folder, in the same way as for the server.
#[derive(Debug, clap::Args)]
pub(super) struct DataDir {
    /// TOML file of settings that the server is started with; its data_dir counts
    #[arg(long, env = "LIGHTPATH_CONFIG", value_name = "FILE")]
    config: Option<PathBuf>,
    /// Folder that the server works in [default: ./lightpath-data]
    #[arg(long, env = "LIGHTPATH_DATA_DIR", value_name = "DIR")]
    data_dir: Option<PathBuf>,
    /// What stdout gets
    #[arg(long, value_name = "FORM", default_value = "table")]
    output: Form,
}

/// Form of a report.
#[derive(Clone, Copy, Debug, clap::ValueEnum)]
enum Form {
    /// For people
    Table,
    /// For programs
    Json,
}

/// Compare a data folder with what its database promises: every constraint, every reference, and every stored file with
/// its SHA-256. Changes nothing, and may run beside the server.
///
/// Exit code 0: nothing is wrong. 1: something is. 2: it could not be checked.
#[derive(Debug, clap::Args)]
#[command(after_help = "\
Examples:
  lightpathd check --data-dir /srv/lightpath
  lightpathd check --output json | jq .problems")]
pub struct CheckArgs {
    #[command(flatten)]
    place: DataDir,
}

/// Copy a data folder, while the server works in it, to a folder that is empty or does not exist. The copy is of one
/// moment, complete, and checked.
#[derive(Debug, clap::Args)]
#[command(after_help = "\
Examples:
  lightpathd backup --data-dir /srv/lightpath /mnt/backup/$(date +%F)")]
pub struct BackupArgs {
    /// Folder that gets the copy
    #[arg(value_name = "DESTINATION")]
    destination: PathBuf,
    #[command(flatten)]
    place: DataDir,
}

/// Make a data folder from a backup. The folder must be empty or not exist; the backup stays as it is.
#[derive(Debug, clap::Args)]
#[command(after_help = "\
Examples:
  lightpathd restore /mnt/backup/2026-11-21 --data-dir /srv/lightpath")]
pub struct RestoreArgs {
    /// Folder that `lightpathd backup` made
    #[arg(value_name = "BACKUP")]
    backup: PathBuf,
    #[command(flatten)]
    place: DataDir,
}

/// Remove what has stayed longer than the settings say: jobs that ended long ago, and artifacts that nothing refers to.
/// A server that runs does so by itself every hour; this is for looking first, and for a server that is stopped.
#[derive(Debug, clap::Args)]
#[command(after_help = "\
Examples:
  lightpathd collect --data-dir /srv/lightpath --dry-run")]
pub struct CollectArgs {
    /// Say what would go, and remove nothing; may run beside the server
    #[arg(long)]
    dry_run: bool,
    /// TOML file of settings that the server is started with
    #[arg(long, env = "LIGHTPATH_CONFIG", value_name = "FILE")]
    config: Option<PathBuf>,
    /// What stdout gets
    #[arg(long, value_name = "FORM", default_value = "table")]
    output: Form,
    #[command(flatten)]
    settings: Settings,
}

/// Exit code if the command could not do its work.
const EXIT_NOT_DONE: u8 = 2;

impl DataDir {
    pub(super) fn path(&self) -> anyhow::Result<PathBuf> {
        if let Some(data_dir) = &self.data_dir {
            return Ok(data_dir.clone());
        }
        let file = self.config.as_deref().map(Settings::read).transpose()?.unwrap_or_default();
        Ok(Effective::merge(Settings::default(), file)?.config.data_dir)
    }

    pub(super) fn print<T: Serialize>(&self, value: &T, text: impl FnOnce(&T) -> String) -> anyhow::Result<()> {
        print(self.output, value, text)
    }
}

fn print<T: Serialize>(output: Form, value: &T, text: impl FnOnce(&T) -> String) -> anyhow::Result<()> {
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
        let data_dir = self.place.path()?;
        let report = runtime()?.block_on(check(&data_dir))?;
        self.place.print(&report, text)?;
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
        let data_dir = self.place.path()?;
        let done = runtime()?.block_on(backup(&data_dir, &self.destination))?;
        self.place.print(&done, |done| {
            let manifest = &done.manifest;
            let mib = manifest.artifact_bytes as f64 / f64::from(1 << 20);
            let jobs = manifest.jobs;
            format!(
                "{}: {jobs} jobs, {} artifacts, {mib:.1} MiB; {} running jobs would start over",
                self.destination.display(),
                manifest.artifacts,
                done.restarting_jobs
            )
        })?;
        Ok(true)
    }
}

impl RestoreArgs {
    /// Restores a backup, checks it and prints the report.
    #[must_use]
    pub fn run(self) -> ExitCode {
        exit(self.copy())
    }

    fn copy(&self) -> anyhow::Result<bool> {
        let data_dir = self.place.path()?;
        let report = runtime()?.block_on(restore(&self.backup, &data_dir))?;
        self.place.print(&report, text)?;
        Ok(report.problems.is_empty())
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
        let config = Effective::merge(self.settings, file)?.config;
        let database = config.data_dir.join(DATABASE);
        if !database.is_file() {
            return Err(UpkeepError::NoData { path: config.data_dir }.into());
        }
        let now_ms = Clock::default().now_ms();
        let retention = config.retention();
        let collected = runtime()?.block_on(async {
            if self.dry_run {
                return retention.preview(&Store::open_beside(&database).await?, now_ms).await;
            }
            // Fails while a server uses the folder: two processes would not know of each other's uploads.
            let artifacts = Artifacts::open(&config.data_dir)?;
            retention.collect(&Store::open(&database).await?, &artifacts, now_ms).await
        })?;
        let what = if self.dry_run { "would go" } else { "gone" };
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

fn text(report: &Report) -> String {
    let mut lines = vec![
        format!("{:<22}{}", "data folder", report.data_dir.display()),
        format!("{:<22}{}", "tables as of", report.schema),
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
    let problems = report.problems.iter();
    lines.extend(problems.map(|it| format!("  {:<12}{} {}", it.kind.as_str(), it.what, it.problem)));
    lines.join("\n")
}
