//! Trying again after a break.

use crate::Error;
use std::time::Duration;
use tonic::Code;

/// First pause after a break.
const PAUSE_MIN: Duration = Duration::from_millis(100);

/// Longest pause between two tries.
const PAUSE_MAX: Duration = Duration::from_secs(3);

/// Tries of a call that makes no headway, before its error is returned: about 15 seconds of pauses.
const TRIES_MAX: u32 = 10;

/// Counts tries and grows the pause between them.
#[derive(Debug)]
pub(crate) struct Backoff {
    tries: u32,
    tries_max: u32,
}

impl Backoff {
    /// For calls: gives up after [`TRIES_MAX`].
    pub(crate) fn new() -> Self {
        Self { tries: 0, tries_max: TRIES_MAX }
    }

    /// Gives up after `tries_max`.
    pub(crate) fn with_tries(tries_max: u32) -> Self {
        Self { tries: 0, tries_max }
    }

    /// There was headway: the count starts over.
    pub(crate) fn reset(&mut self) {
        self.tries = 0;
    }

    /// Pauses where it makes sense to try again after `error`; hands it back otherwise.
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

/// ABORTED means that somebody else is at it: after a pause it is done, or our turn.
fn may_succeed_later(error: &Error) -> bool {
    error.is_unreachable() || error.code() == Some(Code::Aborted)
}

#[cfg(test)]
mod tests {
    use super::*;
    use tonic::Status;

    #[tokio::test(start_paused = true)]
    async fn pauses_grow_and_end() {
        let mut backoff = Backoff::new();
        let mut pauses = 0;
        let started = tokio::time::Instant::now();
        while backoff.pause(Error::from_status("http://lab", Status::unavailable("away"))).await.is_ok() {
            pauses += 1;
        }
        assert_eq!(pauses, TRIES_MAX - 1);
        assert!((10..30).contains(&started.elapsed().as_secs()), "{:?}", started.elapsed());
    }

    #[tokio::test(start_paused = true)]
    async fn a_refusal_is_final() {
        let mut backoff = Backoff::new();
        assert!(backoff.pause(Error::from_status("http://lab", Status::not_found("no"))).await.is_err());
        assert!(backoff.pause(Error::Token).await.is_err());
    }
}
