//! General optimization methods: they compute the next parameters from a loss and its gradient.

pub(crate) mod adam;
pub mod damped;
pub(crate) mod limited_memory;
pub(crate) mod vectors;
