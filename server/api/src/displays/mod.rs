//! Displays: declaring and listing them, and planning how light gets from them to an image.

mod from_wire;
pub(crate) mod lookup;
mod plan_propagation;
mod service;
mod simulated_bench;
mod to_wire;
