//! Retries after a lost connection.

use crate::Error;
use std::time::Duration;
use tonic::Code;

/// First pause before a retry.
const PAUSE_MIN: Duration = Duration::from_millis(100);

/// Longest pause before a retry.
const PAUSE_MAX: Duration = Duration::from_secs(3);

/// Tries of a call without progress before its error is returned. The pauses between them last about 15 seconds in
/// total.
const TRIES_MAX: u32 = 10;

/// Counts the tries of a call and doubles the pause between them.
#[derive(Debug)]
pub(crate) struct Backoff {
    tries: u32,
    tries_max: u32,
}

impl Backoff {
    /// Allows [`TRIES_MAX`] tries, as for a single call.
    pub(crate) fn new() -> Self {
        Self { tries: 0, tries_max: TRIES_MAX }
    }

    /// Allows `tries_max` tries.
    pub(crate) fn with_tries(tries_max: u32) -> Self {
        Self { tries: 0, tries_max }
    }

    /// Restarts the count after progress.
    pub(crate) fn reset(&mut self) {
        self.tries = 0;
    }

    /// Pauses before a retry. Returns `error` instead if a retry cannot help or no tries are left.
    pub(crate) async fn pause(&mut self, error: Error) -> Result<(), Error> {
        self.tries += 1;
        if !may_succeed_later(&error) || self.tries >= self.tries_max {
            return Err(error);
        }
        tokio::time::sleep(self.pause_length()).await;
        Ok(())
    }

    fn pause_length(&self) -> Duration {
        PAUSE_MIN.saturating_mul(1 << self.tries.saturating_sub(1).min(8)).min(PAUSE_MAX)
    }
}

/// True for errors that may not occur in a retry. ABORTED means that another caller is doing the same; a retry succeeds
/// after that caller has finished.
fn may_succeed_later(error: &Error) -> bool {
    error.is_unreachable() || error.code() == Some(Code::Aborted)
}

#[cfg(test)]
mod tests {
    use super::*;
    use tonic::Status;

    #[test]
    fn pauses_grow_up_to_limit() {
        let pause = |tries| Backoff { tries, tries_max: TRIES_MAX }.pause_length();
        assert_eq!(pause(1), PAUSE_MIN);
        assert_eq!(pause(2), 2 * PAUSE_MIN);
        assert_eq!(pause(1000), PAUSE_MAX);
        let all: Duration = (1..TRIES_MAX).map(pause).sum();
        assert!((10..20).contains(&all.as_secs()), "{all:?}");
    }

    #[tokio::test]
    async fn no_retry_after_last_try_or_refusal() {
        let unavailable = || Error::from_status("http://lab", Status::unavailable("away"));
        assert!(Backoff::with_tries(1).pause(unavailable()).await.is_err());
        assert!(Backoff::with_tries(2).pause(unavailable()).await.is_ok());
        let mut backoff = Backoff::new();
        assert!(backoff.pause(Error::from_status("http://lab", Status::not_found("no"))).await.is_err());
        assert!(backoff.pause(Error::Token).await.is_err());
    }
}
