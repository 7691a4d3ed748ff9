//! Pauses between tries.

use std::time::Duration;

/// Pauses that double after each error, up to a limit. Each is shortened by a random part, so that devices which lost
/// the same server do not come back together.
#[derive(Debug)]
pub(crate) struct Backoff {
    min: Duration,
    max: Duration,
    errors: u32,
}

impl Backoff {
    pub(crate) fn new(min: Duration, max: Duration) -> Self {
        Self { min, max, errors: 0 }
    }

    /// Starts again with the shortest pause.
    pub(crate) fn reset(&mut self) {
        self.errors = 0;
    }

    /// The pause after one more error.
    pub(crate) fn next(&mut self) -> Duration {
        let full = self.min.saturating_mul(1 << self.errors.min(20)).min(self.max);
        self.errors = self.errors.saturating_add(1);
        // Without random numbers all devices pause equally long, which is no reason to stop.
        let random = getrandom::u32().unwrap_or(u32::MAX);
        full.mul_f64(0.5 + 0.5 * f64::from(random) / f64::from(u32::MAX))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pauses_double_up_to_a_limit_and_differ() {
        let (min, max) = (Duration::from_secs(5), Duration::from_secs(300));
        let mut backoff = Backoff::new(min, max);
        for errors in 0..40 {
            let full = min.saturating_mul(1 << errors.min(10)).min(max);
            let pause = backoff.next();
            assert!(pause >= full / 2 && pause <= full, "{errors}: {pause:?}");
        }
        let differ: std::collections::BTreeSet<_> = (0..10).map(|_| backoff.next()).collect();
        assert!(differ.len() > 5);
        backoff.reset();
        assert!(backoff.next() <= min);
    }
}
