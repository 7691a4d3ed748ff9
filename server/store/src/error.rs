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
        /// Another keyring was added.
        KeyringChanged = "KEYRING_CHANGED",
    }
}

/// A result with a [`StoreError`], if it names no other error.
pub type Result<T, E = StoreError> = std::result::Result<T, E>;

/// Why the store refused a request or failed. All variants except the last ones are caused by the request.
#[derive(Debug, thiserror::Error)]
pub enum StoreError {
    /// The named resource does not exist.
    #[error("{resource} does not exist")]
    NotFound {
        /// Name of the resource, for example `displays/lab-2`.
        resource: String,
    },
    /// A resource with this name and other content exists.
    #[error("{resource} already exists {detail}")]
    AlreadyExists {
        /// Name of the resource, for example `displays/lab-2`.
        resource: String,
        /// The difference, for example `with other properties`.
        detail: String,
    },
    /// The present state does not allow the request.
    #[error("{message}")]
    Precondition {
        /// Code for programs.
        reason: PreconditionReason,
        /// Text for people.
        message: String,
    },
    /// A record changed during the request. The caller must read it again and retry.
    #[error("{message}")]
    Aborted {
        /// Code for programs.
        reason: AbortReason,
        /// Text for people.
        message: String,
    },
    /// The worker no longer holds the job: the lease expired, the job ended, or another worker has it.
    #[error("the lease on the job is lost")]
    LeaseLost,
    /// The queue is full.
    #[error("the queue is full: {limit} jobs wait already; submit again when some have run")]
    QueueFull {
        /// Limit on the waiting jobs.
        limit: u32,
    },
    /// The owner has reached the limit on waiting jobs.
    #[error("{limit} of your jobs wait already, which is the limit of each owner; submit again when some have run")]
    OwnerQueueFull {
        /// Limit on the waiting jobs of one owner.
        limit: u32,
    },
    /// The queued jobs wait for too many other jobs.
    #[error("the queued jobs wait for {limit} other jobs in all, which is the limit; submit again when some have run")]
    DependenciesFull {
        /// Limit on the dependencies of all queued jobs.
        limit: u32,
    },
    /// The owner has reached the limit on stored bytes.
    #[error(
        "you and your jobs have stored {} MiB, and the limit is {} MiB; retry when some of it has been removed",
        stored_bytes >> 20,
        stored_bytes_max >> 20
    )]
    OwnerBytes {
        /// Bytes that the owner has stored.
        stored_bytes: u64,
        /// Limit on the stored bytes of one owner.
        stored_bytes_max: u64,
    },
    /// The disk of the database is full.
    #[error("no space is left on the disk of the database")]
    DiskFull,
    /// The database is too busy to answer in time.
    #[error("the database is too busy to answer in time; retry later")]
    Busy,
    /// The write did not happen because the process is stopping.
    #[error("the server is stopping")]
    Stopping,
    /// The linked version of SQLite has known bugs.
    #[error("SQLite {found} is too old, but must be at least {required}")]
    SqliteTooOld {
        /// Linked version of SQLite.
        found: String,
        /// Oldest version of SQLite without the bugs.
        required: &'static str,
    },
    /// A stored text cannot be parsed.
    #[error("the stored value of {column} cannot be parsed")]
    Corrupt {
        /// Name of the column.
        column: &'static str,
        /// The error in the text.
        source: serde_json::Error,
    },
    /// The database was changed by a newer version of the program.
    #[error("the database was written by a newer version of this program (step {step}); use that version")]
    NewerDatabase {
        /// The first migration that this version does not know.
        step: i64,
    },
    /// The database still has the tables of an older version: the server of this version has not been started on it
    /// yet.
    #[error("the database has the tables of an older version; start the server of this version once to migrate them")]
    OlderDatabase,
    /// The database is the target of a transfer that has not ended.
    #[error(
        "the database is the target of a move that has not ended: repeat the same `lightpathd migrate` to continue it"
    )]
    Unfinished,
    /// PostgreSQL cannot store a text with the character NUL.
    #[error("a text contains the character NUL (U+0000), which the database cannot store")]
    Nul,
    /// No server has used the database yet.
    #[error("the database is empty; check database_url, or start the server once")]
    EmptyDatabase,
    /// The database is on read-only media, and a part of it is in a log that cannot be read there.
    #[error(
        "the database was not closed, and its log cannot be read in a folder without write access; copy the folder to a \
         disk that can be written"
    )]
    LogUnreadable,
    /// A migration of the tables failed.
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
