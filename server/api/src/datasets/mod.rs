//! Datasets: pairs of holograms and photographs, and their checks. Jobs align and finalize them.

mod calibration;
pub(crate) mod from_wire;
mod lookup;
mod pairs;
mod service;
pub(crate) mod to_wire;
