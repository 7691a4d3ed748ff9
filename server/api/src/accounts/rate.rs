//! Rate limit of each client by the generic cell rate algorithm (ITU-T I.371).
//!
//! ```text
//! a call at time t is accepted if  A ≤ t + τ,   and then  A ← max(A, t) + T
//! ```
//!
//! T = 1/rate is the time between calls, times the number of servers that share the limit; τ = burst · T is how far a
//! caller may be ahead; A is the theoretical arrival time of the next call.

use lightpath_service::Client;
use std::collections::HashMap;
use std::sync::atomic::{AtomicU32, Ordering};
use std::sync::{Mutex, PoisonError};
use std::time::{Duration, Instant};

/// Burst after a pause, in seconds of calls at the allowed rate.
const BURST_S: f64 = 2.0;
/// Limit on the remembered clients. Above it, clients who are not ahead of their rate are forgotten.
const CLIENTS_MAX: usize = 10_000;

/// State of the rate limit of all clients.
#[derive(Debug)]
pub struct Rate {
    /// T, the time between calls; `None`: no limit.
    cost: Option<Duration>,
    /// Number of servers that share the limit.
    servers: AtomicU32,
    tolerance: Duration,
    /// A of each client. Locked only for a lookup and an addition.
    arrivals: Mutex<HashMap<Client, Instant>>,
}

impl Rate {
    /// Limits each client to this many calls a second; 0: no limit.
    pub fn new(calls_per_s: u32) -> Self {
        let cost = (calls_per_s > 0).then(|| Duration::from_secs(1) / calls_per_s);
        let tolerance = Duration::from_secs_f64(BURST_S);
        Self { cost, servers: AtomicU32::new(1), tolerance, arrivals: Mutex::default() }
    }

    /// Gives each client this server's part of the limit, one of `servers` equal ones.
    pub fn share_among(&self, servers: u32) {
        self.servers.store(servers.max(1), Ordering::Relaxed);
    }

    /// Accepts a call, or returns the time after which the client may retry.
    pub fn admit(&self, client: &Client, now: Instant) -> Result<(), Duration> {
        let Some(cost) = self.cost else { return Ok(()) };
        let cost = cost * self.servers.load(Ordering::Relaxed);
        let mut arrivals = self.arrivals.lock().unwrap_or_else(PoisonError::into_inner);
        if arrivals.len() >= CLIENTS_MAX && !arrivals.contains_key(client) {
            arrivals.retain(|_, arrival| *arrival > now);
        }
        let arrival = arrivals.get(client).copied().unwrap_or(now).max(now);
        let ahead = arrival - now;
        if ahead > self.tolerance {
            return Err(ahead - self.tolerance);
        }
        // The table is full of clients who are ahead of their rate, so a new client must wait.
        if arrivals.len() >= CLIENTS_MAX && !arrivals.contains_key(client) {
            return Err(self.tolerance);
        }
        arrivals.insert(client.clone(), arrival + cost);
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn client(name: &str) -> Client {
        Client::Token(name.to_owned())
    }

    #[test]
    fn bursts_are_accepted_and_floods_are_refused() {
        let (rate, start) = (Rate::new(100), Instant::now());
        let accepted = (0..1000).filter(|_| rate.admit(&client("ada"), start).is_ok()).count();
        assert!((200..=201).contains(&accepted), "{accepted}");
        assert!(rate.admit(&client("bob"), start).is_ok(), "each client has its own limit");
        let pause = rate.admit(&client("ada"), start).unwrap_err();
        assert!(rate.admit(&client("ada"), start + pause).is_ok());
        let later = start + Duration::from_secs(60);
        let accepted =
            (0..1000).filter(|n| rate.admit(&client("ada"), later + Duration::from_millis(11) * *n).is_ok()).count();
        assert_eq!(accepted, 1000, "calls below the rate are accepted");
        assert!((0..10_000).all(|_| Rate::new(0).admit(&client("ada"), start).is_ok()));
    }

    #[test]
    fn servers_share_the_limit() {
        let (rate, start) = (Rate::new(100), Instant::now());
        let accepted = |name: &str| (0..1000).filter(|_| rate.admit(&client(name), start).is_ok()).count();
        rate.share_among(4);
        assert!((50..=51).contains(&accepted("ada")));
        rate.share_among(0);
        assert!((200..=201).contains(&accepted("bob")), "this server lives");
    }

    #[test]
    fn number_of_remembered_clients_is_bounded() {
        let (rate, start) = (Rate::new(1), Instant::now());
        for n in 0..2 * CLIENTS_MAX {
            let _ = rate.admit(&client(&n.to_string()), start);
        }
        assert!(rate.arrivals.lock().unwrap().len() <= CLIENTS_MAX);
        assert!(rate.admit(&client("later"), start + Duration::from_secs(60)).is_ok());
    }
}
