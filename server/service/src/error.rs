//! Why a request is refused or fails.

use lightpath_artifacts::ArtifactError;
use lightpath_domain::reason::PreconditionReason;
use lightpath_store::StoreError;
use std::fmt::{self, Display};
use std::sync::Arc;
use std::time::Duration;

lightpath_domain::reasons! {
    /// Which limit of the server has been reached, as a code for programs.
    pub enum LimitReason {
        /// The caller makes too many calls.
        RateLimited = "RATE_LIMITED",
        /// Too many streams follow jobs and kernels.
        TooManyWatchers = "TOO_MANY_WATCHERS",
        /// Too many downloads run.
        TooManyDownloads = "TOO_MANY_DOWNLOADS",
        /// The client has too many open connections.
        TooManyConnections = "TOO_MANY_CONNECTIONS",
        /// Too many uploads run.
        TooManyUploads = "TOO_MANY_UPLOADS",
        /// The unfinished calls use all memory that they may, or too many of them wait.
        TooMuchUnderWay = "TOO_MUCH_UNDER_WAY",
    }
}

/// A field whose value is not allowed. Its text is `{field} {problem}` and the fix.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct WrongField {
    /// Path of the field.
    pub field: String,
    /// What is wrong, such as the value that was given.
    pub problem: String,
    /// What to do about it.
    pub fix: Fix,
}

/// What to do about a wrong field.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Fix {
    /// Give what is allowed, such as `must be 1 to 8`.
    Allowed(String),
    /// Do this, such as `upload it first`.
    Action(String),
}

impl Fix {
    /// The fix as a text of its own.
    #[must_use]
    pub fn text(&self) -> &str {
        match self {
            Self::Allowed(text) | Self::Action(text) => text,
        }
    }

    /// The fix with another text.
    #[must_use]
    pub fn map(&self, change: impl FnOnce(&str) -> String) -> Self {
        match self {
            Self::Allowed(text) => Self::Allowed(change(text)),
            Self::Action(text) => Self::Action(change(text)),
        }
    }
}

impl Display for WrongField {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { field, problem, fix } = self;
        match fix {
            Fix::Allowed(allowed) => write!(f, "{field} {problem}, but {allowed}"),
            Fix::Action(action) => write!(f, "{field} {problem}; {action}"),
        }
    }
}

/// A line that counts all wrong fields, and a line for each of those that are named.
#[must_use]
pub fn text_of_wrong(fields: &[WrongField], count: usize) -> String {
    let mut text = format!("{count} fields of the request are wrong:");
    for wrong in fields {
        text += &format!("\n  {wrong}");
    }
    if count > fields.len() {
        text += &format!("\n  and {} more", count - fields.len());
    }
    text
}

/// A result with a [`ServiceError`], if it names no other error.
pub type Result<T, E = ServiceError> = std::result::Result<T, E>;

/// Why a request was refused or failed; the messages say what most mean. `reason` is a code for programs, and `message`
/// a text for people.
#[derive(Debug, thiserror::Error)]
#[allow(missing_docs)]
pub enum ServiceError {
    /// The value of a field is not allowed.
    #[error("{0}")]
    Invalid(WrongField),
    #[error("{}", text_of_wrong(fields, *count))]
    SeveralInvalid {
        /// The fields, at most as many as one answer names.
        fields: Vec<WrongField>,
        /// Number of all wrong fields.
        count: usize,
        /// Whether each of the fields names a resource that does not exist.
        are_missing: bool,
    },
    #[error("{field}: {what} does not exist; {fix}")]
    Missing { field: String, what: String, fix: &'static str },
    /// The present state does not allow the request.
    #[error("{message}")]
    Precondition { reason: PreconditionReason, message: String },
    /// A limit of the server has been reached.
    #[error("{message}")]
    Exhausted { reason: LimitReason, message: String, retry_after: Duration },
    /// The request has no token, or its token is not accepted.
    #[error("{0}")]
    Unauthenticated(String),
    #[error("the call is refused, because its caller is unknown")]
    NoCaller,
    /// The caller may not make this call.
    #[error("{0}")]
    Denied(String),
    #[error("the database cannot be written; another program may hold its lock")]
    Locked,
    #[error("the database does not answer; the server or the network may be frozen")]
    DatabaseSilent,
    #[error("the server is stopping; retry in a moment")]
    Stopping,
    #[error(
        "the call needs {} MiB of memory, but the server gives a client at most {} MiB for computations; send a smaller \
         picture, or ask the operator for a larger computing_mib_max",
        bytes.div_ceil(1 << 20),
        bytes_max >> 20
    )]
    TooLarge { bytes: u64, bytes_max: u64 },
    /// A file is being made, which takes longer than the caller can wait.
    #[error("the file is being made ready, which takes longer than a device waits; ask again in a moment")]
    Converting { retry_after: Duration },
    /// The error of work for which several calls waited.
    #[error(transparent)]
    Shared(Arc<ServiceError>),
    /// The client left before the call changed anything.
    #[error("the client left before the answer")]
    Cancelled,
    /// The client disconnected or its stream failed.
    #[error("the stream failed")]
    Stream(#[source] Box<dyn std::error::Error + Send + Sync>),
    #[error("no data arrived for {} s; continue at the offset that GetUpload returns", .0.as_secs())]
    Idle(Duration),
    #[error("the server has no random numbers for a secret")]
    NoRandomness,
    /// A task of the server panicked.
    #[error("a task of the server failed")]
    Task(#[source] tokio::task::JoinError),
    #[error("a computation of the server failed")]
    Panicked,
    #[error(transparent)]
    Store(#[from] StoreError),
    #[error(transparent)]
    Artifact(#[from] ArtifactError),
}

impl ServiceError {
    /// The error, also if several calls waited for the work that failed.
    #[must_use]
    pub fn itself(&self) -> &Self {
        match self {
            Self::Shared(error) => error.itself(),
            error => error,
        }
    }
}
