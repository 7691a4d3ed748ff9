//! Datasets: pairs of holograms and photographs, their checks, alignment and split.

mod alignment;
mod finalize;
pub(crate) mod from_wire;
mod lookup;
mod pairs;
mod service;
pub(crate) mod to_wire;
