//! `lightpathd migrate`.

use super::commands::{Form, exit, line, print, runtime};
use super::migrate::{Migration, Moved};
use crate::config::{BucketFlags, Effective, SecretText, Settings};
use crate::database::DATABASE;
use anyhow::{Context as _, bail};
use indicatif::{ProgressBar, ProgressStyle};
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::time::Duration;

/// Move a server's database between its data folder and PostgreSQL, and its files to a bucket. No server may be running.
/// The source does not change, and the target must be empty. All tables are copied, then both sides are read again and
/// compared. After an interruption, the same command continues.
///
/// The files stay in the data folder. With the settings of a bucket, they are stored there, and each is read back and
/// compared with its SHA-256.
///
/// Exit code 0: everything was moved. 1: everything was moved except the listed files, which are missing or damaged in
/// the data folder, too. 2: nothing was moved, or the move is not complete.
#[derive(Debug, clap::Args)]
#[command(after_help = "\
Examples:
  lightpathd migrate --from sqlite:///srv/lightpath \\
      --to postgres://lab@db/lightpath
  lightpathd migrate --from postgres://lab@db/lightpath \\
      --to sqlite:///srv/lightpath")]
pub struct MigrateArgs {
    /// Database to move: sqlite://DATA_DIR or postgres://…
    #[arg(long, value_name = "URL", hide_env_values = true)]
    from: String,
    /// Where to move it: postgres://… or sqlite://DATA_DIR
    #[arg(long, value_name = "URL", hide_env_values = true)]
    to: String,
    /// TOML file with the server's settings, for those of the bucket
    #[arg(long, env = "LIGHTPATH_CONFIG", value_name = "FILE")]
    config: Option<PathBuf>,
    /// Format of the output
    #[arg(long, value_name = "FORM", default_value = "table")]
    output: Form,
    #[command(flatten)]
    bucket: BucketFlags,
}

impl MigrateArgs {
    /// Moves the database and prints what was moved.
    #[must_use]
    pub fn run(self) -> ExitCode {
        exit(self.migrate())
    }

    fn migrate(&self) -> anyhow::Result<bool> {
        let migration = self.migration()?;
        let bar = bar();
        let moved = runtime()?.block_on(migration.run(&mut |step, done, all| {
            bar.set_message(step);
            bar.set_length(all.max(1));
            bar.set_position(done);
        }));
        bar.finish_and_clear();
        let moved = moved?;
        print(self.output, &moved, text)?;
        Ok(moved.blobs.is_none_or(|blobs| blobs.damaged.is_empty()))
    }

    /// What the arguments ask for.
    fn migration(&self) -> anyhow::Result<Migration> {
        let (folder, url, to_server) = match (folder_of(&self.from), folder_of(&self.to)) {
            (Some(folder), None) => (folder, &self.to, true),
            (None, Some(folder)) => (folder, &self.from, false),
            _ => bail!(
                "one of --from and --to must be sqlite://DATA_DIR and the other postgres://…; to move a data folder to \
                 another place, use lightpathd backup and restore"
            ),
        };
        if !url.starts_with("postgres://") && !url.starts_with("postgresql://") {
            bail!("the URL of a database must begin with sqlite://, postgres:// or postgresql://");
        }
        let file = self.config.as_deref().map(Settings::read).transpose()?.unwrap_or_default();
        let folder = folder.to_str().context("the folder must be valid Unicode")?;
        let given = self.bucket.0.clone().with("data_dir", folder).with("database_url", url);
        let mut config = Effective::merge(given, file)?.config;
        // Only a server with a database of PostgreSQL can have a bucket.
        config.database_url = to_server.then(|| SecretText::new(url.clone()));
        config.bucket()?;
        Ok(Migration { config, url: url.clone(), to_server })
    }
}

/// The data folder in a URL such as `sqlite:///srv/lightpath`, which may name the file in it; `None`: another URL.
fn folder_of(url: &str) -> Option<PathBuf> {
    let path = Path::new(url.strip_prefix("sqlite://")?);
    let folder = if path.file_name().is_some_and(|name| name == DATABASE) { path.parent()? } else { path };
    Some(if folder.as_os_str().is_empty() { PathBuf::from(".") } else { folder.to_owned() })
}

/// A progress bar on stderr, if it is a terminal.
fn bar() -> ProgressBar {
    let bar = ProgressBar::new(1);
    let style = ProgressStyle::with_template("{msg:18} {wide_bar} {human_pos}/{human_len} {eta:>4}");
    bar.set_style(style.unwrap_or_else(|_| ProgressStyle::default_bar()));
    bar.enable_steady_tick(Duration::from_millis(200));
    bar
}

fn text(moved: &Moved) -> String {
    let mut lines: Vec<String> = moved
        .tables
        .iter()
        .filter(|table| table.rows > 0)
        .map(|table| format!("{:<22}{:>9}  {}", table.name, table.rows, &table.digest[..16]))
        .collect();
    lines.push(format!("{:<22}{:>9}  the same on both sides", "all rows", moved.rows));
    if let Some(blobs) = &moved.blobs {
        let mib = blobs.bytes as f64 / f64::from(1 << 20);
        lines.push(format!("{:<22}{:>9}  {mib:.1} MiB, read back and compared", "files in the bucket", blobs.files));
        lines.push(format!("{:<22}{:>9}", "missing or damaged", blobs.damaged.len()));
        lines.extend(blobs.damaged.iter().map(line));
    }
    lines.join("\n")
}

#[cfg(test)]
mod tests {
    use super::*;
    use clap::{Args as _, FromArgMatches as _};

    fn args(from: &str, to: &str) -> MigrateArgs {
        let (from, to) = (from.to_owned(), to.to_owned());
        MigrateArgs { from, to, config: None, output: Form::Json, bucket: BucketFlags::default() }
    }

    #[test]
    fn files_go_to_a_bucket_only_with_the_database() {
        let bucket =
            ["--artifacts-url", "s3://lab", "--artifacts-access-key-id", "a", "--artifacts-secret-access-key", "b"];
        for (from, to, fits) in [("sqlite://a", "postgres:///b", true), ("postgres:///b", "sqlite://a", false)] {
            let given = ["migrate", "--from", from, "--to", to].into_iter().chain(bucket);
            let matches = MigrateArgs::augment_args(clap::Command::new("migrate")).get_matches_from(given);
            let migration = MigrateArgs::from_arg_matches(&matches).unwrap().migration();
            assert_eq!(migration.is_ok_and(|migration| migration.config.bucket().unwrap().is_some()), fits);
        }
    }

    #[test]
    fn one_side_is_a_folder_and_the_other_a_server() {
        for (from, to, folder, to_server) in [
            ("sqlite:///srv/lightpath", "postgres:///lab", "/srv/lightpath", true),
            ("postgresql://db/lab", "sqlite:///srv/lightpath/lightpath.db", "/srv/lightpath", false),
            ("sqlite://lightpath.db", "postgres:///lab", ".", true),
        ] {
            let migration = args(from, to).migration().unwrap();
            assert_eq!((migration.config.data_dir, migration.to_server), (PathBuf::from(folder), to_server));
        }
        for (from, to) in [
            ("sqlite://a", "sqlite://b"),
            ("postgres:///a", "postgres:///b"),
            ("sqlite://a", "mysql://b"),
            ("/srv/lightpath", "postgres:///lab"),
        ] {
            assert!(args(from, to).migration().is_err(), "{from} {to}");
        }
    }
}
