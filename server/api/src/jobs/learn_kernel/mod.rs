//! Learning jobs: kernels learned from datasets.

mod from_wire;
pub(crate) mod to_wire;
