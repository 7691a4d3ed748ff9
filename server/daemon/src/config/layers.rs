//! Merging the layers, remembering where each value came from.

use super::{
    CALLS_PER_S, CHECKPOINT_INTERVAL_S, COLLECT_AFTER_DAYS, COMPUTE_THREADS, Config, ConfigError, DRAIN_DEADLINE_S,
    LEASE_S, LogFormat, MIB_MAX, OWNER_QUEUE_LIMIT, QUEUE_LIMIT, RUNNING_LIMIT, TIMEOUT_S, WORKERS,
};
use crate::upkeep::Retention;
use clap::ArgMatches;
use clap::parser::ValueSource;
use lightpath_api::tls::TlsFiles;
use lightpath_artifacts::SpaceLimits;
use lightpath_store::ClaimLimits;
use lightpath_worker::Timeouts;
use std::fmt::{self, Display};
use std::fs;
use std::net::SocketAddr;
use std::ops::RangeInclusive;
use std::path::{Path, PathBuf};
use std::time::Duration;

const DAY_S: f64 = 24.0 * 3600.0;

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
    /// PEM file of the server's certificate, with those that lead to its authority; read again when it changes
    #[arg(long, env = "LIGHTPATH_TLS_CERT", value_name = "FILE")]
    pub tls_cert: Option<PathBuf>,
    /// PEM file of the certificate's private key
    #[arg(long, env = "LIGHTPATH_TLS_KEY", value_name = "FILE")]
    pub tls_key: Option<PathBuf>,
    /// PEM file of authorities: whoever connects must show a certificate of one of them
    #[arg(long, env = "LIGHTPATH_TLS_CLIENT_CA", value_name = "FILE")]
    pub tls_client_ca: Option<PathBuf>,
    /// Ask for a token even on 127.0.0.1; other addresses always do [default: false]
    #[arg(long, env = "LIGHTPATH_REQUIRE_TOKENS", value_name = "BOOL", num_args = 0..=1, default_missing_value = "true")]
    pub require_tokens: Option<bool>,
    /// Let others connect without TLS and tokens: only where whoever can connect may do everything [default: false]
    #[arg(long, env = "LIGHTPATH_INSECURE", value_name = "BOOL", num_args = 0..=1, default_missing_value = "true")]
    pub insecure: Option<bool>,
    /// Calls a second that each token, or each address without one, may make; 0: no limit [default: 2000]
    #[arg(long, env = "LIGHTPATH_CALLS_PER_S_MAX", value_name = "COUNT")]
    pub calls_per_s_max: Option<u32>,
    /// Memory that requests and answers under way may take, all clients together, in MiB; one address may take three
    /// quarters of it; beyond it, calls are refused; 0: no limit [default: 512]
    #[arg(long, env = "LIGHTPATH_UNDER_WAY_MIB_MAX", value_name = "MIB")]
    pub under_way_mib_max: Option<u64>,
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
    /// Jobs of one owner that may wait; 0: as many as all together [default: 0]
    #[arg(long, env = "LIGHTPATH_OWNER_QUEUE_LIMIT", value_name = "COUNT")]
    pub owner_queue_limit: Option<u32>,
    /// Space that one owner may take, with what that owner's jobs made, in MiB; beyond it, uploads and jobs are refused; 0:
    /// no limit [default: 0]
    #[arg(long, env = "LIGHTPATH_OWNER_STORED_MIB_MAX", value_name = "MIB")]
    pub owner_stored_mib_max: Option<u64>,
    /// Jobs of one owner that run at once; 0: no limit [default: 0]
    #[arg(long, env = "LIGHTPATH_OWNER_RUNNING_LIMIT", value_name = "COUNT")]
    pub owner_running_limit: Option<u32>,
    /// Jobs on one display that run at once; 0: no limit [default: 0]
    #[arg(long, env = "LIGHTPATH_DISPLAY_RUNNING_LIMIT", value_name = "COUNT")]
    pub display_running_limit: Option<u32>,
    /// Longest attempt at finding a hologram; 0: no limit [default: 0]
    #[arg(long, env = "LIGHTPATH_OPTIMIZE_TIMEOUT_S", value_name = "SECONDS")]
    pub optimize_timeout_s: Option<f64>,
    /// Longest attempt at learning a kernel; 0: no limit [default: 0]
    #[arg(long, env = "LIGHTPATH_LEARN_TIMEOUT_S", value_name = "SECONDS")]
    pub learn_timeout_s: Option<f64>,
    /// Longest attempt at simulating a capture; 0: no limit [default: 0]
    #[arg(long, env = "LIGHTPATH_SIMULATE_TIMEOUT_S", value_name = "SECONDS")]
    pub simulate_timeout_s: Option<f64>,
    /// Longest attempt at evaluating a kernel; 0: no limit [default: 0]
    #[arg(long, env = "LIGHTPATH_EVALUATE_TIMEOUT_S", value_name = "SECONDS")]
    pub evaluate_timeout_s: Option<f64>,
    /// Space on the disk that only accepted work may use, in MiB; below it, new jobs and uploads are refused [default: 256]
    #[arg(long, env = "LIGHTPATH_DISK_RESERVE_MIB", value_name = "MIB")]
    pub disk_reserve_mib: Option<u64>,
    /// Space that all artifacts together may take, in MiB; 0: all there is [default: 0]
    #[arg(long, env = "LIGHTPATH_STORED_MIB_MAX", value_name = "MIB")]
    pub stored_mib_max: Option<u64>,
    /// Days after which an artifact that nothing refers to is removed; 0: never [default: 7]
    #[arg(long, env = "LIGHTPATH_COLLECT_ARTIFACTS_AFTER_DAYS", value_name = "DAYS")]
    pub collect_artifacts_after_days: Option<f64>,
    /// Days after which a job that has ended is removed, with its events; 0: never [default: 0]
    #[arg(long, env = "LIGHTPATH_COLLECT_JOBS_AFTER_DAYS", value_name = "DAYS")]
    pub collect_jobs_after_days: Option<f64>,
    /// Time that jobs and requests get to end when the server stops [default: 20]
    #[arg(long, env = "LIGHTPATH_DRAIN_DEADLINE_S", value_name = "SECONDS")]
    pub drain_deadline_s: Option<f64>,
    /// Form of the log on stderr; auto: text on a terminal, JSON elsewhere [default: auto]
    #[arg(long, env = "LIGHTPATH_LOG_FORMAT", value_name = "FORM", value_enum)]
    pub log_format: Option<LogFormat>,
    /// What is logged: error, warn, info, debug, or by module, lightpath_api=debug,warn [default: info]
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
            data_dir: merge.pick("data_dir", given.data_dir.clone(), file.data_dir.clone(), default.data_dir),
            listen: merge.pick("listen", given.listen, file.listen, default.listen),
            tls: merge.tls(&given, &file)?,
            require_tokens: merge.pick(
                "require_tokens",
                given.require_tokens,
                file.require_tokens,
                default.require_tokens,
            ),
            insecure: merge.pick("insecure", given.insecure, file.insecure, default.insecure),
            calls_per_s_max: merge.count(
                "calls_per_s_max",
                given.calls_per_s_max,
                file.calls_per_s_max,
                default.calls_per_s_max,
                CALLS_PER_S,
            )?,
            under_way_bytes_max: merge.mib(
                "under_way_mib_max",
                given.under_way_mib_max,
                file.under_way_mib_max,
                default.under_way_bytes_max,
            )?,
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
            owner_queue_limit: merge.count(
                "owner_queue_limit",
                given.owner_queue_limit,
                file.owner_queue_limit,
                default.owner_queue_limit,
                OWNER_QUEUE_LIMIT,
            )?,
            owner_stored_bytes_max: merge.mib(
                "owner_stored_mib_max",
                given.owner_stored_mib_max,
                file.owner_stored_mib_max,
                default.owner_stored_bytes_max,
            )?,
            running: ClaimLimits {
                per_owner: merge.count(
                    "owner_running_limit",
                    given.owner_running_limit,
                    file.owner_running_limit,
                    default.running.per_owner,
                    RUNNING_LIMIT,
                )?,
                per_display: merge.count(
                    "display_running_limit",
                    given.display_running_limit,
                    file.display_running_limit,
                    default.running.per_display,
                    RUNNING_LIMIT,
                )?,
            },
            timeouts: Timeouts {
                optimize: merge.timeout("optimize_timeout_s", given.optimize_timeout_s, file.optimize_timeout_s)?,
                learn: merge.timeout("learn_timeout_s", given.learn_timeout_s, file.learn_timeout_s)?,
                simulate: merge.timeout("simulate_timeout_s", given.simulate_timeout_s, file.simulate_timeout_s)?,
                evaluate: merge.timeout("evaluate_timeout_s", given.evaluate_timeout_s, file.evaluate_timeout_s)?,
            },
            space: SpaceLimits {
                reserve_bytes: merge.mib(
                    "disk_reserve_mib",
                    given.disk_reserve_mib,
                    file.disk_reserve_mib,
                    default.space.reserve_bytes,
                )?,
                stored_bytes_max: merge.mib(
                    "stored_mib_max",
                    given.stored_mib_max,
                    file.stored_mib_max,
                    default.space.stored_bytes_max,
                )?,
            },
            retention: Retention {
                artifacts: merge.days(
                    "collect_artifacts_after_days",
                    given.collect_artifacts_after_days,
                    file.collect_artifacts_after_days,
                    default.retention.artifacts,
                )?,
                jobs: merge.days(
                    "collect_jobs_after_days",
                    given.collect_jobs_after_days,
                    file.collect_jobs_after_days,
                    default.retention.jobs,
                )?,
            },
            drain_deadline: merge.seconds(
                "drain_deadline_s",
                drain.0,
                drain.1,
                default.drain_deadline,
                DRAIN_DEADLINE_S,
            )?,
            log_format: merge.pick("log_format", given.log_format, file.log_format, default.log_format),
            log_level: merge.pick("log_level", given.log_level.clone(), file.log_level.clone(), default.log_level),
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

    fn tls(&mut self, given: &Settings, file: &Settings) -> Result<Option<TlsFiles>, ConfigError> {
        let mut path = |key, given: &Option<PathBuf>, file: &Option<PathBuf>| {
            self.pick(key, given.clone().map(Some), file.clone().map(Some), None)
        };
        let certificate = path("tls_cert", &given.tls_cert, &file.tls_cert);
        let key = path("tls_key", &given.tls_key, &file.tls_key);
        let client_authority = path("tls_client_ca", &given.tls_client_ca, &file.tls_client_ca);
        match (certificate, key) {
            (Some(certificate), Some(key)) => Ok(Some(TlsFiles { certificate, key, client_authority })),
            (Some(_), None) => Err(ConfigError::Half { given: "tls_cert", missing: "tls_key" }),
            (None, Some(_)) => Err(ConfigError::Half { given: "tls_key", missing: "tls_cert" }),
            (None, None) if client_authority.is_some() => {
                Err(ConfigError::Half { given: "tls_client_ca", missing: "tls_cert" })
            }
            (None, None) => Ok(None),
        }
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

    fn mib(
        &mut self,
        key: &'static str,
        given: Option<u64>,
        file: Option<u64>,
        default: u64,
    ) -> Result<u64, ConfigError> {
        Ok(self.count(key, given, file, default >> 20, MIB_MAX)? << 20)
    }

    /// `None` for 0: no limit.
    fn timeout(
        &mut self,
        key: &'static str,
        given: Option<f64>,
        file: Option<f64>,
    ) -> Result<Option<Duration>, ConfigError> {
        let timeout = self.seconds(key, given, file, Duration::ZERO, TIMEOUT_S)?;
        Ok((!timeout.is_zero()).then_some(timeout))
    }

    /// `None` for 0: never.
    fn days(
        &mut self,
        key: &'static str,
        given: Option<f64>,
        file: Option<f64>,
        default: Option<Duration>,
    ) -> Result<Option<Duration>, ConfigError> {
        let days = self.pick(key, given, file, default.map_or(0.0, |age| age.as_secs_f64() / DAY_S));
        if days == 0.0 {
            return Ok(None);
        }
        if COLLECT_AFTER_DAYS.contains(&days) {
            return Ok(Some(Duration::from_secs_f64(days * DAY_S)));
        }
        let allowed = format!("0, or {:.3} to {}", COLLECT_AFTER_DAYS.start(), COLLECT_AFTER_DAYS.end());
        Err(ConfigError::Value { key, value: days.to_string(), allowed })
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
