//! The durable store: displays, datasets, kernels and the job queue in one database, of SQLite or of PostgreSQL.
//!
//! [`Store`] uses only domain types, and callers pass the time in. A [`Store`] is a handle that is cheap to clone.
//!
//! # Durability and consistency
//!
//! - Writers take turns, in short transactions. In SQLite one connection writes, in transactions that begin `immediate`:
//!   without that, a transaction that reads first and writes later could fail with BUSY, however long it waits.
//!   Write-ahead logging lets others read meanwhile. In PostgreSQL the writers of all processes take one advisory lock.
//!   A small pool of read-only connections does all reads. Clients take turns at both, see [`for_client`].
//! - A write runs in a task of its own, so a caller that drops the future (a cancelled gRPC call) cannot leave it half
//!   done.
//! - The changes of a transaction are announced after its commit, see [`Store::subscribe_job_changes`] and the similar
//!   functions. In PostgreSQL other processes hear of them, too.
//!
//! # Errors
//!
//! Every function can fail with [`StoreError::Database`] or [`StoreError::Unreachable`], and one that writes also with
//! [`StoreError::DiskFull`]. Functions name only their other errors.
//!
//! # Layout
//!
//! - `tokens`: API tokens. `signing`: keyrings and private keys. `queue`: pauses and the state of the queue.
//!   `dependencies`: jobs that wait for other jobs. `claims`: which job is next. `ahead`, `forecast`: what is before each waiting job.
//!   `processes`: their signs of life; `living`: those that live.
//! - `gates`: what versions must show before they become active. `rollouts`, `devices`: versions on their way to the
//!   displays in the field.
//! - `webhooks`, `deliveries`: addresses that learn of events, and what they are to learn.
//! - `collection`: automatic removal of old records. `inspect`: read access for checks and backups. `transfer`: copies all
//!   tables to another database.
//! - `store`: the handle. `open`: opens it; `connect`: single connections; `migrations`: the tables, and whether this program
//!   can work on them. `database_time`: the time of day on which processes agree. `sql`: statements that both databases run.
//!   `write`: write transactions.
//!   `changes`: announcements. `notices`: those of other processes. `passed_on`: those of a
//!   process that runs one job of a server. `subscriptions`: receiving announcements. `rows`: text
//!   and JSON. `job_rows`: jobs as rows.
//! - `displays`, `artifacts`, `datasets`, `jobs`, `leases`, `endings`, `cancels`, `events`, `kernels`, `moves`,
//!   `totals`: each an `impl Store` for one table or for one part of a record's life. `prepared`: results of jobs that
//!   align and finalize datasets. `made`: requests that made something, which may be repeated.
#![cfg_attr(test, allow(clippy::unwrap_used))]

mod ahead;
mod artifacts;
mod cancels;
mod changes;
mod claims;
mod collection;
#[cfg(test)]
mod conformance;
mod connect;
mod database_time;
mod datasets;
mod deliveries;
mod dependencies;
mod devices;
mod displays;
mod endings;
mod error;
mod events;
mod forecast;
mod gates;
mod inspect;
mod job_lists;
mod job_rows;
mod jobs;
mod kernel_filter;
mod kernels;
mod leases;
mod living;
mod made;
mod migrations;
mod moves;
mod notices;
mod open;
mod passed_on;
mod prepared;
mod processes;
mod queue;
mod rollouts;
mod rows;
mod signing;
mod sql;
mod store;
mod subscriptions;
mod tokens;
mod totals;
mod transfer;
mod webhooks;
mod write;

pub use ahead::{Ahead, QueuedJob};
pub use artifacts::ArtifactRecord;
pub use changes::Changed;
pub use collection::Deleted;
pub use datasets::{PairFilter, PairsOf};
pub use deliveries::Attempt;
pub use devices::DEVICES_MAX;
pub use displays::DisplayRecord;
pub use error::{AbortReason, Result, StoreError};
pub use forecast::{Place, forecast};
pub use inspect::{Counts, DanglingReference, Inspection, StoredBlob};
pub use job_lists::JobFilter;
pub use jobs::{QueueCounts, QueueLimits, Submitted};
pub use kernel_filter::KernelFilter;
pub use leases::{ClaimLimits, Claimant, Heartbeat};
pub use living::{LIFE, Process, ProcessKind};
pub use made::RequestMark;
pub use moves::{ALIASES_MAX, AliasMove, Promotion};
pub use passed_on::PassedOn;
pub use queue::{BatchProgress, OwnerQueue, Pause};
pub use rollouts::Widening;
pub use signing::{PrivateKey, StoredKeyring};
pub use sql::{for_all_clients, for_client};
pub use store::Store;
pub use tokens::TokenRecord;
pub use totals::{QueueDepth, WaitingWork};
pub use transfer::{ComparedTable, Side, Transfer, TransferError};
pub use webhooks::{WEBHOOKS_MAX, WebhookChange};

/// Limit on the rows that one call returns, for any requested limit: a page of the largest records fits into a message.
pub const LIMIT_MAX: u32 = 1001;

/// Limits the number of rows of one call to [`LIMIT_MAX`], as an integer of the database.
fn page(limit: u32) -> i64 {
    i64::from(limit.min(LIMIT_MAX))
}
