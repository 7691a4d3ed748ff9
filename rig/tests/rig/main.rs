//! Tests of the rig: adapters at the border, and the session against a small server.
#![allow(clippy::unwrap_used, missing_docs, unreachable_pub)] // tests

/// The conformance suite on each adapter.
mod adapters;
/// A device that does what tests want.
mod fake;
/// Planted faults of the simulated bench.
mod faults;
/// The program itself, as a process.
mod program;
/// A server with the three services that a rig needs.
mod server;
/// Requests, answers, cuts, limits, pauses and the safe state.
mod session;
