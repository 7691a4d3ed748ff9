//! Staged rollouts: starting, widening, completing, halting.

mod service;
mod to_wire;
