//! Datasets: creating and listing datasets, adding pairs, and calibration targets. Jobs align and finalize datasets.

mod calibration;
pub(crate) mod from_wire;
mod lookup;
mod pairs;
mod service;
pub(crate) mod to_wire;
