//! Rate limit by the generic cell rate algorithm (ITU-T I.371), for each token or, without a token, for each address.
//!
//! ```text
//! a call at time t is accepted if  A ≤ t + τ,   and then  A ← max(A, t) + T
//! ```
//!
//! T = 1/rate is the time between calls; τ = burst · T is how far a caller may be ahead; A is the theoretical arrival
//! time of the next call.

use std::collections::HashMap;
use std::sync::{Mutex, PoisonError};
use std::time::{Duration, Instant};

/// Burst after a pause, in seconds of calls at the allowed rate.
const BURST_S: f64 = 2.0;
/// Limit on the remembered callers. Above it, callers who are not ahead of their rate are forgotten.
const CALLERS_MAX: usize = 10_000;

/// State of the rate limit of all callers.
#[derive(Debug)]
pub struct Rate {
    /// T, the time between calls; `None`: no limit.
    cost: Option<Duration>,
    tolerance: Duration,
    /// A of each caller. Locked only for a lookup and an addition.
    arrivals: Mutex<HashMap<String, Instant>>,
}

impl Rate {
    /// Limits each caller to this many calls a second; 0: no limit.
    pub fn new(calls_per_s: u32) -> Self {
        let cost = (calls_per_s > 0).then(|| Duration::from_secs(1) / calls_per_s);
        Self { cost, tolerance: Duration::from_secs_f64(BURST_S), arrivals: Mutex::default() }
    }

    /// Accepts a call, or returns the time after which the caller may retry.
    pub fn admit(&self, caller: &str, now: Instant) -> Result<(), Duration> {
        let Some(cost) = self.cost else { return Ok(()) };
        let mut arrivals = self.arrivals.lock().unwrap_or_else(PoisonError::into_inner);
        if arrivals.len() >= CALLERS_MAX && !arrivals.contains_key(caller) {
            arrivals.retain(|_, arrival| *arrival > now);
        }
        let arrival = arrivals.get(caller).copied().unwrap_or(now).max(now);
        let ahead = arrival - now;
        if ahead > self.tolerance {
            return Err(ahead - self.tolerance);
        }
        // The table is full of callers who are ahead of their rate, so a new caller must wait.
        if arrivals.len() >= CALLERS_MAX && !arrivals.contains_key(caller) {
            return Err(self.tolerance);
        }
        arrivals.insert(caller.to_owned(), arrival + cost);
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bursts_are_accepted_and_floods_are_refused() {
        let (rate, start) = (Rate::new(100), Instant::now());
        let accepted = (0..1000).filter(|_| rate.admit("ada", start).is_ok()).count();
        assert!((200..=201).contains(&accepted), "{accepted}");
        assert!(rate.admit("bob", start).is_ok(), "each caller has its own limit");
        let pause = rate.admit("ada", start).unwrap_err();
        assert!(rate.admit("ada", start + pause).is_ok());
        let later = start + Duration::from_secs(60);
        let accepted = (0..1000).filter(|n| rate.admit("ada", later + Duration::from_millis(11) * *n).is_ok()).count();
        assert_eq!(accepted, 1000, "calls below the rate are accepted");
        assert!((0..10_000).all(|_| Rate::new(0).admit("ada", start).is_ok()));
    }

    #[test]
    fn number_of_remembered_callers_is_bounded() {
        let (rate, start) = (Rate::new(1), Instant::now());
        for n in 0..2 * CALLERS_MAX {
            let _ = rate.admit(&n.to_string(), start);
        }
        assert!(rate.arrivals.lock().unwrap().len() <= CALLERS_MAX);
        assert!(rate.admit("later", start + Duration::from_secs(60)).is_ok());
    }
}
