//! Settings of the server: built-in defaults, overridden by a file, overridden by the environment, overridden by flags.

mod layers;
mod print;

pub use layers::{Effective, Origin, Settings};

use crate::upkeep::Retention;
use lightpath_api::tls::TlsFiles;
use lightpath_artifacts::SpaceLimits;
use lightpath_store::ClaimLimits;
use lightpath_worker::Timeouts;
use std::net::{Ipv4Addr, SocketAddr};
use std::num::NonZeroUsize;
use std::ops::RangeInclusive;
use std::path::PathBuf;
use std::time::Duration;

/// Everything that can be set.
#[derive(Clone, Debug, PartialEq)]
pub struct Config {
    /// Folder of database and artifacts; made where missing.
    pub data_dir: PathBuf,
    /// Address and port of gRPC and HTTP.
    pub listen: SocketAddr,
    /// Certificates; `None`: no TLS.
    pub tls: Option<TlsFiles>,
    /// Whether calls need a token even from this machine. From others they always do.
    pub require_tokens: bool,
    /// Others may connect without TLS and tokens.
    pub insecure: bool,
    /// Calls a second that each token, or each address without one, may make; 0: no limit.
    pub calls_per_s_max: u32,
    /// Bytes that requests and answers under way may hold, all clients together; one address, three quarters of it. 0:
    /// no limit.
    pub under_way_bytes_max: u64,
    /// Jobs that run at once.
    pub workers: u32,
    /// Threads that one job computes on.
    pub compute_threads: usize,
    /// A worker that is silent for this long has lost its job to the queue; it tells three times as often that it lives.
    pub lease: Duration,
    /// How often a running job saves its state.
    pub checkpoint_interval: Duration,
    /// Jobs that may wait; more are refused.
    pub queue_limit: u32,
    /// Jobs of one owner that may wait; 0: as many as all together.
    pub owner_queue_limit: u32,
    /// Bytes that one owner may have stored, with what jobs of that owner made; 0: no limit.
    pub owner_stored_bytes_max: u64,
    /// How many jobs of an owner or a display run at once.
    pub running: ClaimLimits,
    /// How long an attempt may take.
    pub timeouts: Timeouts,
    /// What new work must leave free on the disk, and all artifacts together may have.
    pub space: SpaceLimits,
    /// What goes by itself, and when.
    pub retention: Retention,
    /// Time that running jobs and open requests get to end when the server stops.
    pub drain_deadline: Duration,
    /// Form of the log on stderr.
    pub log_format: LogFormat,
    /// What is logged, such as `info` or `lightpath_api=debug,warn`.
    pub log_level: String,
}

/// Form of the log.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum, serde::Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum LogFormat {
    /// Text on a terminal, JSON elsewhere.
    Auto,
    /// For people.
    Text,
    /// One JSON object a line, for log collectors.
    Json,
}

impl Default for Config {
    fn default() -> Self {
        Self {
            data_dir: PathBuf::from("./lightpath-data"),
            listen: SocketAddr::from((Ipv4Addr::LOCALHOST, 7070)),
            tls: None,
            require_tokens: false,
            insecure: false,
            calls_per_s_max: 2000,
            under_way_bytes_max: 512 << 20,
            workers: 1,
            compute_threads: std::thread::available_parallelism().map_or(1, NonZeroUsize::get),
            lease: Duration::from_secs(30),
            checkpoint_interval: Duration::from_secs(10),
            queue_limit: 10_000,
            owner_queue_limit: 0,
            owner_stored_bytes_max: 0,
            running: ClaimLimits::default(),
            timeouts: Timeouts::default(),
            space: SpaceLimits { reserve_bytes: 256 << 20, stored_bytes_max: 0 },
            retention: Retention { artifacts: Some(Duration::from_secs(7 * 24 * 3600)), jobs: None },
            drain_deadline: Duration::from_secs(20),
            log_format: LogFormat::Auto,
            log_level: "info".to_owned(),
        }
    }
}

/// Each running job holds its fields in memory; more of them only wait for the same cores.
const WORKERS: RangeInclusive<u32> = 1..=64;
const COMPUTE_THREADS: RangeInclusive<usize> = 1..=1024;
/// Shorter leases are lost to a pause of the disk; longer ones leave a dead worker's job lying.
const LEASE_S: RangeInclusive<f64> = 0.1..=3600.0;
const CHECKPOINT_INTERVAL_S: RangeInclusive<f64> = 0.01..=3600.0;
/// A row of the queue takes about a kilobyte.
const QUEUE_LIMIT: RangeInclusive<u32> = 1..=1_000_000;
const CALLS_PER_S: RangeInclusive<u32> = 0..=1_000_000;
/// 0: no limit.
const RUNNING_LIMIT: RangeInclusive<u32> = 0..=64;
const OWNER_QUEUE_LIMIT: RangeInclusive<u32> = 0..=1_000_000;
const TIMEOUT_S: RangeInclusive<f64> = 0.0..=2_592_000.0;
/// 16 TiB: more is a mistake in the unit.
const MIB_MAX: RangeInclusive<u64> = 0..=1 << 24;
/// Less than an hour is less than some jobs take between storing what they make and naming it.
const COLLECT_AFTER_DAYS: RangeInclusive<f64> = 1.0 / 24.0..=36_500.0;
const DRAIN_DEADLINE_S: RangeInclusive<f64> = 0.0..=3600.0;

/// Why settings cannot be used.
#[derive(Debug, thiserror::Error)]
pub enum ConfigError {
    /// The file cannot be read.
    #[error("cannot read the configuration file {}", path.display())]
    Read {
        /// The file.
        path: PathBuf,
        /// What the system said.
        source: std::io::Error,
    },
    /// The file is not what it must be: wrong TOML, an unknown key, a value of another type.
    #[error("the configuration file {} is wrong: {problem}", path.display())]
    Parse {
        /// The file.
        path: PathBuf,
        /// What is wrong, with the line and the key.
        problem: String,
    },
    /// One half of a pair of settings.
    #[error("{given} is set, but {missing} is not: TLS needs both")]
    Half {
        /// What was set.
        given: &'static str,
        /// What is missing.
        missing: &'static str,
    },
    /// A value is out of range.
    #[error("{key} is {value}, but must be {allowed}")]
    Value {
        /// The setting.
        key: &'static str,
        /// What was given.
        value: String,
        /// What would be right.
        allowed: String,
    },
}
