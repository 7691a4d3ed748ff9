//! The process that a server starts for one job, because an earlier server died while it ran the job.

use crate::config::{Config, LogFormat};
use crate::server::{ServeError, open_device};
use crate::upkeep::UpkeepError;
use lightpath_artifacts::Artifacts;
use lightpath_worker::{JobInput, JobProgram, OpticsTask, Worker};
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// Name of the command that runs one job.
pub const COMMAND: &str = "job";

/// This program, as the one that runs a job. Its settings are those of this process.
///
/// # Errors
///
/// An error if the system does not say where this program is.
pub fn this_program(config: &Config) -> std::io::Result<JobProgram> {
    // The link leads to the program that runs, also after an update has replaced its file.
    let link = Path::new("/proc/self/exe");
    let file = if link.exists() { PathBuf::from(link) } else { std::env::current_exe()? };
    // Its log is read by this process, which writes it into its own.
    let settings = serde_json::to_string(&Config { log_format: LogFormat::Text, ..config.clone() })?;
    Ok(JobProgram { file, arguments: vec![COMMAND.into()], settings })
}

/// Runs the job.
///
/// # Errors
///
/// [`ServeError`] if the job cannot begin.
pub async fn run(input: JobInput, mut config: Config) -> Result<(), ServeError> {
    let (folder, space, bucket) = (config.data_dir.clone(), config.space(), config.bucket()?);
    let open = move || Artifacts::open_beside(&folder, space, bucket.as_ref());
    let artifacts = tokio::task::spawn_blocking(open).await?.map_err(UpkeepError::from)?;
    let store = config.database()?.open_shared().await?;
    let device = open_device(&mut config).await?;
    input.run(Worker::new(store, artifacts, config.workers(), Arc::new(OpticsTask)).computing_on(device)).await?;
    Ok(())
}
