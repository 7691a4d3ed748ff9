//! Photographs of pictures that displays show.

mod service;
mod to_wire;
