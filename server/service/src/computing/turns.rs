//! Fair turns for computations: decoding a picture, converting a kernel, comparing the pairs of a dataset.
//!
//! Each computation says how much memory it needs, and waits until that memory and a thread are free. Of the clients
//! that wait, the one whose computations took the least time lately has the next turn:
//!
//! ```text
//! spent(t) = Σ over computations of  duration · ½^((t − end) / 10 s)
//! ```
//!
//! So a client with many or long computations delays only itself. Some threads and memory are kept for small computations
//! of clients that spent little: a computation with little memory ends soon, so that even where clients take all other
//! threads for long ones, small ones wait for milliseconds. A turn belongs to the computation, not to the call: a call that
//! its client has cancelled gives back its memory when its computation has really ended.

use crate::client::Client;
use crate::error::{LimitReason, Result, ServiceError};
use std::collections::{HashMap, VecDeque};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};
use tokio::sync::oneshot;

/// Share of the memory that one client may use, so that one client cannot keep out all others.
const CLIENT_SHARE: u64 = 2;
/// Spent time from which a client has no right to the threads and the memory that are kept for others \[s\].
const MUCH_S: f64 = 0.5;
/// Computations for which threads are kept.
const KEPT_AT_ONCE: usize = 2;
/// Part of the memory that is kept for small computations: one over this number.
const KEPT_MEMORY: u64 = 4;
/// Limit on the waiting computations of one client: more than a script submits side by side.
const WAITING_PER_CLIENT_MAX: usize = 128;
/// Limit on all waiting computations. Each holds a request in memory.
const WAITING_MAX: usize = 2048;
/// Time after which a waiting computation is no longer overtaken by smaller ones for which memory is free, unless it is kept.
const PATIENCE: Duration = Duration::from_secs(5);
/// Half-life of the time that a client has spent.
const HALF_LIFE_S: f64 = 10.0;
/// Spent time below which a client is forgotten \[s\].
const FORGOTTEN_S: f64 = 1e-3;
/// Time after which a client that was refused may retry.
pub(super) const RETRY: Duration = Duration::from_secs(2);

/// What all computations together may use.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct TurnLimits {
    /// Number of computations that run at once.
    pub(super) at_once: usize,
    /// Memory \[bytes\].
    pub(super) bytes: u64,
    /// Largest memory of a small computation \[bytes\].
    pub(super) small_bytes: u64,
}

/// The computations that run and wait. Clones share them.
#[derive(Clone, Debug)]
pub(super) struct Turns(Arc<Inner>);

#[derive(Debug)]
struct Inner {
    limits: TurnLimits,
    state: Mutex<State>,
}

#[derive(Debug, Default)]
struct State {
    running: usize,
    bytes: u64,
    waiting: usize,
    clients: HashMap<Client, Account>,
    /// Time to which the spent times refer.
    decayed: Option<Instant>,
}

/// What one client uses.
#[derive(Debug, Default)]
struct Account {
    running: usize,
    bytes: u64,
    spent_s: f64,
    waiting: VecDeque<Waiter>,
}

#[derive(Debug)]
struct Waiter {
    bytes: u64,
    since: Instant,
    granted: oneshot::Sender<Turn>,
}

/// The right to compute. The memory and the thread are free again when it is dropped.
#[derive(Debug)]
pub(super) struct Turn {
    turns: Turns,
    client: Client,
    bytes: u64,
    begin: Instant,
}

impl Turns {
    pub(super) fn new(limits: TurnLimits) -> Self {
        Self(Arc::new(Inner { limits, state: Mutex::default() }))
    }

    /// Waits for a turn with `bytes` of memory.
    ///
    /// # Errors
    ///
    /// [`ServiceError::TooLarge`] if the computation needs more memory than one client may use; [`ServiceError::Exhausted`] if
    /// too many computations wait.
    pub(super) async fn wait(&self, client: &Client, bytes: u64) -> Result<Turn> {
        let bytes_max = self.0.limits.bytes / CLIENT_SHARE;
        if bytes > bytes_max {
            return Err(ServiceError::TooLarge { bytes, bytes_max });
        }
        let (granted, turn) = oneshot::channel();
        self.lock().add(client, Waiter { bytes, since: Instant::now(), granted })?;
        self.grant();
        // The sender is dropped only with the server.
        turn.await.map_err(|_| ServiceError::Stopping)
    }

    /// Gives turns to waiting computations while there is room.
    fn grant(&self) {
        loop {
            let Some((client, Waiter { bytes, granted, .. })) = self.lock().next(self.0.limits, Instant::now()) else {
                return;
            };
            let turn = Turn { turns: self.clone(), client, bytes, begin: Instant::now() };
            // A call that no longer waits drops its turn, which makes room for the next.
            drop(granted.send(turn));
        }
    }

    fn lock(&self) -> MutexGuard<'_, State> {
        // The state is consistent even after a panic: nothing between its changes can panic.
        self.0.state.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl State {
    fn add(&mut self, client: &Client, waiter: Waiter) -> Result<()> {
        self.forget_cancelled();
        let account = self.clients.entry(client.clone()).or_default();
        if account.waiting.len() >= WAITING_PER_CLIENT_MAX {
            return Err(too_many(&format!(
                "{WAITING_PER_CLIENT_MAX} calls of {client} already wait for a computation"
            )));
        }
        if self.waiting >= WAITING_MAX {
            return Err(too_many(&format!("{WAITING_MAX} calls already wait for a computation")));
        }
        account.waiting.push_back(waiter);
        self.waiting += 1;
        Ok(())
    }

    /// Removes the calls that their clients cancelled while they waited.
    fn forget_cancelled(&mut self) {
        for account in self.clients.values_mut() {
            account.waiting.retain(|waiter| !waiter.granted.is_closed());
        }
        self.waiting = self.clients.values().map(|account| account.waiting.len()).sum();
    }

    /// Takes the next computation that may start.
    fn next(&mut self, limits: TurnLimits, now: Instant) -> Option<(Client, Waiter)> {
        self.decay(now);
        self.forget_cancelled();
        if self.running >= limits.at_once {
            return None;
        }
        let client = self.fairest_with_room(limits, now)?;
        let account = self.clients.get_mut(&client)?;
        let waiter = account.waiting.pop_front()?;
        account.running += 1;
        account.bytes += waiter.bytes;
        self.waiting -= 1;
        self.running += 1;
        self.bytes += waiter.bytes;
        Some((client, waiter))
    }

    /// The client that spent least of those for whose first computation there is room.
    fn fairest_with_room(&self, limits: TurnLimits, now: Instant) -> Option<Client> {
        let free = limits.bytes - self.bytes;
        let unkept = free.saturating_sub(limits.bytes / KEPT_MEMORY);
        // With few threads, none can be kept.
        let at_once_unkept = limits.at_once.saturating_sub(KEPT_AT_ONCE).max(1);
        let fronts =
            self.clients.iter().filter_map(|(client, account)| Some((client, account, account.waiting.front()?)));
        let has_share = |account: &Account, front: &Waiter| {
            account.running < at_once_unkept && account.bytes + front.bytes <= limits.bytes / CLIENT_SHARE
        };
        let mut fronts: Vec<_> = fronts.filter(|(_, account, front)| has_share(account, front)).collect();
        fronts.sort_unstable_by(|(_, a, first), (_, b, second)| {
            a.spent_s.total_cmp(&b.spent_s).then(first.since.cmp(&second.since))
        });
        let mut is_promised = self.running >= at_once_unkept;
        for (client, account, front) in fronts {
            let may_use_kept = account.spent_s < MUCH_S && front.bytes <= limits.small_bytes;
            if (may_use_kept && front.bytes <= free) || (!is_promised && front.bytes <= unkept) {
                return Some(client.clone());
            }
            // What becomes free is its own from now on.
            is_promised |= now - front.since > PATIENCE;
        }
        None
    }

    /// Ends a computation that took `spent_s`.
    fn end(&mut self, turn: &Turn, now: Instant) {
        self.decay(now);
        self.running -= 1;
        self.bytes -= turn.bytes;
        if let Some(account) = self.clients.get_mut(&turn.client) {
            account.running -= 1;
            account.bytes -= turn.bytes;
            account.spent_s += (now - turn.begin).as_secs_f64();
        }
    }

    /// Halves the spent times every [`HALF_LIFE_S`], and forgets clients that use and have spent nothing.
    fn decay(&mut self, now: Instant) {
        let before = self.decayed.replace(now).unwrap_or(now);
        let factor = 0.5_f64.powf(now.saturating_duration_since(before).as_secs_f64() / HALF_LIFE_S);
        self.clients.retain(|_, account| {
            account.spent_s *= factor;
            account.running > 0 || !account.waiting.is_empty() || account.spent_s > FORGOTTEN_S
        });
    }
}

fn too_many(message: &str) -> ServiceError {
    let message = format!("{message}; retry when some of them have ended");
    ServiceError::Exhausted { reason: LimitReason::TooMuchUnderWay, message, retry_after: RETRY }
}

impl Drop for Turn {
    fn drop(&mut self) {
        self.turns.lock().end(self, Instant::now());
        self.turns.grant();
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use futures::FutureExt as _;
    use tokio::time::{sleep, timeout};

    const LIMITS: TurnLimits = TurnLimits { at_once: 4, bytes: 100, small_bytes: 10 };

    fn client(name: &str) -> Client {
        Client::Token(name.to_owned())
    }

    /// The turn if it is granted at once.
    async fn at_once(wait: impl Future<Output = Result<Turn>>) -> Option<Turn> {
        timeout(Duration::from_millis(20), wait).await.ok().map(Result::unwrap)
    }

    #[tokio::test]
    async fn one_client_leaves_a_thread_and_memory_for_others() {
        let turns = Turns::new(LIMITS);
        let (ada, bob) = (client("ada"), client("bob"));
        let first = at_once(turns.wait(&ada, 20)).await.unwrap();
        let second = at_once(turns.wait(&ada, 20)).await.unwrap();
        assert!(at_once(turns.wait(&ada, 1)).await.is_none(), "two of four threads");
        assert!(at_once(turns.wait(&bob, 11)).await.is_none(), "what is kept is for small ones");
        let other = at_once(turns.wait(&bob, 10)).await.unwrap();
        drop((first, second));
        assert!(at_once(turns.wait(&ada, 50)).await.is_some());
        assert!(matches!(turns.wait(&ada, 51).await, Err(ServiceError::TooLarge { bytes: 51, bytes_max: 50 })));
        drop(other);
        let state = turns.lock();
        assert_eq!((state.running, state.bytes, state.waiting), (0, 0, 0));
    }

    #[tokio::test]
    async fn threads_and_memory_are_kept_for_small_computations_of_clients_that_spent_little() {
        let turns = Turns::new(LIMITS);
        let heavy = ["ada", "bob", "eve"].map(client);
        for client in &heavy {
            turns.lock().clients.entry(client.clone()).or_default().spent_s = 2.0 * MUCH_S;
        }
        let first = at_once(turns.wait(&heavy[0], 40)).await.unwrap();
        assert!(at_once(turns.wait(&heavy[1], 40)).await.is_none(), "a quarter of the memory is kept");
        assert!(
            at_once(turns.wait(&client("zoe"), 40)).await.is_none(),
            "also from large ones of clients that spent little"
        );
        let second = at_once(turns.wait(&heavy[1], 30)).await.unwrap();
        assert!(at_once(turns.wait(&heavy[2], 1)).await.is_none(), "two threads are kept");
        assert!(at_once(turns.wait(&client("zoe"), 10)).await.is_some());
        drop((first, second));
    }

    #[tokio::test]
    async fn the_client_that_spent_least_is_next() {
        let turns = Turns::new(TurnLimits { at_once: 1, ..LIMITS });
        let (ada, bob) = (client("ada"), client("bob"));
        let first = turns.wait(&ada, 1).await.unwrap();
        sleep(Duration::from_millis(5)).await;
        let (mut later, mut others) = (Box::pin(turns.wait(&ada, 1)), Box::pin(turns.wait(&bob, 1)));
        assert!((&mut later).now_or_never().is_none() && (&mut others).now_or_never().is_none());
        drop(first);
        let other = others.now_or_never().unwrap().unwrap();
        assert!((&mut later).now_or_never().is_none(), "bob has spent less, although ada waited first");
        drop(other);
        assert!(later.now_or_never().is_some());
    }

    #[tokio::test]
    async fn a_computation_that_waits_long_is_not_overtaken() {
        let turns = Turns::new(LIMITS);
        let ada = at_once(turns.wait(&client("ada"), 30)).await.unwrap();
        let (bob, eve) = (client("bob"), client("eve"));
        let mut large = Box::pin(turns.wait(&bob, 50));
        let other = at_once(turns.wait(&eve, 20)).await.unwrap();
        assert!((&mut large).now_or_never().is_none(), "25 bytes are free that are not kept");
        for account in turns.lock().clients.values_mut() {
            account.waiting.iter_mut().for_each(|waiter| waiter.since -= PATIENCE * 2);
        }
        drop(other);
        assert!(at_once(turns.wait(&eve, 20)).await.is_none(), "bob has waited long, and eve has spent more");
        assert!(at_once(turns.wait(&client("zoe"), 10)).await.is_some(), "a small one finds what is kept");
        drop(ada);
        assert!(large.now_or_never().is_some());
    }

    #[tokio::test]
    async fn cancelled_calls_neither_wait_nor_count() {
        let turns = Turns::new(TurnLimits { at_once: 1, ..LIMITS });
        let ada = client("ada");
        let first = turns.wait(&ada, 1).await.unwrap();
        for _ in 0..WAITING_PER_CLIENT_MAX * 2 {
            assert!(turns.wait(&ada, 1).now_or_never().is_none());
        }
        let waiting: Vec<_> = (0..WAITING_PER_CLIENT_MAX).map(|_| Box::pin(turns.wait(&ada, 1))).collect();
        let mut waiting: Vec<_> =
            waiting.into_iter().map(|mut wait| ((&mut wait).now_or_never().is_some(), wait)).collect();
        assert!(waiting.iter().all(|(is_over, _)| !is_over));
        assert!(matches!(turns.wait(&ada, 1).await, Err(ServiceError::Exhausted { .. })));
        waiting.clear();
        drop(first);
        assert!(turns.wait(&ada, 1).now_or_never().is_some());
    }
}
