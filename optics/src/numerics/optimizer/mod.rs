//! General optimization methods: they compute the next parameters from a loss and its gradient.

pub(crate) mod adam;
pub mod damped;
pub mod limited_memory;
pub(crate) mod vectors;
