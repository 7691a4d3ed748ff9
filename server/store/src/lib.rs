//! The durable store: displays, datasets, kernels and the job queue in one SQLite database.
//!
//! [`Store`] speaks only domain types, and time is always passed in. It is a cheap handle: clone it freely.
//!
//! # How it keeps its promises
//!
//! - One connection writes, in short transactions that begin `immediate`: a transaction that reads first and writes
//!   later would fail with BUSY however long it waits. A small pool of read-only connections answers everything else;
//!   write-ahead logging lets them read while the writer writes.
//! - A write runs in a task of its own. A caller that goes away (a dropped gRPC handler) cannot leave it half done.
//! - What a transaction changed is announced after its commit, see [`Store::subscribe_job_changes`] and its siblings.
//!
//! # Layout
//!
//! - `tokens`: who may call. `queue`: pausing, and how it stands. `dependencies`: jobs that wait for others.
//! - `collection`: what goes by itself. `inspect`: a database as it lies there, for checks and backups.
//! - `open`: files, pragmas, migrations. `write`: write transactions. `changes`: announcements. `subscriptions`: listening to
//!   them. `rows`: text and JSON. `job_rows`: jobs as rows.
//! - `displays`, `artifacts`, `datasets`, `jobs`, `leases`, `endings`, `cancels`, `events`, `kernels`, `moves`, `totals`: a table or a
//!   part of its life each, every one an `impl Store`.
#![cfg_attr(test, allow(clippy::unwrap_used))]

mod artifacts;
mod cancels;
mod changes;
mod collection;
#[cfg(test)]
mod conformance;
mod datasets;
mod dependencies;
mod displays;
mod endings;
mod error;
mod events;
mod inspect;
mod job_rows;
mod jobs;
mod kernels;
mod leases;
mod moves;
mod open;
mod queue;
mod rows;
mod subscriptions;
mod tokens;
mod totals;
mod write;

pub use artifacts::ArtifactRecord;
pub use collection::Deleted;
pub use datasets::PAIRS_MAX;
pub use error::{AbortReason, PreconditionReason, StoreError};
pub use inspect::{Counts, DanglingReference, Inspection, StoredBlob};
pub use jobs::{JobFilter, QueueCounts, QueueLimits, Submitted};
pub use leases::{ClaimLimits, Heartbeat};
pub use open::Store;
pub use queue::{BatchProgress, Pause, Turn};
pub use tokens::TokenRecord;
pub use totals::QueueDepth;

/// Most rows that one call returns, whatever limit it names: a page of the largest list fits well into a message.
pub const LIMIT_MAX: u32 = 1001;

/// What one call returns at most, as SQLite wants it.
fn page(limit: u32) -> i64 {
    i64::from(limit.min(LIMIT_MAX))
}
