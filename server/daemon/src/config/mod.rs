//! Settings of the server: built-in defaults, overridden by a file, overridden by the environment, overridden by flags.
//!
//! # Layout
//!
//! - this file: every setting, declared once. `setting`: what a declaration gives: the flag, the environment variable, the
//!   check. `layers`: what each source sets, merged and printed. `uses`: settings in the types of those that use them.

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

/// Largest space \[MiB\], 16 TiB: more is a mistake in the unit.
const SPACE_MIB: Allowed = Allowed::Numbers(0.0, 16_777_216.0);
/// Longest attempt \[s\]: thirty days.
const TIMEOUT_S: Allowed = Allowed::Numbers(0.0, 2_592_000.0);
/// Jobs that run at once: each holds its fields in memory, and more of them only wait for the same cores.
const RUNNING: Allowed = Allowed::Numbers(0.0, 64.0);
/// Less than an hour is less than some jobs take between storing what they make and naming it.
const AGE_DAYS: Allowed = Allowed::ZeroOrNumbers(1.0 / 24.0, 36_500.0);
const FILE: Allowed = Allowed::Text("the path of a file");
const SWITCH: Allowed = Allowed::Text("true or false");

// A declaration: what it means, name and type = default, what the help calls the value, what is allowed.
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
    // Shorter leases are lost to a pause of the disk; longer ones leave a dead worker's job lying.
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

/// Form of the log.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum LogFormat {
    /// Text on a terminal, JSON elsewhere.
    Auto,
    /// For people.
    Text,
    /// One JSON object a line, for log collectors.
    Json,
}

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
    #[error("{key} is {value}, but must be {allowed} ({origin})")]
    Value {
        /// The setting.
        key: &'static str,
        /// What was given.
        value: f64,
        /// What would be right.
        allowed: Allowed,
        /// Where the value came from.
        origin: Origin,
    },
}
