//! Displays: declaring and listing displays, and planning the propagation from a display to an image.

mod from_wire;
pub(crate) mod lookup;
mod plan_propagation;
mod service;
mod simulated_bench;
mod to_wire;
mod update;
