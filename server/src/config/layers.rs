//! Merging the layers, remembering where each value came from.

use super::{
    CHECKPOINT_INTERVAL_S, COMPUTE_THREADS, Config, ConfigError, DRAIN_DEADLINE_S, LEASE_S, LogFormat, QUEUE_LIMIT,
    WORKERS,
};
use clap::ArgMatches;
use clap::parser::ValueSource;
use std::fmt::{self, Display};
use std::fs;
use std::net::SocketAddr;
use std::ops::RangeInclusive;
use std::path::{Path, PathBuf};
use std::time::Duration;

/// One layer of settings: a file, or flags and environment. What is `None` is left to the layer below.
#[derive(Clone, Debug, Default, PartialEq, clap::Args, serde::Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Settings {
    /// Folder of database and artifacts, made where missing [default: ./lightpath-data]
    #[arg(long, env = "LIGHTPATH_DATA_DIR", value_name = "DIR")]
    pub data_dir: Option<PathBuf>,
    /// Address and port of gRPC and HTTP; port 0 takes a free one [default: 127.0.0.1:7070]
    #[arg(long, env = "LIGHTPATH_LISTEN", value_name = "ADDRESS:PORT", value_parser = address)]
    pub listen: Option<SocketAddr>,
    /// Jobs that run at once [default: 1]
    #[arg(long, env = "LIGHTPATH_WORKERS", value_name = "COUNT")]
    pub workers: Option<u32>,
    /// Threads that one job computes on [default: one a core]
    #[arg(long, env = "LIGHTPATH_COMPUTE_THREADS", value_name = "COUNT")]
    pub compute_threads: Option<usize>,
    /// A worker that is silent for this long loses its job to the queue [default: 30]
    #[arg(long, env = "LIGHTPATH_LEASE_S", value_name = "SECONDS")]
    pub lease_s: Option<f64>,
    /// How often a running job saves its state [default: 10]
    #[arg(long, env = "LIGHTPATH_CHECKPOINT_INTERVAL_S", value_name = "SECONDS")]
    pub checkpoint_interval_s: Option<f64>,
    /// Jobs that may wait; more are refused [default: 10000]
    #[arg(long, env = "LIGHTPATH_QUEUE_LIMIT", value_name = "COUNT")]
    pub queue_limit: Option<u32>,
    /// Time that jobs and requests get to end when the server stops [default: 20]
    #[arg(long, env = "LIGHTPATH_DRAIN_DEADLINE_S", value_name = "SECONDS")]
    pub drain_deadline_s: Option<f64>,
    /// Form of the log on stderr [default: text]
    #[arg(long, env = "LIGHTPATH_LOG_FORMAT", value_name = "FORM", value_enum)]
    pub log_format: Option<LogFormat>,
    /// What is logged: error, warn, info, debug, or by module, lightpath_server=debug,warn [default: info]
    #[arg(long, env = "LIGHTPATH_LOG_LEVEL", value_name = "FILTER")]
    pub log_level: Option<String>,
}

fn address(text: &str) -> Result<SocketAddr, String> {
    text.parse().map_err(|_| "must be an IP address and a port, such as 127.0.0.1:7070 or 0.0.0.0:7070".to_owned())
}

/// Where a value came from.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Origin {
    /// Built in.
    Default,
    /// The configuration file.
    File,
    /// An environment variable.
    Environment,
    /// A flag.
    Flag,
}

impl Display for Origin {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Default => "default",
            Self::File => "configuration file",
            Self::Environment => "environment",
            Self::Flag => "flag",
        })
    }
}

/// The settings in effect.
#[derive(Clone, Debug)]
pub struct Effective {
    /// The values.
    pub config: Config,
    /// Where each came from, by key.
    pub origins: Vec<(&'static str, Origin)>,
}

impl Settings {
    /// Reads a TOML file.
    ///
    /// # Errors
    ///
    /// [`ConfigError::Read`]; [`ConfigError::Parse`] for what is no TOML, an unknown key or a value of another type.
    pub fn read(path: &Path) -> Result<Self, ConfigError> {
        let text = fs::read_to_string(path).map_err(|source| ConfigError::Read { path: path.to_owned(), source })?;
        let problem = |error: toml::de::Error| ConfigError::Parse {
            path: path.to_owned(),
            problem: error.to_string().trim_end().to_owned(),
        };
        toml::from_str(&text).map_err(problem)
    }
}

impl Effective {
    /// Merges `given` (flags and environment; `matches` knows which) over `file` over the defaults.
    ///
    /// # Errors
    ///
    /// [`ConfigError::Value`] for a value out of range.
    pub fn merge(given: Settings, matches: Option<&ArgMatches>, file: Settings) -> Result<Self, ConfigError> {
        let default = Config::default();
        let mut merge = Merge { matches, origins: Vec::new() };
        let interval = (given.checkpoint_interval_s, file.checkpoint_interval_s);
        let drain = (given.drain_deadline_s, file.drain_deadline_s);
        let threads = (given.compute_threads, file.compute_threads);
        let config = Config {
            data_dir: merge.pick("data_dir", given.data_dir, file.data_dir, default.data_dir),
            listen: merge.pick("listen", given.listen, file.listen, default.listen),
            workers: merge.count("workers", given.workers, file.workers, default.workers, WORKERS)?,
            compute_threads: merge.count(
                "compute_threads",
                threads.0,
                threads.1,
                default.compute_threads,
                COMPUTE_THREADS,
            )?,
            lease: merge.seconds("lease_s", given.lease_s, file.lease_s, default.lease, LEASE_S)?,
            checkpoint_interval: merge.seconds(
                "checkpoint_interval_s",
                interval.0,
                interval.1,
                default.checkpoint_interval,
                CHECKPOINT_INTERVAL_S,
            )?,
            queue_limit: merge.count(
                "queue_limit",
                given.queue_limit,
                file.queue_limit,
                default.queue_limit,
                QUEUE_LIMIT,
            )?,
            drain_deadline: merge.seconds(
                "drain_deadline_s",
                drain.0,
                drain.1,
                default.drain_deadline,
                DRAIN_DEADLINE_S,
            )?,
            log_format: merge.pick("log_format", given.log_format, file.log_format, default.log_format),
            log_level: merge.pick("log_level", given.log_level, file.log_level, default.log_level),
        };
        Ok(Self { config, origins: merge.origins })
    }
}

struct Merge<'a> {
    matches: Option<&'a ArgMatches>,
    origins: Vec<(&'static str, Origin)>,
}

impl Merge<'_> {
    fn pick<T>(&mut self, key: &'static str, given: Option<T>, file: Option<T>, default: T) -> T {
        let environment = self.matches.and_then(|it| it.value_source(key)) == Some(ValueSource::EnvVariable);
        let (value, origin) = match (given, file) {
            (Some(value), _) if environment => (value, Origin::Environment),
            (Some(value), _) => (value, Origin::Flag),
            (None, Some(value)) => (value, Origin::File),
            (None, None) => (default, Origin::Default),
        };
        self.origins.push((key, origin));
        value
    }

    fn count<T: PartialOrd + Display>(
        &mut self,
        key: &'static str,
        given: Option<T>,
        file: Option<T>,
        default: T,
        allowed: RangeInclusive<T>,
    ) -> Result<T, ConfigError> {
        let value = self.pick(key, given, file, default);
        if allowed.contains(&value) {
            return Ok(value);
        }
        let allowed = format!("{} to {}", allowed.start(), allowed.end());
        Err(ConfigError::Value { key, value: value.to_string(), allowed })
    }

    fn seconds(
        &mut self,
        key: &'static str,
        given: Option<f64>,
        file: Option<f64>,
        default: Duration,
        allowed: RangeInclusive<f64>,
    ) -> Result<Duration, ConfigError> {
        self.count(key, given, file, default.as_secs_f64(), allowed).map(Duration::from_secs_f64)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use clap::{Args, Command, FromArgMatches};

    fn parse(arguments: &[&str], file: &str) -> Result<Effective, ConfigError> {
        let matches = Settings::augment_args(Command::new("test")).get_matches_from([&["test"], arguments].concat());
        let given = Settings::from_arg_matches(&matches).unwrap();
        Effective::merge(given, Some(&matches), toml::from_str(file).unwrap())
    }

    #[test]
    fn flags_win_over_the_file_and_the_file_over_defaults() {
        let effective = parse(&["--workers", "2", "--lease-s", "6"], "workers = 3\nqueue_limit = 7\n").unwrap();
        assert_eq!((effective.config.workers, effective.config.queue_limit), (2, 7));
        assert_eq!(effective.config.lease, Duration::from_secs(6));
        let origin = |key| effective.origins.iter().find(|(name, _)| *name == key).unwrap().1;
        assert_eq!(origin("workers"), Origin::Flag);
        assert_eq!(origin("queue_limit"), Origin::File);
        assert_eq!(origin("listen"), Origin::Default);
    }

    #[test]
    fn an_address_needs_a_port() {
        for bad in ["7070", "localhost:7070", "127.0.0.1"] {
            assert!(address(bad).unwrap_err().contains("such as 127.0.0.1:7070"), "{bad}");
        }
        assert_eq!(address("[::1]:0").unwrap().port(), 0);
    }

    #[test]
    fn what_cannot_be_right_is_refused_by_name() {
        for (arguments, message) in [
            (["--workers", "0"], "workers is 0, but must be 1 to 64"),
            (["--lease-s", "NaN"], "lease_s is NaN, but must be 0.1 to 3600"),
            (["--queue-limit", "2000000"], "queue_limit is 2000000, but must be 1 to 1000000"),
        ] {
            assert_eq!(parse(&arguments, "").unwrap_err().to_string(), message);
        }
    }

    #[test]
    fn unknown_keys_are_named() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("lightpath.toml");
        fs::write(&path, "wokers = 2\n").unwrap();
        let message = Settings::read(&path).unwrap_err().to_string();
        assert!(message.contains("unknown field `wokers`"), "{message}");
        assert!(matches!(Settings::read(folder.path()), Err(ConfigError::Read { .. })));
    }

    #[test]
    fn the_defaults_are_the_ones_that_the_help_tells() {
        let effective = parse(&[], "").unwrap();
        assert_eq!(effective.config, Config::default());
        assert!(effective.origins.iter().all(|(_, origin)| *origin == Origin::Default));
    }
}
