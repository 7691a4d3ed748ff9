//! The safe state, asked for by code that must not block.

use crate::bench::Bench;
use crate::log;
use std::sync::Arc;

/// Makes the bench safe, and says so if it is not known to be.
pub(super) async fn make_safe(bench: &Arc<Bench>) {
    let bench = Arc::clone(bench);
    match tokio::task::spawn_blocking(move || bench.make_safe()).await {
        Ok(Ok(())) => {}
        Ok(Err(error)) => log::line(format_args!("THE BENCH MAY NOT BE SAFE: {error}")),
        Err(error) => log::line(format_args!("THE BENCH MAY NOT BE SAFE: {error}")),
    }
}
