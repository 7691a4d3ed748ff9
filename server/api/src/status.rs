//! Conversion of errors into gRPC statuses.
//!
//! Every status has an `ErrorInfo` with a stable reason for programs, the domain `lightpath`, and the subject of the
//! error. Wrong fields are in `BadRequest`. The message for users (`LocalizedMessage`) of each wrong field, and of the
//! status if there is none, is the fix. Internal errors are logged with an id, and clients receive only the id.

use crate::fixes;
use crate::status_size::{Texts, fitting};
use lightpath_artifacts::ArtifactError;
use lightpath_domain::causes::with_causes;
use lightpath_service::{ServiceError, WrongField, missing, text_of_wrong};
use lightpath_store::StoreError;
use std::collections::HashMap;
use std::time::Duration;
use tonic::{Code, Status};
use tonic_types::{ErrorDetails, FieldViolation, LocalizedMessage, StatusExt as _};
use uuid::Uuid;

/// Domain of all reasons.
const DOMAIN: &str = "lightpath";
/// Language of all texts.
const LOCALE: &str = "en";
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
    /// What to do, unless the wrong fields have their own fixes or the client need only retry.
    fix: &'static str,
}

/// The status of an error.
pub(crate) fn of(error: ServiceError) -> Status {
    match error.itself() {
        ServiceError::Artifact(ArtifactError::DataLoss { digest }) => {
            tracing::error!(digest, "a stored artifact no longer matches its digest");
        }
        // Clients try again; what the bucket's server did is for its operator.
        ServiceError::Artifact(ArtifactError::Remote { .. }) => {
            tracing::warn!(causes = with_causes(&error), "a call of the bucket failed");
        }
        _ => {}
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
        ServiceError::Invalid(wrong) => {
            let answer = Answer::new(Code::InvalidArgument, "INVALID_FIELD").about("field", &wrong.field);
            Answer { wrong: vec![wrong.clone()], ..answer }
        }
        ServiceError::SeveralInvalid { fields, are_missing, count } => {
            let (code, reason) =
                if *are_missing { (Code::NotFound, "NOT_FOUND") } else { (Code::InvalidArgument, "INVALID_FIELD") };
            let answer = Answer::new(code, reason).about("field", fields.first().map_or("", |first| &first.field));
            Answer { wrong: fields.clone(), wrong_count: *count, ..answer }
        }
        ServiceError::Missing { field, what, fix } => {
            let answer = Answer::new(Code::NotFound, "NOT_FOUND").about("resource", what);
            Answer { wrong: vec![missing(field.clone(), what, fix)], ..answer }
        }
        ServiceError::Precondition { reason, .. } => {
            Answer::new(Code::FailedPrecondition, reason.as_str()).fix(fixes::of_precondition(*reason))
        }
        ServiceError::Exhausted { reason, retry_after, .. } => {
            Answer::new(Code::ResourceExhausted, reason.as_str()).retry(*retry_after).fix(fixes::of_limit(*reason))
        }
        ServiceError::Unauthenticated(_) => Answer::new(Code::Unauthenticated, "UNAUTHENTICATED").fix(fixes::TOKEN),
        ServiceError::NoCaller => Answer::new(Code::Unauthenticated, "NO_CALLER").fix(fixes::TOKEN),
        ServiceError::Denied(_) => Answer::new(Code::PermissionDenied, "PERMISSION_DENIED").fix(fixes::ROLE),
        ServiceError::DatabaseSilent => Answer::new(Code::Unavailable, "DATABASE_SILENT").retry(QUEUE_RETRY),
        ServiceError::Locked => Answer::new(Code::Unavailable, "DATABASE_LOCKED").retry(QUEUE_RETRY),
        ServiceError::Stopping => Answer::new(Code::Unavailable, "STOPPING").retry(RESTART_RETRY),
        ServiceError::TooLarge { .. } => Answer::new(Code::FailedPrecondition, "TOO_LARGE").fix(fixes::MEMORY),
        ServiceError::Converting { retry_after } => Answer::new(Code::Unavailable, "CONVERTING").retry(*retry_after),
        ServiceError::Shared(error) => return answer(error),
        ServiceError::Cancelled => Answer::new(Code::Cancelled, "CLIENT_LEFT").fix(fixes::AGAIN),
        ServiceError::Idle(_) => Answer::new(Code::DeadlineExceeded, "IDLE").fix(fixes::CONTINUE),
        ServiceError::Stream(_) | ServiceError::Task(_) | ServiceError::Panicked | ServiceError::NoRandomness => {
            return None;
        }
        ServiceError::Store(error) => return store_answer(error),
        ServiceError::Artifact(error) => return artifact_answer(error),
    })
}

fn store_answer(error: &StoreError) -> Option<Answer> {
    Some(match error {
        StoreError::NotFound { resource } => {
            Answer::new(Code::NotFound, "NOT_FOUND").about("resource", resource).fix(fixes::NAME)
        }
        StoreError::AlreadyExists { resource, .. } => {
            Answer::new(Code::AlreadyExists, "ALREADY_EXISTS").about("resource", resource).fix(fixes::OTHER_NAME)
        }
        StoreError::Precondition { reason, .. } => {
            Answer::new(Code::FailedPrecondition, reason.as_str()).fix(fixes::of_precondition(*reason))
        }
        StoreError::Aborted { reason, .. } => {
            Answer::new(Code::Aborted, reason.as_str()).fix(fixes::of_change(*reason))
        }
        StoreError::LeaseLost => Answer::new(Code::Aborted, "LEASE_LOST").fix(fixes::AGAIN),
        StoreError::QueueFull { .. } => Answer::new(Code::ResourceExhausted, "QUEUE_FULL").retry(QUEUE_RETRY),
        StoreError::OwnerQueueFull { .. } => {
            Answer::new(Code::ResourceExhausted, "OWNER_QUEUE_FULL").retry(QUEUE_RETRY)
        }
        StoreError::DependenciesFull { .. } => {
            Answer::new(Code::ResourceExhausted, "DEPENDENCIES_FULL").retry(QUEUE_RETRY)
        }
        StoreError::OwnerBytes { .. } => Answer::new(Code::ResourceExhausted, "OWNER_STORED_BYTES").retry(DISK_RETRY),
        StoreError::Nul => Answer::new(Code::InvalidArgument, "INVALID_FIELD").fix(fixes::PLAIN_TEXT),
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
        ArtifactError::BadDigest { .. } => {
            Answer::new(Code::InvalidArgument, "INVALID_FIELD").about("field", "digest").fix(fixes::DIGEST)
        }
        ArtifactError::NotFound { digest } => {
            Answer::new(Code::NotFound, "NOT_FOUND").about("resource", digest).fix(fixes::NAME)
        }
        ArtifactError::DataLoss { digest } => {
            Answer::new(Code::DataLoss, "DATA_LOSS").about("resource", digest).fix(fixes::REPAIR)
        }
        ArtifactError::OutOfRange { .. } => {
            Answer::new(Code::OutOfRange, "OUT_OF_RANGE").about("field", "offset_bytes").fix(fixes::OFFSET)
        }
        ArtifactError::WrongOffset { .. } => {
            Answer::new(Code::Aborted, "WRONG_OFFSET").about("field", "start.offset_bytes").fix(fixes::CONTINUE)
        }
        ArtifactError::UploadBusy { digest } => {
            Answer::new(Code::Aborted, "UPLOAD_BUSY").about("resource", digest).retry(UPLOAD_RETRY)
        }
        ArtifactError::WrongSize { .. } => {
            Answer::new(Code::InvalidArgument, "WRONG_SIZE").about("field", "start.size_bytes").fix(fixes::WHOLE_FILE)
        }
        ArtifactError::WrongDigest { .. } => {
            Answer::new(Code::InvalidArgument, "WRONG_DIGEST").about("field", "start.digest").fix(fixes::WHOLE_FILE)
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
        Self { code, reason, about: None, wrong: Vec::new(), wrong_count: 0, retry_after: None, fix: "" }
    }

    fn about(mut self, kind: &'static str, what: &str) -> Self {
        self.about = Some((kind, what.to_owned()));
        self
    }

    fn retry(mut self, after: Duration) -> Self {
        self.retry_after = Some(after);
        self.fix = fixes::RETRY;
        self
    }

    fn fix(mut self, fix: &'static str) -> Self {
        self.fix = fix;
        self
    }

    fn status(self, message: String) -> Status {
        let Self { code, reason, about, wrong, wrong_count, retry_after, fix } = self;
        let (kind, about) = about.unzip();
        let texts = Texts { message, about: about.unwrap_or_default(), wrong };
        fitting(texts, |Texts { message, about, wrong }| {
            let message = if wrong_count > 0 { text_of_wrong(&wrong, wrong_count) } else { message };
            let mut details = ErrorDetails::new();
            if !wrong.is_empty() {
                details.set_bad_request(wrong.into_iter().map(violation).collect::<Vec<_>>());
            }
            let metadata: HashMap<_, _> = kind.iter().map(|&kind| (kind.to_owned(), about.clone())).collect();
            if !fix.is_empty() {
                details.set_localized_message(LOCALE, fix);
            }
            details.set_error_info(reason, DOMAIN, metadata);
            if retry_after.is_some() {
                details.set_retry_info(retry_after);
            }
            Status::with_error_details(code, message, details)
        })
    }
}

/// The status of an error that only HTTP knows.
pub(crate) fn plain(code: Code, reason: &'static str, message: String, fix: &'static str) -> Status {
    Answer::new(code, reason).fix(fix).status(message)
}

/// A wrong field as gRPC writes it: the description is the problem, and the message for users is the fix.
fn violation(wrong: WrongField) -> FieldViolation {
    let fix = LocalizedMessage::new(LOCALE, wrong.fix.text());
    FieldViolation { localized_message: Some(fix), ..FieldViolation::new(wrong.field, wrong.problem) }
}

/// Logs the error with its causes, and sends the client the id of the log entry.
fn internal(error: &ServiceError) -> Status {
    let id = Uuid::now_v7().to_string();
    tracing::error!(id, causes = with_causes(error), "internal error");
    let message = format!("internal error {id}; the cause is in the server's log");
    Answer::new(Code::Internal, "INTERNAL").about("error_id", &id).fix(fixes::REPORT).status(message)
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::sync::Arc;

    #[test]
    fn statuses_name_the_reason_the_field_and_when_to_retry() {
        let status = of(lightpath_service::Field::new("spec").at("distance_m").but("is NaN", "must be …"));
        assert_eq!((status.code(), status.message()), (Code::InvalidArgument, "spec.distance_m is NaN, but must be …"));
        let details = status.get_error_details();
        let violation = &details.bad_request().unwrap().field_violations[0];
        assert_eq!((violation.field.as_str(), violation.description.as_str()), ("spec.distance_m", "is NaN"));
        assert_eq!(violation.localized_message.as_ref().unwrap().message, "must be …");
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
        let wrong = [field.at("width_px").but("is 0", "must be 8"), field.at("height_px").invalid("is 1", "add 7")];
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
