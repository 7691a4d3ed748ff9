//! Jobs that suggest holograms to photograph.

mod from_wire;
pub(crate) mod to_wire;
