//! The one map from errors to gRPC statuses.
//!
//! Every status carries an `ErrorInfo`: a stable reason for programs, the domain `lightpath`, and what it is about.
//! What went wrong inside the server is logged under an id, and only the id is sent.

use super::error::ApiError;
use lightpath_artifacts::ArtifactError;
use lightpath_domain::causes::with_causes;
use lightpath_store::StoreError;
use std::collections::HashMap;
use std::error::Error;
use std::time::Duration;
use tonic::{Code, Status};
use tonic_types::{ErrorDetails, StatusExt as _};
use uuid::Uuid;

/// Whose reasons these are.
const DOMAIN: &str = "lightpath";
/// When to submit again to a full queue.
const QUEUE_RETRY: Duration = Duration::from_secs(5);
/// When to try again on a full disk: somebody has to make room first.
const DISK_RETRY: Duration = Duration::from_secs(60);
/// When to try again while another upload of the same artifact runs.
const UPLOAD_RETRY: Duration = Duration::from_secs(1);
/// When a server that stops is likely back.
const RESTART_RETRY: Duration = Duration::from_secs(1);

/// What a status is made of.
struct Answer {
    code: Code,
    reason: &'static str,
    message: String,
    /// What it is about: (`field`, path) or (`resource`, name).
    about: Option<(&'static str, String)>,
    retry_after: Option<Duration>,
}

impl From<ApiError> for Status {
    fn from(error: ApiError) -> Self {
        let message = error.to_string();
        match error {
            ApiError::Invalid { field, problem } => {
                let mut details = ErrorDetails::with_bad_request_violation(&*field, problem);
                details.set_error_info("INVALID_FIELD", DOMAIN, HashMap::from([("field".to_owned(), field)]));
                Self::with_error_details(Code::InvalidArgument, message, details)
            }
            ApiError::Missing { what, .. } => {
                Answer::new(Code::NotFound, "NOT_FOUND", message).about("resource", what).status()
            }
            ApiError::Precondition { reason, .. } => Answer::new(Code::FailedPrecondition, reason, message).status(),
            ApiError::Exhausted { reason, retry_after, .. } => {
                Answer::new(Code::ResourceExhausted, reason, message).retry(retry_after).status()
            }
            ApiError::Unauthenticated(_) => Answer::new(Code::Unauthenticated, "UNAUTHENTICATED", message).status(),
            ApiError::Denied(_) => Answer::new(Code::PermissionDenied, "PERMISSION_DENIED", message).status(),
            ApiError::Locked => Answer::new(Code::Unavailable, "DATABASE_LOCKED", message).retry(QUEUE_RETRY).status(),
            ApiError::Stopping => Answer::new(Code::Unavailable, "STOPPING", message).retry(RESTART_RETRY).status(),
            ApiError::Idle(_) => Answer::new(Code::DeadlineExceeded, "IDLE", message).status(),
            ApiError::Stream(status) => *status,
            error @ ApiError::Task(_) => internal(&error),
            ApiError::Store(error) => store_status(error),
            ApiError::Artifact(error) => artifact_status(error),
        }
    }
}

fn store_status(error: StoreError) -> Status {
    let message = error.to_string();
    match error {
        StoreError::NotFound { what } => {
            Answer::new(Code::NotFound, "NOT_FOUND", message).about("resource", what).status()
        }
        StoreError::AlreadyExists { what, .. } => {
            Answer::new(Code::AlreadyExists, "ALREADY_EXISTS", message).about("resource", what).status()
        }
        StoreError::Precondition { reason, .. } => Answer::new(Code::FailedPrecondition, reason, message).status(),
        StoreError::Aborted { reason, .. } => Answer::new(Code::Aborted, reason, message).status(),
        StoreError::LeaseLost => Answer::new(Code::Aborted, "LEASE_LOST", message).status(),
        StoreError::QueueFull { .. } => {
            Answer::new(Code::ResourceExhausted, "QUEUE_FULL", message).retry(QUEUE_RETRY).status()
        }
        StoreError::OwnerQueueFull { .. } => {
            Answer::new(Code::ResourceExhausted, "OWNER_QUEUE_FULL", message).retry(QUEUE_RETRY).status()
        }
        StoreError::OwnerBytes { .. } => {
            Answer::new(Code::ResourceExhausted, "OWNER_STORED_BYTES", message).retry(DISK_RETRY).status()
        }
        StoreError::DiskFull => Answer::new(Code::ResourceExhausted, "DISK_FULL", message).retry(DISK_RETRY).status(),
        StoreError::Busy => Answer::new(Code::Unavailable, "DATABASE_BUSY", message).retry(QUEUE_RETRY).status(),
        StoreError::Stopping => Answer::new(Code::Unavailable, "STOPPING", message).retry(RESTART_RETRY).status(),
        error @ (StoreError::SqliteTooOld { .. }
        | StoreError::Corrupt { .. }
        | StoreError::NewerDatabase { .. }
        | StoreError::OlderDatabase
        | StoreError::Migration(_)
        | StoreError::Database(_)) => internal(&error),
    }
}

fn artifact_status(error: ArtifactError) -> Status {
    let message = error.to_string();
    match error {
        ArtifactError::BadDigest { .. } => {
            Answer::new(Code::InvalidArgument, "INVALID_FIELD", message).about("field", "digest").status()
        }
        ArtifactError::NotFound { digest } => {
            Answer::new(Code::NotFound, "NOT_FOUND", message).about("resource", digest).status()
        }
        ArtifactError::DataLoss { digest } => {
            tracing::error!(digest, "a stored artifact no longer matches its digest");
            Answer::new(Code::DataLoss, "DATA_LOSS", message).about("resource", digest).status()
        }
        ArtifactError::OutOfRange { .. } => {
            Answer::new(Code::OutOfRange, "OUT_OF_RANGE", message).about("field", "offset_bytes").status()
        }
        ArtifactError::WrongOffset { .. } => {
            Answer::new(Code::Aborted, "WRONG_OFFSET", message).about("field", "start.offset_bytes").status()
        }
        ArtifactError::UploadBusy { digest } => {
            let busy = Answer::new(Code::Aborted, "UPLOAD_BUSY", message);
            busy.about("resource", digest).retry(UPLOAD_RETRY).status()
        }
        ArtifactError::WrongSize { .. } => {
            Answer::new(Code::InvalidArgument, "WRONG_SIZE", message).about("field", "start.size_bytes").status()
        }
        ArtifactError::WrongDigest { .. } => {
            Answer::new(Code::InvalidArgument, "WRONG_DIGEST", message).about("field", "start.digest").status()
        }
        ArtifactError::DiskFull => {
            Answer::new(Code::ResourceExhausted, "DISK_FULL", message).retry(DISK_RETRY).status()
        }
        ArtifactError::DiskLow { .. } => {
            Answer::new(Code::ResourceExhausted, "DISK_LOW", message).retry(DISK_RETRY).status()
        }
        ArtifactError::QuotaSpent { .. } => {
            Answer::new(Code::ResourceExhausted, "STORED_BYTES", message).retry(DISK_RETRY).status()
        }
        error @ (ArtifactError::Locked { .. } | ArtifactError::Io { .. }) => internal(&error),
    }
}

impl Answer {
    fn new(code: Code, reason: &'static str, message: String) -> Self {
        Self { code, reason, message, about: None, retry_after: None }
    }

    fn about(mut self, kind: &'static str, what: impl Into<String>) -> Self {
        self.about = Some((kind, what.into()));
        self
    }

    fn retry(mut self, after: Duration) -> Self {
        self.retry_after = Some(after);
        self
    }

    fn status(self) -> Status {
        let metadata = self.about.map(|(kind, what)| (kind.to_owned(), what));
        let mut details =
            ErrorDetails::with_error_info(self.reason, DOMAIN, metadata.into_iter().collect::<HashMap<_, _>>());
        if self.retry_after.is_some() {
            details.set_retry_info(self.retry_after);
        }
        Status::with_error_details(self.code, self.message, details)
    }
}

/// Logs the error with its sources, and tells the client where to look for it.
fn internal(error: &(dyn Error + 'static)) -> Status {
    let id = Uuid::now_v7().to_string();
    tracing::error!(id, causes = with_causes(error), "internal error");
    let message = format!("internal error {id}; the server's log tells what happened");
    Answer::new(Code::Internal, "INTERNAL", message).about("error_id", id).status()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn statuses_name_the_reason_the_field_and_when_to_retry() {
        let refused = ApiError::Invalid { field: "spec.distance_m".into(), problem: "is NaN, but must be …".into() };
        let status = Status::from(refused);
        assert_eq!((status.code(), status.message()), (Code::InvalidArgument, "spec.distance_m is NaN, but must be …"));
        let details = status.get_error_details();
        assert_eq!(details.bad_request().unwrap().field_violations[0].field, "spec.distance_m");
        let info = details.error_info().unwrap();
        assert_eq!((info.reason.as_str(), info.domain.as_str()), ("INVALID_FIELD", "lightpath"));
        assert_eq!(info.metadata["field"], "spec.distance_m");

        let status = Status::from(ApiError::from(StoreError::QueueFull { limit: 3 }));
        assert_eq!(status.code(), Code::ResourceExhausted);
        assert_eq!(status.get_error_details().retry_info().unwrap().retry_delay, Some(QUEUE_RETRY));
        for later in [ApiError::Stopping, StoreError::Busy.into()] {
            let status = Status::from(later);
            assert_eq!(status.code(), Code::Unavailable);
            assert!(status.get_error_details().retry_info().is_some());
        }
    }

    #[test]
    fn internal_errors_stay_inside() {
        let source = std::io::Error::other("/secret/path");
        let status = Status::from(ApiError::from(ArtifactError::Io { action: "read a file", source }));
        assert_eq!(status.code(), Code::Internal);
        assert!(!status.message().contains("secret") && status.message().starts_with("internal error"));
    }
}
