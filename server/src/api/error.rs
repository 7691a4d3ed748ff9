//! Why a request is refused or fails.

use crate::artifacts::ArtifactError;
use crate::store::StoreError;
use std::time::Duration;

/// Why a request is refused or fails, in the API's words; [`super::status`] maps it to a gRPC status.
#[derive(Debug, thiserror::Error)]
pub(crate) enum ApiError {
    /// A field is not what it must be.
    #[error("{field} {problem}")]
    Invalid { field: String, problem: String },
    /// A field names something that is not there.
    #[error("{field}: {what} does not exist; {fix}")]
    Missing { field: String, what: String, fix: &'static str },
    /// Not possible in this state; the reason is stable, for programs.
    #[error("{message}")]
    Precondition { reason: &'static str, message: String },
    /// Too much at once.
    #[error("{message}")]
    Exhausted { reason: &'static str, message: String, retry_after: Duration },
    /// No token, or none that is accepted.
    #[error("{0}")]
    Unauthenticated(String),
    /// Not for this caller.
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
    #[error(transparent)]
    Store(#[from] StoreError),
    #[error(transparent)]
    Artifact(#[from] ArtifactError),
}
