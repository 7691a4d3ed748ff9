//! Turns of clients at the connections of a pool.
//!
//! A database has few connections. If all statements waited in one line, a client with hundreds of calls would let
//! everybody else wait behind them. So each client has a line of its own. Of the clients that wait, the one that held
//! connections for the least time lately is next:
//!
//! ```text
//! held(t) = Σ over statements of  duration · ½^((t − end) / 10 s)
//! ```
//!
//! The last free connection is kept for clients that held connections for less than the mean of all clients: behind a
//! few clients whose statements take long, others would wait until one of these ends.
//!
//! What the server does for itself (claims, heartbeats, health, webhooks) belongs to no client and comes before all calls.

use std::collections::{HashMap, VecDeque};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};
use tokio::sync::oneshot;
use tokio::time::timeout;

/// Connections that one client leaves to others, and that clients leave to those that held less, where there are several.
const KEPT: usize = 1;
/// How long a statement waits for its turn.
const WAIT_MAX: Duration = Duration::from_secs(30);
/// Half-life of the time for which a client has held connections.
const HALF_LIFE_S: f64 = 10.0;
/// Time below which a client is forgotten \[s\].
const FORGOTTEN_S: f64 = 1e-4;

tokio::task_local! {
    /// The client whose work the task does. A parameter would have to pass through every function of the store and of all
    /// that use it.
    static CLIENT: Option<Arc<str>>;
}

/// Does `work` for a client: its statements wait in the line of that client.
pub fn for_client<W: Future>(client: Arc<str>, work: W) -> impl Future<Output = W::Output> {
    // Not in the task itself: hundreds of calls may wait, and each await would keep another copy of the work's state.
    CLIENT.scope(Some(client), Box::pin(work))
}

/// Does `work` that a client has asked for, and that serves all clients: its statements do not wait in the line of that
/// client.
pub fn for_all_clients<W: Future>(work: W) -> impl Future<Output = W::Output> {
    CLIENT.scope(None, Box::pin(work))
}

/// Makes work that a task of its own will do count for the client of the present task.
pub(crate) fn for_same_client<W: Future>(work: W) -> impl Future<Output = W::Output> {
    CLIENT.scope(present_client(), work)
}

fn present_client() -> Option<Arc<str>> {
    CLIENT.try_with(Clone::clone).ok().flatten()
}

/// The turns at one pool. Clones share them.
#[derive(Clone, Debug)]
pub(super) struct Turns(Arc<Mutex<State>>);

#[derive(Debug)]
struct State {
    connections: usize,
    held: usize,
    /// By client; `None` is the server itself.
    clients: HashMap<Option<Arc<str>>, Account>,
    /// Time to which the held times refer.
    decayed: Instant,
}

/// What one client uses.
#[derive(Debug, Default)]
struct Account {
    held: usize,
    held_s: f64,
    waiting: VecDeque<oneshot::Sender<Turn>>,
}

/// The right to a connection, until it is dropped.
#[derive(Debug)]
pub(crate) struct Turn {
    turns: Turns,
    client: Option<Arc<str>>,
    begin: Instant,
}

impl Turns {
    /// Turns at a pool with this number of connections.
    pub(super) fn new(connections: u32) -> Self {
        let (connections, decayed) = (connections as usize, Instant::now());
        Self(Arc::new(Mutex::new(State { connections, held: 0, clients: HashMap::new(), decayed })))
    }

    /// Waits for a turn of the present client.
    ///
    /// # Errors
    ///
    /// [`sqlx::Error::PoolTimedOut`].
    pub(super) async fn wait(&self) -> Result<Turn, sqlx::Error> {
        let (granted, turn) = oneshot::channel();
        self.lock().clients.entry(present_client()).or_default().waiting.push_back(granted);
        self.grant();
        match timeout(WAIT_MAX, turn).await {
            Ok(Ok(turn)) => Ok(turn),
            _ => Err(sqlx::Error::PoolTimedOut),
        }
    }

    /// Gives turns to waiting clients while there are connections.
    fn grant(&self) {
        loop {
            let Some((client, granted)) = self.lock().next(Instant::now()) else { return };
            let turn = Turn { turns: self.clone(), client, begin: Instant::now() };
            // Who no longer waits drops the turn, which makes room for the next.
            drop(granted.send(turn));
        }
    }

    fn lock(&self) -> MutexGuard<'_, State> {
        // The state is consistent even after a panic: nothing between its changes can panic.
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl State {
    /// Takes the next statement that may get a connection.
    fn next(&mut self, now: Instant) -> Option<(Option<Arc<str>>, oneshot::Sender<Turn>)> {
        self.decay(now);
        if self.held >= self.connections {
            return None;
        }
        let unkept = self.connections.saturating_sub(KEPT).max(1);
        let mean_s = self.mean_held_s();
        let may_use_kept = |account: &Account| self.held < unkept || account.held_s <= mean_s;
        loop {
            let waiting = self.clients.iter_mut().filter(|(_, account)| !account.waiting.is_empty());
            let has_share = |account: &Account| account.held < unkept && may_use_kept(account);
            let allowed = waiting.filter(|(client, account)| client.is_none() || has_share(account));
            let (client, account) = allowed.min_by(|(a, first), (b, second)| {
                a.is_some().cmp(&b.is_some()).then(first.held_s.total_cmp(&second.held_s))
            })?;
            // Hundreds may have been cancelled since. A turn for each would be dropped at once, and each drop looks for the
            // next: too deep for the stack.
            while let Some(granted) = account.waiting.pop_front() {
                if !granted.is_closed() {
                    account.held += 1;
                    self.held += 1;
                    return Some((client.clone(), granted));
                }
            }
        }
    }

    /// Mean of the times for which clients have held connections \[s\].
    fn mean_held_s(&self) -> f64 {
        let of_clients = self.clients.iter().filter(|(client, _)| client.is_some());
        let (sum_s, count) =
            of_clients.fold((0.0, 0), |(sum_s, count), (_, account)| (sum_s + account.held_s, count + 1));
        sum_s / f64::from(count.max(1))
    }

    fn end(&mut self, turn: &Turn, now: Instant) {
        self.decay(now);
        self.held -= 1;
        if let Some(account) = self.clients.get_mut(&turn.client) {
            account.held -= 1;
            account.held_s += (now - turn.begin).as_secs_f64();
        }
    }

    /// Halves the held times every [`HALF_LIFE_S`], and forgets clients that hold nothing and held little.
    fn decay(&mut self, now: Instant) {
        let factor = 0.5_f64.powf(now.saturating_duration_since(self.decayed).as_secs_f64() / HALF_LIFE_S);
        self.decayed = now;
        self.clients.retain(|_, account| {
            account.held_s *= factor;
            account.held > 0 || !account.waiting.is_empty() || account.held_s > FORGOTTEN_S
        });
    }
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
    use futures::future::{join_all, join3};
    use std::sync::atomic::{AtomicUsize, Ordering};

    /// A turn of a client (empty: of the server itself) if it is granted at once.
    fn at_once(turns: &Turns, client: &str) -> Option<Turn> {
        let wait = turns.wait();
        let turn = if client.is_empty() { wait.now_or_never() } else { for_client(client.into(), wait).now_or_never() };
        turn.map(Result::unwrap)
    }

    #[tokio::test]
    async fn the_client_that_held_least_is_next_after_the_server_itself() {
        let turns = Turns::new(1);
        let first = at_once(&turns, "ada").unwrap();
        tokio::time::sleep(Duration::from_millis(5)).await;
        let mut ada = Box::pin(for_client("ada".into(), turns.wait()));
        let mut bob = Box::pin(for_client("bob".into(), turns.wait()));
        let mut own = Box::pin(turns.wait());
        assert!((&mut ada).now_or_never().is_none() && (&mut bob).now_or_never().is_none());
        assert!((&mut own).now_or_never().is_none());
        drop(first);
        assert!((&mut ada).now_or_never().is_none() && (&mut bob).now_or_never().is_none());
        drop(own.now_or_never().unwrap());
        assert!((&mut ada).now_or_never().is_none(), "bob has held nothing, although ada waited first");
        drop(bob.now_or_never().unwrap());
        assert!(ada.now_or_never().is_some());
    }

    #[tokio::test]
    async fn a_client_with_many_reads_delays_those_of_others_by_a_few() {
        let folder = tempfile::tempdir().unwrap();
        let store = crate::Store::open(&folder.path().join("lightpath.db")).await.unwrap();
        let (ended, reads) = (AtomicUsize::new(0), 200);
        let read = async || {
            store.queue_counts().await.unwrap();
            ended.fetch_add(1, Ordering::Relaxed)
        };
        let mut many = Box::pin(for_client("ada".into(), join_all((0..reads).map(|_| read()))));
        assert!((&mut many).now_or_never().is_none(), "all of them wait");
        let (before_own, before_other, _) =
            join3(for_client("ada".into(), read()), for_client("bob".into(), read()), many).await;
        assert!(before_other < 20, "{before_other} of {reads} reads of another client came first");
        assert!(before_own > 150, "{before_own} of {reads} earlier reads of the same client came first");
    }

    #[tokio::test]
    async fn thousands_of_cancelled_statements_are_passed_over() {
        let turns = Turns::new(1);
        let first = at_once(&turns, "ada").unwrap();
        let waiting: Vec<_> = (0..100_000)
            .map(|_| {
                let mut wait = Box::pin(for_client("ada".into(), turns.wait()));
                assert!((&mut wait).now_or_never().is_none());
                wait
            })
            .collect();
        drop(waiting);
        drop(first);
        assert!(at_once(&turns, "ada").is_some());
    }

    #[tokio::test]
    async fn one_client_leaves_a_connection_to_others_and_who_leaves_gives_back_all() {
        let turns = Turns::new(3);
        let held = [at_once(&turns, "ada").unwrap(), at_once(&turns, "ada").unwrap()];
        assert!(at_once(&turns, "ada").is_none(), "the wait was dropped");
        let other = at_once(&turns, "bob").unwrap();
        drop((held, other));
        assert_eq!(turns.lock().held, 0);
        let own: Vec<_> = (0..3).filter_map(|_| at_once(&turns, "")).collect();
        assert_eq!(own.len(), 3, "the server itself may use all");
    }

    #[tokio::test]
    async fn the_last_connection_is_kept_for_clients_that_held_less() {
        let turns = Turns::new(3);
        for client in ["ada", "bob"] {
            let turn = at_once(&turns, client).unwrap();
            tokio::time::sleep(Duration::from_millis(5)).await;
            drop(turn);
        }
        let _little = at_once(&turns, "eve").unwrap();
        let _held = at_once(&turns, "ada").unwrap();
        assert!(at_once(&turns, "bob").is_none(), "one connection is left, and bob held more than the mean");
        assert!(at_once(&turns, "cyd").is_some(), "cyd has held nothing");
    }
}
