//! Evaluation jobs: how well a kernel predicts a dataset.

mod from_wire;
pub(crate) mod to_wire;
