//! The parts of a display that its [model](super::model) describes, one file for each.

pub mod crosstalk;
pub(crate) mod dust;
pub(crate) mod ghost;
pub mod light_blur;
pub(crate) mod order_errors;
pub(crate) mod partial_coherence;
pub(crate) mod response_variation;
pub mod spatial_variation;
