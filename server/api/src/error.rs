//! Why a request is refused or fails.

use lightpath_artifacts::ArtifactError;
use lightpath_store::StoreError;
use std::time::Duration;

/// Why a request is refused or fails, in the words of the API; `status` maps it to a gRPC status.
#[derive(Debug, thiserror::Error)]
pub enum ApiError {
    /// A field is not what it must be.
    #[error("{field} {problem}")]
    Invalid {
        /// Path of the field.
        field: String,
        /// What is wrong with it, and what it must be.
        problem: String,
    },
    /// A field names something that is not there.
    #[error("{field}: {what} does not exist; {fix}")]
    Missing {
        /// Path of the field.
        field: String,
        /// Name of the thing.
        what: String,
        /// What to do.
        fix: &'static str,
    },
    /// Not possible in this state; the reason is stable, for programs.
    #[error("{message}")]
    Precondition {
        /// For programs.
        reason: &'static str,
        /// For people.
        message: String,
    },
    /// Too much at once.
    #[error("{message}")]
    Exhausted {
        /// For programs.
        reason: &'static str,
        /// For people.
        message: String,
        /// When to try again.
        retry_after: Duration,
    },
    /// No token, or none that is accepted.
    #[error("{0}")]
    Unauthenticated(String),
    /// The call did not pass the gate, so that nobody knows who makes it.
    #[error("it is not known who makes this call, and it is not answered")]
    NoCaller,
    /// The caller may not do this.
    #[error("{0}")]
    Denied(String),
    /// Somebody else holds the database.
    #[error("the database lets nobody write; is another program at it?")]
    Locked,
    /// The server drains.
    #[error("the server is stopping; try again in a moment")]
    Stopping,
    /// The client went away or broke its stream.
    #[error("the stream broke")]
    Stream(#[source] Box<tonic::Status>),
    /// The client sent nothing for too long.
    #[error("nothing arrived for {} s; go on from where GetUpload says", .0.as_secs())]
    Idle(Duration),
    /// A panic in a task of the server.
    #[error("a task of the server failed")]
    Task(#[source] tokio::task::JoinError),
    /// The store refuses or fails.
    #[error(transparent)]
    Store(#[from] StoreError),
    /// The files refuse or fail.
    #[error(transparent)]
    Artifact(#[from] ArtifactError),
}
