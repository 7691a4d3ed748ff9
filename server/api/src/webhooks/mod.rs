//! Webhooks: which addresses learn of which events.

mod service;
mod to_wire;
