//! Tests of the agent against a server that misbehaves as its script says.
//!
//! - `material`: keys, keyrings, manifests and kernels. `server`: the server. `bench`: a server, a directory and an agent
//!   for a test, and what must always be true of the directory.
//! - `trust`: documents that the agent refuses. `search`: how it finds the kernel. `freeze`: servers that confirm nothing, or drip. `bodies`: files that it refuses or continues. `start`: what it does with
//!   what lies in its directory. `polling`: when it asks, and what it says. `reports`, `self_tests`. `sets`: several kernels that change together. `disk`: full and
//!   read-only ones. `slots`: what stands in the way there. `kills`: death at every point and at any time. `memory`. `tls`.
#![allow(clippy::unwrap_used)]

mod bench;
mod bodies;
mod disk;
mod freeze;
mod kills;
mod material;
// It reads the memory of a process from /proc.
#[cfg(target_os = "linux")]
mod memory;
mod polling;
mod reports;
mod search;
mod self_tests;
mod server;
mod sets;
mod slots;
mod start;
mod tls;
mod trust;
