//! The agent of a display in the field: it keeps a verified kernel on the device's disk.
//!
//! [`Agent::start`] checks what lies on the disk. [`Agent::check`] asks the server once for the active version, fetches
//! and checks its file, tests it, and then lets the application use it. [`Agent::run`] does this for ever. [`KernelSet`] has an agent for
//! each of several kernels, and changes them together.
//!
//! ```text
//! DIR/current ──> a          the slot in use; the application opens DIR/current/kernel
//! DIR/a, DIR/b               slots: kernel, manifest (what vouches for it), keyring (what vouched for the manifest)
//! DIR/b/part-sha256-…        a file that is being fetched
//! DIR/keyring, DIR/state     the newest trusted keyring; what the agent remembers
//! ```
//!
//! # Invariants
//!
//! - `DIR/current/kernel` is a whole file whose manifest was accepted, or it does not exist.
//! - The agent changes only the slot that is not in use, and writes and removes nothing through links in its directory. One rename of `current` changes the slot in use.
//! - A kernel becomes a slot's `kernel` only after its self-test has passed and its digest is right, before and after.
//! - The kernels of a set are all of one generation, and one rename changes all of them.
//! - The memory that a kernel takes does not depend on its size.
//!
//! # Layout
//!
//! - `arguments`, `settings`, `optics`, `clock`: what the agent is told. `keep`: an agent of one kernel, or of a set. `status`: what it prints about a directory.
//! - `set`: several kernels that change together.
//! - `agent`: the order of all steps. `slots`: the directory. `durable`: changes that survive a power cut. `state`: what
//!   the agent remembers. `vouching`: which keyrings and manifests it accepts.
//! - `http`, `tls`: calls of the server. `kernel_search`: which kernel of the server is meant. `download`: a file in
//!   pieces. `self_test`: the device's own test. `report`: what the server is told. `schedule`, `rounds`: when. `problem`: what can go wrong. `log`: lines on stderr.
#![cfg_attr(test, allow(clippy::unwrap_used))]

mod agent;
mod arguments;
mod clock;
mod download;
mod durable;
mod http;
mod keep;
mod kernel_search;
mod log;
mod optics;
mod problem;
mod regular_file;
mod report;
mod rounds;
mod schedule;
mod self_test;
mod set;
mod settings;
mod slots;
mod state;
mod status;
mod tls;
mod vouching;

pub use agent::{Agent, Checked};
pub use arguments::{Cli, Command, RunArguments, StatusArguments, Task};
pub use clock::Clock;
pub use problem::{BodyProblem, Problem};
pub use set::{KernelSet, SetChecked};
pub use settings::{Pace, Settings};
pub use slots::Slot;
pub use status::status;
