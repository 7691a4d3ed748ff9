//! When to repeat a failed attempt.
//!
//! ```text
//! delay = min(first · 2^(attempt − 1), max) · u,    u uniform in [½, 1)
//! ```
//!
//! Jobs that failed together (on a full disk, say) come back apart from each other.

use std::time::Duration;
use uuid::Uuid;

/// Exponential, with jitter.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Backoff {
    /// After the first attempt.
    pub first: Duration,
    /// At most.
    pub max: Duration,
}

impl Default for Backoff {
    fn default() -> Self {
        Self { first: Duration::from_secs(2), max: Duration::from_secs(300) }
    }
}

impl Backoff {
    /// The pause after attempt number `attempt` (from 1).
    #[must_use]
    pub fn delay(&self, attempt: u32) -> Duration {
        let doublings = attempt.saturating_sub(1).min(31);
        let full = self.first.saturating_mul(1 << doublings).min(self.max);
        // The last bits of a UUID v7 are random: enough for jitter, without a generator of its own.
        let random = (Uuid::now_v7().as_u128() & 0xffff_ffff) as f64 / f64::from(u32::MAX);
        full.mul_f64(0.5 + 0.5 * random)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pauses_double_up_to_the_longest() {
        let backoff = Backoff { first: Duration::from_secs(2), max: Duration::from_secs(60) };
        for (attempt, full_s) in [(1, 2.0), (2, 4.0), (3, 8.0), (6, 60.0), (1000, 60.0)] {
            for _ in 0..20 {
                let delay_s = backoff.delay(attempt).as_secs_f64();
                assert!((full_s / 2.0..=full_s).contains(&delay_s), "attempt {attempt}: {delay_s} s");
            }
        }
    }
}
