//! What can go wrong between a client and a server.

use std::error::Error as _;
use std::fmt;
use std::io;
use std::path::PathBuf;
use std::time::Duration;
use tonic::{Code, Status};
use tonic_types::StatusExt as _;

/// Shorthand for this crate's results.
pub type Result<T> = std::result::Result<T, Error>;

/// Why a call gave no result.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// The server's address is unusable.
    #[error("server URL \"{url}\" {reason}")]
    Url {
        /// What was given.
        url: String,
        /// What is wrong with it, and the fix.
        reason: String,
    },
    /// The access token is unusable.
    #[error("the access token is empty or has characters outside printable ASCII")]
    Token,
    /// No connection, or it broke, or the server is shutting down. The call may succeed later.
    #[error("server {url} could not be reached: {reason}")]
    Unreachable {
        /// The server's address.
        url: String,
        /// What happened, as precisely as is known.
        reason: String,
        /// The status that the call ended with.
        status: Status,
    },
    /// The server answered no.
    #[error(transparent)]
    Refused(#[from] Refusal),
    /// The job ended without the result that was asked for.
    #[error("{job} {ending}")]
    JobUnsuccessful {
        /// `jobs/{id}`.
        job: String,
        /// How it ended, with the reason.
        ending: String,
    },
    /// What arrived is not what its digest promises.
    #[error("the bytes of {digest} arrived damaged (they hash to {found}); try again")]
    Damaged {
        /// The digest asked for.
        digest: String,
        /// The digest of what arrived.
        found: String,
    },
    /// An answer breaks the API's rules.
    #[error("the server's answer makes no sense: {what}; client and server may be of different versions")]
    Protocol {
        /// What is wrong.
        what: &'static str,
    },
    /// A local file could not be read or written.
    #[error("could not {action} {}: {source}", path.display())]
    File {
        /// `read`, `write`, …
        action: &'static str,
        /// Which file.
        path: PathBuf,
        /// What the system said.
        source: io::Error,
    },
}

/// The server's refusal. Shown as its code and message, then a line for each field and for the retry delay.
#[derive(Debug)]
pub struct Refusal {
    /// The status with all its details.
    pub status: Status,
    /// Which fields of the request are wrong, where the server said so.
    pub fields: Vec<FieldViolation>,
    /// When the call may be tried again, where the server said so.
    pub retry_delay: Option<Duration>,
    /// A stable word for programs, for example `QUEUE_FULL`; empty where the server gave none.
    pub reason: String,
}

/// One wrong field of a request.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct FieldViolation {
    /// Path of the field, for example `display.pixel_pitch_m`.
    pub field: String,
    /// What is wrong and what would be right.
    pub description: String,
}

impl Error {
    pub(crate) fn from_status(url: &str, status: Status) -> Self {
        if is_unreachable(&status) {
            let reason = unreachable_reason(&status);
            return Self::Unreachable { url: url.to_owned(), reason, status };
        }
        Self::Refused(Refusal::from(status))
    }

    pub(crate) fn file(action: &'static str, path: &std::path::Path, source: io::Error) -> Self {
        Self::File { action, path: path.to_owned(), source }
    }

    /// The gRPC code that the call ended with, where it got as far as a server or a connection.
    #[must_use]
    pub fn code(&self) -> Option<Code> {
        match self {
            Self::Unreachable { status, .. } => Some(status.code()),
            Self::Refused(refusal) => Some(refusal.status.code()),
            Self::Url { .. }
            | Self::Token
            | Self::JobUnsuccessful { .. }
            | Self::Damaged { .. }
            | Self::Protocol { .. }
            | Self::File { .. } => None,
        }
    }

    /// No server answered, or it is shutting down: the same call may succeed later.
    #[must_use]
    pub fn is_unreachable(&self) -> bool {
        matches!(self, Self::Unreachable { .. })
    }
}

impl From<Status> for Refusal {
    fn from(status: Status) -> Self {
        let details = status.get_error_details();
        let fields = details.bad_request().map_or_else(Vec::new, |bad| {
            let field = |v: &tonic_types::FieldViolation| FieldViolation {
                field: v.field.clone(),
                description: v.description.clone(),
            };
            bad.field_violations.iter().map(field).collect()
        });
        let retry_delay = details.retry_info().and_then(|retry| retry.retry_delay);
        let reason = details.error_info().map_or_else(String::new, |info| info.reason.clone());
        Self { status, fields, retry_delay, reason }
    }
}

impl fmt::Display for Refusal {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}: {}", code_name(self.status.code()), self.status.message())?;
        for field in &self.fields {
            // A single violation is usually the message itself.
            if !self.status.message().contains(&field.description) || !self.status.message().contains(&field.field) {
                write!(f, "\n  {}: {}", field.field, field.description)?;
            }
        }
        if let Some(delay) = self.retry_delay {
            write!(f, "\n  try again in {} s", delay.as_secs_f64().ceil())?;
        }
        Ok(())
    }
}

impl std::error::Error for Refusal {}

/// Broken connections come as UNAVAILABLE, or as other codes with a transport error behind them.
fn is_unreachable(status: &Status) -> bool {
    let from_transport = status.source().is_some_and(|source| {
        source.is::<tonic::transport::Error>() || source.is::<tonic::Status>() || source.is::<io::Error>()
    });
    status.code() == Code::Unavailable || from_transport || is_broken_stream(status)
}

/// A connection that breaks in the middle of a stream, as hyper and h2 report it through tonic.
fn is_broken_stream(status: &Status) -> bool {
    matches!(status.code(), Code::Unknown | Code::Internal | Code::Cancelled)
        && [
            "h2 protocol error",
            "transport error",
            "error reading a body",
            "connection error",
            "operation was canceled",
        ]
        .iter()
        .any(|sign| status.message().contains(sign))
}

/// The innermost cause: "Connection refused" says more than "transport error".
fn unreachable_reason(status: &Status) -> String {
    let mut reason = status.message().to_owned();
    let mut source = status.source();
    while let Some(cause) = source {
        reason = cause.to_string();
        source = cause.source();
    }
    reason
}

/// The code as the API's documentation writes it.
fn code_name(code: Code) -> &'static str {
    match code {
        Code::Ok => "OK",
        Code::Cancelled => "CANCELLED",
        Code::Unknown => "UNKNOWN",
        Code::InvalidArgument => "INVALID_ARGUMENT",
        Code::DeadlineExceeded => "DEADLINE_EXCEEDED",
        Code::NotFound => "NOT_FOUND",
        Code::AlreadyExists => "ALREADY_EXISTS",
        Code::PermissionDenied => "PERMISSION_DENIED",
        Code::ResourceExhausted => "RESOURCE_EXHAUSTED",
        Code::FailedPrecondition => "FAILED_PRECONDITION",
        Code::Aborted => "ABORTED",
        Code::OutOfRange => "OUT_OF_RANGE",
        Code::Unimplemented => "UNIMPLEMENTED",
        Code::Internal => "INTERNAL",
        Code::Unavailable => "UNAVAILABLE",
        Code::DataLoss => "DATA_LOSS",
        Code::Unauthenticated => "UNAUTHENTICATED",
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use tonic_types::ErrorDetails;

    #[test]
    fn a_refusal_shows_code_message_fields_and_delay() {
        let mut details = ErrorDetails::with_bad_request_violation("job.seed", "must be a number");
        details.set_retry_info(Some(Duration::from_millis(1500)));
        details.set_error_info("BAD_FIELD", "lightpath", std::collections::HashMap::new());
        let status = Status::with_error_details(Code::InvalidArgument, "the request is wrong", details);
        let Error::Refused(refusal) = Error::from_status("http://lab", status) else { panic!("not refused") };
        assert_eq!(refusal.reason, "BAD_FIELD");
        assert_eq!(
            refusal.to_string(),
            "INVALID_ARGUMENT: the request is wrong\n  job.seed: must be a number\n  try again in 2 s"
        );
    }

    #[test]
    fn a_violation_that_is_the_message_is_not_shown_twice() {
        let details = ErrorDetails::with_bad_request_violation("distance_m", "is NaN, but must be finite");
        let status =
            Status::with_error_details(Code::InvalidArgument, "distance_m is NaN, but must be finite", details);
        assert_eq!(Refusal::from(status).to_string(), "INVALID_ARGUMENT: distance_m is NaN, but must be finite");
    }

    #[test]
    fn unavailable_is_unreachable() {
        let error = Error::from_status("http://lab", Status::unavailable("draining"));
        assert!(error.is_unreachable());
        assert_eq!(error.to_string(), "server http://lab could not be reached: draining");
        assert_eq!(error.code(), Some(Code::Unavailable));
    }
}
