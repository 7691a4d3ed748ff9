//! Dataset jobs, which align or finalize a dataset.

mod from_wire;
pub(crate) mod to_wire;
