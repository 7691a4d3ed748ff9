//! Datasets: creating and listing datasets, adding pairs, and calibration targets. Jobs align and finalize datasets.

mod from_wire;
mod service;
pub(crate) mod to_wire;
