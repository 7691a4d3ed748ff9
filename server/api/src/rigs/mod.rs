//! Rigs: the programs at the benches, and what is asked of them.

mod messages;
mod service;
