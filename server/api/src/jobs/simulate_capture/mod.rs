//! Jobs that simulate a photograph.

mod from_wire;
pub(crate) mod to_wire;
