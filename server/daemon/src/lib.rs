//! The Lightpath server: a durable job queue, workers on the optics engine, and a registry of learned kernels, behind
//! one gRPC and HTTP port.
//!
//! # Errors
//!
//! Every function that uses a server's data can fail with the errors of its database and of its artifacts. Functions
//! name only their other errors.
//!
//! # Layout
//!
//! - [`config`], [`server`]: settings, and the assembly of store, workers and API. [`database`]: where the database is.
//!   [`worker_process`]: the assembly of a process that only runs jobs. [`job_process`]: the process of a single job. `workers`: start and end of the workers.
//!   `life`: by what others know that this process lives.
//!   [`devices`]: graphics cards: the choice of a process, and the list for people.
//!   [`listening`]: the port, and who has it if it is taken.
//! - [`upkeep`]: commands for operators on a data folder: check, back up, restore, collect.
//! - [`demo`]: the whole loop on a simulated display, for new users.
//! - [`fuzzing`]: access to every decoder, for fuzzers.
#![cfg_attr(test, allow(clippy::unwrap_used))]

pub mod config;
pub mod database;
pub mod demo;
pub mod devices;
pub mod fuzzing;
pub mod job_process;
pub mod listening;
pub mod server;
pub mod upkeep;
pub mod worker_process;

mod life;
mod workers;
