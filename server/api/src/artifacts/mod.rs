//! Artifacts: uploading and downloading them, and using them in other resources.

pub(crate) mod download;
mod keep;
mod lookup;
mod picture;
mod service;
mod to_wire;
mod upload;
