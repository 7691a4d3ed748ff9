//! Reports to the server: which version the device uses, and which one it gave up.

use crate::http::{Http, one_line, user_agent};
use crate::problem::Problem;
use crate::schedule::Backoff;
use crate::settings::Pace;
use crate::{Settings, log};
use serde_json::json;
use std::time::{Duration, Instant};

/// Limit on the length of the message \[bytes\]. It is the server's.
const MESSAGE_BYTES_MAX: usize = 1024;

/// What a report says.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct Standing {
    /// Id of the kernel.
    pub(crate) kernel: String,
    /// Version in use; `None`: the device uses none.
    pub(crate) version: Option<u32>,
    /// Digest of its file; empty: none.
    pub(crate) digest: String,
    /// Highest generation that was accepted.
    pub(crate) generation: u64,
    /// Version that was given up; `None`: none was.
    pub(crate) tried_version: Option<u32>,
    /// Why; also what else the server should know.
    pub(crate) message: String,
    /// What the self-test printed about the version in use.
    pub(crate) loss: Option<f64>,
}

impl Standing {
    /// The report in protobuf's JSON form, in which a 64-bit number is a text.
    fn json(&self, settings: &Settings) -> String {
        let mut json = json!({
            "kernel": self.kernel,
            "format": if self.version.is_none() { "" } else { settings.format.as_str() },
            "digest": self.digest,
            "generation": self.generation.to_string(),
            "message": shortened(&one_line(&self.message, MESSAGE_BYTES_MAX)),
            "agent": user_agent(),
        });
        if let Some(version) = self.version {
            json["version"] = version.into();
        }
        if let Some(version) = self.tried_version {
            json["triedVersion"] = version.into();
        }
        if let Some(loss) = self.loss {
            json["selfTestLoss"] = loss.into();
        }
        json.to_string()
    }

    /// The standing without the numbers in its message: these change with each try.
    fn without_numbers(&self) -> Self {
        let message = self.message.chars().filter(|character| !character.is_ascii_digit()).collect();
        Self { message, ..self.clone() }
    }
}

/// Sends reports when something has changed, and from time to time.
#[derive(Debug)]
pub(crate) struct Reporter {
    interval: Duration,
    backoff: Backoff,
    due: Instant,
    last: Option<Standing>,
}

impl Reporter {
    pub(crate) fn new(pace: &Pace) -> Self {
        let backoff = Backoff::new(pace.error_pause_min, pace.error_pause_max);
        Self { interval: pace.report_interval, backoff, due: Instant::now(), last: None }
    }

    /// Time until the next report.
    pub(crate) fn due_in(&self) -> Duration {
        self.due.saturating_duration_since(Instant::now())
    }

    /// Sends a report if one is due. A failure is logged, and the report is sent again later.
    pub(crate) fn send(&mut self, standing: &Standing, http: &Http, settings: &Settings) {
        let key = standing.without_numbers();
        if self.last.as_ref() != Some(&key) {
            self.due = Instant::now();
            self.backoff.reset();
        }
        if !self.due_in().is_zero() {
            return;
        }
        self.last = Some(key);
        let pause = match http.report(&standing.json(settings)) {
            Ok(()) => {
                self.backoff.reset();
                self.interval
            }
            Err(Problem::Refused { status, message, retry_after: None, .. }) if (400..500).contains(&status) => {
                // The same report would be refused again.
                log::line(format_args!("the server takes no report of this device ({status}: {message})"));
                self.interval
            }
            Err(problem) => {
                log::line(format_args!("the agent could not send its report: {problem}"));
                self.backoff.next().max(problem.retry_after().unwrap_or_default())
            }
        };
        self.due = Instant::now() + pause;
    }
}

/// The beginning of a message, within the limit of a report.
pub(crate) fn shortened(message: &str) -> &str {
    let mut end = message.len().min(MESSAGE_BYTES_MAX);
    while !message.is_char_boundary(end) {
        end -= 1;
    }
    &message[..end]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn messages_are_cut_between_characters() {
        assert_eq!(shortened("wrong"), "wrong");
        assert_eq!(shortened(&"µ".repeat(600)), "µ".repeat(512));
        assert_eq!(shortened(&("x".to_owned() + &"µ".repeat(600))).len(), 1023);
    }
}
