//! Photographs of pictures that displays show.

mod score;
mod service;
mod to_wire;
