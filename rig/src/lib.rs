//! The program at a bench: it shows patterns on an SLM and photographs what it shows, for a Lightpath server.
//!
//! [`session::serve`] connects out to the server, takes requests, and answers with photographs. [`take`] takes one
//! photograph. What stands on the bench is behind the traits of [`device`]; [`adapters`] implement them, and
//! [`conformance`] tests an implementation.
//!
//! # Invariants
//!
//! - Each request is photographed once, however often it is asked for, and the answer is on disk before it is sent.
//! - No request exceeds the limits of the rig's own file.
//! - Light is on only while a photograph is taken, where there is a shutter.
//! - A device that hangs or panics does not end the program, and the shutter is closed afterwards.
//! - After [`bench::Bench::make_safe`] nothing that was begun before opens the shutter or shows a pattern.
//!
//! # Layout
//!
//! - `device`: the border: traits, levels, frames, a thread for each device. `bench`: the devices together, the safe state.
//! - `adapters`: a folder for each way to drive devices: `simulated`, `folder`, `command`. `opening`: the one that the file names.
//! - `take`: one photograph. `limits`: what it must not exceed. `pictures`: files.
//! - `session`: the connection (`mod.rs`), requests and what became of them (`desk.rs`), patterns, the description.
//! - `state`: what is kept in the rig's folder. `settings`: the rig's file; `ranges`: what its numbers may be. `problem`: why the program ends.
//! - `arguments`, `programs`: the command line. `conformance`: the suite for adapters. `log`: lines on stderr.
#![cfg_attr(test, allow(clippy::unwrap_used))]

pub mod adapters;
mod arguments;
pub mod bench;
pub mod conformance;
pub mod device;
pub mod limits;
mod log;
pub mod opening;
pub mod pictures;
mod problem;
mod programs;
mod ranges;
pub mod session;
pub mod settings;
pub mod state;
pub mod take;

pub use arguments::Cli;
pub use problem::Problem;
pub use programs::run;
