//! A memory of the targets that have light in the region of interest. Artifacts never change, so a checked target need
//! not be decoded again for later jobs.

use std::collections::{HashMap, VecDeque};
use std::sync::{Arc, Mutex, PoisonError};

/// Limit on the remembered checks, which need some hundred bytes each.
const CHECKS_MAX: usize = 1000;

/// The latest checks. Clones share them.
#[derive(Clone, Debug, Default)]
pub(super) struct CheckedTargets(Arc<Mutex<Checks>>);

#[derive(Debug, Default)]
struct Checks {
    /// Memory for decoding each target \[bytes\].
    known: HashMap<String, u64>,
    /// Keys of the checks, the oldest first.
    order: VecDeque<String>,
}

impl CheckedTargets {
    /// Memory for decoding a target that is known to have light \[bytes\]; `None`: it was not checked. `key` names the
    /// picture and everything else on which the check depends.
    pub(super) fn decoding_bytes(&self, key: &str) -> Option<u64> {
        self.lock().known.get(key).copied()
    }

    /// Remembers a check. The oldest check is forgotten if there are too many.
    pub(super) fn insert(&self, key: String, decoding_bytes: u64) {
        let mut checks = self.lock();
        if checks.known.insert(key.clone(), decoding_bytes).is_some() {
            return;
        }
        checks.order.push_back(key);
        if checks.order.len() > CHECKS_MAX
            && let Some(oldest) = checks.order.pop_front()
        {
            checks.known.remove(&oldest);
        }
    }

    fn lock(&self) -> std::sync::MutexGuard<'_, Checks> {
        // The state is consistent even after a panic: both parts change together, and nothing in between can panic.
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_the_latest_checks_are_remembered() {
        let targets = CheckedTargets::default();
        for n in 0..CHECKS_MAX + 2 {
            targets.insert(n.to_string(), 7);
            targets.insert(n.to_string(), 7);
        }
        let found = [0, 1, 2, CHECKS_MAX + 1].map(|n| targets.decoding_bytes(&n.to_string()));
        assert_eq!(found, [None, None, Some(7), Some(7)]);
        let checks = targets.lock();
        assert_eq!((checks.known.len(), checks.order.len()), (CHECKS_MAX, CHECKS_MAX));
    }
}
