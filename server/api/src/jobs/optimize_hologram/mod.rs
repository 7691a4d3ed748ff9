//! Hologram jobs: optimized phases that show pictures.

mod checks;
mod from_wire;
mod pictures;
mod planes;
mod search;
pub(crate) mod to_wire;
