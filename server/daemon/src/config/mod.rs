//! Settings of the server. A file overrides the built-in defaults, environment variables override the file, and flags
//! override environment variables.
//!
//! # Layout
//!
//! - this file: declarations of all settings. `setting`: the flag, environment variable and check of each declaration.
//!   `layers`: the settings of each source, merged and printed. `uses`: settings in the types of the server's parts.

mod layers;
mod setting;
mod uses;

pub use layers::{Effective, Origin, Settings};
pub use setting::Allowed;

use serde::{Deserialize, Serialize};
use setting::{Setting, settings};
use std::net::{Ipv4Addr, SocketAddr};
use std::num::NonZeroUsize;
use std::path::PathBuf;

/// Range of a space \[MiB\]: at most 16 TiB. A larger value is probably in the wrong unit.
const SPACE_MIB: Allowed = Allowed::Numbers(0.0, 16_777_216.0);
/// Range of a time limit \[s\]: at most thirty days.
const TIMEOUT_S: Allowed = Allowed::Numbers(0.0, 2_592_000.0);
/// Range of the jobs that run at once. Each job holds its fields in memory, and more jobs only compete for the same
/// cores.
const RUNNING: Allowed = Allowed::Numbers(0.0, 64.0);
/// Range of an age \[days\]: at least an hour, because some jobs refer to an artifact long after they stored it.
const AGE_DAYS: Allowed = Allowed::ZeroOrNumbers(1.0 / 24.0, 36_500.0);
const FILE: Allowed = Allowed::Text("the path of a file");
const SWITCH: Allowed = Allowed::Text("true or false");

// Form of a declaration: description, name and type = default, name of the value in the help, allowed values.
settings! {
    /// Folder of database and artifacts, made where missing
    data_dir: PathBuf = "./lightpath-data".into(), "DIR", Allowed::Text("the path of a folder");
    /// Address and port of gRPC and HTTP; port 0 takes a free one
    listen: SocketAddr = (Ipv4Addr::LOCALHOST, 7070).into(), "ADDRESS:PORT",
        Allowed::Text("an IP address and a port, such as 127.0.0.1:7070 or 0.0.0.0:7070");
    /// PEM file of the server's certificate, with those that lead to its authority; read again when it changes
    tls_cert: Option<PathBuf> = None, "FILE", FILE;
    /// PEM file of the certificate's private key
    tls_key: Option<PathBuf> = None, "FILE", FILE;
    /// PEM file of authorities: whoever connects must show a certificate of one of them
    tls_client_ca: Option<PathBuf> = None, "FILE", FILE;
    /// Ask for a token even on 127.0.0.1; other addresses always do
    require_tokens: bool = false, "BOOL", SWITCH;
    /// Let others connect without TLS and tokens: only where whoever can connect may do everything
    insecure: bool = false, "BOOL", SWITCH;
    /// Calls a second that each token, or each address without one, may make; 0: no limit
    calls_per_s_max: u32 = 2000, "COUNT", Allowed::Numbers(0.0, 1e6);
    /// Memory that requests and answers under way may take, all clients together, in MiB; one address may take three
    /// quarters of it; beyond it, calls are refused; 0: no limit
    under_way_mib_max: f64 = 512.0, "MIB", SPACE_MIB;
    /// Jobs that run at once
    workers: u32 = 1, "COUNT", Allowed::Numbers(1.0, 64.0);
    /// Threads that one job computes on; unless set, one for each core
    compute_threads: usize = std::thread::available_parallelism().map_or(1, NonZeroUsize::get), "COUNT",
        Allowed::Numbers(1.0, 1024.0);
    // A pause of the disk could make a shorter lease expire. A longer lease delays the jobs of a dead worker.
    /// A worker that is silent for this long loses its job to the queue
    lease_s: f64 = 30.0, "SECONDS", Allowed::Numbers(0.1, 3600.0);
    /// How often a running job saves its state
    checkpoint_interval_s: f64 = 10.0, "SECONDS", Allowed::Numbers(0.01, 3600.0);
    // A row of the queue takes about a kilobyte.
    /// Jobs that may wait; more are refused
    queue_limit: u32 = 10_000, "COUNT", Allowed::Numbers(1.0, 1e6);
    /// Jobs of one owner that may wait; 0: as many as all together
    owner_queue_limit: u32 = 0, "COUNT", Allowed::Numbers(0.0, 1e6);
    /// Space that one owner may take, with what that owner's jobs made, in MiB; beyond it, uploads and jobs are refused;
    /// 0: no limit
    owner_stored_mib_max: f64 = 0.0, "MIB", SPACE_MIB;
    /// Jobs of one owner that run at once; 0: no limit
    owner_running_limit: u32 = 0, "COUNT", RUNNING;
    /// Jobs on one display that run at once; 0: no limit
    display_running_limit: u32 = 0, "COUNT", RUNNING;
    /// Longest attempt at finding a hologram; 0: no limit
    optimize_timeout_s: f64 = 0.0, "SECONDS", TIMEOUT_S;
    /// Longest attempt at learning a kernel; 0: no limit
    learn_timeout_s: f64 = 0.0, "SECONDS", TIMEOUT_S;
    /// Longest attempt at simulating a capture; 0: no limit
    simulate_timeout_s: f64 = 0.0, "SECONDS", TIMEOUT_S;
    /// Longest attempt at evaluating a kernel; 0: no limit
    evaluate_timeout_s: f64 = 0.0, "SECONDS", TIMEOUT_S;
    /// Longest attempt at aligning or finalizing a dataset; 0: no limit
    prepare_timeout_s: f64 = 0.0, "SECONDS", TIMEOUT_S;
    /// Longest attempt at reporting on a kernel; 0: no limit
    report_timeout_s: f64 = 0.0, "SECONDS", TIMEOUT_S;
    /// Space on the disk that only accepted work may use, in MiB; below it, new jobs and uploads are refused
    disk_reserve_mib: f64 = 256.0, "MIB", SPACE_MIB;
    /// Space that all artifacts together may take, in MiB; 0: all there is
    stored_mib_max: f64 = 0.0, "MIB", SPACE_MIB;
    /// Days after which an artifact that nothing refers to is removed; 0: never
    collect_artifacts_after_days: f64 = 7.0, "DAYS", AGE_DAYS;
    /// Days after which a job that has ended is removed, with its events; 0: never
    collect_jobs_after_days: f64 = 0.0, "DAYS", AGE_DAYS;
    /// Time that jobs and requests get to end when the server stops
    drain_deadline_s: f64 = 20.0, "SECONDS", Allowed::Numbers(0.0, 3600.0);
    /// Form of the log on stderr; auto: text on a terminal, JSON elsewhere
    log_format: LogFormat = LogFormat::Auto, "FORM", Allowed::Text("auto, text or json");
    /// What is logged: error, warn, info, debug, or by module, lightpath_api=debug,warn
    log_level: String = "info".into(), "FILTER", Allowed::Text("a filter, such as info or lightpath_api=debug,warn");
}

/// Format of the log.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum LogFormat {
    /// Text on a terminal, JSON otherwise.
    Auto,
    /// Text for people.
    Text,
    /// One JSON object a line, for log collectors.
    Json,
}

/// Error in the settings.
#[derive(Debug, thiserror::Error)]
pub enum ConfigError {
    /// The configuration file cannot be read.
    #[error("cannot read the configuration file {}", path.display())]
    Read {
        /// Path of the file.
        path: PathBuf,
        /// Error of the operating system.
        source: std::io::Error,
    },
    /// The configuration file has invalid TOML, an unknown key, or a value of the wrong type.
    #[error("the configuration file {} is wrong: {problem}", path.display())]
    Parse {
        /// Path of the file.
        path: PathBuf,
        /// Description of the error, with line and key.
        problem: String,
    },
    /// One of two settings that belong together is missing.
    #[error("{given} is set, but {missing} is not: TLS needs both")]
    Half {
        /// Name of the setting that is present.
        given: &'static str,
        /// Name of the setting that is missing.
        missing: &'static str,
    },
    /// A value is out of range.
    #[error("{key} is {value}, but must be {allowed} ({origin})")]
    Value {
        /// Name of the setting.
        key: &'static str,
        /// The value.
        value: f64,
        /// Allowed values.
        allowed: Allowed,
        /// Source of the value.
        origin: Origin,
    },
}
