//! Jobs that report on a kernel version.

mod from_wire;
pub(crate) mod to_wire;
