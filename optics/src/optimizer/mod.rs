//! Descent methods that know nothing of optics: from a loss and its gradient to the next parameters.

pub(crate) mod adam;
pub mod damped;
pub(crate) mod limited_memory;
mod vectors;
