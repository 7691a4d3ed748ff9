//! Conversion of errors into gRPC statuses.
//!
//! Every status has an `ErrorInfo` with a stable reason for programs, the domain `lightpath`, and the subject of the
//! error. Internal errors are logged with an id, and clients receive only the id.

use crate::status_size::{Texts, fitting};
use lightpath_artifacts::ArtifactError;
use lightpath_domain::causes::with_causes;
use lightpath_service::{ServiceError, WrongField, text_of_wrong};
use lightpath_store::StoreError;
use std::collections::HashMap;
use std::time::Duration;
use tonic::{Code, Status};
use tonic_types::{ErrorDetails, StatusExt as _};
use uuid::Uuid;

/// Domain of all reasons.
const DOMAIN: &str = "lightpath";
/// Time after which a client may submit to a full queue again.
const QUEUE_RETRY: Duration = Duration::from_secs(5);
/// Time after which a client may retry on a full disk: an operator must make room first.
const DISK_RETRY: Duration = Duration::from_secs(60);
/// Time after which a client may retry while another upload of the same artifact runs.
const UPLOAD_RETRY: Duration = Duration::from_secs(1);
/// Time after which a client may retry when the remote for artifacts has not answered.
const REMOTE_RETRY: Duration = Duration::from_secs(5);
/// Time after which a stopping server has probably been restarted.
const RESTART_RETRY: Duration = Duration::from_secs(1);

/// Content of a status.
struct Answer {
    code: Code,
    reason: &'static str,
    /// Subject of the error: (`field`, path), (`resource`, name) or (`error_id`, id in the log).
    about: Option<(&'static str, String)>,
    /// The fields whose values are wrong.
    wrong: Vec<WrongField>,
    /// Number of all wrong fields, if the message lists them.
    wrong_count: usize,
    retry_after: Option<Duration>,
}

/// The status of an error.
pub(crate) fn of(error: ServiceError) -> Status {
    if let ServiceError::Artifact(ArtifactError::DataLoss { digest }) = error.itself() {
        tracing::error!(digest, "a stored artifact no longer matches its digest");
    }
    match error {
        ServiceError::Stream(cause) if cause.is::<Status>() => match cause.downcast() {
            Ok(status) => *status,
            Err(cause) => internal(&ServiceError::Stream(cause)),
        },
        error => answer(&error).map_or_else(|| internal(&error), |answer| answer.status(error.to_string())),
    }
}

/// The gRPC code of an error.
pub(crate) fn code(error: &ServiceError) -> Code {
    match error {
        ServiceError::Stream(cause) => cause.downcast_ref().map_or(Code::Internal, Status::code),
        error => answer(error).map_or(Code::Internal, |answer| answer.code),
    }
}

/// The answer that clients receive for an error; `None` for internal errors.
fn answer(error: &ServiceError) -> Option<Answer> {
    Some(match error {
        ServiceError::Invalid { field, problem } => {
            let answer = Answer::new(Code::InvalidArgument, "INVALID_FIELD").about("field", field);
            Answer { wrong: vec![WrongField { field: field.clone(), problem: problem.clone() }], ..answer }
        }
        ServiceError::SeveralInvalid { fields, are_missing, count } => {
            let (code, reason) =
                if *are_missing { (Code::NotFound, "NOT_FOUND") } else { (Code::InvalidArgument, "INVALID_FIELD") };
            let answer = Answer::new(code, reason).about("field", fields.first().map_or("", |first| &first.field));
            Answer { wrong: fields.clone(), wrong_count: *count, ..answer }
        }
        ServiceError::Missing { what, .. } => Answer::new(Code::NotFound, "NOT_FOUND").about("resource", what),
        ServiceError::Precondition { reason, .. } => Answer::new(Code::FailedPrecondition, reason.as_str()),
        ServiceError::Exhausted { reason, retry_after, .. } => {
            Answer::new(Code::ResourceExhausted, reason.as_str()).retry(*retry_after)
        }
        ServiceError::Unauthenticated(_) => Answer::new(Code::Unauthenticated, "UNAUTHENTICATED"),
        ServiceError::NoCaller => Answer::new(Code::Unauthenticated, "NO_CALLER"),
        ServiceError::Denied(_) => Answer::new(Code::PermissionDenied, "PERMISSION_DENIED"),
        ServiceError::DatabaseSilent => Answer::new(Code::Unavailable, "DATABASE_SILENT").retry(QUEUE_RETRY),
        ServiceError::Locked => Answer::new(Code::Unavailable, "DATABASE_LOCKED").retry(QUEUE_RETRY),
        ServiceError::Stopping => Answer::new(Code::Unavailable, "STOPPING").retry(RESTART_RETRY),
        ServiceError::TooLarge { .. } => Answer::new(Code::FailedPrecondition, "TOO_LARGE"),
        ServiceError::Converting { retry_after } => Answer::new(Code::Unavailable, "CONVERTING").retry(*retry_after),
        ServiceError::Shared(error) => return answer(error),
        ServiceError::Cancelled => Answer::new(Code::Cancelled, "CLIENT_LEFT"),
        ServiceError::Idle(_) => Answer::new(Code::DeadlineExceeded, "IDLE"),
        ServiceError::Stream(_) | ServiceError::Task(_) | ServiceError::Panicked | ServiceError::NoRandomness => {
            return None;
        }
        ServiceError::Store(error) => return store_answer(error),
        ServiceError::Artifact(error) => return artifact_answer(error),
    })
}

fn store_answer(error: &StoreError) -> Option<Answer> {
    Some(match error {
        StoreError::NotFound { resource } => Answer::new(Code::NotFound, "NOT_FOUND").about("resource", resource),
        StoreError::AlreadyExists { resource, .. } => {
            Answer::new(Code::AlreadyExists, "ALREADY_EXISTS").about("resource", resource)
        }
        StoreError::Precondition { reason, .. } => Answer::new(Code::FailedPrecondition, reason.as_str()),
        StoreError::Aborted { reason, .. } => Answer::new(Code::Aborted, reason.as_str()),
        StoreError::LeaseLost => Answer::new(Code::Aborted, "LEASE_LOST"),
        StoreError::QueueFull { .. } => Answer::new(Code::ResourceExhausted, "QUEUE_FULL").retry(QUEUE_RETRY),
        StoreError::OwnerQueueFull { .. } => {
            Answer::new(Code::ResourceExhausted, "OWNER_QUEUE_FULL").retry(QUEUE_RETRY)
        }
        StoreError::DependenciesFull { .. } => {
            Answer::new(Code::ResourceExhausted, "DEPENDENCIES_FULL").retry(QUEUE_RETRY)
        }
        StoreError::OwnerBytes { .. } => Answer::new(Code::ResourceExhausted, "OWNER_STORED_BYTES").retry(DISK_RETRY),
        StoreError::Nul => Answer::new(Code::InvalidArgument, "INVALID_FIELD"),
        StoreError::DiskFull => Answer::new(Code::ResourceExhausted, "DISK_FULL").retry(DISK_RETRY),
        StoreError::Busy => Answer::new(Code::Unavailable, "DATABASE_BUSY").retry(QUEUE_RETRY),
        StoreError::Unreachable(_) => Answer::new(Code::Unavailable, "DATABASE_UNREACHABLE").retry(QUEUE_RETRY),
        StoreError::Stopping => Answer::new(Code::Unavailable, "STOPPING").retry(RESTART_RETRY),
        StoreError::SqliteTooOld { .. }
        | StoreError::Corrupt { .. }
        | StoreError::NewerDatabase { .. }
        | StoreError::OlderDatabase
        | StoreError::OpenConnection { .. }
        | StoreError::Unfinished
        | StoreError::EmptyDatabase
        | StoreError::LogUnreadable
        | StoreError::Migration(_)
        | StoreError::Database(_) => return None,
    })
}

fn artifact_answer(error: &ArtifactError) -> Option<Answer> {
    Some(match error {
        ArtifactError::BadDigest { .. } => Answer::new(Code::InvalidArgument, "INVALID_FIELD").about("field", "digest"),
        ArtifactError::NotFound { digest } => Answer::new(Code::NotFound, "NOT_FOUND").about("resource", digest),
        ArtifactError::DataLoss { digest } => Answer::new(Code::DataLoss, "DATA_LOSS").about("resource", digest),
        ArtifactError::OutOfRange { .. } => {
            Answer::new(Code::OutOfRange, "OUT_OF_RANGE").about("field", "offset_bytes")
        }
        ArtifactError::WrongOffset { .. } => {
            Answer::new(Code::Aborted, "WRONG_OFFSET").about("field", "start.offset_bytes")
        }
        ArtifactError::UploadBusy { digest } => {
            Answer::new(Code::Aborted, "UPLOAD_BUSY").about("resource", digest).retry(UPLOAD_RETRY)
        }
        ArtifactError::WrongSize { .. } => {
            Answer::new(Code::InvalidArgument, "WRONG_SIZE").about("field", "start.size_bytes")
        }
        ArtifactError::WrongDigest { .. } => {
            Answer::new(Code::InvalidArgument, "WRONG_DIGEST").about("field", "start.digest")
        }
        ArtifactError::DiskFull => Answer::new(Code::ResourceExhausted, "DISK_FULL").retry(DISK_RETRY),
        ArtifactError::DiskLow { .. } => Answer::new(Code::ResourceExhausted, "DISK_LOW").retry(DISK_RETRY),
        ArtifactError::QuotaSpent { .. } => Answer::new(Code::ResourceExhausted, "STORED_BYTES").retry(DISK_RETRY),
        ArtifactError::Remote { .. } => Answer::new(Code::Unavailable, "REMOTE").retry(REMOTE_RETRY),
        ArtifactError::BadRemote { .. }
        | ArtifactError::UnfitRemote { .. }
        | ArtifactError::OtherRemote { .. }
        | ArtifactError::Locked { .. }
        | ArtifactError::Unfinished { .. }
        | ArtifactError::Io { .. } => return None,
    })
}

impl Answer {
    fn new(code: Code, reason: &'static str) -> Self {
        Self { code, reason, about: None, wrong: Vec::new(), wrong_count: 0, retry_after: None }
    }

    fn about(mut self, kind: &'static str, what: &str) -> Self {
        self.about = Some((kind, what.to_owned()));
        self
    }

    fn retry(mut self, after: Duration) -> Self {
        self.retry_after = Some(after);
        self
    }

    fn status(self, message: String) -> Status {
        let Self { code, reason, about, wrong, wrong_count, retry_after } = self;
        let (kind, about) = about.unzip();
        let texts = Texts { message, about: about.unwrap_or_default(), wrong };
        fitting(texts, |Texts { message, about, wrong }| {
            let message = if wrong_count > 0 { text_of_wrong(&wrong, wrong_count) } else { message };
            let mut details = ErrorDetails::new();
            for WrongField { field, problem } in wrong {
                details.add_bad_request_violation(field, problem);
            }
            let metadata: HashMap<_, _> = kind.iter().map(|&kind| (kind.to_owned(), about.clone())).collect();
            details.set_error_info(reason, DOMAIN, metadata);
            if retry_after.is_some() {
                details.set_retry_info(retry_after);
            }
            Status::with_error_details(code, message, details)
        })
    }
}

/// Logs the error with its causes, and sends the client the id of the log entry.
fn internal(error: &ServiceError) -> Status {
    let id = Uuid::now_v7().to_string();
    tracing::error!(id, causes = with_causes(error), "internal error");
    let message = format!("internal error {id}; the cause is in the server's log");
    Answer::new(Code::Internal, "INTERNAL").about("error_id", &id).status(message)
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::sync::Arc;

    #[test]
    fn statuses_name_the_reason_the_field_and_when_to_retry() {
        let refused =
            ServiceError::Invalid { field: "spec.distance_m".into(), problem: "is NaN, but must be …".into() };
        let status = of(refused);
        assert_eq!((status.code(), status.message()), (Code::InvalidArgument, "spec.distance_m is NaN, but must be …"));
        let details = status.get_error_details();
        assert_eq!(details.bad_request().unwrap().field_violations[0].field, "spec.distance_m");
        let info = details.error_info().unwrap();
        assert_eq!((info.reason.as_str(), info.domain.as_str()), ("INVALID_FIELD", "lightpath"));
        assert_eq!(info.metadata["field"], "spec.distance_m");

        let status = of(ServiceError::from(StoreError::QueueFull { limit: 3 }));
        assert_eq!(status.code(), Code::ResourceExhausted);
        assert_eq!(status.get_error_details().retry_info().unwrap().retry_delay, Some(QUEUE_RETRY));
        let converting = ServiceError::Shared(Arc::new(ServiceError::Converting { retry_after: QUEUE_RETRY }));
        for later in [ServiceError::Stopping, StoreError::Busy.into(), converting] {
            let status = of(later);
            assert_eq!(status.code(), Code::Unavailable);
            assert!(status.get_error_details().retry_info().is_some());
        }
    }

    #[test]
    fn status_lists_every_wrong_field() {
        let field = lightpath_service::Field::new("display");
        let wrong = [field.at("width_px").invalid("is 0"), field.at("height_px").invalid("is 1")];
        let status = of(lightpath_service::all_of(wrong));
        assert_eq!(status.code(), Code::InvalidArgument);
        let bad = status.get_error_details().bad_request().unwrap().field_violations.clone();
        let named: Vec<_> = bad.iter().map(|bad| (bad.field.as_str(), bad.description.as_str())).collect();
        assert_eq!(named, [("display.width_px", "is 0"), ("display.height_px", "is 1")]);
        let missing =
            ["a", "b"].map(|name| lightpath_service::Field::new(name).missing("displays/x", "create it first"));
        assert_eq!(of(lightpath_service::all_of(missing)).code(), Code::NotFound);
    }

    #[test]
    fn clients_do_not_see_the_causes_of_internal_errors() {
        let source = std::io::Error::other("/secret/path");
        let status = of(ServiceError::from(ArtifactError::Io { action: "read a file", source }));
        assert_eq!(status.code(), Code::Internal);
        assert!(!status.message().contains("secret") && status.message().starts_with("internal error"));
    }
}
