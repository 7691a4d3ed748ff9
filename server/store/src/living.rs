//! Processes that work on a database, and which of them live.

use lightpath_domain::ability::Abilities;
use std::sync::{Arc, Mutex, PoisonError};
use std::time::Duration;

/// Time for which a process counts as living after its last sign of life.
pub const LIFE: Duration = Duration::from_secs(20);

lightpath_domain::words! {
    /// What a process does.
    pub enum ProcessKind {
        /// It answers calls.
        Server = "server",
        /// It runs jobs.
        Worker = "worker",
        /// It answers calls and runs jobs.
        Both = "both",
    }
}

/// A process that works on the database.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Process {
    /// Identity of its data folder.
    pub id: String,
    /// What it does.
    pub kind: ProcessKind,
    /// Name of its workers, for people.
    pub name: String,
    /// Version of the program.
    pub version: String,
    /// Its labels, and the largest estimated memory of a job that it starts: 0 if it runs no jobs.
    pub abilities: Abilities,
    /// Number of jobs that it runs at the same time; 0: it runs no jobs.
    pub workers: u32,
    /// Time of its start \[ms since 1970\].
    pub start_time_ms: i64,
    /// Time of its last sign of life \[ms since 1970\].
    pub seen_time_ms: i64,
}

impl Process {
    /// Whether it answers calls.
    #[must_use]
    pub fn serves(&self) -> bool {
        self.kind != ProcessKind::Worker
    }

    /// Whether it runs jobs.
    #[must_use]
    pub fn works(&self) -> bool {
        self.kind != ProcessKind::Server
    }
}

/// The living processes as this one knows them.
#[derive(Debug, Default)]
pub(super) struct Living {
    // Held only to copy a pointer, so no thread waits long.
    processes: Mutex<Arc<[Process]>>,
}

impl Living {
    pub(super) fn processes(&self) -> Arc<[Process]> {
        Arc::clone(&self.processes.lock().unwrap_or_else(PoisonError::into_inner))
    }

    pub(super) fn set(&self, processes: Vec<Process>) {
        *self.processes.lock().unwrap_or_else(PoisonError::into_inner) = processes.into();
    }
}
