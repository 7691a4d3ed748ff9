//! Tokens that were accepted lately. A token that is not among them costs its address a call before the database is
//! asked, so that nobody makes the database look for tokens that do not exist.

use std::collections::HashSet;
use std::sync::{Arc, Mutex, PoisonError};

/// Limit on the remembered tokens, for their memory: about 1 MB. Above it, all are forgotten and noted again.
const TOKENS_MAX: usize = 10_000;

/// Hashes of tokens that were accepted. They only decide what a call counts for: each call is checked anew.
#[derive(Clone, Debug, Default)]
pub struct KnownTokens(Arc<Mutex<HashSet<String>>>);

impl KnownTokens {
    pub(super) fn contains(&self, hash: &str) -> bool {
        self.0.lock().unwrap_or_else(PoisonError::into_inner).contains(hash)
    }

    /// Notes whether a token is accepted.
    pub(super) fn note(&self, hash: &str, is_accepted: bool) {
        let mut known = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        if !is_accepted {
            known.remove(hash);
        } else if !known.contains(hash) {
            if known.len() >= TOKENS_MAX {
                known.clear();
            }
            known.insert(hash.to_owned());
        }
    }
}
