//! What drives the devices of a bench: a folder for each way.

pub mod command;
pub mod folder;
pub mod simulated;
