//! Verification jobs: holograms judged by an independent model.

mod from_wire;
pub(crate) mod to_wire;
