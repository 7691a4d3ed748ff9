//! Patterns from the server. The last few are kept, and the next one is read ahead.

use crate::bench::Bench;
use crate::device::Levels;
use crate::pictures;
use lightpath::{Client, Error};
use std::collections::VecDeque;
use std::sync::Arc;
use tokio::sync::Mutex;

/// Patterns that are kept: the current one, the next one, and a reference pattern that comes back now and then.
const KEPT: usize = 6;

/// Why there is no pattern.
pub(super) struct NoPattern {
    pub(super) message: String,
    pub(super) retryable: bool,
}

/// Patterns by their digest.
pub(super) struct Patterns {
    client: Client,
    bench: Arc<Bench>,
    /// The lock is held while a pattern is read, so that no two requests read the same one.
    kept: Mutex<VecDeque<(String, Levels)>>,
}

impl Patterns {
    pub(super) fn new(client: Client, bench: Arc<Bench>) -> Self {
        Self { client, bench, kept: Mutex::default() }
    }

    /// The levels of a pattern.
    pub(super) async fn levels(&self, digest: &str) -> Result<Levels, NoPattern> {
        let mut kept = self.kept.lock().await;
        if let Some(at) = kept.iter().position(|(known, _)| known == digest)
            && let Some(found) = kept.remove(at)
        {
            let levels = found.1.clone();
            kept.push_front(found);
            return Ok(levels);
        }
        let bytes = self.client.download(digest).await.map_err(|error| NoPattern {
            message: format!("the pattern {digest} could not be read: {error}"),
            retryable: error.is_unreachable() || matches!(error, Error::Damaged { .. } | Error::Protocol { .. }),
        })?;
        let levels = pictures::pattern(&bytes, self.bench.slm())
            .map_err(|error| NoPattern { message: error.to_string(), retryable: false })?;
        kept.push_front((digest.to_owned(), levels.clone()));
        kept.truncate(KEPT);
        Ok(levels)
    }
}
