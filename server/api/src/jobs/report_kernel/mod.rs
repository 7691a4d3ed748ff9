//! Report jobs: the report of a kernel version.

mod from_wire;
pub(crate) mod to_wire;
