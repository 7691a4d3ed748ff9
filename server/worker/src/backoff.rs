//! Pauses before a failed attempt is repeated.
//!
//! ```text
//! delay = min(first · 2^(attempt − 1), max) · u,    u uniform in [½, 1)
//! ```
//!
//! `first` depends on the error: a full disk needs an operator to make room, a panic is most likely a bug that happens
//! again, and other errors may pass soon. The random factor spreads the retries of jobs that failed together (on a full
//! disk, for example).

use lightpath_domain::job::FailureReason;
use std::time::Duration;
use uuid::Uuid;

/// Exponential backoff with jitter.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Backoff {
    /// Pause after the first attempt, for most errors.
    pub first: Duration,
    /// Pause after the first attempt that found the disk full.
    pub first_disk_full: Duration,
    /// Pause after the first attempt that panicked.
    pub first_panic: Duration,
    /// Longest pause.
    pub max: Duration,
}

impl Default for Backoff {
    fn default() -> Self {
        Self {
            first: Duration::from_secs(2),
            first_disk_full: Duration::from_secs(15),
            first_panic: Duration::from_secs(10),
            max: Duration::from_secs(300),
        }
    }
}

impl Backoff {
    /// Backoff with the same pauses for all errors.
    #[must_use]
    pub fn uniform(first: Duration, max: Duration) -> Self {
        Self { first, first_disk_full: first, first_panic: first, max }
    }

    /// The pause after attempt number `attempt` (from 1), which failed for `reason`.
    #[must_use]
    pub fn delay(&self, reason: FailureReason, attempt: u32) -> Duration {
        let doublings = attempt.saturating_sub(1).min(31);
        let first = match reason {
            FailureReason::DiskFull => self.first_disk_full,
            FailureReason::Panic => self.first_panic,
            _ => self.first,
        };
        let full = first.saturating_mul(1 << doublings).min(self.max);
        // The last bits of a UUID v7 are random, which is enough for jitter and avoids another random generator.
        let random = (Uuid::now_v7().as_u128() & 0xffff_ffff) as f64 / f64::from(u32::MAX);
        full.mul_f64(0.5 + 0.5 * random)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pauses_double_until_the_longest_pause() {
        let backoff = Backoff { max: Duration::from_secs(60), ..Backoff::default() };
        for (attempt, full_s) in [(1, 2.0), (2, 4.0), (3, 8.0), (6, 60.0), (1000, 60.0)] {
            for _ in 0..20 {
                let delay_s = backoff.delay(FailureReason::Io, attempt).as_secs_f64();
                assert!((full_s / 2.0..=full_s).contains(&delay_s), "attempt {attempt}: {delay_s} s");
            }
        }
        assert!(
            backoff.delay(FailureReason::DiskFull, 1) >= Duration::from_millis(7500),
            "an operator has to make room"
        );
        assert!(backoff.delay(FailureReason::Panic, 1) >= Duration::from_secs(5));
    }
}
