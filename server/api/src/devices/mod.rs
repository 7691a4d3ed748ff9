//! Devices: who runs what, and their groups.

mod service;
mod to_wire;
