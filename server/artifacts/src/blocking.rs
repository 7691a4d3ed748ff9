//! File access on threads that may block.

use crate::error::{ArtifactError, Result};
use std::io;

/// Runs file access on a thread that may block. The work runs to its end even if the caller drops the future.
pub(crate) async fn blocking<T, F>(work: F) -> Result<T>
where
    T: Send + 'static,
    F: FnOnce() -> Result<T> + Send + 'static,
{
    match tokio::task::spawn_blocking(work).await {
        Ok(outcome) => outcome,
        Err(error) => match error.try_into_panic() {
            Ok(panic) => std::panic::resume_unwind(panic),
            Err(_) => Err(ArtifactError::io("run a file operation", io::Error::other("the server is stopping"))),
        },
    }
}
