//! Jobs that learn a kernel.

mod from_wire;
pub(crate) mod to_wire;
