//! A limit on the memory of messages that are received or sent, for each client and for all clients together.

use lightpath_service::{Client, LimitReason, Result, ServiceError};
use std::collections::HashMap;
use std::mem;
use std::sync::{Arc, Mutex, PoisonError};
use std::time::Duration;

/// Quarters of the budget that one client may use; the rest is for other clients.
const CLIENT_QUARTERS: usize = 3;
/// Time after which a refused client may retry: calls usually end within it, unless their clients are slow.
const RETRY: Duration = Duration::from_secs(1);

/// The bytes that are in use, and their limit.
#[derive(Debug)]
pub struct MemoryBudget {
    bytes_max: usize,
    /// Locked only for a lookup and an addition.
    used: Mutex<Used>,
}

#[derive(Debug, Default)]
struct Used {
    all: usize,
    /// Bytes of each client. Only clients that use memory have an entry, so the map has at most one entry per call.
    by_client: HashMap<Client, usize>,
}

/// A part of the budget, released on drop.
#[derive(Debug)]
pub(crate) struct Share {
    budget: Arc<MemoryBudget>,
    client: Client,
    bytes: usize,
}

impl MemoryBudget {
    /// Creates a budget of `bytes_max`; 0: no limit.
    pub fn new(bytes_max: u64) -> Self {
        let bytes_max = if bytes_max == 0 { usize::MAX } else { usize::try_from(bytes_max).unwrap_or(usize::MAX) };
        Self { bytes_max, used: Mutex::default() }
    }

    /// Takes `bytes` for a call of `client`, or returns an error that says when to retry.
    pub(crate) fn take(self: &Arc<Self>, client: &Client, bytes: usize) -> Result<Share> {
        let mut used = self.used.lock().unwrap_or_else(PoisonError::into_inner);
        let own = used.by_client.get(client).copied().unwrap_or_default();
        if own + bytes > self.bytes_max / 4 * CLIENT_QUARTERS {
            return Err(exhausted(&format!("unfinished calls of {client} use the memory that one client may use")));
        }
        if used.all + bytes > self.bytes_max {
            return Err(exhausted("unfinished calls use the memory that all clients together may use"));
        }
        used.all += bytes;
        used.by_client.insert(client.clone(), own + bytes);
        Ok(Share { budget: Arc::clone(self), client: client.clone(), bytes })
    }
}

fn exhausted(message: &str) -> ServiceError {
    let message = format!("{message}; retry when some of them have ended");
    ServiceError::Exhausted { reason: LimitReason::TooMuchUnderWay, message, retry_after: RETRY }
}

impl Share {
    /// Takes more bytes for the same call.
    pub(crate) fn grow(&mut self, bytes: usize) -> Result<()> {
        let mut more = self.budget.take(&self.client, bytes)?;
        self.bytes += mem::take(&mut more.bytes);
        Ok(())
    }
}

impl Drop for Share {
    fn drop(&mut self) {
        let mut used = self.budget.used.lock().unwrap_or_else(PoisonError::into_inner);
        used.all -= self.bytes;
        if let Some(own) = used.by_client.get_mut(&self.client) {
            *own -= self.bytes;
            if *own == 0 {
                used.by_client.remove(&self.client);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn one_client_leaves_room_for_others_and_all_together_stay_below_the_limit() {
        let budget = Arc::new(MemoryBudget::new(400));
        let client = |n: u32| Client::Token(n.to_string());
        let mut first = budget.take(&client(1), 200).unwrap();
        first.grow(100).unwrap();
        assert!(first.grow(1).is_err() && budget.take(&client(1), 1).is_err());
        let second = budget.take(&client(2), 100).unwrap();
        assert!(budget.take(&client(3), 1).is_err());
        drop(first);
        let third = budget.take(&client(3), 300).unwrap();
        drop((second, third));
        let used = budget.used.lock().unwrap();
        assert!(used.all == 0 && used.by_client.is_empty(), "{used:?}");
    }

    #[test]
    fn without_a_limit_nothing_is_refused() {
        assert!(Arc::new(MemoryBudget::new(0)).take(&Client::Address(None), 1 << 50).is_ok());
    }
}
