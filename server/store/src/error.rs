//! What can go wrong in the store.

lightpath_domain::reasons! {
    /// Why something is not possible in the state of things, for programs.
    pub enum PreconditionReason {
        /// The dataset is finalized, and does not change any more.
        DatasetFinalized = "DATASET_FINALIZED",
        /// The dataset has as many pairs as it may have.
        DatasetFull = "DATASET_FULL",
        /// A part of the dataset's split has no pairs.
        DatasetSplitEmpty = "DATASET_SPLIT_EMPTY",
        /// A job that this one comes after has failed or was cancelled.
        DependencyEnded = "DEPENDENCY_ENDED",
        /// Jobs, datasets or kernels belong to the display.
        DisplayInUse = "DISPLAY_IN_USE",
        /// The job has ended.
        JobEnded = "JOB_ENDED",
        /// The job did not fail and was not cancelled.
        JobNotRetryable = "JOB_NOT_RETRYABLE",
        /// The kernel has no active version before the present one.
        NoEarlierVersion = "NO_EARLIER_VERSION",
        /// The queue is not paused.
        NotPaused = "NOT_PAUSED",
        /// Another job does the same work.
        NotUnique = "NOT_UNIQUE",
    }
}

lightpath_domain::reasons! {
    /// What changed in between, for programs.
    pub enum AbortReason {
        /// Another version of the kernel was made active.
        ActiveVersionChanged = "ACTIVE_VERSION_CHANGED",
        /// The dataset's pairs or alignment.
        DatasetChanged = "DATASET_CHANGED",
    }
}

/// Why the store refused or failed. Everything but the last variants is about the request, not about the store.
#[derive(Debug, thiserror::Error)]
pub enum StoreError {
    /// What was named is not there.
    #[error("{what} does not exist")]
    NotFound {
        /// For example `displays/lab-2`.
        what: String,
    },
    /// The name is taken by something with other content.
    #[error("{what} already exists {detail}")]
    AlreadyExists {
        /// For example `displays/lab-2`.
        what: String,
        /// What differs, for example `with other properties`.
        detail: String,
    },
    /// Not possible in this state.
    #[error("{message}")]
    Precondition {
        /// For programs.
        reason: PreconditionReason,
        /// For people.
        message: String,
    },
    /// Something changed in between: read again and retry.
    #[error("{message}")]
    Aborted {
        /// For programs.
        reason: AbortReason,
        /// For people.
        message: String,
    },
    /// The worker no longer holds the job: it was given to another, ended, or the lease ran out.
    #[error("the lease on the job is lost")]
    LeaseLost,
    /// No more jobs may wait.
    #[error("the queue is full: {limit} jobs wait already; submit again when some have run")]
    QueueFull {
        /// Most jobs that may wait.
        limit: u32,
    },
    /// Nobody may have more jobs waiting than this.
    #[error("{limit} of your jobs wait already, which is as many as may; submit again when some have run")]
    OwnerQueueFull {
        /// Most jobs of one owner that may wait.
        limit: u32,
    },
    /// Nobody may have more stored than this.
    #[error(
        "you have {} of {} MiB stored, with what your jobs made; more is possible when some of that has been removed",
        stored_bytes >> 20,
        stored_bytes_max >> 20
    )]
    OwnerBytes {
        /// What the owner has.
        stored_bytes: u64,
        /// What each owner may have.
        stored_bytes_max: u64,
    },
    /// No space left for the database.
    #[error("no space is left on the disk of the database")]
    DiskFull,
    /// So much is asked of the database that nobody had time for this.
    #[error("the database had no time for this; too much is asked of it")]
    Busy,
    /// The write did not happen because the process is about to end.
    #[error("the server is stopping")]
    Stopping,
    /// The linked SQLite has known bugs.
    #[error("SQLite {found} is too old, but must be at least {required}")]
    SqliteTooOld {
        /// The linked version.
        found: String,
        /// The oldest version without the bugs.
        required: &'static str,
    },
    /// A stored text could not be understood.
    #[error("{column} of a row cannot be read")]
    Corrupt {
        /// The column's name.
        column: &'static str,
        /// What is wrong with it.
        source: serde_json::Error,
    },
    /// A newer program has been at work here.
    #[error("the database was written by a newer version of this program (step {step}); use that version")]
    NewerDatabase {
        /// The first migration that this program does not know.
        step: i64,
    },
    /// Its server has not been started with this version of the program yet.
    #[error("the database is of an older version; start the server of this version first")]
    OlderDatabase,
    /// The database could not be brought to this version's tables.
    #[error("the database cannot be migrated")]
    Migration(#[source] sqlx::migrate::MigrateError),
    /// Anything else from the database.
    #[error("the database failed")]
    Database(#[source] sqlx::Error),
}

impl StoreError {
    pub(super) fn not_found(what: impl Into<String>) -> Self {
        Self::NotFound { what: what.into() }
    }

    pub(super) fn exists(what: impl Into<String>, detail: impl Into<String>) -> Self {
        Self::AlreadyExists { what: what.into(), detail: detail.into() }
    }

    pub(super) fn precondition(reason: PreconditionReason, message: impl Into<String>) -> Self {
        Self::Precondition { reason, message: message.into() }
    }

    /// The same call may succeed later without anybody doing anything but making room.
    #[must_use]
    pub fn is_transient(&self) -> bool {
        match self {
            Self::DiskFull
            | Self::Database(_)
            | Self::Busy
            | Self::Stopping
            | Self::QueueFull { .. }
            | Self::OwnerQueueFull { .. }
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
            | Self::Migration(_) => false,
        }
    }
}

impl From<sqlx::Error> for StoreError {
    fn from(error: sqlx::Error) -> Self {
        /// SQLITE_FULL, and SQLITE_IOERR_SHMSIZE: no room for the log's index.
        const FULL: [&str; 2] = ["13", "4874"];
        match error.as_database_error().and_then(|e| e.code()) {
            Some(code) if FULL.contains(&&*code) => Self::DiskFull,
            _ if matches!(error, sqlx::Error::PoolTimedOut) => Self::Busy,
            _ => Self::Database(error),
        }
    }
}
