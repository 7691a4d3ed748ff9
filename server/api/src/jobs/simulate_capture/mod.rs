//! Simulation jobs: photographs of a simulated display.

mod from_wire;
pub(crate) mod to_wire;
