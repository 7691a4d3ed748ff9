//! Jobs that evaluate a kernel on a dataset.

mod from_wire;
pub(crate) mod to_wire;
