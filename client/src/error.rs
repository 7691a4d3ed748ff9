//! The errors of this crate.

use lightpath_proto::code_name;
use std::error::Error as _;
use std::fmt;
use std::io;
use std::path::PathBuf;
use std::time::Duration;
use tonic::{Code, Status};
use tonic_types::StatusExt as _;

/// A result with this crate's [`Error`].
pub type Result<T> = std::result::Result<T, Error>;

/// An error of a call, or of a file that the call needs; the messages say what each means.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
#[allow(missing_docs)]
pub enum Error {
    /// The server's address is malformed, or its certificates cannot be used.
    #[error("server URL \"{url}\" {reason}")]
    Url { url: String, reason: String },
    #[error(
        "the access token is empty or has characters other than printable ASCII; use a token of `lightpathd token create`"
    )]
    Token,
    /// The token would go unencrypted to another machine.
    #[error(
        "the access token would go unencrypted to {url}: use https://, or allow it (--token-over-http, LIGHTPATH_TOKEN_OVER_HTTP=true) if \
         nobody else is on the network"
    )]
    OpenToken { url: String },
    /// No server answered, the connection was lost, or the server is shutting down. The call may succeed later.
    #[error("server {url} could not be reached: {reason}")]
    Unreachable {
        url: String,
        /// The innermost known cause.
        reason: String,
        /// The gRPC status of the call.
        status: Status,
    },
    #[error(transparent)]
    Refused(#[from] Refusal),
    /// The job has no result, because it failed, was cancelled or has not ended.
    #[error("{job} {ending}")]
    JobUnsuccessful {
        /// `jobs/{id}`.
        job: String,
        ending: String,
    },
    #[error("the bytes of {digest} arrived damaged: their digest is {found}; try again")]
    Damaged { digest: String, found: String },
    #[error("the server's answer is invalid: {what}; client and server may have different versions")]
    Protocol { what: &'static str },
    #[error("could not {action} {}: {source}", path.display())]
    File {
        /// The action that failed: `read`, `write`, …
        action: &'static str,
        path: PathBuf,
        source: io::Error,
    },
}

/// A refusal by the server. Its text is the code and the message, which names all wrong fields, then the retry delay.
#[derive(Debug)]
pub struct Refusal {
    /// The gRPC status with all details.
    pub status: Status,
    /// The wrong fields of the request. Empty if the server named none.
    pub fields: Vec<FieldViolation>,
    /// Time to wait before a retry, if the server gave one.
    pub retry_delay: Option<Duration>,
    /// Reason as a stable word for programs, for example `QUEUE_FULL`. Empty if the server gave none.
    pub reason: String,
}

/// A wrong field of a request.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct FieldViolation {
    /// Path of the field, for example `display.pixel_pitch_m`.
    pub field: String,
    /// What is wrong, such as the value that was given.
    pub problem: String,
    /// What to do, such as the values that are allowed.
    pub fix: String,
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

    /// The gRPC code of the call. `None` for errors that arose on the client's side.
    #[must_use]
    pub fn code(&self) -> Option<Code> {
        match self {
            Self::Unreachable { status, .. } => Some(status.code()),
            Self::Refused(refusal) => Some(refusal.status.code()),
            Self::Url { .. }
            | Self::Token
            | Self::OpenToken { .. }
            | Self::JobUnsuccessful { .. }
            | Self::Damaged { .. }
            | Self::Protocol { .. }
            | Self::File { .. } => None,
        }
    }

    /// True if no server answered or the server is shutting down. The same call may succeed later.
    #[must_use]
    pub fn is_unreachable(&self) -> bool {
        matches!(self, Self::Unreachable { .. })
    }
}

impl Error {
    /// Time after which to ask again for a file that the server is making; `None` for other errors.
    pub(crate) fn converting(&self) -> Option<Duration> {
        let Self::Unreachable { status, .. } = self else { return None };
        let refusal = Refusal::from(status.clone());
        refusal.retry_delay.filter(|_| refusal.reason == "CONVERTING")
    }
}

impl Refusal {
    /// What to do, for people. Empty if the wrong fields have their own fixes, or the server gave none.
    #[must_use]
    pub fn fix(&self) -> String {
        let details = self.status.get_error_details();
        details.localized_message().map_or_else(String::new, |fix| fix.message.clone())
    }

    /// Name of the resource that does not exist, such as `displays/lab`. Empty if that was not the reason of the refusal,
    /// or not the only one.
    #[must_use]
    pub fn missing_resource(&self) -> String {
        let details = self.status.get_error_details();
        let subject = details.error_info().and_then(|info| info.metadata.get("resource").cloned());
        subject.filter(|_| self.status.code() == Code::NotFound).unwrap_or_default()
    }
}

impl From<Status> for Refusal {
    fn from(status: Status) -> Self {
        let details = status.get_error_details();
        let fields = details.bad_request().map_or_else(Vec::new, |bad| {
            let field = |v: &tonic_types::FieldViolation| FieldViolation {
                field: v.field.clone(),
                problem: v.description.clone(),
                fix: v.localized_message.as_ref().map_or_else(String::new, |fix| fix.message.clone()),
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
            // If the message has the field already, do not repeat it.
            if !self.status.message().contains(&field.field) {
                write!(f, "\n  {}: {}", field.field, field.problem)?;
            }
        }
        if let Some(delay) = self.retry_delay {
            write!(f, "\n  try again in {} s", delay.as_secs_f64().ceil())?;
        }
        Ok(())
    }
}

impl std::error::Error for Refusal {}

/// True for a lost connection. tonic reports it as UNAVAILABLE, or as another code with a transport error as its
/// source.
fn is_unreachable(status: &Status) -> bool {
    let from_transport = status.source().is_some_and(|source| {
        source.is::<tonic::transport::Error>() || source.is::<tonic::Status>() || source.is::<io::Error>()
    });
    status.code() == Code::Unavailable || from_transport || is_broken_stream(status)
}

/// True for a connection that was lost in the middle of a stream. hyper and h2 report it only in the text of the
/// message.
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

/// The innermost cause, such as "Connection refused". The outer text, such as "transport error", is less precise.
fn unreachable_reason(status: &Status) -> String {
    let mut reason = status.message().to_owned();
    let mut source = status.source();
    while let Some(cause) = source {
        reason = cause.to_string();
        source = cause.source();
    }
    reason
}

#[cfg(test)]
mod tests {
    use super::*;
    use tonic_types::ErrorDetails;

    #[test]
    fn refusal_shows_code_message_fields_and_delay() {
        let mut details = ErrorDetails::with_bad_request_violation("job.seed", "must be a number");
        details.set_retry_info(Some(Duration::from_millis(1500)));
        details.set_error_info("BAD_FIELD", "lightpath", std::collections::HashMap::new());
        details.set_localized_message("en", "give a number");
        let status = Status::with_error_details(Code::InvalidArgument, "the request is wrong", details);
        let Error::Refused(refusal) = Error::from_status("http://lab", status) else { panic!("not refused") };
        assert_eq!((refusal.reason.as_str(), refusal.fix().as_str()), ("BAD_FIELD", "give a number"));
        assert_eq!(
            refusal.to_string(),
            "INVALID_ARGUMENT: the request is wrong\n  job.seed: must be a number\n  try again in 2 s"
        );
    }

    #[test]
    fn violation_in_message_is_not_repeated() {
        let details = ErrorDetails::with_bad_request_violation("distance_m", "is NaN, but must be finite");
        let status =
            Status::with_error_details(Code::InvalidArgument, "distance_m is NaN, but must be finite", details);
        assert_eq!(Refusal::from(status).to_string(), "INVALID_ARGUMENT: distance_m is NaN, but must be finite");
    }

    #[test]
    fn unavailable_server_counts_as_unreachable() {
        let error = Error::from_status("http://lab", Status::unavailable("draining"));
        assert!(error.is_unreachable());
        assert_eq!(error.to_string(), "server http://lab could not be reached: draining");
        assert_eq!(error.code(), Some(Code::Unavailable));
    }
}
