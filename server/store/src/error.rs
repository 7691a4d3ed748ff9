//! Errors of the store.

use lightpath_domain::reason::PreconditionReason;
use serde::de::Error as _;
use std::fmt::Display;

lightpath_domain::reasons! {
    /// What changed during a request, as a code for programs.
    pub enum AbortReason {
        /// Another version of the kernel was made active.
        ActiveVersionChanged = "ACTIVE_VERSION_CHANGED",
        /// The alias of the kernel was made to name another version.
        AliasChanged = "ALIAS_CHANGED",
        /// The rollout changed.
        RolloutChanged = "ROLLOUT_CHANGED",
        /// The pairs or the alignment of the dataset changed.
        DatasetChanged = "DATASET_CHANGED",
        /// The display changed.
        DisplayChanged = "DISPLAY_CHANGED",
        /// The webhook changed.
        WebhookChanged = "WEBHOOK_CHANGED",
        /// Another keyring was added.
        KeyringChanged = "KEYRING_CHANGED",
    }
}

/// A result with a [`StoreError`], if it names no other error.
pub type Result<T, E = StoreError> = std::result::Result<T, E>;

/// Why the store refused a request or failed; the messages say what most mean. All variants except the last ones are
/// caused by the request. `resource` is a name such as `displays/lab-2`, `reason` a code for programs, and `message` a
/// text for people.
#[derive(Debug, thiserror::Error)]
#[allow(missing_docs)]
pub enum StoreError {
    #[error("{resource} does not exist")]
    NotFound { resource: String },
    /// A resource with this name and other content exists. `detail` is the difference, such as `with other properties`.
    #[error("{resource} already exists {detail}")]
    AlreadyExists { resource: String, detail: String },
    /// The present state does not allow the request.
    #[error("{message}")]
    Precondition { reason: PreconditionReason, message: String },
    /// A record changed during the request. The caller must read it again and retry.
    #[error("{message}")]
    Aborted { reason: AbortReason, message: String },
    /// The worker no longer holds the job: the lease expired, the job ended, or another worker has it.
    #[error("the lease on the job is lost")]
    LeaseLost,
    #[error("the queue is full: {limit} jobs wait already; submit again when some have run")]
    QueueFull { limit: u32 },
    #[error("{limit} of your jobs wait already, which is the limit of each owner; submit again when some have run")]
    OwnerQueueFull { limit: u32 },
    #[error("the queued jobs wait for {limit} other jobs in all, which is the limit; submit again when some have run")]
    DependenciesFull { limit: u32 },
    #[error(
        "you and your jobs have stored {} MiB, and the limit is {} MiB; retry when some of it has been removed",
        stored_bytes >> 20,
        stored_bytes_max >> 20
    )]
    OwnerBytes { stored_bytes: u64, stored_bytes_max: u64 },
    #[error("no space is left on the disk of the database")]
    DiskFull,
    #[error("the database is too busy to answer in time; retry later")]
    Busy,
    /// The write did not happen because the process is stopping.
    #[error("the server is stopping")]
    Stopping,
    /// The linked version of SQLite has known bugs.
    #[error("SQLite {found} is too old, but must be at least {required}")]
    SqliteTooOld { found: String, required: &'static str },
    #[error(
        "the URL of the database does not say whether the connection to {host} is encrypted: add ?sslmode=verify-full (with \
         &sslrootcert=FILE for an authority of your own), or ?sslmode=disable where nobody else is on the network"
    )]
    OpenConnection { host: String },
    #[error("the stored value of {column} cannot be parsed")]
    Corrupt { column: &'static str, source: serde_json::Error },
    /// `step` is the first migration that this version does not know.
    #[error("the database was written by a newer version of this program (step {step}); use that version")]
    NewerDatabase { step: i64 },
    #[error("the database has the tables of an older version; start the server of this version once to migrate them")]
    OlderDatabase,
    #[error(
        "the database is the target of a move that has not ended: repeat the same `lightpathd migrate` to continue it"
    )]
    Unfinished,
    /// PostgreSQL cannot store a text with the character NUL.
    #[error("a text contains the character NUL (U+0000), which the database cannot store")]
    Nul,
    #[error("the database is empty; check database_url, or start the server once")]
    EmptyDatabase,
    #[error(
        "the database was not closed, and its log cannot be read in a folder without write access; copy the folder to a \
         disk that can be written"
    )]
    LogUnreadable,
    #[error("the database cannot be migrated")]
    Migration(#[source] sqlx::migrate::MigrateError),
    /// The database's server cannot be reached, or it is stopping or starting.
    #[error("the database cannot be reached")]
    Unreachable(#[source] sqlx::Error),
    /// Any other error of the database.
    #[error("the database failed")]
    Database(#[source] sqlx::Error),
}

impl StoreError {
    pub(super) fn not_found(resource: impl Into<String>) -> Self {
        Self::NotFound { resource: resource.into() }
    }

    pub(super) fn exists(resource: impl Into<String>, detail: impl Into<String>) -> Self {
        Self::AlreadyExists { resource: resource.into(), detail: detail.into() }
    }

    pub(super) fn precondition(reason: PreconditionReason, message: impl Into<String>) -> Self {
        Self::Precondition { reason, message: message.into() }
    }

    pub(super) fn corrupt(column: &'static str, problem: impl Display) -> Self {
        Self::Corrupt { column, source: serde_json::Error::custom(problem) }
    }

    /// Whether the same call may succeed later, if necessary after an operator has made room on the disk.
    #[must_use]
    pub fn is_transient(&self) -> bool {
        match self {
            Self::DiskFull
            | Self::Database(_)
            | Self::Unreachable(_)
            | Self::Busy
            | Self::Stopping
            | Self::QueueFull { .. }
            | Self::OwnerQueueFull { .. }
            | Self::DependenciesFull { .. }
            | Self::OwnerBytes { .. } => true,
            Self::NotFound { .. }
            | Self::AlreadyExists { .. }
            | Self::Precondition { .. }
            | Self::Aborted { .. }
            | Self::LeaseLost
            | Self::SqliteTooOld { .. }
            | Self::Corrupt { .. }
            | Self::NewerDatabase { .. }
            | Self::OlderDatabase
            | Self::OpenConnection { .. }
            | Self::EmptyDatabase
            | Self::Unfinished
            | Self::Nul
            | Self::LogUnreadable
            | Self::Migration(_) => false,
        }
    }
}

impl From<sqlx::Error> for StoreError {
    fn from(error: sqlx::Error) -> Self {
        /// Codes of a full disk: `SQLITE_FULL`, `SQLITE_IOERR_SHMSIZE` (no room for the index of the log), and
        /// PostgreSQL's `disk_full`.
        const FULL: [&str; 3] = ["13", "4874", "53100"];
        /// PostgreSQL's codes of a text with the character NUL, and of JSON with it.
        const NUL: [&str; 2] = ["22021", "22P05"];
        /// PostgreSQL's codes of a server that stops or starts or has ended a transaction that did nothing for too long,
        /// and the class of broken connections.
        const AWAY: [&str; 5] = ["57P01", "57P02", "57P03", "25P03", "08"];
        match error.as_database_error().and_then(|e| e.code()) {
            Some(code) if FULL.contains(&&*code) => Self::DiskFull,
            Some(code) if NUL.contains(&&*code) => Self::Nul,
            Some(code) if AWAY.iter().any(|away| code.starts_with(away) && code.len() == 5) => Self::Unreachable(error),
            _ if matches!(error, sqlx::Error::Io(_) | sqlx::Error::Tls(_)) => Self::Unreachable(error),
            _ if matches!(error, sqlx::Error::PoolTimedOut) => Self::Busy,
            _ => Self::Database(error),
        }
    }
}
