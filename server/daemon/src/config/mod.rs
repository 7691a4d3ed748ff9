//! Settings of the server. A file overrides the built-in defaults, environment variables override the file, and flags
//! override environment variables.
//!
//! # Layout
//!
//! - this file: declarations of all settings. `setting`: the flag, environment variable and check of each declaration.
//!   `secret_text`: values that are never printed. `machine_memory`: the default of the memory for jobs. `layers`: the
//!   settings of each source, merged and printed. `conversions`: settings as the types that the parts of the server use.

mod conversions;
mod layers;
mod machine_memory;
mod secret_text;
mod setting;

pub(crate) use conversions::days;
pub use layers::{BucketFlags, Effective, Origin, ServeFlags, Settings, WorkerFlags};
pub use secret_text::SecretText;
pub use setting::Allowed;

use lightpath_domain::ability::LabelError;
use lightpath_domain::origin::OriginError;
use lightpath_gpu::DeviceChoice;
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
    /// Folder of the database and the artifacts; created if it does not exist
    data_dir: PathBuf = "./lightpath-data".into(), "DIR", Allowed::Text("the path of a folder");
    /// URL of a PostgreSQL database for queue and registry; without one they are in a file in data_dir
    database_url: Option<SecretText> = None, "URL", Allowed::Text("a URL such as postgres://lightpath@db.example/lightpath");
    /// Bucket of an S3 store for artifacts and saved states, so that servers with one database share them; data_dir then
    /// keeps copies of those used last; needs database_url
    artifacts_url: Option<String> = None, "S3_URL", Allowed::Text("a URL such as s3://bucket or s3://bucket/prefix");
    /// Address of the S3 store, unless it is Amazon's
    artifacts_endpoint: Option<String> = None, "URL", Allowed::Text("a URL such as https://s3.example.org");
    /// Region of the bucket; stores other than Amazon's often have none, and take any name
    artifacts_region: String = "us-east-1".into(), "REGION", Allowed::Text("a name such as eu-central-1");
    /// Name of the key that signs requests to the S3 store
    artifacts_access_key_id: Option<String> = None, "ID", Allowed::Text("the name of a key");
    /// The key that signs requests to the S3 store; other users see the arguments of a program, so give it in the
    /// configuration file or in the environment
    artifacts_secret_access_key: Option<SecretText> = None, "SECRET", Allowed::Text("a key");
    /// Allow an endpoint without TLS; artifacts then pass the network unencrypted
    artifacts_allow_http: bool = false, "BOOL", SWITCH;
    /// Limit on the copies of artifacts and saved states that data_dir keeps when they are in a bucket, in MiB
    artifacts_cache_mib_max: f64 = 16_384.0, "MIB", SPACE_MIB;
    /// Address and port for gRPC and HTTP; port 0 chooses a free port
    listen: SocketAddr = (Ipv4Addr::LOCALHOST, 7070).into(), "ADDRESS:PORT",
        Allowed::Text("an IP address and a port, such as 127.0.0.1:7070 or 0.0.0.0:7070");
    /// PEM file of the server's certificate, followed by its intermediate certificates; read again when it changes
    tls_cert: Option<PathBuf> = None, "FILE", FILE;
    /// PEM file of the certificate's private key
    tls_key: Option<PathBuf> = None, "FILE", FILE;
    /// PEM file of certificate authorities; every client must show a certificate from one of them
    tls_client_ca: Option<PathBuf> = None, "FILE", FILE;
    /// Require tokens on 127.0.0.1, too; other addresses require tokens unless insecure is set
    require_tokens: bool = false, "BOOL", SWITCH;
    /// Let other machines connect without TLS and tokens; then every client may do everything
    insecure: bool = false, "BOOL", SWITCH;
    /// Limit on the calls per second of each token, or of each address without a token; the living servers of one database
    /// share it equally; 0: no limit
    calls_per_s_max: u32 = 2000, "COUNT", Allowed::Numbers(0.0, 1e6);
    /// Limit on the memory of all unfinished requests and answers, in MiB; one address gets at most three quarters of
    /// it; further calls are refused; 0: no limit
    under_way_mib_max: f64 = 512.0, "MIB", SPACE_MIB;
    /// Limit on the memory of the computations for calls, such as decoding a submitted picture or converting a kernel,
    /// in MiB; one client gets at most half of it; further computations wait
    computing_mib_max: f64 = 3072.0, "MIB", Allowed::Numbers(64.0, 1_048_576.0);
    /// Names of the server, besides localhost and its IP addresses, under which it answers without tokens; separated by
    /// commas
    host_names: String = String::new(), "NAMES", Allowed::Text("names separated by commas, such as lab-server,lab-server.example");
    /// Origins of web pages of other sites that may call the server, separated by commas; such a page may do what its
    /// token may, or everything if the server requires no tokens
    cors_origins: String = String::new(), "ORIGINS", Allowed::Text("origins separated by commas, such as https://dash.example,http://localhost:8000");
    /// Origins to which webhooks may go, separated by commas; without one there are no webhooks
    webhook_origins: String = String::new(), "ORIGINS", Allowed::Text("origins separated by commas, such as https://hooks.example,http://localhost:9000");
    /// Run no jobs in this process; processes of `lightpathd worker` run them
    no_worker: bool = false, "BOOL", SWITCH;
    /// Address and port at which a worker answers /healthz and /metrics; without one it answers nothing
    status_listen: Option<SocketAddr> = None, "ADDRESS:PORT",
        Allowed::Text("an IP address and a port, such as 127.0.0.1:7071");
    /// Name of the workers in the events of jobs; by default the name of the machine where several processes share a
    /// database
    worker_name: Option<String> = None, "NAME", Allowed::Text("a name");
    /// Labels of this process, separated by commas: it runs only jobs whose needs are among these labels, and jobs
    /// without needs
    worker_labels: String = String::new(), "LABELS", Allowed::Text("labels separated by commas, such as gpu,bench-2");
    /// What computes holograms: auto (a graphics card where it is faster than the processor), cpu, gpu, or gpu:N, the card
    /// with the number N in `lightpathd devices`; a process with a card has the label gpu
    device: DeviceChoice = DeviceChoice::Auto, "DEVICE", Allowed::Text("auto, cpu, gpu, or gpu: and a number, such as gpu:1");
    /// Number of jobs that run at the same time
    workers: u32 = 1, "COUNT", Allowed::Numbers(1.0, 64.0);
    /// Number of threads of one job; by default one for each core
    compute_threads: usize = std::thread::available_parallelism().map_or(1, NonZeroUsize::get), "COUNT",
        Allowed::Numbers(1.0, 1024.0);
    // A pause of the disk could make a shorter lease expire. A longer lease delays the jobs of a dead worker.
    /// Time without a heartbeat after which a worker loses its job and the job returns to the queue
    lease_s: f64 = 30.0, "SECONDS", Allowed::Numbers(0.1, 3600.0);
    /// Time between two saved states of a running job
    checkpoint_interval_s: f64 = 10.0, "SECONDS", Allowed::Numbers(0.01, 3600.0);
    // A row of the queue takes about a kilobyte.
    /// Limit on the waiting jobs; further jobs are refused
    queue_limit: u32 = 10_000, "COUNT", Allowed::Numbers(1.0, 1e6);
    /// Limit on the waiting jobs of one owner; 0: only queue_limit applies
    owner_queue_limit: u32 = 0, "COUNT", Allowed::Numbers(0.0, 1e6);
    /// Limit on the space of one owner, including the results of the owner's jobs, in MiB; further uploads and jobs are
    /// refused; 0: no limit
    owner_stored_mib_max: f64 = 0.0, "MIB", SPACE_MIB;
    /// Limit on the jobs of one owner that run at the same time; 0: no limit
    owner_running_limit: u32 = 0, "COUNT", RUNNING;
    /// Limit on the jobs on one display that run at the same time; 0: no limit
    display_running_limit: u32 = 0, "COUNT", RUNNING;
    /// Time limit of one attempt to optimize a hologram; 0: no limit
    optimize_timeout_s: f64 = 0.0, "SECONDS", TIMEOUT_S;
    /// Time limit of one attempt to learn a kernel; 0: no limit
    learn_timeout_s: f64 = 0.0, "SECONDS", TIMEOUT_S;
    /// Time limit of one attempt to simulate a capture; 0: no limit
    simulate_timeout_s: f64 = 0.0, "SECONDS", TIMEOUT_S;
    /// Time limit of one attempt to evaluate a kernel; 0: no limit
    evaluate_timeout_s: f64 = 0.0, "SECONDS", TIMEOUT_S;
    /// Time limit of one attempt to align or finalize a dataset; 0: no limit
    prepare_timeout_s: f64 = 0.0, "SECONDS", TIMEOUT_S;
    /// Time limit of one attempt to report on a kernel; 0: no limit
    report_timeout_s: f64 = 0.0, "SECONDS", TIMEOUT_S;
    /// Time limit of one attempt to suggest holograms; 0: no limit
    suggest_timeout_s: f64 = 0.0, "SECONDS", TIMEOUT_S;
    /// Time limit of one attempt to verify holograms; 0: no limit
    verify_timeout_s: f64 = 0.0, "SECONDS", TIMEOUT_S;
    // The rest is for the server itself: unfinished requests (under_way_mib_max), the checks of uploaded pictures (up
    // to 1 GiB each for large ones), the database, and the system.
    /// Limit on the estimated memory of all running jobs together, in MiB; a job that needs more is refused, unless another
    /// living process of the same database gives it more; by default
    /// three quarters of the machine's memory or of the limit of its control group, and at least 1 GiB less than all of
    /// it
    job_memory_mib_max: f64 = machine_memory::for_jobs_mib(), "MIB", Allowed::Numbers(64.0, 16_777_216.0);
    /// Limit on the estimated time of one attempt at a job; a job that needs longer is refused
    job_time_s_max: f64 = 86_400.0, "SECONDS", Allowed::Numbers(1.0, 31_536_000.0);
    /// Free disk space that is reserved for accepted work, in MiB; below it, new jobs and uploads are refused
    disk_reserve_mib: f64 = 256.0, "MIB", SPACE_MIB;
    /// Limit on the size of all artifacts together, in MiB; 0: no limit
    stored_mib_max: f64 = 0.0, "MIB", SPACE_MIB;
    /// Days since its last use after which an artifact without references is removed; 0: never
    collect_artifacts_after_days: f64 = 7.0, "DAYS", AGE_DAYS;
    /// Days since its end after which a job is removed, with its events; 0: never
    collect_jobs_after_days: f64 = 0.0, "DAYS", AGE_DAYS;
    /// Days for which a signed manifest of a kernel is valid; afterwards devices refuse it and need a newer one
    manifest_days: f64 = 7.0, "DAYS", Allowed::Numbers(0.01, 366.0);
    /// Mean time after which a device asks again for a manifest
    poll_interval_s: f64 = 60.0, "SECONDS", Allowed::Numbers(1.0, 86_400.0);
    /// Time limit for jobs and requests to end when the server stops
    drain_deadline_s: f64 = 20.0, "SECONDS", Allowed::Numbers(0.0, 3600.0);
    /// Format of the log on stderr; auto: text on a terminal, JSON otherwise
    log_format: LogFormat = LogFormat::Auto, "FORM", Allowed::Text("auto, text or json");
    /// Lowest level that is logged: error, warn, info or debug; also by module, such as lightpath_api=debug,warn
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

/// Error in the settings; the messages say what each means.
#[derive(Debug, thiserror::Error)]
#[allow(missing_docs)]
pub enum ConfigError {
    #[error("cannot read the configuration file {}", path.display())]
    Read { path: PathBuf, source: std::io::Error },
    /// The configuration file has invalid TOML, an unknown key, or a value of the wrong type.
    #[error("the configuration file {} is invalid: {problem}", path.display())]
    Parse { path: PathBuf, problem: String },
    #[error("{given} is set, but {missing} is not: {reason}")]
    Incomplete { given: &'static str, missing: &'static str, reason: &'static str },
    #[error("artifacts_url is {url:?}, but must be a URL such as s3://bucket or s3://bucket/prefix")]
    ArtifactsUrl { url: String },
    #[error(
        "artifacts_endpoint is {url:?}, but must begin with https://, or with http:// if artifacts_allow_http is true"
    )]
    ArtifactsEndpoint { url: String },
    #[error("cors_origins {0}")]
    Origins(OriginError),
    #[error("webhook_origins {0}")]
    WebhookOrigins(OriginError),
    #[error("worker_labels {0}")]
    Labels(LabelError),
    #[error("database_url must be a URL such as postgres://lightpath@db.example/lightpath")]
    DatabaseUrl,
    #[error(
        "{what} needs {missing}: processes that work together share a PostgreSQL database and a bucket; see \"Run several \
         processes\" in the operating guide"
    )]
    NotShared { what: &'static str, missing: &'static str },
    #[error("{key} is {value}, but must be {allowed} ({origin})")]
    Value { key: &'static str, value: f64, allowed: Allowed, origin: Origin },
}
