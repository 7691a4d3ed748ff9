//! Errors of the API.

use lightpath_artifacts::ArtifactError;
use lightpath_store::StoreError;
use std::time::Duration;

/// Why a request was refused or failed. `status` maps each error to a gRPC status.
#[derive(Debug, thiserror::Error)]
pub enum ApiError {
    /// The value of a field is not allowed.
    #[error("{field} {problem}")]
    Invalid {
        /// Path of the field.
        field: String,
        /// The value that was given, and the values that are allowed.
        problem: String,
    },
    /// A field names a resource that does not exist.
    #[error("{field}: {what} does not exist; {fix}")]
    Missing {
        /// Path of the field.
        field: String,
        /// Name of the missing resource.
        what: String,
        /// Advice to the client.
        fix: &'static str,
    },
    /// The present state does not allow the request. The reason is a stable code for programs.
    #[error("{message}")]
    Precondition {
        /// Code for programs.
        reason: &'static str,
        /// Text for people.
        message: String,
    },
    /// A limit of the server has been reached.
    #[error("{message}")]
    Exhausted {
        /// Code for programs.
        reason: &'static str,
        /// Text for people.
        message: String,
        /// Time after which the client may retry.
        retry_after: Duration,
    },
    /// The request has no token, or its token is not accepted.
    #[error("{0}")]
    Unauthenticated(String),
    /// The call did not pass the gate, so its caller is unknown.
    #[error("the call is refused, because its caller is unknown")]
    NoCaller,
    /// The caller may not make this call.
    #[error("{0}")]
    Denied(String),
    /// Another process holds the database.
    #[error("the database cannot be written; another program may hold its lock")]
    Locked,
    /// The server is stopping.
    #[error("the server is stopping; retry in a moment")]
    Stopping,
    /// The client disconnected or its stream failed.
    #[error("the stream failed")]
    Stream(#[source] Box<tonic::Status>),
    /// The client sent nothing for too long.
    #[error("no data arrived for {} s; continue at the offset that GetUpload returns", .0.as_secs())]
    Idle(Duration),
    /// A task of the server panicked.
    #[error("a task of the server failed")]
    Task(#[source] tokio::task::JoinError),
    /// The store refused the request or failed.
    #[error(transparent)]
    Store(#[from] StoreError),
    /// The artifact folder refused the request or failed.
    #[error(transparent)]
    Artifact(#[from] ArtifactError),
}
